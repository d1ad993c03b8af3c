"""How the plan was found: findings on placement, refinement and figures left out."""

from collections.abc import Iterator

from syncplan.planning.findings import Finding
from syncplan.planning.judged_team import JudgedTeam

CENTRES_PLACED = "centres-placed"
"""The code of the finding that the centres are none of the user's."""

CLEARED = "cleared"
"""The code of the finding that refinement cleared what was too near."""

PLACED = "the centres were found by placement; formation.centers_m of the plan's scenario has them"
"""The message of the first."""


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


def cleared(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that refinement cleared what was too near, whatever that cost."""
    record = judged.refinement
    if record is not None and record.cleared:
        yield Finding(
            CLEARED,
            "note",
            "the plan that was given came too near to vehicles, landmarks or areas; this one "
            "clears them or comes less near, which counted before its figures",
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
