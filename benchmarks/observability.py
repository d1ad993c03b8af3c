"""How much faster the closed-form observability matrix is than an empirical one by pybounds.

Both judge the same window (one period) from the same sightings: syncplan by the closed form of
every bearing's derivative, pybounds by simulating the team from perturbed initial states, two runs
a state, and differencing what is measured. Rows of bearings that are out of sight at a sample are
taken out of the empirical matrix, rows are divided by their sigma and positions are counted in
mean radii on both sides; the rank is the number of singular values above the same share of the
largest. Singular values must agree, and ranks be equal, before anything is reported.

The third scene lacks rank. Differencing leaves noise where a singular value ought to be zero: in
the discrete mode it stays below the tolerance, in the continuous one it does not and counts as
rank, so there the rank is shown but not compared.

pybounds runs in both of its modes: continuous, its default, integrated by IDAS, and discrete,
with the exact arc as the step. Setting its simulator up is not timed. A bearing that crosses the
branch cut of atan2 between two runs is off by a turn; that is put right here.

    python benchmarks/observability.py
"""

import math
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.arrays import Array
from syncplan.observability.rank import assess, link_information
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.noise import Noise
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Sensors, Team

SAMPLE_TIME_S = 0.1
SIGMA_RAD = 0.1
AGREEMENT = {"continuous": 1e-5, "discrete": 1e-8}
"""Largest difference of singular values, as a share of the largest one."""

RATIO_TARGET = 100.0
LABELS = {"pair": "2 vehicles", "same": "6 vehicles", "alternate": "6 vehicles alternating"}


@dataclass(frozen=True, slots=True)
class Scene:
    """A team and every bearing of the window."""

    key: str
    team: Team
    sightings: Sightings
    samples: int


def pair_with_landmarks() -> Scene:
    """Return two vehicles in opposite phase, the first with two landmarks always in view."""
    landmarks = np.array([[0.0, 28.0], [0.0, -28.0]])
    return _scene("pair", [[0, 0], [70, 0]], [1, 1], [0.3, 0.3 + np.pi], landmarks)


def paper_grid(alternating: bool) -> Scene:
    """Return the paper's grid (section 5.1) synchronised, one sense or alternating.

    Alternating at equal radii, linked vehicles are in mirror motion and rank is lost.
    """
    centers = [[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]]
    landmarks = np.array([[190.0, 0.0], [190.0, 70.0]])
    if alternating:
        phases = [0.3, np.pi - 0.3, 0.3, -0.3, np.pi + 0.3, -0.3]
        return _scene("alternate", centers, [1, -1] * 3, phases, landmarks)
    phases = [0.3 + np.pi * (k % 2) for k in range(6)]
    return _scene("same", centers, [1] * 6, phases, landmarks)


def _scene(
    key: str,
    centers: Sequence[Sequence[float]],
    senses: Sequence[float],
    phases: Sequence[float],
    landmarks: Array,
) -> Scene:
    count = len(centers)
    orbits = Orbits(
        centers=np.array(centers, dtype=float),
        radii=np.full(count, 20.0),
        senses=np.array(senses, dtype=float),
        phases=np.array(phases),
        rate=0.2,
    )
    sensors = Sensors(
        ranges=np.full(count, 50.0),
        fields_of_view=np.full(count, 2.0 * np.pi),
        boresights=np.zeros(count),
        bearing_sigmas=np.full(count, SIGMA_RAD),
        sample_time=SAMPLE_TIME_S,
    )
    team = Team(orbits, landmarks, sensors, Noise(0.1, 0.01, 5.0, 0.1))
    windows = find_windows(team)
    last = math.ceil(orbits.period / SAMPLE_TIME_S) - 1
    sightings = sample_sightings(windows, orbits.period, sensors, 0, last)
    return Scene(key, team, sightings, last + 1)


# --- the two matrices ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Judgement:
    """Rank and singular values (3n,) of one side, and the seconds they took."""

    rank: int
    values: Array
    seconds: float


def closed_form(scene: Scene, repeats: int) -> Judgement:
    """Return the judgement of syncplan, the fastest of `repeats`."""
    seconds = float("inf")
    for _ in range(repeats):
        begin = time.perf_counter()
        links = link_information(scene.team, scene.sightings)
        verdict = assess(scene.team, links)
        seconds = min(seconds, time.perf_counter() - begin)
    return Judgement(verdict.rank, verdict.singular_values, seconds)


def empirical(scene: Scene, discrete: bool) -> tuple[Judgement, int]:
    """Return the judgement of pybounds, and how many bearings in sight jump at the branch cut."""
    from pybounds import EmpiricalObservabilityMatrix

    orbits, sightings = scene.team.orbits, scene.sightings
    ways = list(zip(sightings.observers.tolist(), sightings.targets.tolist(), strict=True))
    pairs = sorted(set(ways))
    team = simulator(scene, pairs, discrete)
    start = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)]).ravel()
    readings = np.column_stack([orbits.speeds, orbits.turn_rates]).ravel()
    inputs = np.tile(readings, (scene.samples, 1))
    place = {pair: k for k, pair in enumerate(pairs)}
    measured = np.array([place[way] for way in ways])
    columns = np.tile([orbits.radii.mean(), orbits.radii.mean(), 1.0], orbits.count)
    weights = columns / scene.team.sensors.bearing_sigmas[sightings.observers, None]
    begin = time.perf_counter()
    found = EmpiricalObservabilityMatrix(team, start, inputs)
    change = (found.y_plus - found.y_minus)[sightings.steps, :, measured]
    matrix = wrap(change) / (2.0 * found.eps) * weights
    values = np.linalg.svd(matrix, compute_uv=False)
    rank = int(np.sum(values > RANK_TOLERANCE * values[0]))
    seconds = time.perf_counter() - begin
    jumps = int(np.sum((np.abs(change) > np.pi).any(axis=1)))
    return Judgement(rank, values, seconds), jumps


def simulator(scene: Scene, pairs: list[tuple[int, int]], discrete: bool) -> Any:
    """Return pybounds' simulator of the team: its motion, and the bearings of `pairs`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import casadi
        import pybounds

    n, landmarks = scene.team.orbits.count, scene.team.landmarks.tolist()

    def flow(X: Any, U: Any) -> list[Any]:
        rates = []
        for i in range(n):
            rates += [U[2 * i] * casadi.cos(X[3 * i + 2]), U[2 * i] * casadi.sin(X[3 * i + 2])]
            rates += [U[2 * i + 1]]
        return rates

    def arc(X: Any, U: Any) -> list[Any]:
        after = []
        for i in range(n):
            x, y, psi, radius = X[3 * i], X[3 * i + 1], X[3 * i + 2], U[2 * i] / U[2 * i + 1]
            turned = psi + U[2 * i + 1] * SAMPLE_TIME_S
            after += [x + radius * (casadi.sin(turned) - casadi.sin(psi))]
            after += [y - radius * (casadi.cos(turned) - casadi.cos(psi)), turned]
        return after

    def bearings(X: Any, U: Any) -> list[float]:
        seen = []
        for o, t in pairs:
            x, y = (X[3 * t], X[3 * t + 1]) if t < n else landmarks[t - n]
            seen.append(math.atan2(y - X[3 * o + 1], x - X[3 * o]) - X[3 * o + 2])
        return seen

    return pybounds.Simulator(
        arc if discrete else flow,
        bearings,
        dt=SAMPLE_TIME_S,
        discrete=discrete,
        state_names=[f"{state}{i}" for i in range(n) for state in ("x", "y", "psi")],
        input_names=[f"{reading}{i}" for i in range(n) for reading in ("v", "w")],
    )


# --- comparison ----------------------------------------------------------------------------------


def _compare(scene: Scene, repeats: int) -> dict[str, float]:
    """Figures of one scene. Raises RuntimeError where the two sides disagree.

    Differencing leaves noise in singular values that ought to be zero. Where it is above the
    tolerance, it counts as rank: a deficient rank is compared only where the noise is below.
    """
    ours = closed_form(scene, repeats)
    size = 3 * scene.team.orbits.count
    result = {
        "exact_s": ours.seconds,
        "rank": float(ours.rank),
        "state_dim": float(size),
        "samples": float(scene.samples),
        "bearings": float(len(scene.sightings.steps)),
    }
    for mode, allowed in AGREEMENT.items():
        theirs, jumps = empirical(scene, discrete=mode == "discrete")
        noise = float(np.abs(theirs.values - ours.values).max() / ours.values[0])
        if not noise <= allowed:
            raise RuntimeError(f"{scene.key}, {mode}: singular values differ by {noise:.1e}")
        comparable = ours.rank == size or noise < RANK_TOLERANCE
        if comparable and theirs.rank != ours.rank:
            raise RuntimeError(f"{scene.key}, {mode}: rank {theirs.rank}, ours {ours.rank}")
        result |= {
            f"{mode}_s": theirs.seconds,
            f"{mode}_ratio": theirs.seconds / ours.seconds,
            f"{mode}_rank": float(theirs.rank),
            f"{mode}_noise": noise,
            "jumps": float(jumps),
        }
    return result


def main(repeats: int = 20) -> dict[str, float]:
    """Return, for each scene: seconds of both sides, ratios, ranks and differences."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # optional parts that pybounds' dependencies miss
        import_module("pybounds")
    return {
        f"{scene.key}_{name}": value
        for scene in (pair_with_landmarks(), paper_grid(False), paper_grid(True))
        for name, value in _compare(scene, repeats).items()
    }


def figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of a result."""
    shown = []
    for key, label in LABELS.items():
        rank, size = result[f"{key}_rank"], result[f"{key}_state_dim"]
        name = f"observability, {label}"
        what = f"{name}: closed form, rank {rank:.0f} of {size:.0f}"
        shown.append(Figure(what, result[f"{key}_exact_s"], "s"))
        for mode in AGREEMENT:
            rank = result[f"{key}_{mode}_rank"]
            what = f"{name}: faster than pybounds, {mode}, rank {rank:.0f} of {size:.0f}"
            shown.append(Figure(what, result[f"{key}_{mode}_ratio"], "x", RATIO_TARGET))
    return shown


if __name__ == "__main__":
    print_figures(figures(main()))
