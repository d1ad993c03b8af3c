"""Whether every pose is determined, and by how much: findings on rank and certificate."""

from collections.abc import Iterator

import numpy as np

from syncplan.observability.error_modes import ErrorMode
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.planning.findings import Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.scenario.specification import per_vehicle

__all__ = ["error_undetermined", "near_degenerate", "needs_prior", "not_certified", "unobservable"]

LARGEST_CONDITION_NUMBER = 1e6
"""Of the windowed matrix: beyond it, full rank rests on noise-free geometry."""


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
    for mode, found in _error_modes(judged):
        if mode.moves_poses:
            yield Finding(
                "needs-prior",
                "warning",
                f"positions and headings rest on what is known of errors beforehand: {found}",
                tuple(judged.scenario.vehicle_names[k] for k in mode.vehicles),
                Cure(mode.cure),
            )


def error_undetermined(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield a finding for each way in which errors are not determined, but poses are."""
    verdict = judged.error_verdict
    if verdict is not None and verdict.extended is None:
        yield Finding(
            "error-undetermined",
            "note",
            f"not checked for {verdict.state_dim} states which errors one window determines",
        )
    for mode, found in _error_modes(judged):
        if not mode.moves_poses:
            yield Finding(
                "error-undetermined",
                "note",
                f"the filter rests on what is known of errors beforehand: {found}",
                tuple(judged.scenario.vehicle_names[k] for k in mode.vehicles),
                Cure(mode.cure),
            )


def _error_modes(judged: JudgedTeam) -> Iterator[tuple[ErrorMode, str]]:
    """Each way in which errors are not determined, and what was found in words."""
    verdict = judged.error_verdict
    if verdict is None or verdict.extended is None:
        return
    rank = f"rank {verdict.extended.rank} of {verdict.state_dim} with errors as states"
    for mode in verdict.modes:
        words = f"no sighting can detect {mode.description}"
        yield mode, f"{words}; {rank}, over {judged.scenario.window:.4g} s"


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
