"""What is determined of errors that last, as documents hold it."""

from collections.abc import Sequence

from syncplan.observability.error_modes import ErrorVerdict, ExtendedObservability
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.reports.document_base import finite_or_none
from syncplan.reports.plan_schemas import ExtendedRank, StateVerdict, UndeterminedErrors

_POSES = (("position", "m", (0, 1)), ("heading", "rad", (2,)))


def extended_rank_record(verdict: ErrorVerdict | None, names: Sequence[str]) -> ExtendedRank | None:
    """Return the rank with errors of the vehicles named as states; None where there is none."""
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
    """Return what is determined by kind of state, of the vehicles named; None where no errors."""
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
