"""Plans as documents."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.circles import heading, position
from syncplan.planning.planner import Plan
from syncplan.reports.document_base import Window, finite_or_none
from syncplan.reports.error_report import extended_rank_record, state_verdicts
from syncplan.reports.flown_plan_schemas import flown_plan
from syncplan.reports.plan_schemas import (
    CertificateVerdict,
    CloseApproach,
    DirectedContact,
    DroppedLink,
    ErrorPrediction,
    LandmarkLink,
    Link,
    ObservabilityVerdict,
    PlanDocument,
    PredictedStateError,
    Separation,
    SynchronisationRecord,
    Unobservable,
    VehicleMotion,
    VehicleOrbit,
    Witness,
)
from syncplan.reports.refinement_report import refinement_result
from syncplan.reports.start_up_schemas import start_up_record
from syncplan.reports.verdict_schemas import plan_verdict

GIVEN = "the phases were given and judged as they are"

Point = tuple[float, float]


def plan_document(plan: Plan) -> PlanDocument:
    """Return the document of a plan; angles in [0, 2 pi), infinities as null."""
    verdict = plan.verdict
    names, landmarks = plan.scenario.vehicle_names, plan.scenario.landmark_names
    return PlanDocument(
        version=__version__,
        verdict=plan_verdict(verdict),
        scenario=plan.scenario,
        period_s=plan.orbits.period,
        vehicles=_vehicles(plan, names),
        links=[_link(plan, item, names) for item in plan.links],
        landmark_links=[
            _landmark_link(plan, item, names, landmarks) for item in plan.landmark_links
        ],
        incidental_links=[_link(plan, item, names) for item in plan.incidental_links],
        dropped_links=[
            DroppedLink(a=names[item.a], b=names[item.b], reason=item.reason)
            for item in plan.dropped_links
        ],
        synchronisation=_synchronisation(plan, names),
        connectivity_period_s=plan.connectivity_period,
        separation=_separation(plan, names),
        observability=_observability(plan, names),
        witness=[
            Witness(
                vehicles=[names[k] for k in tree.vehicles],
                landmark_links=[(names[v], landmarks[k]) for v, k in tree.landmark_links],
                vehicle_links=[(names[a], names[b]) for a, b in tree.vehicle_links],
            )
            for tree in plan.certificate.witness
        ],
        predicted_rms_m=error_prediction(plan.prediction.rms, names, plan.prediction.note),
        steady_rms_m=(
            None
            if plan.prediction.steady is None
            else error_prediction(plan.prediction.steady, names)
        ),
        window_bound_m=error_prediction(plan.prediction.window, names),
        expected_rms_m=_expected(plan, names),
        predicted_errors=_predicted_states(plan),
        start_up=(
            None if plan.start_up is None else start_up_record(plan.start_up, names, landmarks)
        ),
        refinement=None if plan.refinement is None else refinement_result(plan.refinement),
        flight=None if plan.flight is None else flown_plan(plan.flight),
        notes=[one.message for one in verdict.findings],
    )


def certificate_reason(plan: Plan) -> str:
    """Return in words why the certificate holds or does not."""
    certificate = plan.certificate
    if certificate.holds:
        parts = len(certificate.witness)
        whole = "all vehicles are" if parts == 1 else f"each of {parts} components of vehicles is"
        return f"{whole} joined by rank-3 links and held by two distinct landmarks"
    names, landmarks = plan.scenario.vehicle_names, plan.scenario.landmark_names
    who = ", ".join(names[k] for k in certificate.lacking[:8])
    if len(certificate.lacking) > 8:
        who += f" and {len(certificate.lacking) - 8} more"
    if not certificate.anchors:
        return (
            f"{who}: no link of rank 2 to a landmark, and no rank-3 link to a vehicle that has one"
        )
    seen = ", ".join(landmarks[k] for k in certificate.anchors)
    return (
        f"{who}: links of rank 2 only to {seen}; two distinct landmarks are needed, and a landmark "
        "shared with other vehicles does not join them"
    )


def _vehicles(plan: Plan, names: list[str]) -> list[VehicleOrbit]:
    orbits = plan.orbits
    where, ahead = position(orbits, 0.0), heading(orbits, 0.0) % (2.0 * np.pi)
    return [
        VehicleOrbit(
            name=names[k],
            center_m=_point(orbits.centers[k]),
            radius_m=float(orbits.radii[k]),
            direction=_sense(float(orbits.senses[k])),
            speed_mps=float(orbits.speeds[k]),
            phase_rad=float(orbits.phases[k]),
            position_m=_point(where[k]),
            heading_rad=float(ahead[k]),
        )
        for k in range(orbits.count)
    ]


def _link(plan: Plan, item: LinkVerdict, names: list[str]) -> Link:
    a, b = names[item.a], names[item.b]
    same = plan.orbits.senses[item.a] == plan.orbits.senses[item.b]
    ways = ((a, b, item.forward), (b, a, item.backward))
    return Link(
        a=a,
        b=b,
        rule="same" if same else "opposite",
        phase_residual_rad=item.residual,
        min_distance_m=item.min_distance,
        contact_s=item.contact,
        contact_share=_contact_share(plan, item),
        windows_s=_windows(item.windows),
        directed=[
            DirectedContact(
                **{"from": one},
                to=other,
                windows_s=_windows(windows),
                contact_s=float(np.sum(windows[:, 1] - windows[:, 0])),
            )
            for one, other, windows in ways
        ],
        phase_tolerance_rad=item.tolerance,
        phase_tolerance_s=item.tolerance / plan.orbits.rate,
        rank=item.rank,
        certified=item.certified,
        reason=item.reason,
    )


def _contact_share(plan: Plan, item: LinkVerdict) -> float | None:
    found = plan.synchronisation
    attainable = found.attainable if found is not None else None
    most = 0.0 if attainable is None else attainable.get((item.a, item.b), 0.0)
    return min(item.contact / (most * plan.orbits.period), 1.0) if most > 0.0 else None


def _landmark_link(
    plan: Plan, item: LinkVerdict, names: list[str], landmarks: list[str]
) -> LandmarkLink:
    return LandmarkLink(
        vehicle=names[item.a],
        landmark=landmarks[item.b - plan.orbits.count],
        min_distance_m=item.min_distance,
        windows_s=_windows(item.windows),
        contact_s=item.contact,
        rank=item.rank,
        certified=item.certified,
        reason=item.reason,
    )


def _synchronisation(plan: Plan, names: list[str]) -> SynchronisationRecord:
    found = plan.synchronisation
    if found is None:
        refined = plan.refinement is not None
        return SynchronisationRecord(
            method="refined" if refined else "given",
            smallest_margin_m=None,
            bound_m=None,
            bound_note="the phases were refined" if refined else GIVEN,
            odd_cycle=[],
            alternating_proven_largest=None,
        )
    return SynchronisationRecord(
        method=found.method,
        smallest_margin_m=found.margin,
        bound_m=found.bound,
        bound_note=found.bound_note,
        odd_cycle=[names[k] for k in found.odd_cycle],
        alternating_proven_largest=plan.alternating_proven,
    )


def _separation(plan: Plan, names: list[str]) -> Separation:
    """Without a separation that is asked for, the verdict alone says who comes too near."""
    nearest, required = plan.approach, plan.scenario.separation
    return Separation(
        min_m=nearest.distance if nearest else None,
        between=(names[nearest.a], names[nearest.b]) if nearest else None,
        time_s=nearest.time if nearest else None,
        required_m=required,
        violations=[
            CloseApproach(
                min_m=item.distance, between=(names[item.a], names[item.b]), time_s=item.time
            )
            for item in (plan.too_close if required else ())
        ],
    )


def _observability(plan: Plan, names: list[str]) -> ObservabilityVerdict:
    verdict = plan.observability
    return ObservabilityVerdict(
        rank=verdict.rank,
        state_dim=verdict.state_dim,
        observable=verdict.observable,
        window_s=plan.scenario.window,
        rank_gap=finite_or_none(verdict.gap),
        certificate=CertificateVerdict(
            holds=plan.certificate.holds, reason=certificate_reason(plan)
        ),
        condition_number=finite_or_none(verdict.condition_number),
        min_eigenvalue=verdict.min_eigenvalue,
        singular_values=[float(value) for value in verdict.singular_values],
        unobservable=unobservable_motions(plan.unobservable, names),
        extended=extended_rank_record(plan.error_verdict, names),
        states=state_verdicts(plan.error_verdict, names),
    )


def unobservable_motions(
    modes: Sequence[UnobservableMode], names: Sequence[str]
) -> list[Unobservable]:
    """Return unobservable modes of the vehicles named as documents hold them."""
    return [
        Unobservable(
            description=item.description,
            vehicles=[names[k] for k in item.vehicles],
            motion=[
                VehicleMotion(
                    vehicle=names[k],
                    shift_m=_point(item.motion[k]),
                    turn_rad=float(item.motion[k, 2]),
                )
                for k in item.vehicles
            ],
            cure=item.cure,
        )
        for item in modes
    ]


def error_prediction(values: Array | None, names: Sequence[str], note: str = "") -> ErrorPrediction:
    """Return predicted errors (n,) m of the vehicles named as documents hold them."""
    if values is None:
        return ErrorPrediction(overall=None, vehicles=dict.fromkeys(names), note=note)
    return ErrorPrediction(
        overall=finite_or_none(float(np.sqrt(np.mean(values**2)))),
        vehicles={
            name: finite_or_none(float(value)) for name, value in zip(names, values, strict=True)
        },
        note=note,
    )


def _expected(plan: Plan, names: list[str]) -> ErrorPrediction | None:
    neglect = plan.prediction.neglect
    if neglect is None or neglect.expected is None:
        return None
    return error_prediction(neglect.expected, names)


def _predicted_states(plan: Plan) -> list[PredictedStateError] | None:
    found = [
        PredictedStateError(state=one.label, unit=one.unit, sigma=one.sigma, predicted_rms=one.rms)
        for one in plan.prediction.states
    ]
    return found or None


def _windows(windows: Array) -> list[Window]:
    return [(float(start), float(end)) for start, end in windows]


def _point(values: Sequence[float] | Array) -> Point:
    return float(values[0]), float(values[1])


def _sense(value: float) -> Literal["ccw", "cw"]:
    return "ccw" if value > 0.0 else "cw"
