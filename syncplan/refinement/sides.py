"""On which side of each landmark and each keep-out a circle passes.

A landmark lies outside a circle or within it, and so does a keep-out that its path must not cross:
flying round an obstacle is a plan. Each is a constraint of its own, so the side is fixed while a
stage is solved, and every start has its own.

      (   x   )    within: the circle goes round it
      (       )  x    outside
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.refinement.problem import RefineProblem

_SAFETY = 1e-4
"""Share of a clearance by which the solver keeps beyond it."""

_LEAST_SHARE = 1e-3
"""Share of a clearance that is asked for where bounds allow less."""


def kept_landmarks(problem: RefineProblem) -> Index:
    """Return the (g, 2) vehicles and landmarks whose clearance the solver keeps."""
    guarded = problem.guarded_landmarks()
    moves = np.any(problem.freedom.free[:3, guarded[:, 0]], axis=0)
    return np.asarray(guarded[moves])


def side_count(problem: RefineProblem) -> int:
    """Return the number of values of `sides_of`."""
    return len(kept_landmarks(problem)) + len(problem.area.outside) * problem.orbits.count


def sides_of(problem: RefineProblem, circles: Array) -> Array:
    """Return the side that circles (4, n) in m are on, of each landmark kept, then each keep-out.

    Positive outside, negative within. Landmarks: 1 / m, the side over the clearance to be kept;
    keep-outs: 1, those of each polygon for all vehicles.
    """
    return np.concatenate([_of_landmarks(problem, circles), _of_keep_outs(problem, circles)])


def _of_landmarks(problem: RefineProblem, circles: Array) -> Array:
    """The side of the start, unless its bounds allow more room on the other and too little here.

    Where they allow too little on either, as much as they allow is kept.
    """
    k, landmark = kept_landmarks(problem).T
    places = problem.landmarks[landmark]
    asked = problem.guarded_clearance * (1.0 + _SAFETY)
    nearest, furthest = problem.freedom.reaches(k, places)
    least, most = problem.freedom.lower[2, k], problem.freedom.upper[2, k]
    outside, within = furthest - least, most - nearest
    beyond = np.hypot(*(circles[:2, k].T - places).T) >= circles[2, k]
    own, other = np.where(beyond, outside, within), np.where(beyond, within, outside)
    swapped = (own < asked) & (other > own)
    kept = np.clip(np.where(swapped, other, own), _LEAST_SHARE * asked, asked)
    return np.asarray(np.where(beyond != swapped, 1.0, -1.0) / kept)


def _of_keep_outs(problem: RefineProblem, circles: Array) -> Array:
    centers, radii = circles[:2].T, circles[2]
    round_them = [
        problem.area.goes_round(number, centers, radii)
        for number in range(len(problem.area.outside))
    ]
    return np.where(np.concatenate([np.zeros(0, dtype=bool), *round_them]), -1.0, 1.0)
