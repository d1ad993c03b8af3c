"""Observability and predicted errors of a team, as parts of documents."""

from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import Field

from syncplan.arrays import Array
from syncplan.documents import (
    Document,
    DocumentPart,
    OrAbsent,
    Point,
    finite_or_none,
    point_of,
)
from syncplan.observability.error_modes import ErrorVerdict, ExtendedObservability
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.planning.plans import Plan
from syncplan.results.quantities import plain


class CertificateVerdict(DocumentPart):
    """The certificate: the corrected Theorem 3.3."""

    holds: bool
    reason: str


class VehicleMotion(DocumentPart):
    """Displacement of one vehicle in an unobservable motion."""

    vehicle: str
    shift_m: Point
    turn_rad: float


class Unobservable(DocumentPart):
    """A motion of the team that no sighting can detect."""

    description: str
    vehicles: list[str]
    motion: list[VehicleMotion]
    cure: str


class StateVerdict(DocumentPart):
    """Whether one window determines a kind of state, whatever the others are."""

    state: str = Field(
        description="position, heading, or a kind of error", examples=["wind", "speed scale"]
    )
    unit: str = Field(examples=["m/s"])
    determined: bool
    undetermined: list[str] = Field(description="Which of them are not, by name")


class UndeterminedErrors(DocumentPart):
    """A change of errors, and of poses with them, that no sighting can detect."""

    description: str
    states: list[str] = Field(description="Errors that change")
    vehicles: list[str] = Field(description="Vehicles whose errors or poses change")
    moves_poses: bool = Field(description="Whether positions or headings change too")
    cure: str


class ExtendedRank(DocumentPart):
    """Rank with the constant errors that the filter estimates as states, without priors."""

    rank: int
    state_dim: int
    rank_gap: float | None = Field(
        description="Last counted singular value over the first not counted; null if none is left"
    )
    poses_determined: bool = Field(
        description="Whether every position and heading is determined, whatever the errors are"
    )
    undetermined: list[UndeterminedErrors]


class ObservabilityVerdict(Document):
    """Rank and conditioning of the windowed matrix of the poses, positions in mean radii."""

    rank: int
    state_dim: int
    observable: bool
    window_s: float
    rank_gap: float | None = Field(
        description="Last counted singular value over the first not counted; null if none is left"
    )
    certificate: CertificateVerdict
    condition_number: float | None
    min_eigenvalue: float = Field(
        description="Smallest eigenvalue of the windowed information, positions in mean radii; "
        "0 where unobservable"
    )
    singular_values: list[float] = Field(
        description="Descending; above 150 vehicles only the largest, the last that counts and "
        "those that do not"
    )
    unobservable: list[Unobservable]
    extended: OrAbsent[ExtendedRank] = Field(
        default=None,
        description="Rank with errors as states; absent where the filter estimates none that are "
        "constant, or where there are too many states",
    )
    states: OrAbsent[list[StateVerdict]] = Field(
        default=None, description="Determined states, by kind; absent as `extended` is"
    )

    @property
    def determined(self) -> Iterator[str]:
        """A line on the rank with errors as states; none if there are no such states."""
        if self.extended is not None and self.states is not None:
            lacking = [one.state for one in self.states if not one.determined]
            rest = f"; without priors not determined: {', '.join(lacking)}" if lacking else ""
            rank = f"rank {self.extended.rank} of {self.extended.state_dim}"
            yield plain(f"with errors as states: {rank}{rest}")


class ErrorPrediction(DocumentPart):
    """Predicted RMS position error, per vehicle and over all."""

    overall: float | None
    vehicles: dict[str, float | None]
    note: str = ""


def certificate_reason(plan: Plan) -> str:
    """Return the reason why the certificate holds or does not, in words."""
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


def observability_of(plan: Plan, names: list[str]) -> ObservabilityVerdict:
    """Return rank and certificate of a plan of the named vehicles as documents hold them."""
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
        singular_values=verdict.singular_values[np.isfinite(verdict.singular_values)].tolist(),
        unobservable=unobservable_motions(plan.unobservable, names),
        extended=extended_rank_record(plan.error_verdict, names),
        states=state_verdicts(plan.error_verdict, names),
    )


def unobservable_motions(
    modes: Sequence[UnobservableMode], names: Sequence[str]
) -> list[Unobservable]:
    """Return unobservable modes of the named vehicles as documents hold them."""
    return [
        Unobservable(
            description=item.description,
            vehicles=[names[k] for k in item.vehicles],
            motion=[
                VehicleMotion(
                    vehicle=names[k],
                    shift_m=point_of(item.motion[k]),
                    turn_rad=float(item.motion[k, 2]),
                )
                for k in item.vehicles
            ],
            cure=item.cure,
        )
        for item in modes
    ]


def error_prediction(values: Array | None, names: Sequence[str], note: str = "") -> ErrorPrediction:
    """Return predicted errors (n,) m of the named vehicles as documents hold them."""
    if values is None:
        return ErrorPrediction(overall=None, vehicles=dict.fromkeys(names), note=note)
    return ErrorPrediction(
        overall=finite_or_none(float(np.sqrt(np.mean(values**2)))),
        vehicles={
            name: finite_or_none(float(value)) for name, value in zip(names, values, strict=True)
        },
        note=note,
    )


_POSES = (("position", "m", (0, 1)), ("heading", "rad", (2,)))


def extended_rank_record(verdict: ErrorVerdict | None, names: Sequence[str]) -> ExtendedRank | None:
    """Return the rank with errors of the named vehicles as states; None if there is none."""
    if verdict is None or verdict.extended is None:
        return None
    found = verdict.extended
    return ExtendedRank(
        rank=found.rank,
        state_dim=found.state_dim,
        rank_gap=finite_or_none(found.gap),
        poses_determined=found.poses_determined,
        undetermined=[
            UndeterminedErrors(
                description=mode.description,
                states=list(mode.states),
                vehicles=[names[k] for k in mode.vehicles],
                moves_poses=mode.moves_poses,
                cure=mode.cure,
            )
            for mode in verdict.modes
        ],
    )


def state_verdicts(verdict: ErrorVerdict | None, names: Sequence[str]) -> list[StateVerdict] | None:
    """Return the verdict by kind of state of the named vehicles; None if no errors are states."""
    if verdict is None or verdict.extended is None:
        return None
    return [*_poses(verdict.extended, names), *_errors(verdict.extended, names)]


def _poses(found: ExtendedObservability, names: Sequence[str]) -> list[StateVerdict]:
    count = len(names)
    determined = found.determined[: 3 * count].reshape(count, 3)
    verdicts = []
    for what, unit, axes in _POSES:
        lacking = [
            f"{what} of {name}"
            for name, row in zip(names, determined[:, axes], strict=True)
            if not row.all()
        ]
        verdicts.append(_verdict(what, unit, lacking))
    return verdicts


def _errors(found: ExtendedObservability, names: Sequence[str]) -> list[StateVerdict]:
    layout, begin = found.layout, 3 * len(names)
    labels, determined = layout.labels(names), found.determined[begin:]
    verdicts = []
    for name in layout.names:
        own = {int(column) - begin for column in layout.columns[name].ravel() if column >= 0}
        lacking = [labels[k] for k in sorted(own) if not determined[k]]
        verdicts.append(_verdict(name.replace("_", " "), ERROR_STATES[name].unit, lacking))
    return verdicts


def _verdict(what: str, unit: str, lacking: list[str]) -> StateVerdict:
    return StateVerdict(state=what, unit=unit, determined=not lacking, undetermined=lacking)
