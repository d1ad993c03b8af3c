"""Results of trials: errors and consistency figures, kept so that parts join exactly.

Figures of each trial are concatenated. Sums over trials follow a binary tree over chunks of
CHUNK_TRIALS trials, whose shape depends on the trial numbers alone:

    chunk          0   1   2   3   4   5
    level 1        01      23      45         a part of a run keeps the sums of its largest
    level 2        0123                       complete branches; `merge` joins adjacent ones

so parts of a run that are computed elsewhere and merged give the bytes of the whole.

If a filter is lost in some trials, these dominate an RMS over trials. The median trial is what to
expect of one run; the share of trials over a multiple of the bound shows how often to expect worse.

An archive of trials is a part of a Monte Carlo run as bytes, an .npz file of plain arrays.
"""

import io
from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from types import EllipsisType
from typing import Any
from zipfile import BadZipFile

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.consistency import interval_of_rms
from syncplan.estimation.filter_setup import ERROR, SAMPLE_EVERY, SQUARE, VARIANCE, FilterStatistics

CHUNK_TRIALS = 16
"""A run can be divided at multiples of this many trials."""


@dataclass(frozen=True, slots=True)
class Branch:
    """Sums over 2^level chunks, from chunk index * 2^level on.

    Attributes
    ----------
    level, index : place in the binary tree over the chunks
    sums : (steps + 1, n, 11) three signed errors, the squared errors of position and heading, their
        two variances, and squares and variances of x and y alone; for a flight, as in FlightResult
    error_sums : (steps + 1, e, 3) of errors of the bias states, their squares and variances
    """

    level: int
    index: int
    sums: Array
    error_sums: Array = field(default_factory=lambda: np.zeros((0, 0, 3)))


@dataclass(frozen=True, slots=True)
class MonteCarloResult:
    """Result of a run of trials. Errors are (x, y, heading) in m, m, rad, heading wrapped.

    Attributes
    ----------
    seed, first_trial, steps : seed, number of the first trial, and samples per trial
    mean_squares : (trials, n, 3) squared error, mean over steps k = 1..steps
    late_mean_squares : (trials, n, 3) the same over the second half, steps k with 2k > steps
    final_errors : (trials, n, 3) at the last step
    covered : (trials, n) coordinates within three sigma, out of `coverage_samples`
    coverage_samples : 3 for every tenth step and the last
    nees : (trials,) e' P^-1 e over all 3n states, mean over every tenth step and the last;
        NaN where the covariance was not positive definite at any of them
    nees_samples : (trials,) number of them that counted
    nis_sums, accepted, gated : (trials,) sum of innovation^2 / variance over accepted sightings,
        number of these, and number that the gate rejected
    branches : sums of the series over trials, empty unless asked for
    state_squares, late_state_squares : (trials, e) squared error of each further state, mean over
        the run and over its second half; in the order of the filter's StateLayout
    states_covered : (trials, e) share of the sampled steps at which it is within three sigma
    """

    seed: int
    first_trial: int
    steps: int
    mean_squares: Array
    late_mean_squares: Array
    final_errors: Array
    covered: Array
    coverage_samples: int
    nees: Array
    nees_samples: Array
    nis_sums: Array
    accepted: Array
    gated: Array
    branches: tuple[Branch, ...]
    state_squares: Array = field(default_factory=lambda: np.zeros((0, 0)))
    late_state_squares: Array = field(default_factory=lambda: np.zeros((0, 0)))
    states_covered: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.nees)


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Root mean squares over trials (and samples): arrays (n,) by vehicle.

    Attributes
    ----------
    x, y, position : m, over the run; position is sqrt(x^2 + y^2)
    heading : rad, over the run
    late_position, late_heading : m, rad, over the second half
    final_position : m, at the last step
    """

    x: Array
    y: Array
    position: Array
    heading: Array
    late_position: Array
    late_heading: Array
    final_position: Array

    def overall(self, vehicles: Flags | EllipsisType = ...) -> "Accuracy":
        """Return the root mean squares over all vehicles, or those chosen, as 0-d arrays."""
        values = (getattr(self, field.name)[vehicles] for field in fields(self))
        return Accuracy(*(np.asarray(np.sqrt(np.mean(value**2))) for value in values))


@dataclass(frozen=True, slots=True)
class ErrorSeries:
    """Errors and the filter's own sigmas over time, steps k = 0..steps, across trials.

    Attributes
    ----------
    mean_errors : (steps + 1, n, 3) signed, m, m, rad
    position_rms, heading_rms : (steps + 1, n) m, rad
    position_sigma, heading_sigma : (steps + 1, n) root of the mean of Pxx + Pyy in m, of Phh in rad
    axis_rms, axis_sigma : (steps + 1, n, 2) m, of x and y alone
    """

    mean_errors: Array
    position_rms: Array
    heading_rms: Array
    position_sigma: Array
    heading_sigma: Array
    axis_rms: Array
    axis_sigma: Array


@dataclass(frozen=True, slots=True)
class StateSeries:
    """Errors and the filter's own sigmas of the e further states over time, steps k = 0..steps.

    Attributes
    ----------
    mean_errors, rms : (steps + 1, e) in each state's unit
    sigma : (steps + 1, e) root of the mean variance
    """

    mean_errors: Array
    rms: Array
    sigma: Array


def result_of(
    statistics: Sequence[FilterStatistics],
    count: int,
    *,
    steps: int,
    seed: int = 0,
    first_trial: int = 0,
    judged_from: int = 0,
    known: Flags | None = None,
) -> MonteCarloResult:
    """Return the result of a chunk of trials of `steps` samples, from `first_trial` on.

    `count` is the number of vehicles. NEES and coverage were taken at every tenth sample after
    `judged_from`, and at the last. Of `known` (steps,), errors were taken at those samples alone.
    The statistics share one series; `first_trial` is a multiple of CHUNK_TRIALS, and there are at
    most as many trials.
    """
    taken = np.ones(steps, dtype=bool) if known is None else known
    sample = np.arange(1, steps + 1)
    judged = (sample % SAMPLE_EVERY == 0) | (sample == steps)
    sampled = int(np.sum(taken & judged & (sample > judged_from)))

    def per_trial(name: str) -> Array:
        lanes_last = np.concatenate([getattr(one, name) for one in statistics], axis=-1)
        return np.ascontiguousarray(np.moveaxis(lanes_last, -1, 0))

    def of_poses(values: Array) -> Array:
        return values[:, : 3 * count].reshape(-1, count, 3)

    samples = per_trial("nees_samples")
    squares, covered = per_trial("squares") / np.sum(taken), per_trial("covered")
    with np.errstate(invalid="ignore", divide="ignore"):
        nees = per_trial("nees") / samples
        late_squares = per_trial("late_squares") / np.sum(taken[steps // 2 :])
        states_covered = covered[:, 3 * count :] / sampled
    series = statistics[0].series
    return MonteCarloResult(
        seed=seed,
        first_trial=first_trial,
        steps=steps,
        mean_squares=of_poses(squares),
        late_mean_squares=of_poses(late_squares),
        final_errors=of_poses(per_trial("final") if taken[-1] else np.nan * per_trial("final")),
        covered=of_poses(covered).sum(axis=2),
        coverage_samples=3 * sampled,
        nees=nees,
        nees_samples=samples,
        nis_sums=per_trial("nis"),
        accepted=per_trial("accepted"),
        gated=per_trial("gated"),
        branches=(_branch_of(series, count, first_trial),) if len(series) else (),
        state_squares=squares[:, 3 * count :],
        late_state_squares=late_squares[:, 3 * count :],
        states_covered=states_covered,
    )


def _branch_of(series: Array, count: int, first_trial: int) -> Branch:
    """Sums of a chunk, from a series (samples + 1, 3n + e, 3)."""
    errors, squares, variances = (
        series[:, : 3 * count, quantity].reshape(-1, count, 3)
        for quantity in (ERROR, SQUARE, VARIANCE)
    )
    pairs = [
        np.stack([one[..., 0] + one[..., 1], one[..., 2]], axis=2) for one in (squares, variances)
    ]
    sums = np.concatenate([errors, *pairs, squares[..., :2], variances[..., :2]], axis=2)
    return Branch(0, first_trial // CHUNK_TRIALS, sums, series[:, 3 * count :].copy())


def merge(parts: Sequence[MonteCarloResult]) -> MonteCarloResult:
    """Return one result from consecutive parts of a run, with the bytes of an undivided run.

    Raises InputError if parts differ in seed or length, leave a gap, or if a part before the last
    does not end at a multiple of CHUNK_TRIALS.
    """
    head = parts[0]
    following = head.first_trial
    for part in parts:
        if (part.seed, part.steps) != (head.seed, head.steps):
            raise InputError("parts of different seed or length can't be merged", key="seed")
        if part.first_trial != following:
            raise InputError(f"{part.first_trial}, expected {following}", key="first_trial")
        following = part.first_trial + part.trials
    for part in parts[1:]:
        if part.first_trial % CHUNK_TRIALS:
            problem = f"{part.first_trial} is not a multiple of {CHUNK_TRIALS}"
            raise InputError(problem, key="first_trial")
    by_trial: dict[str, Any] = {
        one.name: np.concatenate([getattr(part, one.name) for part in parts])
        for one in fields(head)
        if isinstance(getattr(head, one.name), np.ndarray)
    }
    branches = joined([branch for part in parts for branch in part.branches])
    return replace(head, branches=branches, **by_trial)


def check_whole(
    result: MonteCarloResult, trials: int, vehicles: Flags | EllipsisType = ...
) -> None:
    """Raise InputError if trials of a run are missing, NoSolutionError if filters diverged.

    Errors of vehicles other than `vehicles` may be NaN.
    """
    if (result.first_trial, result.trials) != (0, trials):
        problem = f"{result.trials} from {result.first_trial} on given, of {trials}"
        raise InputError(problem, key="parts")
    lost = int(np.sum(~np.isfinite(result.mean_squares[:, vehicles]).all(axis=(1, 2))))
    if lost:
        raise NoSolutionError(
            f"the filter diverged in {lost} of {trials} trials: its errors are no longer finite; "
            "smaller sigmas or a shorter sample time may help"
        )


def accuracy(result: MonteCarloResult) -> Accuracy:
    """Return the root-mean-square errors by vehicle, over trials and samples."""
    whole = result.mean_squares.mean(axis=0)
    late = result.late_mean_squares.mean(axis=0)
    final = (result.final_errors**2).mean(axis=0)
    return Accuracy(
        x=np.sqrt(whole[:, 0]),
        y=np.sqrt(whole[:, 1]),
        position=np.sqrt(whole[:, 0] + whole[:, 1]),
        heading=np.sqrt(whole[:, 2]),
        late_position=np.sqrt(late[:, 0] + late[:, 1]),
        late_heading=np.sqrt(late[:, 2]),
        final_position=np.sqrt(final[:, 0] + final[:, 1]),
    )


def series(result: MonteCarloResult) -> ErrorSeries:
    """Return errors and sigmas over time; raises InputError for a run without series."""
    mean = _mean_series(result, "sums")
    return ErrorSeries(
        mean_errors=mean[..., :3],
        position_rms=np.sqrt(mean[..., 3]),
        heading_rms=np.sqrt(mean[..., 4]),
        position_sigma=np.sqrt(mean[..., 5]),
        heading_sigma=np.sqrt(mean[..., 6]),
        axis_rms=np.sqrt(mean[..., 7:9]),
        axis_sigma=np.sqrt(mean[..., 9:11]),
    )


def state_series(result: MonteCarloResult) -> StateSeries:
    """Return errors and sigmas of further states; raises InputError for a run without series."""
    mean = _mean_series(result, "error_sums")
    return StateSeries(
        mean_errors=mean[..., 0], rms=np.sqrt(mean[..., 1]), sigma=np.sqrt(mean[..., 2])
    )


def joined(branches: Sequence[Branch]) -> tuple[Branch, ...]:
    """Return the branches in order, with siblings joined into their parents."""
    stack: list[Branch] = []
    for branch in branches:
        stack.append(branch)
        while len(stack) > 1 and _are_siblings(stack[-2], stack[-1]):
            right, left = stack.pop(), stack.pop()
            sums, errors = left.sums + right.sums, left.error_sums + right.error_sums
            stack.append(Branch(left.level + 1, left.index // 2, sums, errors))
    return tuple(stack)


def _mean_series(result: MonteCarloResult, name: str) -> Array:
    if not result.branches:
        raise InputError("the run kept no series; run it with_series=True", key="with_series")
    total: Array = getattr(result.branches[0], name)
    for branch in result.branches[1:]:
        total = total + getattr(branch, name)
    return total / result.trials


def _are_siblings(left: Branch, right: Branch) -> bool:
    same = left.level == right.level and left.index + 1 == right.index
    return same and left.index % 2 == 0


# --- spread of errors over trials -----------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class TrialErrors:
    """Errors of each trial.

    Attributes
    ----------
    late_squares : (trials, n) m^2, mean squared position error over the second half of the run
    """

    late_squares: Array

    @property
    def late_position(self) -> Array:
        """(trials, n) m, RMS position error over the second half of the run."""
        return np.asarray(np.sqrt(self.late_squares))

    def intervals(self) -> list[tuple[float, float] | None]:
        """Return the 95 % interval of each vehicle's RMS over trials in m; see interval_of_rms."""
        return [interval_of_rms(squares) for squares in self.late_squares.T]

    def overall_interval(self, vehicles: Flags | EllipsisType = ...) -> tuple[float, float] | None:
        """Return the interval of the RMS over all vehicles, or those chosen, in m."""
        return interval_of_rms(self.late_squares[:, vehicles].mean(axis=1))

    def median(self) -> Array:
        """Return the median over trials, (n,) m."""
        return np.asarray(np.median(self.late_position, axis=0))

    def overall_median(self) -> float:
        """Return the median over trials of the RMS over vehicles, m."""
        return float(np.median(np.sqrt(np.mean(self.late_squares, axis=1))))

    def over(self, limits: Array) -> Flags:
        """Return (trials, n) whether each vehicle is over its limit (n,) in m."""
        return np.asarray(self.late_position > limits)


def trial_errors(result: MonteCarloResult) -> TrialErrors:
    """Return the errors of each trial of a run."""
    squares = result.late_mean_squares
    return TrialErrors(np.asarray(squares[..., 0] + squares[..., 1]))


# --- archives -------------------------------------------------------------------------------------


_BRANCHES = "branches"


def pack(part: MonteCarloResult) -> bytes:
    """Return a part as bytes, bit for bit."""
    arrays: dict[str, Any] = {
        field.name: np.asarray(getattr(part, field.name))
        for field in fields(part)
        if field.name != _BRANCHES
    }
    arrays["places"] = np.array(
        [(branch.level, branch.index) for branch in part.branches], dtype=np.int64
    ).reshape(-1, 2)
    for k, branch in enumerate(part.branches):
        arrays[f"sums_{k}"], arrays[f"error_sums_{k}"] = branch.sums, branch.error_sums
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def unpack(data: bytes) -> MonteCarloResult:
    """Return the part that `pack` turned into bytes; raises InputError for other bytes.

    Parts packed by versions without further states load as parts without any.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            places = stored["places"].tolist()
            branches = tuple(
                Branch(level, index, stored[f"sums_{k}"], *_later(stored, f"error_sums_{k}"))
                for k, (level, index) in enumerate(places)
            )
            values = {
                field.name: _value(stored[field.name])
                for field in fields(MonteCarloResult)
                if field.name != _BRANCHES
                and (field.name in stored or field.default_factory is MISSING)
            }
    except (OSError, EOFError, BadZipFile, ValueError, KeyError) as error:
        raise InputError(f"not a part of a run: {error}", key="parts") from None
    return MonteCarloResult(branches=branches, **values)


def _later(stored: Any, name: str) -> list[Any]:
    """Array that older archives lack, in a list; empty if it is missing."""
    return [stored[name]] if name in stored else []


def _value(stored: Any) -> Any:
    """Stored scalar as a Python number; a stored array unchanged."""
    return stored.item() if stored.ndim == 0 else stored
