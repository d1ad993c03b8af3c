"""The best formation of so many vehicles and landmarks, by CMA-ES with restarts.

A strategy that has settled is begun anew from a random point with twice as many candidates at a
time, until all evaluations are made.

Source
------
Hansen, "The CMA evolution strategy: a tutorial", arXiv 1604.00772, 2016; restarts: Auger, Hansen,
"A restart CMA evolution strategy with increasing population size", IEEE CEC 2005
"""

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.designs.candidates import UNFIT, Space
from syncplan.errors import InputError

SPREAD = 0.25
"""Standard deviation of the first candidates in the unit cube."""

NEARBY = 0.1
"""The same around a point that is already good."""

FEW, MOST_CROWDED = 2500, 4
"""Evaluations for each multiple of the usual number of candidates at a time, and the most."""


@dataclass(frozen=True, slots=True)
class Found:
    """Best candidate of a search.

    Attributes
    ----------
    point : (size,) of the unit cube
    value : m, its worst predicted error; from UNFIT on, it has faults
    evaluations : number of candidates looked at
    """

    point: Array
    value: float
    evaluations: int

    @property
    def fits(self) -> bool:
        """Whether the candidate has no faults."""
        return self.value < UNFIT

    def as_bytes(self) -> bytes:
        """Return the result as JSON, whose numbers read back unchanged."""
        return json.dumps([self.point.tolist(), self.value, self.evaluations]).encode()

    @classmethod
    def of_bytes(cls, data: bytes) -> "Found":
        """Return the result that `as_bytes` gave."""
        point, value, evaluations = json.loads(data)
        return cls(np.array(point), value, evaluations)


def search(
    space: Space,
    evaluations: int,
    seed: tuple[int, ...],
    start: Array | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Found:
    """Return the best candidate of a space after about so many evaluations.

    The search begins near `start`, and its result is no worse, or it begins at random. Where `stop`
    returns True, it ends early.
    """
    cma = _cma()
    generator = np.random.default_rng(seed)
    begin = generator.uniform(0.2, 0.8, space.size) if start is None else start
    best, made = Found(begin, space.value(begin), 1), 1
    spread = SPREAD if start is None else NEARBY
    # a long search can afford more at a time, which settles less often on a poor formation
    crowd = min(max(evaluations // FEW, 1), MOST_CROWDED)
    together = crowd * (4 + int(3.0 * np.log(space.size)))
    while made < evaluations and not stop():
        strategy = cma.CMAEvolutionStrategy(
            begin,
            spread,
            {
                "bounds": [0.0, 1.0],
                "popsize": together,
                "randn": lambda *shape: generator.standard_normal(shape),
                "seed": np.nan,
                "verbose": -9,
            },
        )
        while made < evaluations and not strategy.stop() and not stop():
            points = [np.asarray(one, dtype=float) for one in strategy.ask()]
            values = [space.value(one) for one in points]
            strategy.tell(points, values)
            made += len(points)
            first = int(np.argmin(values))
            if values[first] < best.value:
                best = Found(points[first], values[first], made)
        begin, spread, together = generator.uniform(0.2, 0.8, space.size), SPREAD, 2 * together
    return Found(best.point, best.value, made)


def _cma() -> Any:
    try:
        # it warns where its own figures are not available
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import cma
    except ImportError:
        raise InputError(
            "designs need the package cma; install the extra: pip install 'syncplan[design]'"
        ) from None
    return cma
