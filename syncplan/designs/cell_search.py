"""The best formation of so many vehicles and landmarks, by CMA-ES in short rounds.

A round begins at a random point; the next one, with smaller steps, around the best that it found;
and so on in turns, until all evaluations are made.

Source
------
Hansen, "The CMA evolution strategy: a tutorial", arXiv 1604.00772, 2016
"""

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.designs.candidates import UNFIT, Space
from syncplan.errors import InputError

SPREAD = 0.25
"""Standard deviation of the first candidates in the unit cube."""

NEARBY = 0.1
"""The same around a point that is already good."""

AT_FIRST, AROUND = 1500, 3000
"""Most evaluations from a random point, and around what these found."""


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
    generator = np.random.default_rng(seed)
    near = start is not None
    begin = generator.uniform(0.2, 0.8, space.size) if start is None else start
    best, made = Found(begin, space.value(begin), 1), 1
    while made < evaluations and not stop():
        most = min(AROUND if near else AT_FIRST, evaluations - made)
        found = _round(space, begin, NEARBY if near else SPREAD, most, generator, stop)
        made += found.evaluations
        best = min(best, found, key=lambda one: one.value)
        begin = generator.uniform(0.2, 0.8, space.size) if near else found.point
        near = not near
    return Found(best.point, best.value, made)


def _round(
    space: Space,
    begin: Array,
    spread: float,
    evaluations: int,
    generator: np.random.Generator,
    stop: Callable[[], bool],
) -> Found:
    """The best candidate of a strategy, which ends once it has settled."""
    strategy = _cma().CMAEvolutionStrategy(
        begin,
        spread,
        {
            "bounds": [0.0, 1.0],
            "randn": lambda *shape: generator.standard_normal(shape),
            "seed": np.nan,
            "verbose": -9,
        },
    )
    best, made = Found(begin, np.inf, 0), 0
    while made < evaluations and not strategy.stop() and not stop():
        points = [np.asarray(one, dtype=float) for one in strategy.ask()]
        values = list(takewhile(lambda _: not stop(), map(space.value, points)))
        if len(values) < len(points):
            break
        strategy.tell(points, values)
        made += len(points)
        first = int(np.argmin(values))
        if values[first] < best.value:
            best = Found(points[first], values[first], made)
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
