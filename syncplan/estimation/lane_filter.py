"""A compiled filter: many trials side by side, and whether numba has compiled it yet."""

import hashlib
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
    empty_augmented_statistics,
)
from syncplan.estimation.filter_setup import FilterSetup, MotionModel, Readings
from syncplan.estimation.filter_statistics import (
    SAMPLE_EVERY,
    FilterStatistics,
    empty_series,
    empty_statistics,
)

__all__ = ["WIDE_UP_TO", "LaneFilter", "Lanes", "augmented_specimen", "compiled", "pose_specimen"]

WIDE_LANES = 16
"""Trials filtered side by side: four times as fast as one by one for 6 vehicles."""

WIDE_UP_TO = 60
"""Largest team filtered in wide lanes; above they gain nothing and cost sixteenfold memory."""

KERNEL_FILES = (
    "augmented_correction.py",
    "augmented_frame.py",
    "augmented_prediction.py",
    "augmented_setup.py",
    "batched_filter.py",
    "filter_setup.py",
    "filter_statistics.py",
    "lane_statistics.py",
)
"""Files that compiled kernels rest on: kernels that others call, records whose fields are known."""

Lanes = NDArray[np.int8] | tuple[int]
"""Only its length counts: the number of lanes.

One lane is passed as the tuple (0,): the compiler knows the length of a tuple, the loop over lanes
vanishes and the loop over columns vectorises instead. More lanes are passed as an array, and the
loop over lanes vectorises.
"""

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Return the kernel compiled, and kept in numba's disk cache where one can be written.

    The cache alone notices only changes of the kernel's own file; here it notices changes of
    KERNEL_FILES as well.
    """
    try:
        jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
        kernel: Any = jit(function)
    except RuntimeError:  # neither the package nor the home directory can be written
        jit = numba.njit(nogil=True, error_model="numpy")
        kernel = jit(function)
    with suppress(AttributeError):  # a numba whose cache has another layout
        file = kernel._cache._cache_file
        file._source_stamp = (file._source_stamp, _shared_stamp())
    return cast(Function, kernel)


@cache
def _shared_stamp() -> bytes:
    """Digest of the kernel files."""
    files = (Path(__file__).with_name(name).read_bytes() for name in KERNEL_FILES)
    return hashlib.sha256(b"".join(files)).digest()


@dataclass(frozen=True, slots=True)
class LaneFilter:
    """A filter whose trials are lanes, the last axis of every array.

    Attributes
    ----------
    kernel : compiled, of (FilterSetup, Readings, FilterStatistics, Lanes): adds to the statistics
        and returns the state (n, 3, lanes) and the covariance's lower triangle (3n, 3n, lanes); or
        of their augmented forms, returning the further states (e, lanes) between the two
    specimen : arguments of the kernel for n vehicles and no step: their types are what is compiled
    """

    kernel: Any
    specimen: Callable[[int], tuple[Any, ...]]

    @staticmethod
    def lanes_for(n: int) -> int:
        """Return how many trials of n vehicles it is best to filter side by side."""
        return WIDE_LANES if n <= WIDE_UP_TO else 1

    def run(
        self,
        setup: FilterSetup | AugmentedSetup,
        readings: Readings | AugmentedReadings,
        statistics: FilterStatistics | AugmentedStatistics,
    ) -> tuple[Array, ...]:
        """Return the state (n, 3, lanes) and the covariance (3n, 3n, lanes) at the end.

        Of the covariance only the lower triangle counts. Adds to the statistics on the way. Any
        number of lanes will do.
        """
        n, _, width = readings.initial.shape
        ended: tuple[Array, ...] = self.kernel(setup, readings, statistics, _lanes(n, width))
        return ended

    def is_compiled(self, n: int) -> bool:
        """Return whether the kernel for n vehicles is in memory or in numba's disk cache.

        If not, the first run compiles it, which takes some seconds: say so before it starts. False
        where numba's cache has another layout than the one read here.
        """
        typeof: Any = numba.typeof
        types = tuple(typeof(argument) for argument in self.specimen(n))
        if types in self.kernel.overloads:
            return True
        try:
            index = self.kernel._cache._cache_file._load_index()
            return any(tuple(key[0]) == types for key in index)
        except (AttributeError, TypeError, IndexError, OSError):
            return False

    def compile(self, n: int) -> None:
        """Compile the kernel for n vehicles, or load it from numba's disk cache."""
        self.kernel(*self.specimen(n))


def _lanes(n: int, width: int) -> Lanes:
    return (0,) if width == LaneFilter.lanes_for(n) == 1 else np.zeros(width, dtype=np.int8)


def augmented_specimen(n: int) -> tuple[Any, ...]:
    """Return arguments of a kernel with further states, for n vehicles and no step."""
    poses, readings, _, lanes = pose_specimen(n)
    setup = AugmentedSetup(
        poses=poses,
        columns=np.full((n, 7), -1, dtype=np.int64),
        variances=np.zeros(0),
        first_gust=3 * n,
        decay=1.0,
        gust_noise=0.0,
    )
    truth = AugmentedReadings(*readings, np.zeros((1, n, 1)), np.zeros((0, 1)), np.zeros((1, 0, 1)))
    series = empty_series(n, 0, wanted=False), np.zeros((0, 0, 3))
    return setup, truth, empty_augmented_statistics(n, 0, 1, series), lanes


def pose_specimen(n: int) -> tuple[FilterSetup, Readings, FilterStatistics, Lanes]:
    """Return arguments of a kernel of poses, for n vehicles and no step."""
    none = np.zeros(0, dtype=np.int64)
    still = np.zeros((0, n, 1))
    setup = FilterSetup(
        truth=np.zeros((1, n, 3)),
        spans=np.zeros(0),
        compared=np.zeros(1, dtype=np.int64),
        landmarks=np.zeros((0, 2)),
        first=np.zeros(2, dtype=np.int64),
        observers=none,
        targets=none,
        kinds=none,
        variances=np.zeros(0),
        initial_variances=np.ones((n, 3)),
        motion=MotionModel(time=1.0, substeps=0, speed_variance=0.0, turn_rate_variance=0.0),
        gate=math.inf,
        sample_every=SAMPLE_EVERY,
    )
    readings = Readings(np.zeros((n, 3, 1)), still, still, np.zeros((0, 1)))
    statistics = empty_statistics(n, 1, empty_series(n, 0, wanted=False))
    return setup, readings, statistics, _lanes(n, 1)
