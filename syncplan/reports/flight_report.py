"""Flights as documents, with notes on the meaning of their figures."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.documents import DocumentPart, OrAbsent, finite_or_none
from syncplan.estimation.considered_errors import neglected_errors
from syncplan.guidance.flight_options import AS_COMMANDED, GUIDANCES, FlightOptions
from syncplan.orbits.lost_parts import phrase_of
from syncplan.phrases import in_words, listed, percent
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.plan_records import Interval, MeetingsFlown
from syncplan.planning.plans import Plan
from syncplan.planning.share_test import share_of
from syncplan.reports import run_figures
from syncplan.reports.flight_series import FlightOverTime, flight_over_time
from syncplan.results.quantities import each, plain, quantity
from syncplan.results.stories import Row, Story, Table, flat
from syncplan.scenario.disturbances import ReadingsKind

if TYPE_CHECKING:
    from syncplan.planning.plan_flights import Flight


class PhaseError(DocumentPart):
    """Time by which a vehicle is ahead of the plan, or behind it, over the second half."""

    rms: float = quantity("phase rms", unit="s")
    worst: float = quantity("worst", "In any trial", "s", drop=2)


class FlightErrors(run_figures.Errors):
    """Errors of the estimates against the truth as flown, over all trials."""

    predicted_rms_m: float | None = Field(
        description="The plan's bound, of circles flown exactly; null for another duration"
    )
    rms_over_predicted: float | None = Field(
        default=None,
        description="Second-half RMS over predicted_rms_m; null in older files, as intervals",
    )
    rms_over_predicted_interval: Interval | None = Field(default=None, description="95 %")
    bound_rms_m: float = quantity(
        "bound",
        "The bound along the paths truly flown, by the sightings truly made, RMS over the second "
        "half",
        "m",
        drop=3,
    )
    rms_over_bound: float | None = quantity("ratio", "Second-half RMS over bound_rms_m", form=".2f")
    rms_over_bound_interval: Interval | None = Field(
        default=None, description="95 %, with the bound taken for exact"
    )
    tracking_rms_m: float = quantity(
        "off plan", "True distance from the plan's place, second half", "m"
    )


class FlownVehicle(DocumentPart):
    """Figures of one vehicle in flight."""

    name: str = quantity(
        "vehicle",
        words=each(lambda flown: plain(flown.name) + ("" if flown.errors else " (lost)")),
        order=-2,
    )
    errors: FlightErrors | None = Field(description="Null for a vehicle that is lost on the way")
    phase_error_s: PhaseError | None
    phase_tolerance_s: float | None = Field(
        description="The least of its links' in the plan: how late it may be until one never comes "
        "into contact; null where it has none"
    )
    meetings_kept: float | None = quantity(
        "meetings kept",
        "Share of its meetings in the plan in which a sighting was made; null where it has none",
        form="%",
        drop=4,
    )
    longest_without_sighting_s: float = quantity(
        "unseen", "In any trial, from time 0 on", "s", form=".4g", drop=1
    )
    saturated_share: float = Field(description="Share of samples with a command at a limit")
    refused_share: float | None = Field(
        description="Share of decisions of guidance mpc whose program was not solved: the vehicle "
        "then flies the best of its guesses; null for other guidances"
    )
    anchor: str | None = Field(
        description="Vehicle or landmark that it stays in contact with; null for none"
    )
    sought_share: float = Field(
        description="Share of samples at which its circle was moved to be sure of its anchor"
    )


class FlownSeparation(DocumentPart):
    """Least separation of any two vehicles, over trials."""

    median: float
    worst: float
    between: tuple[str, str] = Field(description="Which two, in the worst trial")
    time_s: float = Field(description="When, in the worst trial")
    planned: float = Field(description="The plan's own")
    asked: float | None = Field(description="min_separation_m; null where none is asked for")
    quantiles: list[float] = Field(
        description="Of the closest in each trial, at 41 shares of the trials from 0 to 1"
    )
    below_asked_share: float | None = Field(
        description="Share of trials below min_separation_m; null where none is asked for"
    )
    below_asked_interval: Interval | None = Field(
        default=None, description="95 % interval of the share (Clopper and Pearson)"
    )

    @property
    def line(self) -> str:
        """How near vehicles came, and how near they come in the plan."""
        below = ""
        if self.below_asked_share is not None:
            share = percent(self.below_asked_share, self.below_asked_interval)
            below = f"; nearer than asked in {share} of the trials"
        return (
            f"least separation: {self.median:.3g} m in the median trial, {self.worst:.3g} m in the "
            f"worst ({plain('-'.join(self.between))} at {self.time_s:.4g} s); the plan has "
            f"{self.planned:.3g} m{below}"
        )


class FlightEvent(DocumentPart):
    """A loss or a hold, the same in every trial."""

    event: str = Field(description="As it was asked for", examples=["v3@60", "v2@100:20"])
    kind: Literal["loss", "hold"]
    subject: str = Field(
        description="Vehicle, sensor or landmark that is lost or held",
        examples=["v3", "sensor of v3"],
    )
    begin_s: float
    end_s: float | None = Field(description="Null for what is lost")
    what: str = Field(examples=["v3 is lost at 60 s"])
    settled_s: float | None = Field(
        default=None,
        description="Of a hold: median time from its end until the vehicle keeps its phase within "
        "1 s for a period; null where half of the trials never do, where less than a period is "
        "left to say, and for losses",
    )

    @property
    def line(self) -> str:
        """What happens, and when a held vehicle is in phase again in the median trial."""
        settled = ""
        if self.kind == "hold" and self.settled_s is None:
            settled = "; not seen in phase for a period after it"
        elif self.settled_s is not None:
            settled = f"; in phase again {self.settled_s:.3g} s after"
        return f"{plain(self.what)}{settled}"


class FlightConditions(DocumentPart):
    """Faults of sightings and true wind in every trial, as requested."""

    dropout: float = Field(description="Share of sightings that are lost on their way")
    outliers: float = Field(description="Share of bearings that are false, anywhere in view")
    mistaken: float = Field(
        description="Share of sightings whose true target is a vehicle in sight other than the "
        "assumed one"
    )
    late: int = Field(description="Samples after which sightings arrive")
    wind_mps: tuple[float, float] | None = Field(
        description="True wind x, y of all trials; null where each draws its own by wind.sigma_mps"
    )


class FlownStateError(DocumentPart):
    """Errors of a filter state other than a pose, over all trials."""

    state: str = quantity("state", "Name", examples=["wind x", "speed scale of v1"])
    unit: str = quantity("unit", "Of the errors", examples=["m/s"])
    rms: float = quantity("total", "Over the samples after time 0", drop=2)
    rms_second_half: float = quantity("2nd half")
    bound_rms: float = quantity(
        "bound",
        "The bound along the paths truly flown, by the sightings truly made, RMS over the second "
        "half",
    )
    ratio: float | None = quantity("ratio", "Second-half RMS over bound_rms", form=".2f", drop=3)
    coverage: float = quantity(
        "3 sigma", "Share of samples within 3 sigma; ideal 0.9973", form=".1%", drop=1
    )


LimitsFrom = Literal["scenario", "default"]


class VehicleModel(DocumentPart):
    """Model of the vehicles: limits, lag and readings."""

    speed_mps: tuple[float, float] = Field(description="Least and largest airspeed of any vehicle")
    turn_rate_rad_s: float = Field(description="Largest turn rate")
    speed_from: LimitsFrom = Field(description="default: up to twice the plan's speed")
    turn_rate_from: LimitsFrom = Field(description="default: up to 4 times the plan's turn rate")
    lag_s: float
    readings: ReadingsKind


MOST_MISSED = 6
"""Most pairs named."""

_OF_ESTIMATES = [
    f"errors.{name}"
    for name in ("rms_m", "rms_x_m", "rms_y_m", "coverage_3sigma", "rms_second_half_interval_m")
]
"""Figures that the table of a flight leaves out."""


class FlightDocument(run_figures.TrueWorldReport):
    """Many flights of a plan, in closed loop."""

    drawn_as: ClassVar[str] = "flight"

    verdict: PlanVerdict = Field(description="Of the plan that was flown")
    trials: int
    seed: int
    duration_s: float
    guidance: str
    conditions: FlightConditions
    vehicle_model: VehicleModel
    filter: run_figures.FilterRecord
    observable: bool
    filter_lost_share: float = Field(
        description="Share of trials in which some vehicle's error in the second half is over 5 "
        "times the bound along the path it truly took"
    )
    filter_lost_interval: Interval | None = Field(
        default=None,
        description="95 % interval of the share (Clopper and Pearson); null in older files",
    )
    out_of_contact_share: float = Field(
        description="Share of trials in which some vehicle made no sighting, and was in none, for "
        "more than two periods"
    )
    out_of_contact_interval: Interval | None = Field(default=None, description="Likewise")
    least_separation_m: FlownSeparation | None = Field(description="Null for a single vehicle")
    saturated_share: float
    wind_error_mps: float | None = Field(
        description="RMS error of the estimated wind, second half; null where it is no state"
    )
    events: list[FlightEvent]
    vehicles: list[FlownVehicle]
    overall: FlightErrors
    errors: OrAbsent[list[FlownStateError]] = Field(
        default=None,
        description="Of states of the filter that are no poses; absent where there are none",
    )
    links: list[MeetingsFlown]
    anees: run_figures.Spread
    nis: run_figures.Spread
    series: OrAbsent[FlightOverTime] = Field(
        default=None, description="Over time; absent unless asked for"
    )
    notes: list[str]

    @property
    def run(self) -> str:
        """Number and length of the flights, and seed, in words."""
        return f"{self.trials} flights of {self.duration_s:g} s, seed {self.seed}"

    def body(self) -> Story:
        """Yield errors and phases by vehicle, and events."""
        overall, record = self.overall, self.filter
        yield (
            f"[bold]{plain(self.name) or 'flight'}[/]: {self.run}, guidance {self.guidance}, "
            f"filter {record.kind}"
        )
        title = "second half: error of estimates and distance from the plan in m, phase"
        yield Table(title, self.vehicles, without=_OF_ESTIMATES, stated="m")
        yield from overall.overall_line(overall.rms_over_bound, overall.rms_over_bound_interval)
        yield from self._states
        yield (
            f"filter lost in {percent(self.filter_lost_share, self.filter_lost_interval)} of the "
            "trials, out of contact in "
            f"{percent(self.out_of_contact_share, self.out_of_contact_interval)}; commands at a "
            f"limit {percent(self.saturated_share)} of the time"
        )
        if self.least_separation_m is not None:
            yield self.least_separation_m.line
        if self.wind_error_mps is not None:
            yield f"wind known to {self.wind_error_mps:.3g} m/s"
        yield from (event.line for event in self.events)
        yield from self._missed
        if record.gate_probability is not None:
            yield (
                f"gate at {record.gate_probability:g}: {record.gated} of "
                f"{record.used + record.gated} sightings rejected"
            )
        anees = self.anees.words(trusted=self.verdict.go)
        yield f"ANEES {anees}; NIS {self.nis.words(trusted=self.verdict.go)}"

    @property
    def _missed(self) -> Iterator[str]:
        """The pairs that missed some of their meetings, the worst first."""
        missed = [link for link in self.links if link.kept_share < 1.0]
        if missed:
            missed.sort(key=lambda link: link.kept_share)
            texts = [f"{'-'.join(link.between)} {percent(link.kept_share)}" for link in missed]
            rest = "; of all others all" if len(missed) < len(self.links) else ""
            yield f"meetings kept: {plain(listed(texts, MOST_MISSED))}{rest}"

    def frame_rows(self) -> Iterator[Row]:
        """Yield the vehicles as rows of a data frame."""
        for vehicle in self.vehicles:
            row = flat(vehicle.model_dump(exclude={"errors", "phase_error_s"}))
            phase = {} if vehicle.phase_error_s is None else vehicle.phase_error_s.model_dump()
            row |= {f"phase_{key}_s": value for key, value in phase.items()}
            yield row | ({} if vehicle.errors is None else flat(vehicle.errors.model_dump()))


_SHARES = np.linspace(0.0, 1.0, 41)


def flight_document(flight: "Flight") -> FlightDocument:
    """Return the report of a flight."""
    run, plan, result = flight.run, flight.plan, flight.result
    found, figures = result.estimates, result.figures
    options, record = run.options, flight.record
    document = FlightDocument(
        version=__version__,
        name=plan.scenario.name,
        truth=run_figures.keys_in_truth(plan),
        expected_rms_m=run_figures.expected_in_truth(plan, flight.expected),
        verdict=plan.verdict,
        trials=result.trials,
        seed=found.seed,
        duration_s=run.duration,
        guidance=options.guidance,
        conditions=_conditions(flight.run.options),
        vehicle_model=_model(flight),
        filter=run_figures.filter_record(options, run.chosen_because, flight.judged_from, found),
        observable=plan.observable,
        filter_lost_share=record.filter_lost_share,
        filter_lost_interval=record.filter_lost_interval,
        out_of_contact_share=record.out_of_contact_share,
        out_of_contact_interval=record.out_of_contact_interval,
        least_separation_m=_separation(flight),
        saturated_share=float(figures.saturated.mean()),
        wind_error_mps=_wind_error(flight),
        events=_events(flight),
        vehicles=[_vehicle(flight, k) for k in range(plan.team.count)],
        overall=_overall(flight),
        errors=_state_errors(flight),
        links=record.meetings_kept,
        anees=run_figures.spread_of(flight.anees),
        nis=run_figures.spread_of(flight.nis),
        series=flight_over_time(flight),
        notes=[],
    )
    return document.model_copy(update={"notes": notes_of(flight, document)})


def _conditions(options: FlightOptions) -> FlightConditions:
    return FlightConditions(
        dropout=options.dropout,
        outliers=options.outliers,
        mistaken=options.mistaken,
        late=options.late,
        wind_mps=options.wind,
    )


def _model(flight: "Flight") -> VehicleModel:
    limits, motion = flight.run.limits, flight.run.plan.scenario.motion
    given = flight.run.plan.scenario.limits
    speed, turn = (None, None) if given is None else (given.speed_mps, given.turn_rate_rad_s)
    return VehicleModel(
        speed_mps=(float(limits.least_speeds.min()), float(limits.most_speeds.max())),
        turn_rate_rad_s=float(limits.most_turn_rates.max()),
        speed_from="default" if speed is None else "scenario",
        turn_rate_from="default" if turn is None else "scenario",
        lag_s=motion.lag_s or 0.0,
        readings=motion.readings or "commanded",
    )


def _vehicle(flight: "Flight", k: int) -> FlownVehicle:
    figures, names = flight.result.figures, flight.run.plan.scenario.vehicle_names
    bodies = [*names, *flight.run.plan.scenario.landmark_names]
    anchor = int(flight.run.team.setup.contact.anchors.bodies[k])
    there = bool(flight.there[k])
    decides = GUIDANCES[flight.run.options.guidance].mode == AS_COMMANDED
    pairs = flight.meetings.pairs
    own = np.flatnonzero((pairs == k).any(axis=1))
    planned = int(figures.planned_meetings[own].sum()) * flight.result.trials
    kept = float(figures.kept_meetings[:, own].sum())
    return FlownVehicle(
        name=names[k],
        errors=_errors(flight, k) if there else None,
        phase_error_s=PhaseError(
            rms=float(np.sqrt(figures.phase_squares[:, k].mean())),
            worst=float(figures.worst_phases[:, k].max()),
        )
        if there
        else None,
        phase_tolerance_s=_tolerance(flight.run.plan, k),
        meetings_kept=kept / planned if planned else None,
        longest_without_sighting_s=float(figures.longest_unseen[:, k].max()),
        saturated_share=float(figures.saturated[:, k].mean()),
        refused_share=float(figures.refused[:, k].mean()) if decides else None,
        anchor=bodies[anchor] if anchor >= 0 else None,
        sought_share=float(figures.sought[:, k].mean()),
    )


def _tolerance(plan: Plan, k: int) -> float | None:
    """Smallest phase tolerance in s of a vehicle's links; None without links."""
    found = [item.tolerance for item in plan.links if k in (item.a, item.b)]
    return min(found) / plan.orbits.rate if found else None


def _errors(flight: "Flight", k: int) -> FlightErrors:
    predicted, tracking = flight.predicted, flight.result.figures.tracking_squares[:, k]
    return _compared(
        run_figures.errors_of(flight.accuracy, k, float(flight.coverage[k])),
        flight.trial_errors.intervals()[k],
        None if predicted is None else float(predicted[k]),
        float(flight.bound[k]),
        tracking,
    )


def _overall(flight: "Flight") -> FlightErrors:
    """Errors over all vehicles that are present in the second half."""
    there, predicted = flight.there, flight.predicted
    covered = float(np.mean(flight.coverage[there]))
    return _compared(
        run_figures.errors_of(flight.accuracy.overall(there), (), covered),
        flight.trial_errors.overall_interval(there),
        None if predicted is None else float(np.sqrt(np.mean(predicted[there] ** 2))),
        float(np.sqrt(np.mean(flight.bound[there] ** 2))),
        flight.result.figures.tracking_squares[:, there],
    )


def _compared(
    errors: dict[str, Any],
    interval: Interval | None,
    predicted: float | None,
    bound: float,
    tracking: Array,
) -> FlightErrors:
    """Errors beside prediction and bound in m; `tracking` are squared distances from the plan."""
    rms = errors["rms_second_half_m"]
    return FlightErrors(
        **errors,
        rms_second_half_interval_m=interval,
        predicted_rms_m=predicted,
        **run_figures.ratio_of("rms_over_predicted", rms, interval, predicted),
        bound_rms_m=bound,
        **run_figures.ratio_of("rms_over_bound", rms, interval, bound),
        tracking_rms_m=float(np.sqrt(tracking.mean())),
    )


def _separation(flight: "Flight") -> FlownSeparation | None:
    plan, figures = flight.run.plan, flight.result.figures
    if plan.approach is None or not np.isfinite(figures.separations).all():
        return None
    worst, names = int(np.argmin(figures.separations)), plan.scenario.vehicle_names
    a, b = figures.nearest[worst].tolist()
    asked = flight.run.limits.separation
    close, interval = share_of(flight.too_close) if asked > 0.0 else (None, None)
    return FlownSeparation(
        median=float(np.median(figures.separations)),
        worst=float(figures.separations[worst]),
        between=(names[a], names[b]),
        time_s=float(figures.nearest_times[worst]),
        planned=plan.approach.distance,
        asked=asked if asked > 0.0 else None,
        quantiles=np.quantile(figures.separations, _SHARES).tolist(),
        below_asked_share=close,
        below_asked_interval=interval,
    )


def _events(flight: "Flight") -> list[FlightEvent]:
    events, settled = flight.run.events, flight.result.figures.settled
    found = [
        FlightEvent(
            event=f"{one.name}@{one.time:g}",
            kind="loss",
            subject=phrase_of(one.name).removeprefix("the "),
            begin_s=one.time,
            end_s=None,
            what=one.sentence,
        )
        for one in events.losses
    ]
    for k, hold in enumerate(events.holds):
        # a trial that never settles counts as infinite
        median = float(np.median(np.nan_to_num(settled[:, k], nan=np.inf)))
        event = FlightEvent(
            event=f"{hold.name}@{hold.time:g}:{hold.length:g}",
            kind="hold",
            subject=hold.name,
            begin_s=hold.time,
            end_s=hold.time + hold.length,
            what=hold.sentence,
            settled_s=finite_or_none(median),
        )
        found.append(event)
    return sorted(found, key=lambda one: one.begin_s)


def _wind_error(flight: "Flight") -> float | None:
    columns = flight.run.team.layout.columns.get("wind")
    if columns is None:
        return None
    own = columns[0] - 3 * flight.run.plan.team.count
    squares = flight.result.estimates.late_state_squares[:, own]
    return float(np.sqrt(squares.sum(axis=1).mean()))


def _state_errors(flight: "Flight") -> list[FlownStateError] | None:
    layout, found = flight.run.team.layout, flight.result.estimates
    labels = layout.labels(flight.run.plan.scenario.vehicle_names)
    if not labels:
        return None
    bounds = np.sqrt(flight.result.figures.state_bound_squares.mean(axis=0)).tolist()
    states = zip(labels, layout.units, strict=True)
    return [
        FlownStateError(**one, bound_rms=bound)
        for one, bound in zip(run_figures.state_errors(found, states, bounds), bounds, strict=True)
    ]


def notes_of(flight: "Flight", report: FlightDocument) -> list[str]:
    """Return notes for the reader of a flight's report."""
    return [
        f"guidance {report.guidance}: {GUIDANCES[report.guidance].sentence} Vehicles start where "
        "initial_sigma puts them, about the plan, and their estimates at the plan",
        *_of_truth(report),
        *_of_conditions(flight),
        *_of_holds(flight),
        *_of_vehicles(report),
        *_of_places(flight),
        *_of_filter(flight, report),
        *_of_guidance(report),
    ]


def _of_truth(report: FlightDocument) -> Iterator[str]:
    """Note on how the simulated world differs from the scenario."""
    own = report.overall
    note = run_figures.truth_note(
        report.truth, report.expected_rms_m, own.rms_second_half_m, own.predicted_rms_m
    )
    if note is not None:
        yield note


def _of_conditions(flight: "Flight") -> Iterator[str]:
    """Notes on faults of sightings, and on losses."""
    conditions = flight.run.options.conditions
    if conditions:
        yield f"in every trial {listed(conditions, len(conditions))}"
    if flight.run.options.late:
        yield (
            "where sightings are late, errors of estimates are of the time when sightings were "
            "made, and vehicles steer by estimates carried on from there"
        )
    if flight.run.events.losses:
        yield (
            "a vehicle that is lost takes no further part: nobody sees it, it sees nobody, and "
            "separations leave it out"
        )


def _of_holds(flight: "Flight") -> Iterator[str]:
    """Notes on held vehicles, and on those whose return to phase can't be judged."""
    team, holds = flight.run.team, flight.run.events.holds
    if holds:
        circling = any(team.limits.least_speeds[one.vehicle] > 0.0 for one in holds)
        does = "circles at its least speed and largest turn rate" if circling else "stands still"
        yield f"a vehicle that is held {does} in the air, and drifts with the wind"
    for one in holds:
        if not team.shows_phase_after(one):
            yield (
                f"{one.sentence}: less than a period, {team.team.orbits.period:.3g} s, is left, "
                "too little to say when it has its phase again"
            )


def _of_vehicles(report: FlightDocument) -> Iterator[str]:
    """Notes on assumed limits of vehicles."""
    model = report.vehicle_model
    if model.speed_from == "default":
        low, high = model.speed_mps
        yield (
            f"no limits.speed_mps: airspeeds from {low:g} to {high:.4g} m/s were supposed; give "
            "what the vehicles can do"
        )
    if model.turn_rate_from == "default":
        yield (
            f"no limits.turn_rate_rad_s: turn rates up to {model.turn_rate_rad_s:.4g} rad/s were "
            "supposed; give what the vehicles can do"
        )


def _of_places(flight: "Flight") -> Iterator[str]:
    """Notes on keys of the scenario that no flight takes into account."""
    scenario = flight.plan.scenario
    given = [key for key in ("area_m", "keep_out_m") if getattr(scenario, key)]
    if given:
        yield (
            f"flights do not check {' and '.join(given)}: a vehicle off the plan may cross the "
            "edge; compare the distance from the plan with the room that there is"
        )


def _of_filter(flight: "Flight", report: FlightDocument) -> Iterator[str]:
    """Notes on the time from which the filter is judged, and on errors that it leaves out."""
    yield from run_figures.start_notes(flight.judged_from)
    neglected = neglected_errors(flight.plan.team)
    if neglected:
        yield (
            f"the filter does not estimate {in_words(neglected)}: vehicles do not know that they "
            "are off, and the bound does not either; filter.estimate makes them states"
        )
    wind = report.conditions.wind_mps or (0.0, 0.0)
    if any(wind) and report.wind_error_mps is None and "wind" not in neglected:
        yield (
            "the wind is no state of the filter: vehicles do not know that they are off, and the "
            "bound does not either; wind.sigma_mps makes it one"
        )


def _of_guidance(report: FlightDocument) -> Iterator[str]:
    """Notes on circles that guidance moved, and on programs that it did not solve."""
    sought = max(one.sought_share for one in report.vehicles)
    if sought > 0.0:
        yield (
            "where a vehicle was not sure to meet its anchor, its circle was moved towards it, "
            f"for up to {percent(sought)} of the time"
        )
    refused = max(report.vehicles, key=lambda one: one.refused_share or 0.0)
    if refused.refused_share:
        yield (
            f"the program of {report.guidance} was not solved in up to "
            f"{percent(refused.refused_share)} of a vehicle's decisions ({refused.name}): it "
            "then flies the best of its guesses"
        )
