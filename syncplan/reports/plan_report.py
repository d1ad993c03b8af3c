"""Plans as documents."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from syncplan import __version__
from syncplan.documents import (
    Document,
    DocumentPart,
    OrAbsent,
    Point,
    VersionedDocument,
    Window,
    point_of,
    windows_of,
)
from syncplan.estimation.start_up_index import StartUpIndex
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.circles import extent, heading, position
from syncplan.phrases import Places, listed, metres, percent
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.observability_records import (
    ErrorPrediction,
    ObservabilityVerdict,
    error_prediction,
    observability_of,
)
from syncplan.planning.plan_records import FlownPlan
from syncplan.planning.plans import Plan
from syncplan.reports.refinement_report import RefinementResult, refinement_result
from syncplan.results.quantities import MISSING, Quantity, plain, quantity
from syncplan.results.stories import Column, Grid, Report, Row, Story, Table, flat
from syncplan.scenario.ground import WIDEST_M, map_departure
from syncplan.scenario.lat_lon_keys import lat_lon_places
from syncplan.scenario.specification import Scenario
from syncplan.terms import TERMS


class VehicleOrbit(DocumentPart):
    """One vehicle's circle and its pose at time 0."""

    name: str = quantity("vehicle")
    center_m: Point = quantity(
        "centre",
        unit="m",
        words=lambda team: map(places_of(team).words, (each.center_m for each in team)),
        drop=7,
    )
    radius_m: float = quantity("R", unit="m", form="g", drop=4)
    direction: Literal["ccw", "cw"] = quantity("sense", drop=3)
    speed_mps: float = quantity("speed", unit="m/s", form=".4g", drop=5, order=1)
    phase_rad: float = quantity(
        "phase", "Angle from +x about the centre, in [0, 2 pi)", form=".4f", drop=6
    )
    position_m: Point = quantity(
        "position",
        unit="m",
        words=lambda team: map(places_of(team).words, (each.position_m for each in team)),
        drop=2,
        order=1,
    )
    heading_rad: float = quantity(
        "heading", "Direction of flight from +x, in [0, 2 pi)", form=".4f", drop=1, order=1
    )


def places_of(vehicles: Sequence[VehicleOrbit]) -> Places:
    """Return the words for places of a team."""
    return Places([each.center_m for each in vehicles], [each.radius_m for each in vehicles])


class DirectedContact(DocumentPart):
    """Contact windows in which one vehicle sees the other."""

    from_: str = Field(alias="from", serialization_alias="from")
    to: str
    windows_s: list[Window]
    contact_s: float


class Link(Document):
    """A meeting of two vehicles, once a period."""

    a: str
    b: str
    rule: Literal["same", "opposite"]
    phase_residual_rad: float
    min_distance_m: float
    contact_s: float
    contact_share: OrAbsent[float] = Field(
        default=None,
        description="contact_s over the longest that any phases give this link; only where phases "
        "were chosen for limited fields of view or among obstacles",
    )
    windows_s: list[Window] = Field(description="Union of both ways; an end may pass the period")
    directed: list[DirectedContact]
    phase_tolerance_rad: float = Field(
        description="Least slip of either phase that loses contact; pi if none does"
    )
    phase_tolerance_s: float = Field(description="The same as time: how late a vehicle may be")
    rank: int
    certified: bool
    reason: str


class LandmarkLink(DocumentPart):
    """Contact of a vehicle with a landmark."""

    vehicle: str
    landmark: str
    min_distance_m: float
    windows_s: list[Window]
    contact_s: float
    rank: int
    certified: bool
    reason: str


class DroppedLink(DocumentPart):
    """A listed link that never comes into contact."""

    a: str
    b: str
    reason: str


class CloseApproach(DocumentPart):
    """Closest approach of two vehicles, and its first time."""

    min_m: float
    between: tuple[str, str]
    time_s: float


class Separation(DocumentPart):
    """Least separation over all pairs, and the pairs below the required one."""

    min_m: float | None
    between: tuple[str, str] | None
    time_s: float | None
    required_m: float
    violations: list[CloseApproach]


class Witness(DocumentPart):
    """One component of the certificate: two landmark links and a tree of rank-3 links."""

    vehicles: list[str]
    landmark_links: list[tuple[str, str]]
    vehicle_links: list[tuple[str, str]]


class PredictedStateError(DocumentPart):
    """Predicted RMS error of a filter state other than a pose."""

    state: str = quantity("state", "Name", examples=["wind x", "speed scale of v1"])
    unit: str = quantity("unit", examples=["m/s"])
    sigma: float = quantity(
        "sigma at start", "Its standard deviation before anything is seen", form=".4g"
    )
    predicted_rms: float = quantity(
        "error",
        "Over the second half of the run, as predicted_rms_m, for circles flown in still air: in "
        "a wind of a quarter of the speed, the wind itself is known half as well",
    )


class StartUpRecord(DocumentPart):
    """Whether the filter can be expected to reach the bound from the initial sigmas.

    Assumes errors drawn from the scenario's sigmas, and circles flown exactly.
    """

    index: float = Field(
        description="Largest second-order term of a bearing over the deviation of its innovation, "
        "with the covariance of the bound; up to 0.45, an ekf can be expected to reach the bound",
        examples=[0.2],
    )
    observer: str = Field(description="Who measures the bearing that has the index")
    target: str
    time_s: float
    pilot: dict[str, Any] | None = Field(
        default=None, description="null; in older files, a few trials from the initial sigmas"
    )
    untried: str = Field(default="", description="Empty; in older files, why there is no pilot")


class SynchronisationRecord(DocumentPart):
    """Method that found the phases, with its margin and bound."""

    method: str
    smallest_margin_m: float | None
    bound_m: float | None
    bound_note: str
    odd_cycle: list[str]
    alternating_proven_largest: bool | None

    def line(self, links: Sequence[Link]) -> str:
        """The method, what it found for the links and the bound on it."""
        if self.smallest_margin_m is None:
            return f"phases: {self.method}"
        bound = "" if self.bound_m is None else f", bound {self.bound_m:.4g} m"
        shares = [link.contact_share for link in links if link.contact_share is not None]
        seen = f"; {percent(min(shares))} or more of attainable contact" if shares else ""
        margin = f"smallest margin {metres(self.smallest_margin_m)} m{bound}"
        return f"phases: {self.method}{seen}; {margin}"


class PlacesOnGround(DocumentPart):
    """The places of a plan on the ground, and the departure of the flat map from it."""

    places: dict[str, Any] = Field(
        description="The scenario's places in degrees, [latitude, longitude], by the dotted keys "
        "that stand for those in metres",
        examples=[{"landmarks_lat_lon_deg": {"mast": [47.3977, 8.5456]}}],
    )
    map_departure_m: float = Field(
        description="Largest difference of a distance on the flat map and on the ground, between "
        "any two places of circles and landmarks; of a sphere with the curvature at the origin"
    )


MOST_LISTED = 40
"""Most links listed."""

_MEETING = (
    Quantity("link"),
    Quantity("rule", text=True, drop=3),
    Quantity("closest", "m", drop=5),
    Quantity("contact", "s", drop=4),
    Quantity("from", "s", drop=1),
    Quantity("tolerance", "rad", drop=2),
    Quantity("rank"),
)


class PlanDocument(VersionedDocument, Report):
    """A plan: orbits, meetings and the verdict on observability."""

    verdict: OrAbsent[PlanVerdict] = Field(
        default=None, description="Go or no-go, with all findings; absent from older files"
    )
    scenario: Scenario
    period_s: float
    vehicles: list[VehicleOrbit]
    ground: OrAbsent[PlacesOnGround] = Field(
        default=None,
        description="The places in degrees; absent without a geo_origin, over 1,000 km from it "
        "and from older files",
    )
    links: list[Link]
    landmark_links: list[LandmarkLink]
    incidental_links: list[Link]
    dropped_links: list[DroppedLink]
    synchronisation: SynchronisationRecord
    connectivity_period_s: float | None
    separation: Separation
    observability: ObservabilityVerdict
    witness: list[Witness]
    predicted_rms_m: ErrorPrediction
    steady_rms_m: ErrorPrediction | None
    window_bound_m: ErrorPrediction
    expected_rms_m: OrAbsent[ErrorPrediction] = Field(
        default=None,
        description="RMS position error to be expected of the filter, which leaves out errors that "
        "the scenario states and does not know what they cost; absent where it leaves out none",
    )
    predicted_errors: OrAbsent[list[PredictedStateError]] = Field(
        default=None,
        description="States of the filter that are no poses; absent where there are none",
    )
    start_up: OrAbsent[StartUpRecord] = Field(
        default=None,
        description="Whether the filter reaches the predicted error; absent where none is "
        "predicted, from plans that are not observable and from older files",
    )
    refinement: OrAbsent[RefinementResult] = Field(
        default=None, description="Record of the refinement; absent where there was none"
    )
    flight: OrAbsent[FlownPlan] = Field(
        default=None, description="Results of flying the plan; absent where it was not flown"
    )
    notes: list[str] = Field(description="The messages of the verdict's findings")

    def body(self) -> Story:
        """Yield poses, meetings and errors."""
        seen, nearest, ground = self.observability, self.separation, self.ground
        state = "[green]observable[/]" if seen.observable else "[red]NOT observable[/]"
        yield (
            f"[bold]{plain(self.scenario.name or 'plan')}[/]: {state}, rank {seen.rank} of "
            f"{seen.state_dim}; period {self.period_s:.4g} s"
        )
        yield from seen.determined
        holds = "holds" if seen.certificate.holds else "does not hold"
        yield f"certificate {holds}: {plain(seen.certificate.reason)}"
        if self.connectivity_period_s is not None:
            yield (
                f"any {self.connectivity_period_s:.4g} s of sightings certify the team "
                "(connectivity period)"
            )
        if nearest.min_m is not None and nearest.between is not None:
            yield f"least separation {metres(nearest.min_m)} m, {plain('-'.join(nearest.between))}"
        if (origin := self.scenario.geo_origin) is not None and ground is not None:
            yield (
                f"[0, 0] at {origin.lat_deg:.7f}, {origin.lon_deg:.7f}; distances on the flat map "
                f"and on the ground differ by up to {max(ground.map_departure_m, 1e-3):.2g} m"
            )
        if self.flight is not None:
            yield plain(self.flight.line)
        yield self.synchronisation.line(self.links)
        yield self._vehicle_table
        yield from self._error_lines
        yield from self._meetings
        if self.refinement is not None:
            yield from self.refinement.body()
            if seen.extended is not None:
                yield (
                    "rank, window bound, determinant, eigenvalue and trace are of the poses, as if "
                    "all else were known; predicted errors are of all states"
                )
        terms = {
            "polish": "polish" in self.synchronisation.method,
            "unlisted": bool(self.incidental_links),
            "window bound": self.refinement is not None,
        }
        yield from (f"[dim]{term}: {TERMS[term].meaning}[/]" for term in terms if terms[term])

    def remarks(self) -> tuple[()]:
        """Return none: the findings are the notes."""
        return ()

    @property
    def _vehicle_table(self) -> Table:
        errors = self.predicted_rms_m.vehicles
        predicted = [errors[vehicle.name] for vehicle in self.vehicles]
        texts = [MISSING if error is None else f"{error:.3g}" for error in predicted]
        beside = [Column(Quantity("error", "m"), texts)]
        if self.flight is not None:
            texts = [self.flight.error_of(vehicle.name) for vehicle in self.vehicles]
            beside.append(Column(Quantity("flown", "m"), texts))
        flown = "" if self.flight is None else "and the flown "
        title = f"vehicles at time 0, with the predicted {flown}RMS error"
        return Table(title, self.vehicles, beside=beside)

    @property
    def _error_lines(self) -> Iterator[str | Table]:
        """The other states of the filter, and the cost of errors that it does not estimate."""
        if self.expected_rms_m is not None and self.expected_rms_m.overall is not None:
            own = self.predicted_rms_m.overall
            beside = "" if own is None else f" where the filter predicts {own:.3g} m"
            yield (
                f"[yellow]expected RMS error {self.expected_rms_m.overall:.3g} m over all vehicles"
                f"{beside}: some errors are not estimated[/]"
            )
        if states := self.predicted_errors:
            # in wind, it is known less well
            windy = any(each.state.startswith("wind ") for each in states)
            air = "; predictions suppose still air" if windy else ""
            yield Table(
                f"errors that the filter estimates, with the predicted RMS error{air}", states
            )

    @property
    def _meetings(self) -> Iterator[str | Grid]:
        """The table of meetings, and the links that do not count for the certificate, by reason."""
        rows: list[tuple[str, ...]] = []
        short: dict[str, list[str]] = {}
        meetings: list[tuple[str, str, str, Link | LandmarkLink]] = [
            (
                f"{link.a}-{link.b}",
                f"{link.rule}{unlisted}",
                f"{link.phase_tolerance_rad:.3f}",
                link,
            )
            for links, unlisted in ((self.links, ""), (self.incidental_links, ", unlisted"))
            for link in links
        ]
        meetings += [
            (f"{link.vehicle}-{link.landmark}", "landmark", "-", link)
            for link in self.landmark_links
        ]
        for name, rule, tolerance, link in meetings:
            begin = f"{link.windows_s[0][0]:.2f}" if link.windows_s else "-"
            distances = f"{link.min_distance_m:.2f}", f"{link.contact_s:.2f}", begin
            rows.append((plain(name), rule, *distances, tolerance, str(link.rank)))
            short.setdefault(link.reason, []).append(plain(name))
        if rows:
            yield Grid("meetings, once a period", _MEETING, rows)
        for reason, names in short.items():
            if reason:
                # all that the table can show
                yield f"[yellow]not certified[/]: {listed(names, 2 * MOST_LISTED)}: {reason}"

    def frame_rows(self) -> Iterator[Row]:
        """Yield the vehicles as rows of a data frame."""
        predicted, window = self.predicted_rms_m.vehicles, self.window_bound_m.vehicles
        records = () if self.flight is None else self.flight.vehicles
        flown = {record.name: record.rms_m for record in records}
        for vehicle in self.vehicles:
            yield {
                **flat(vehicle.model_dump()),
                "predicted_rms_m": predicted.get(vehicle.name),
                "window_bound_m": window.get(vehicle.name),
                **({"flown_rms_m": flown.get(vehicle.name)} if flown else {}),
            }


GIVEN = "the phases were given and judged as they are"


def plan_document(plan: Plan) -> PlanDocument:
    """Return the document of a plan; angles in [0, 2 pi), infinities as null."""
    verdict = plan.verdict
    names, landmarks = plan.scenario.vehicle_names, plan.scenario.landmark_names
    return PlanDocument(
        version=__version__,
        verdict=verdict,
        scenario=plan.scenario,
        period_s=plan.orbits.period,
        vehicles=_vehicles(plan, names),
        ground=places_on_ground(plan),
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
        observability=observability_of(plan, names),
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
        flight=plan.flight,
        notes=[one.message for one in verdict.findings],
    )


def _vehicles(plan: Plan, names: list[str]) -> list[VehicleOrbit]:
    orbits = plan.orbits
    where, ahead = position(orbits, 0.0), heading(orbits, 0.0) % (2.0 * np.pi)
    return [
        VehicleOrbit(
            name=names[k],
            center_m=point_of(orbits.centers[k]),
            radius_m=float(orbits.radii[k]),
            direction=_sense(float(orbits.senses[k])),
            speed_mps=float(orbits.speeds[k]),
            phase_rad=float(orbits.phases[k]),
            position_m=point_of(where[k]),
            heading_rad=float(ahead[k]),
        )
        for k in range(orbits.count)
    ]


def places_on_ground(plan: Plan) -> PlacesOnGround | None:
    """Return the places of a plan in degrees; None without a geo_origin, or too far from it."""
    origin = plan.scenario.geo_origin
    if origin is None:
        return None
    reached = extent(plan.orbits, plan.landmarks)
    if np.hypot(*reached.T).max() > WIDEST_M:
        return None
    return PlacesOnGround(
        places=lat_lon_places(plan.scenario), map_departure_m=map_departure(origin, reached)
    )


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
        windows_s=windows_of(item.windows),
        directed=[
            DirectedContact(
                **{"from": one},
                to=other,
                windows_s=windows_of(windows),
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
        windows_s=windows_of(item.windows),
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
    """Least separation; without a required one, the verdict alone reports close approaches."""
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


def _sense(value: float) -> Literal["ccw", "cw"]:
    return "ccw" if value > 0.0 else "cw"


def start_up_record(
    index: StartUpIndex, names: Sequence[str], landmarks: Sequence[str]
) -> StartUpRecord:
    """Return the start-up index of a plan as documents hold it."""
    return StartUpRecord(
        index=index.value,
        observer=names[index.observer],
        target=[*names, *landmarks][index.target],
        time_s=index.time,
    )
