"""Finding that errors are above their predictions, in flights and in the trials of a validation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from syncplan.arrays import Array
from syncplan.estimation.consistency import TOLERANCE
from syncplan.phrases import in_words, listed
from syncplan.planning.flight_checks import LOOKS_FOR_ITS_START, cure_of, flights_in_words
from syncplan.planning.judged_team import MOST_NAMED, FindingCure, JudgedTeam, Remark
from syncplan.planning.plan_records import Interval
from syncplan.scenario.truths import changed_keys

ERROR_ABOVE_PREDICTION = "error-above-prediction"
"""Code of the finding."""

WORTH_A_WARNING, WORTH_A_STOP = 1.25, 2.0
"""Ratios of an RMS error to its prediction, and values of ANEES, from which they are findings."""

SIGNIFICANT = 1.0 + TOLERANCE
"""Multiple of the prediction above which the whole 95 % interval of a finding lies."""


@dataclass(frozen=True, slots=True)
class ComparedError:
    """RMS error of a vehicle in m, or ANEES, beside its prediction.

    Attributes
    ----------
    value : over all flights or trials
    interval : its 95 % interval
    predicted : 1 for ANEES
    vehicle : name; empty for ANEES
    """

    value: float
    interval: Interval
    predicted: float
    vehicle: str = ""

    @property
    def excess(self) -> float:
        """Ratio to the prediction where the whole interval is well above it; 0 elsewhere."""
        well_above = self.interval[0] > SIGNIFICANT * self.predicted
        return self.value / self.predicted if well_above else 0.0

    @property
    def text(self) -> str:
        """Error, interval and prediction in words."""
        low, high = self.interval
        if not self.vehicle:
            return f"ANEES {self.value:.3g} ({low:.3g} to {high:.3g}), 1 for a consistent filter"
        return (
            f"{self.vehicle} {self.value:.3g} m ({low:.3g} to {high:.3g}), {self.predicted:.3g} m "
            "predicted"
        )


def compared_errors(
    rms: Sequence[tuple[str, float | None, Interval | None]],
    anees: tuple[float | None, Interval | None],
    names: Sequence[str],
    predicted: Array | None,
) -> list[ComparedError]:
    """Return errors that have an interval and a prediction.

    `rms` holds name, RMS error in m and its interval for each vehicle, `anees` value and interval,
    and `predicted` (n,) the RMS errors in m of the vehicles `names`.
    """
    expected = {} if predicted is None else dict(zip(names, predicted.tolist(), strict=True))
    figures = [("", *anees, 1.0), *((*figure, expected.get(figure[0])) for figure in rms)]
    return [
        ComparedError(value, interval, prediction, vehicle)
        for vehicle, value, interval, prediction in figures
        if value is not None and interval is not None and prediction
    ]


def errors_above(errors: Sequence[ComparedError]) -> list[ComparedError]:
    """Return the errors that are well above their predictions, the largest ratio first."""
    above = [error for error in errors if error.excess >= WORTH_A_WARNING]
    return sorted(above, key=lambda error: -error.excess)


def flown_errors(judged: JudgedTeam) -> list[ComparedError]:
    """Return the errors of a plan's flights beside their predictions.

    Predictions hold for the scenario's duration, without losses, holds and faults of sightings.
    """
    flight = judged.flight
    if flight is None or flight.events or flight.duration_s != judged.scenario.duration_s:
        return []
    return compared_errors(
        [(vehicle.name, vehicle.rms_m, vehicle.rms_interval_m) for vehicle in flight.vehicles],
        (flight.anees, flight.anees_interval),
        judged.scenario.vehicle_names,
        judged.prediction.rms,
    )


def error_above_prediction(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that errors in flight are well above their predictions."""
    flight = judged.flight
    if flight is not None:
        yield from _remarks(judged, flown_errors(judged), flights_in_words(flight), flight.filter)


def error_in_trials(
    judged: JudgedTeam,
    errors: Sequence[ComparedError],
    trials: str,
    filter_name: str,
    *,
    flown_well: bool,
) -> Iterator[Remark]:
    """Yield the finding that errors in the trials of a validation are above their predictions.

    `trials` states their number and length in words. For a plan that was flown well, the finding is
    a warning: flights show what the filter reaches.
    """
    for remark in _remarks(judged, errors, trials, filter_name):
        flight = judged.flight
        if flight is None or not flown_well:
            yield remark
        else:
            yield replace(
                remark,
                level="warning",
                message=f"{remark.message}. The plan flew well in {flights_in_words(flight)} "
                f"(filter {flight.filter}): vehicles held to exact circles are the harder case, as "
                "the filter linearises about an estimate that wanders while they stay on their "
                "circles, which makes up information along weak directions; in flight, guidance "
                "keeps estimates on the plan",
            )


def _remarks(
    judged: JudgedTeam, errors: Sequence[ComparedError], runs: str, filter_name: str
) -> Iterator[Remark]:
    above = errors_above(errors)
    if not above:
        return
    neglect, scenario = judged.prediction.neglect, judged.scenario
    cure: FindingCure | str
    if neglect is not None:
        cure = FindingCure(
            text=f"estimate {in_words(neglect.names)} as states", change={"filter.estimate": "auto"}
        )
    else:
        cure = cure_of(
            ("filter.kind robust", filter_name != LOOKS_FOR_ITS_START),
            ("a better known start", True),
            ("meetings that turn the lines of sight further", True),
            ("flights, in which guidance keeps estimates on the plan", judged.flight is None),
        )
    differs = scenario.truth is not None and any(
        changed_keys(scenario, scenario.in_truth, scenario.truth)
    )
    world = ", in a world that differs from the scenario" if differs else ""
    yield Remark(
        "stop" if above[0].excess >= WORTH_A_STOP else "warning",
        f"errors in {runs} (filter {filter_name}){world} are above their predictions (95 % "
        f"intervals): {listed([error.text for error in above], MOST_NAMED)}",
        tuple(error.vehicle for error in above if error.vehicle),
        cure=cure,
    )
