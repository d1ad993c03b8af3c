"""The stages of one start: ever more samples, ever sharper steps between seen and unseen."""

from dataclasses import dataclass

import numpy as np

from syncplan.refinement.problem import RefineProblem
from syncplan.refinement.sample_times import SampleTimes, samples_of

_LEAST_WIDTH, _LARGEST_WIDTH = 0.002, 0.05
_STEP_OF_SPACING = 0.25
_FEW, _MANY = 64, 400


@dataclass(frozen=True, slots=True)
class Stage:
    """How one stage looks at the problem.

    Attributes
    ----------
    samples : most samples of a window that are distinguished
    width : of the step between seen and unseen, as a share of the range
    barrier : weight of the logarithmic barrier, of the objectives that have one
    iterations : most that IPOPT may take
    tolerance : at which IPOPT calls it solved
    last : whether contacts keep a safety distance from their limits
    """

    samples: int
    width: float
    barrier: float
    iterations: int
    tolerance: float
    last: bool


def stages_of(problem: RefineProblem) -> tuple[Stage, ...]:
    """Return soft, sharper, nearly hard: the last step as wide as what passes between samples."""
    most = int(np.clip(12_000 // max(problem.orbits.count, 1), 2 * _FEW, _MANY))
    last = max(_LEAST_WIDTH, step_width(problem, samples_in(problem, problem.window, most)))
    return (
        Stage(_FEW, 0.1, 0.3, 60, 1e-3, False),
        Stage(_FEW, max(0.04, last), 0.05, 60, 1e-3, False),
        Stage(most, last, 0.01, 150, 1e-4, True),
    )


def samples_in(problem: RefineProblem, span: float, most: int) -> SampleTimes:
    """Return the samples in `span` s, at most `most` of them distinguished."""
    return samples_of(span, problem.sensors, problem.orbits.rate, most)


def step_width(problem: RefineProblem, times: SampleTimes) -> float:
    """Return a share of the range: about what passes between neighbouring samples, at most 5 %."""
    passed = 2.0 * problem.orbits.radii.max() * times.spacing
    return float(min(_STEP_OF_SPACING * passed / problem.sensors.ranges.max(), _LARGEST_WIDTH))
