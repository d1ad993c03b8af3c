"""A compiled filter: many trials side by side, and whether numba has compiled it yet."""

import hashlib
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numpy.typing import NDArray

from syncplan.arrays import Array
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
    empty_augmented_statistics,
    without_errors,
)
from syncplan.estimation.filter_setup import FilterSetup, MotionModel, Readings
from syncplan.estimation.filter_statistics import (
    SAMPLE_EVERY,
    FilterStatistics,
    empty_series,
    empty_statistics,
)

WIDE_LANES = 16
"""Trials filtered side by side: four times as fast as one by one for 6 vehicles."""

WIDE_UP_TO = 60
"""Largest team filtered in wide lanes; above they gain nothing and cost sixteenfold memory."""

KERNEL_FILES = (
    "augmented_clocks.py",
    "augmented_correction.py",
    "augmented_curvature.py",
    "augmented_frame.py",
    "augmented_prediction.py",
    "augmented_rows.py",
    "augmented_setup.py",
    "augmented_statistics.py",
    "batch_problem.py",
    "batched_filter.py",
    "filter_setup.py",
    "filter_statistics.py",
    "lane_filter.py",
    "lane_statistics.py",
    "second_order.py",
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
    KERNEL_FILES as well, and of kernels beside it in another package.
    """
    return _compiled(function, {})


def inner(function: Function) -> Function:
    """Return a kernel as `compiled` does, to be built into the kernels that call it.

    No array that it writes to may overlap another of its arrays. So the compiler need not find that
    out before each loop over lanes, which are short, nor count references at each call.
    """
    return _compiled(function, {"forceinline": True, "pipeline_class": _Apart})


class _Apart(CompilerBase):
    """Numba's compiler, for functions whose arrays do not overlap."""

    def define_pipelines(self) -> list[Any]:
        with suppress(AttributeError):  # a numba without the flag: slower code, the same results
            self.state.flags.noalias = True
        passes: Any = DefaultPassBuilder
        return [passes.define_nopython_pipeline(self.state)]


def _compiled(function: Function, options: dict[str, Any]) -> Function:
    try:
        jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy", **options)
        kernel: Any = jit(function)
    except RuntimeError:  # neither the package nor the home directory can be written
        jit = numba.njit(nogil=True, error_model="numpy", **options)
        kernel = jit(function)
    with suppress(AttributeError):  # a numba whose cache has another layout
        file = kernel._cache._cache_file
        folder = Path(function.__code__.co_filename).parent
        file._source_stamp = (file._source_stamp, _shared_stamp(), _stamp_of(folder))
        file._load_index = _none_if_renamed(file._load_index)
    return cast(Function, kernel)


def _none_if_renamed(load: Callable[[], Any]) -> Callable[[], Any]:
    """`load` an index of cached kernels; none where it names a record that is called otherwise now.

    Numba unpickles the types of kernels before it looks whether they are still up to date.
    """

    def loaded() -> Any:
        try:
            return load()
        except (AttributeError, ImportError):
            return {}

    return loaded


@cache
def _shared_stamp() -> bytes:
    """Digest of the kernel files."""
    files = (Path(__file__).with_name(name).read_bytes() for name in KERNEL_FILES)
    return hashlib.sha256(b"".join(files)).digest()


@cache
def _stamp_of(folder: Path) -> bytes:
    """Digest of the kernels, and records of theirs, in another package than this one."""
    if folder == Path(__file__).parent:
        return b""
    texts = [file.read_bytes() for file in sorted(folder.glob("*.py"))]
    marks = b"@compiled", b"@inner", b"NamedTuple"
    return hashlib.sha256(
        b"".join(text for text in texts if any(mark in text for mark in marks))
    ).digest()


def has_compiled(kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Return whether a kernel for arguments of these types is in memory or in numba's disk cache.

    False where numba's cache has another layout than the one read here.
    """
    typeof: Any = numba.typeof
    types = tuple(typeof(argument) for argument in arguments)
    if types in kernel.overloads:
        return True
    try:
        index = kernel._cache._cache_file._load_index()
        return any(tuple(key[0]) == types for key in index)
    except (AttributeError, TypeError, IndexError, OSError):
        return False


def is_in_cache(kernel: Any) -> bool:
    """Return whether a kernel for any arguments is in memory or in numba's disk cache."""
    if kernel.overloads:
        return True
    try:
        return bool(kernel._cache._cache_file._load_index())
    except (AttributeError, TypeError, OSError):
        return False


@dataclass(frozen=True, slots=True)
class LaneFilter:
    """A filter whose trials are lanes, the last axis of every array.

    Attributes
    ----------
    kernel : compiled, of (FilterSetup, Readings, FilterStatistics, Lanes), the state (n, 3, lanes),
        the covariance's lower triangle (3n, 3n, lanes) and two samples: takes both from the first
        sample to the second and adds to the statistics; or of their augmented forms, with the
        further states (e, lanes) between state and covariance
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
        streams: Sequence[np.random.SeedSequence] = (),
    ) -> tuple[Array, ...]:
        """Return the state (n, 3, lanes) and the covariance (3n, 3n, lanes) at the end.

        With further states, they stand between the two, (e, lanes). Of the covariance only the
        lower triangle counts. Adds to the statistics on the way. Any number of lanes will do.
        `streams` are for filters that draw numbers, which these do not.
        """
        state = start_of(setup, readings)
        self.advance(setup, readings, statistics, state, 0, len(readings.speeds))
        return state

    def advance(
        self,
        setup: FilterSetup | AugmentedSetup,
        readings: Readings | AugmentedReadings,
        statistics: FilterStatistics | AugmentedStatistics,
        state: tuple[Array, ...],
        begin: int,
        end: int,
    ) -> None:
        """Take a state, as `run` returns it, from sample `begin` to sample `end`, in place."""
        n, _, width = readings.initial.shape
        self.kernel(setup, readings, statistics, lanes_of(n, width), *state, begin, end)

    def is_compiled(self, n: int) -> bool:
        """Return whether the kernel for n vehicles is in memory or in numba's disk cache.

        If not, the first run compiles it, which takes some seconds: say so before it starts.
        """
        return has_compiled(self.kernel, self.specimen(n))

    def compile(self, n: int) -> None:
        """Compile the kernel for n vehicles, or load it from numba's disk cache."""
        self.kernel(*self.specimen(n))


def start_of(
    setup: FilterSetup | AugmentedSetup, readings: Readings | AugmentedReadings
) -> tuple[Array, ...]:
    """Return the state of each lane at sample 0, in arrays of its own."""
    augmented = setup if isinstance(setup, AugmentedSetup) else None
    poses = setup if isinstance(setup, FilterSetup) else setup.poses
    variances = [poses.initial_variances.ravel()]
    if augmented is not None:
        variances.append(augmented.variances)
    diagonal = np.concatenate(variances)
    width = readings.initial.shape[-1]
    P = np.zeros((len(diagonal), len(diagonal), width))
    P[np.arange(len(diagonal)), np.arange(len(diagonal))] = diagonal[:, None]
    if augmented is None:
        return readings.initial.copy(), P
    return readings.initial.copy(), np.zeros((len(augmented.variances), width)), P


def lanes_of(n: int, width: int) -> Lanes:
    """Return the lanes of so many trials of n vehicles, as kernels take them."""
    return (0,) if width == LaneFilter.lanes_for(n) == 1 else np.zeros(width, dtype=np.int8)


def augmented_specimen(n: int) -> tuple[Any, ...]:
    """Return arguments of a kernel with further states, for n vehicles and no step."""
    poses, readings, _, lanes, *_ = pose_specimen(n)
    setup = without_errors(poses)
    truth = AugmentedReadings(
        initial=readings.initial,
        speeds=readings.speeds,
        turn_rates=readings.turn_rates,
        sightings=readings.sightings,
        headings=np.zeros((1, n, 1)),
        constants=np.zeros((0, 1)),
        changing=np.zeros((1, 0, 1)),
    )
    series = empty_series(n, 0, wanted=False), np.zeros((0, 0, 3))
    statistics = empty_augmented_statistics(n, 0, 1, series)
    return setup, truth, statistics, lanes, *start_of(setup, truth), 0, 0


def pose_specimen(n: int) -> tuple[Any, ...]:
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
        second_order=False,
        period=1.0,
        judged_from=0,
        lost_variances=np.ones((n, 3)),
        sample_every=SAMPLE_EVERY,
        noise_known=True,
    )
    readings = Readings(np.zeros((n, 3, 1)), still, still, np.zeros((0, 1)))
    statistics = empty_statistics(n, 1, empty_series(n, 0, wanted=False))
    return setup, readings, statistics, lanes_of(n, 1), *start_of(setup, readings), 0, 0
