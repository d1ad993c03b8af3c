"""Flights as documents, with what their figures mean in words."""

from typing import Any

import numpy as np

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.flight.flight_options import AS_COMMANDED, GUIDANCES, FlightOptions
from syncplan.flight.flying import Flight
from syncplan.planning.lost_parts import phrase_of
from syncplan.planning.planner import Plan
from syncplan.reports.document_base import finite_or_none
from syncplan.reports.flight_notes import notes_of
from syncplan.reports.flight_schemas import (
    FlightConditions,
    FlightDocument,
    FlightErrors,
    FlightEvent,
    FlownLink,
    FlownSeparation,
    FlownStateError,
    FlownVehicle,
    PhaseError,
    VehicleModel,
)
from syncplan.reports.flight_series_report import flight_over_time
from syncplan.reports.run_schemas import FilterRecord
from syncplan.reports.truth_report import expected_in_truth, keys_in_truth
from syncplan.reports.validation_report import spread_of
from syncplan.reports.verdict_schemas import plan_verdict

_SHARES = np.linspace(0.0, 1.0, 41)


def flight_document(flight: Flight) -> FlightDocument:
    """Return the report of a flight."""
    run, plan, result = flight.run, flight.plan, flight.result
    found, figures = result.estimates, result.figures
    options, record = run.options, flight.record
    document = FlightDocument(
        version=__version__,
        name=plan.scenario.name,
        truth=keys_in_truth(plan),
        expected_rms_m=expected_in_truth(plan, flight.expected),
        verdict=plan_verdict(plan.verdict),
        trials=result.trials,
        seed=found.seed,
        duration_s=run.duration,
        guidance=options.guidance,
        conditions=_conditions(flight.run.options),
        vehicle_model=_model(flight),
        filter=_filter(flight),
        observable=plan.observable,
        filter_lost_share=record.lost_share,
        out_of_contact_share=record.out_of_contact_share,
        least_separation_m=_separation(flight),
        saturated_share=float(figures.saturated.mean()),
        wind_error_mps=_wind_error(flight),
        events=_events(flight),
        vehicles=[_vehicle(flight, k) for k in range(plan.team.count)],
        overall=_overall(flight),
        errors=_state_errors(flight),
        links=[
            FlownLink(between=one.between, meetings=one.meetings, kept_share=one.kept_share)
            for one in record.pairs
        ],
        anees=spread_of(flight.anees),
        nis=spread_of(flight.nis),
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


def _filter(flight: Flight) -> FilterRecord:
    options, found = flight.run.options, flight.result.estimates
    return FilterRecord(
        model=options.filter_model.motion,
        kind=options.filter,
        chosen_because=flight.run.chosen_because,
        judged_from_s=flight.judged_from,
        substeps=options.motion_substeps,
        gate_probability=options.gate_probability,
        gated=int(found.gated.sum()),
        used=int(found.accepted.sum()),
    )


def _model(flight: Flight) -> VehicleModel:
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


def _vehicle(flight: Flight, k: int) -> FlownVehicle:
    figures, names = flight.result.figures, flight.run.plan.scenario.vehicle_names
    bodies = [*names, *flight.run.plan.scenario.landmark_names]
    anchor = int(flight.run.team.setup.contact.anchors[k])
    there = bool(flight.there[k])
    decides = GUIDANCES[flight.run.options.guidance].mode == AS_COMMANDED
    pairs = flight.meetings.pairs
    own = np.flatnonzero((pairs == k).any(axis=1))
    planned = int(figures.planned_meetings[own].sum()) * flight.result.trials
    kept = float(figures.kept_meetings[:, own].sum())
    bound = float(flight.bound[k])
    return FlownVehicle(
        name=names[k],
        errors=_errors(flight, k, bound, figures.tracking_squares[:, k]) if there else None,
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
    """The least phase tolerance in s of a vehicle's links; None without any."""
    found = [item.tolerance for item in plan.links if k in (item.a, item.b)]
    return min(found) / plan.orbits.rate if found else None


def _errors(flight: Flight, k: int, bound: float, tracking: Array) -> FlightErrors:
    accuracy, predicted = flight.accuracy, flight.predicted
    return FlightErrors(
        **_figures(accuracy, k, float(flight.coverage[k])),
        predicted_rms_m=None if predicted is None else float(predicted[k]),
        bound_rms_m=bound,
        rms_over_bound=_share(float(accuracy.late_position[k]), bound),
        tracking_rms_m=float(np.sqrt(tracking.mean())),
    )


def _overall(flight: Flight) -> FlightErrors:
    """Over all vehicles that are there in the second half."""
    there, predicted = flight.there, flight.predicted
    accuracy = flight.accuracy
    bound = float(np.sqrt(np.mean(flight.bound[there] ** 2)))

    def overall(name: str) -> float:
        return float(np.sqrt(np.mean(getattr(accuracy, name)[there] ** 2)))

    late = overall("late_position")
    return FlightErrors(
        rms_m=overall("position"),
        rms_second_half_m=late,
        rms_x_m=overall("x"),
        rms_y_m=overall("y"),
        rms_heading_rad=overall("heading"),
        final_error_m=overall("final_position"),
        coverage_3sigma=float(np.mean(flight.coverage[there])),
        predicted_rms_m=None
        if predicted is None
        else float(np.sqrt(np.mean(predicted[there] ** 2))),
        bound_rms_m=bound,
        rms_over_bound=_share(late, bound),
        tracking_rms_m=float(np.sqrt(flight.result.figures.tracking_squares[:, there].mean())),
    )


def _figures(accuracy: Any, k: int, covered: float) -> dict[str, float]:
    return {
        "rms_m": float(accuracy.position[k]),
        "rms_second_half_m": float(accuracy.late_position[k]),
        "rms_x_m": float(accuracy.x[k]),
        "rms_y_m": float(accuracy.y[k]),
        "rms_heading_rad": float(accuracy.heading[k]),
        "final_error_m": float(accuracy.final_position[k]),
        "coverage_3sigma": covered,
    }


def _separation(flight: Flight) -> FlownSeparation | None:
    plan, figures = flight.run.plan, flight.result.figures
    if plan.approach is None or not np.isfinite(figures.separations).all():
        return None
    worst, names = int(np.argmin(figures.separations)), plan.scenario.vehicle_names
    a, b = figures.nearest[worst].tolist()
    asked = flight.run.limits.separation
    return FlownSeparation(
        median=float(np.median(figures.separations)),
        worst=float(figures.separations[worst]),
        between=(names[a], names[b]),
        time_s=float(figures.nearest_times[worst]),
        planned=plan.approach.distance,
        asked=asked if asked > 0.0 else None,
        quantiles=np.quantile(figures.separations, _SHARES).tolist(),
        below_asked_share=float(np.mean(figures.separations < asked)) if asked > 0.0 else None,
    )


def _events(flight: Flight) -> list[FlightEvent]:
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
        # a trial that never settles counts as one that takes for ever
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


def _wind_error(flight: Flight) -> float | None:
    columns = flight.run.team.layout.columns.get("wind")
    if columns is None:
        return None
    own = columns[0] - 3 * flight.run.plan.team.count
    squares = flight.result.estimates.late_state_squares[:, own]
    return float(np.sqrt(squares.sum(axis=1).mean()))


def _state_errors(flight: Flight) -> list[FlownStateError] | None:
    layout, found = flight.run.team.layout, flight.result.estimates
    labels = layout.labels(flight.run.plan.scenario.vehicle_names)
    if not labels:
        return None
    rms, late = (
        np.sqrt(one.mean(axis=0)) for one in (found.state_squares, found.late_state_squares)
    )
    bound = np.sqrt(flight.result.figures.state_bound_squares.mean(axis=0))
    covered = found.states_covered.mean(axis=0)
    return [
        FlownStateError(
            state=label,
            unit=unit,
            rms=float(rms[k]),
            rms_second_half=float(late[k]),
            bound_rms=float(bound[k]),
            ratio=_share(float(late[k]), float(bound[k])),
            coverage=float(covered[k]),
        )
        for k, (label, unit) in enumerate(zip(labels, layout.units, strict=True))
    ]


def _share(value: float, whole: float) -> float | None:
    return finite_or_none(value / whole) if whole > 0.0 else None
