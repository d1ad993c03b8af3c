"""How the plan was found: findings on placement, refinement and figures left out."""

from collections.abc import Iterator

from syncplan.planning.findings import Finding
from syncplan.planning.judged_team import JudgedTeam

__all__ = [
    "CENTRES_PLACED",
    "PLACED",
    "bound_missing",
    "centres_placed",
    "not_refined",
    "search_cut_short",
]

CENTRES_PLACED = "centres-placed"
"""The code of the finding that the centres are none of the user's."""

PLACED = "the centres were found by placement; formation.centers_m of the plan's scenario has them"
"""Its message."""


def centres_placed(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that the centres are none of the user's."""
    if judged.centres_placed or judged.placement is not None:
        yield Finding(CENTRES_PLACED, "note", PLACED)


def not_refined(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that refinement found nothing better."""
    record = judged.refinement
    if record is not None and not record.improved:
        yield Finding(
            "not-refined",
            "warning",
            f"not refined: {record.reason}; this is the plan that was given",
        )


def search_cut_short(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that refinement did not come to its end."""
    record = judged.refinement
    if record is not None and record.improved and record.cut_short:
        yield Finding(
            "search-cut-short",
            "note",
            "the search for a better plan was cut short; this is the best it had found",
        )


def bound_missing(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that errors are not predicted, and why."""
    if judged.prediction.note:
        yield Finding("bound-missing", "note", judged.prediction.note)
