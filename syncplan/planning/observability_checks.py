"""Whether every pose is determined, and by how much: findings on rank and certificate."""

from collections.abc import Iterator

import numpy as np

from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.planning.findings import Cure, Finding, Level
from syncplan.planning.judged_team import JudgedTeam
from syncplan.scenario.specification import per_vehicle

LARGEST_CONDITION_NUMBER = 1e6
"""Of the windowed matrix: beyond it, full rank rests on noise-free geometry."""

_WITH_POSES: tuple[str, Level, str] = ("needs-prior", "warning", "positions and headings rest")
_ERRORS_ALONE: tuple[str, Level, str] = ("error-undetermined", "note", "the filter rests")
"""Code, level and opening words of what errors leave open with poses, and without."""


def unobservable(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield a finding for each motion of the team that no sighting can detect."""
    names, rank = judged.scenario.vehicle_names, judged.observability
    window = f"rank {rank.rank} of {rank.state_dim} over {judged.scenario.window:.4g} s"
    for mode in judged.unobservable:
        yield Finding(
            "unobservable",
            "stop",
            f"no sighting can detect a {mode.description}; {window}",
            tuple(names[k] for k in mode.vehicles),
            Cure(mode.cure, _desynchronised(judged, mode)),
        )


def near_degenerate(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that full rank is barely so."""
    condition = judged.observability.condition_number
    if judged.observability.observable and condition > LARGEST_CONDITION_NUMBER:
        yield Finding(
            "near-degenerate",
            "warning",
            f"observable, but barely: the condition number of one window is {condition:.3g}, above "
            f"{LARGEST_CONDITION_NUMBER:g}",
            cure=Cure("a small desynchronisation, unequal radii, a longer window, or refinement"),
        )


def needs_prior(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield a finding for each way in which errors not determined take poses with them."""
    yield from _resting_on_priors(judged, poses=True)


def error_undetermined(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield a finding for each way in which errors are not determined, but poses are."""
    verdict = judged.error_verdict
    if verdict is not None and verdict.extended is None:
        yield Finding(
            "error-undetermined",
            "note",
            f"not checked for {verdict.state_dim} states which errors one window determines: it "
            "takes long",
            cure=Cure(
                "a smaller team of the same pattern, or fewer errors in filter.estimate; in Python "
                "syncplan.observability.extended_rank.assess_extended has no limit"
            ),
        )
    yield from _resting_on_priors(judged, poses=False)


def _resting_on_priors(judged: JudgedTeam, *, poses: bool) -> Iterator[Finding]:
    """A finding for each way in which errors are not determined that moves poses, or does not."""
    verdict = judged.error_verdict
    if verdict is None or verdict.extended is None:
        return
    code, level, rests = _WITH_POSES if poses else _ERRORS_ALONE
    rank = f"rank {verdict.extended.rank} of {verdict.state_dim} with errors as states"
    for mode in verdict.modes:
        if mode.moves_poses == poses:
            yield Finding(
                code,
                level,
                f"{rests} on what is known of errors beforehand: no sighting can detect "
                f"{mode.description}; {rank}, over {judged.scenario.window:.4g} s",
                tuple(judged.scenario.vehicle_names[k] for k in mode.vehicles),
                Cure(mode.cure),
            )


def not_certified(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that the rank decides alone, without the certificate."""
    if judged.observability.observable and not judged.certificate.holds:
        names = judged.scenario.vehicle_names
        yield Finding(
            "not-certified",
            "note",
            "observable by rank, though the certificate (sufficient, not necessary) does not hold",
            tuple(names[k] for k in judged.certificate.lacking),
        )


def _desynchronised(judged: JudgedTeam, mode: UnobservableMode) -> dict[str, float]:
    """The change that cures a mode; one offset for all turns a team of one sense as a whole."""
    now = per_vehicle(judged.scenario.orbit.desync_rad, judged.scenario.size)
    if np.ptp(judged.orbits.senses) == 0.0 or max(map(abs, now)) >= mode.desync:
        return {}
    return {"orbit.desync_rad": mode.desync}
