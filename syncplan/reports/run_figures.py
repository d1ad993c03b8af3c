"""Figures that all runs of the filter share, as parts of documents and in words."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, JsonValue

from syncplan.arrays import Array
from syncplan.documents import (
    Document,
    DocumentPart,
    OrAbsent,
    Point,
    VersionedDocument,
    finite_or_none,
)
from syncplan.estimation.consistency import FEWEST_TRIALS, TOLERANCE, Consistency
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.trials import Accuracy, MonteCarloResult, series
from syncplan.phrases import listed
from syncplan.planning.plan_records import Interval
from syncplan.planning.plans import Plan
from syncplan.results.quantities import each, plain, quantity
from syncplan.results.stories import Report, Table
from syncplan.scenario.filters import FORMER_NAMES, FilterName, MotionName
from syncplan.scenario.truths import changed_keys

# --- a world that differs from the model ----------------------------------------------------------


class TrueKey(DocumentPart):
    """A key of the scenario in which the simulated world differs."""

    key: str = Field(examples=["wind.gust_sigma_mps"])
    assumed: JsonValue = Field(
        description="The scenario's value, which plan, prediction and filter take for true; null "
        "where it gives none, a list where vehicles differ",
        examples=[0.2],
    )
    true: JsonValue = Field(description="The simulated world's value", examples=[0.6])


class ExpectedErrors(DocumentPart):
    """Expected RMS position error over the second half, per vehicle and over all."""

    overall: float
    vehicles: dict[str, float]


MOST_NAMED = 6
"""Largest number of keys that a note names."""


def keys_in_truth(plan: Plan) -> list[TrueKey] | None:
    """Return the keys in which a plan's world differs; None if it has no truth of its own."""
    scenario = plan.scenario
    if scenario.truth is None:
        return None
    found = changed_keys(scenario, scenario.in_truth, scenario.truth)
    return [TrueKey(key=one.key, assumed=one.assumed, true=one.true) for one in found]


def expected_in_truth(plan: Plan, expected: Array | None) -> ExpectedErrors | None:
    """Return the errors (n,) m expected in a plan's world; None without a truth or errors."""
    if plan.scenario.truth is None or expected is None:
        return None
    return ExpectedErrors(
        overall=float(np.sqrt(np.mean(expected**2))),
        vehicles=dict(zip(plan.scenario.vehicle_names, expected.tolist(), strict=True)),
    )


def truth_note(
    keys: Sequence[TrueKey] | None,
    expected: ExpectedErrors | None,
    found: float,
    predicted: float | None,
) -> str | None:
    """Return a note on how the world differs, with errors in m; None if no key differs."""
    if not keys:
        return None
    each = [f"{one.key} is {_words(one.true)}, not {_words(one.assumed)}" for one in keys]
    text = f"in the simulated world {listed(each, MOST_NAMED)}. Second-half RMS: {found:.3g} m"
    if expected is not None:
        text += f", {expected.overall:.3g} m expected"
    return text if predicted is None else f"{text}; the filter's own bound is {predicted:.3g} m"


def _words(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


class StateErrorFigures(DocumentPart):
    """Errors of a filter state other than a pose, over all trials."""

    state: str = quantity("state", "Name", examples=["wind x", "speed scale of v1"])
    unit: str = quantity("unit", "Of the errors", examples=["m/s"])
    rms: float = quantity("total", "Over the samples after time 0", drop=2)
    rms_second_half: float = quantity("2nd half")
    predicted_rms: float | None = quantity(
        "bound",
        "The bound, over the second half, for circles flown in still air: in a wind of "
        "a quarter of the speed, the wind itself is known half as well",
    )
    ratio: float | None = quantity(
        "ratio", "Second-half RMS over predicted RMS", form=".2f", drop=3
    )
    coverage: float = quantity(
        "3 sigma", "Share of samples within 3 sigma; ideal 0.9973", form=".1%", drop=1
    )


class StateErrorSeries(DocumentPart):
    """Errors over time of a filter state other than a pose, in its unit."""

    state: str = Field(examples=["wind x", "speed scale of v1"])
    unit: str = Field(examples=["m/s"])
    rms: list[float] = Field(description="Over the trials, at each sample of `time_s`")
    mean: list[float]
    sigma: list[float] = Field(description="The filter's own sigma")
    predicted: list[float] | None = Field(
        default=None, description="The bound; null where none is computed"
    )


class Spread(DocumentPart):
    """Mean of a normalised squared error, with its confidence interval and the verdict."""

    value: float | None = Field(description="1 for a consistent filter; null without samples")
    band: tuple[float, float] | None = Field(
        description="Two-sided 95 % confidence interval of `value`; null where too few trials "
        "were run. In files without `basis`, the chi-square band of a consistent filter"
    )
    verdict: Literal["consistent", "optimistic", "conservative", "unknown"] = Field(
        description="optimistic where the whole interval is above 1.1 (sigmas too small), "
        "conservative where it is below 0.9; unknown without an interval, or where one over trials "
        "is wider than 0.4; otherwise consistent"
    )
    count: int = Field(description="Number of trials or degrees of freedom behind the interval")
    basis: Literal["trials", "chi-square"] | None = Field(
        default=None,
        description="Basis of the interval: the spread over trials or, for a single run, a "
        "chi-square variable; null in older files",
    )

    def words(self, *, trusted: bool = True) -> str:
        """The value with its interval, and the verdict in colour: green only where it is trusted.

        A filter may be consistent about all that it can know of a plan that is not observable.
        """
        good = "green" if trusted else "bold"
        colour = {"consistent": good, "unknown": "yellow"}.get(self.verdict, "red")
        return f"{interval_words(self)}: [{colour}]{verdict_words(self)}[/]"


anees_cells = each(lambda part: "-" if part.anees.value is None else f"{part.anees.value:.2f}")
"""Texts of the ANEES of parts that have one."""


def ends(interval: Interval) -> str:
    """Return the ends of an interval in words."""
    return " to ".join(f"{end:.3g}" for end in interval)


class Errors(DocumentPart):
    """Errors over all trials; RMS over the samples after time 0."""

    rms_m: float = quantity("total", unit="m", drop=4)
    rms_second_half_m: float = quantity("2nd half", unit="m")
    rms_second_half_interval_m: Interval | None = quantity(
        "95 %",
        "95 % interval of rms_second_half_m, from the spread over trials; null for "
        f"fewer than {FEWEST_TRIALS} trials, and in older files, as other intervals",
        default=None,
        words=each(lambda errors: ends(errors.rms_second_half_interval_m)),
    )
    rms_x_m: float = quantity("x", unit="m", drop=1, order=-1)
    rms_y_m: float = quantity("y", unit="m", drop=2, order=-1)
    rms_heading_rad: float
    final_error_m: float = Field(description="RMS over the trials at the last sample")
    coverage_3sigma: float = quantity(
        "3 sigma",
        "Share of coordinates within 3 sigma; ideal 0.9973",
        form=".1%",
        drop=3,
        order=3,
    )

    def overall_line(self, ratio: float | None, interval: Interval | None) -> Iterator[str]:
        """The RMS over all vehicles and its ratio to a bound, in a line; none without intervals."""
        if self.rms_second_half_interval_m is None:
            return
        beside = f", ratio {ratio:.3g} ({ends(interval)})" if ratio and interval else ""
        yield (
            f"all vehicles: {self.rms_second_half_m:.3g} m (95 % interval "
            f"{ends(self.rms_second_half_interval_m)}){beside}"
        )


class ErrorFigures(Errors):
    """Errors over all trials; RMS over the samples after time 0."""

    predicted_rms_m: float | None = quantity("bound", unit="m", order=2)
    rms_over_predicted: float | None = quantity(
        "ratio", "Second-half RMS over predicted RMS", form=".2f", drop=5, order=2
    )
    rms_over_predicted_interval: Interval | None = Field(default=None, description="95 %")
    median_rms_second_half_m: float | None = quantity(
        "median",
        "Median over the trials of each trial's second-half RMS; null in older files",
        "m",
        default=None,
        drop=6,
        order=1,
    )
    share_over_3_predicted: float | None = Field(
        default=None,
        description="Share of trials whose second-half RMS is over 3 times the predicted RMS; "
        "overall, of trials in which any vehicle's is. Null where nothing is predicted",
    )
    share_over_3_predicted_interval: Interval | None = Field(
        default=None, description="95 % (Clopper and Pearson)"
    )
    share_over_10_predicted: float | None = Field(
        default=None, description="The same over 10 times the predicted RMS"
    )
    share_over_10_predicted_interval: Interval | None = Field(
        default=None, description="95 % (Clopper and Pearson)"
    )


class VehicleFigures(ErrorFigures):
    """Errors of one vehicle."""

    name: str = quantity("vehicle", order=-2)


class FilterRecord(DocumentPart):
    """The filter that was run."""

    model: MotionName = Field(description="Integration of readings: exact arcs, or Euler's method")
    kind: FilterName | None = Field(
        default=None, description="Which filter; null in older files, whose filter is ekf or paper"
    )
    chosen_because: str | None = Field(
        default=None, description="Why this filter; null in older files"
    )
    judged_from_s: float = Field(
        default=0.0,
        description="Time from which on ANEES, NIS and coverage count: robust looks for its start "
        "until then",
    )
    substeps: int
    gate_probability: float | None
    gated: int = Field(description="Bearings rejected by the gate")
    used: int = Field(description="Bearings used")

    @property
    def words(self) -> str:
        """The filter that ran and the reason for it, marked up."""
        why = f" ({self.chosen_because})" if self.chosen_because else ""
        return plain(f"filter {self.kind or FORMER_NAMES[self.model]}{why}")


class VehicleSeries(DocumentPart):
    """Errors of one vehicle over time: RMS, mean and the filter's own sigma over the trials.

    Null where a recording has no truth to compare with.
    """

    name: str
    rms_m: list[float | None]
    rms_x_m: list[float | None]
    rms_y_m: list[float | None]
    rms_heading_rad: list[float | None]
    mean_x_m: list[float | None]
    mean_y_m: list[float | None]
    mean_heading_rad: list[float | None]
    sigma_m: list[float | None] = Field(description="The filter's own position sigma")
    sigma_x_m: list[float | None]
    sigma_y_m: list[float | None]
    sigma_heading_rad: list[float | None]


class Series(Document):
    """Errors over time."""

    time_s: list[float]
    vehicles: list[VehicleSeries]
    errors: OrAbsent[list[StateErrorSeries]] = Field(
        default=None,
        description="Of states of the filter that are no poses; absent where there are none",
    )


PLACE_DECIMALS = 3
"""Decimals of positions in m over time."""


def rounded_or_none(values: Array, decimals: int) -> list[float | None]:
    """Return values rounded, None in place of those that are not finite."""
    return [value if math.isfinite(value) else None for value in np.round(values, decimals)]


class GroundMark(DocumentPart):
    """A landmark."""

    name: str
    position_m: Point


class PathOverTime(DocumentPart):
    """True and estimated positions of a vehicle over time, null where not known."""

    name: str
    true_x_m: list[float | None]
    true_y_m: list[float | None]
    estimated_x_m: list[float | None]
    estimated_y_m: list[float | None]

    @classmethod
    def of(cls, name: str, true: Array, estimated: Array, **others: Any) -> Self:
        """Return the path of true and estimated positions (moments, 2) in m, to 1 mm."""
        places = {"true": true, "estimated": estimated}
        axes = {
            f"{kind}_{axis}_m": rounded_or_none(values[:, i], PLACE_DECIMALS)
            for kind, values in places.items()
            for i, axis in enumerate("xy")
        }
        return cls(name=name, **axes, **others)


class RunReport(VersionedDocument, Report):
    """A report of a run, which may hold `series`."""

    name: str

    @property
    def has_errors(self) -> bool:
        """Whether errors are known, as in all runs except recordings without truth."""
        return True

    @property
    def _states(self) -> Iterator[Table]:
        """The table of errors of states beside the poses, if there are any."""
        if errors := getattr(self, "errors", None):
            title = (
                "RMS error of what else the filter estimates, over the run and over its second half"
            )
            yield Table(title, errors)


class TrueWorldReport(RunReport):
    """A report of a run in a simulated world."""

    truth: OrAbsent[list[TrueKey]] = Field(
        default=None,
        description="Keys of which the simulated world differs; absent where the scenario and the "
        "request give no truth",
    )
    expected_rms_m: OrAbsent[ExpectedErrors] = Field(
        default=None,
        description="Expected RMS error of the filter in that world along the circles, by a linear "
        "recursion; absent where there is no truth, or it was not computed",
    )


def spread_of(figure: Consistency) -> Spread:
    """Return a consistency figure as a document holds it."""
    return Spread(
        value=finite_or_none(figure.value),
        band=None if math.isnan(figure.band[0]) else figure.band,
        verdict=figure.verdict,
        count=figure.count,
        basis=figure.basis,
    )


def filter_record(
    options: FilterOptions, why: str, judged_from: float, found: MonteCarloResult
) -> FilterRecord:
    """Return the record of the filter that ran, the reason and its counts; `judged_from` in s."""
    return FilterRecord(
        model=options.filter_model.motion,
        kind=options.filter,
        chosen_because=why,
        judged_from_s=judged_from,
        substeps=options.motion_substeps,
        gate_probability=options.gate_probability,
        gated=int(found.gated.sum()),
        used=int(found.accepted.sum()),
    )


def start_notes(judged_from: float) -> list[str]:
    """Return the note on the time in s from which the filter is judged; none if it is 0."""
    if not judged_from:
        return []
    return [
        f"the filter looks for its start until {judged_from:.4g} s: ANEES, NIS and coverage count "
        "from there on"
    ]


def state_errors(
    found: MonteCarloResult, states: Iterable[tuple[str, str]], bounds: Sequence[float | None]
) -> Iterator[dict[str, Any]]:
    """Yield the common figures of each further state: label, unit, errors and coverage."""
    squares = found.state_squares, found.late_state_squares
    rms, late = (np.sqrt(one.mean(axis=0)).tolist() for one in squares)
    covered = found.states_covered.mean(axis=0).tolist()
    for k, ((label, unit), bound) in enumerate(zip(states, bounds, strict=True)):
        ratio = finite_or_none(late[k] / bound) if bound else None
        shown = {"state": label, "unit": unit, "rms": rms[k], "rms_second_half": late[k]}
        yield {**shown, "ratio": ratio, "coverage": covered[k]}


def errors_of(accuracy: Accuracy, vehicle: int | tuple[()], covered: float) -> dict[str, Any]:
    """Return the fields of Errors for a vehicle; `vehicle` is () for an overall accuracy.

    Those of which nothing is known are None: of times at which a recording has no truth.
    """
    values = {
        "rms_m": float(accuracy.position[vehicle]),
        "rms_second_half_m": float(accuracy.late_position[vehicle]),
        "rms_x_m": float(accuracy.x[vehicle]),
        "rms_y_m": float(accuracy.y[vehicle]),
        "rms_heading_rad": float(accuracy.heading[vehicle]),
        "final_error_m": float(accuracy.final_position[vehicle]),
        "coverage_3sigma": covered,
    }
    return {name: finite_or_none(value) for name, value in values.items()}


def ratio_of(
    name: str, rms: float, interval: Interval | None, reference: float | None
) -> dict[str, Any]:
    """Return the ratio of an RMS error to a reference in m, and its interval, as fields `name`."""
    if not reference:
        return {name: None}
    ends = None if interval is None else (interval[0] / reference, interval[1] / reference)
    return {name: finite_or_none(rms / reference), f"{name}_interval": ends}


def series_of(result: MonteCarloResult, names: Sequence[str], sample_time: float) -> Series:
    """Return errors and sigmas over time as a document holds them; `sample_time` in s.

    Raises InputError for a run that kept no series.
    """
    kept = series(result)
    steps = np.arange(result.steps + 1)
    return Series(
        time_s=(steps * sample_time).tolist(),
        vehicles=[
            VehicleSeries(
                name=name,
                rms_m=_known(kept.position_rms[:, k]),
                rms_x_m=_known(kept.axis_rms[:, k, 0]),
                rms_y_m=_known(kept.axis_rms[:, k, 1]),
                rms_heading_rad=_known(kept.heading_rms[:, k]),
                mean_x_m=_known(kept.mean_errors[:, k, 0]),
                mean_y_m=_known(kept.mean_errors[:, k, 1]),
                mean_heading_rad=_known(kept.mean_errors[:, k, 2]),
                sigma_m=_known(kept.position_sigma[:, k]),
                sigma_x_m=_known(kept.axis_sigma[:, k, 0]),
                sigma_y_m=_known(kept.axis_sigma[:, k, 1]),
                sigma_heading_rad=_known(kept.heading_sigma[:, k]),
            )
            for k, name in enumerate(names)
        ],
    )


def _known(values: Array) -> list[float | None]:
    """Values, with None for NaN."""
    return [finite_or_none(value) for value in values.tolist()]


_MOST_DECIMALS = 9


def spread_figures(figure: Spread) -> tuple[str, str, str]:
    """Return value and ends of the interval with as many digits as their comparison needs.

    Rounding does not change their order, nor that of the ends and the tolerated range. Raises
    ValueError for a figure without an interval.
    """
    if figure.value is None or figure.band is None:
        raise ValueError("the figure has no interval")
    values = (figure.value, *figure.band)
    decimals = _decimals(max(abs(value) for value in values))
    while decimals < _MOST_DECIMALS and _compared(*values) != _compared(
        *(round(value, decimals) for value in values)
    ):
        decimals += 1
    shown = [f"{value:.{decimals}f}" for value in values]
    return shown[0], shown[1], shown[2]


def interval_words(figure: Spread) -> str:
    """Return the value with its interval and the interval's basis, without the verdict."""
    if figure.value is None:
        return "no samples"
    if figure.band is None:
        runs = "trial" if figure.count == 1 else "trials"
        return f"{figure.value:.{_decimals(figure.value)}f} over {figure.count} {runs}"
    value, low, high = spread_figures(figure)
    if figure.basis is None:
        return f"{value}, 95 % band {low} to {high}"
    if figure.basis == "trials":
        return f"{value}, 95 % interval {low} to {high} over {figure.count} trials"
    return (
        f"{value}, 95 % interval {low} to {high} of one run, "
        f"{figure.count} chi-square degrees of freedom"
    )


def verdict_words(figure: Spread) -> str:
    """Return the verdict, or the reason why there is none."""
    if figure.verdict != "unknown":
        return figure.verdict
    if figure.value is None:
        return "not judged"
    if figure.band is None:
        return f"not judged, at least {FEWEST_TRIALS} trials are needed"
    return "not judged, the interval is too wide: run more trials"


def _decimals(value: float) -> int:
    """Number of decimals for four significant digits; at least one, at most three."""
    return max(1, min(3, 3 - math.floor(math.log10(max(value, 1.0)))))


def _compared(value: float, low: float, high: float) -> tuple[bool, ...]:
    tolerated = (1.0 - TOLERANCE, 1.0 + TOLERANCE)
    ends = [end > limit for end in (low, high) for limit in tolerated]
    return (low < value, value < high, *ends)
