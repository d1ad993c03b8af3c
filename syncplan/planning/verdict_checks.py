"""The table of checks that a verdict is made of, and those on how the plan was found."""

from collections.abc import Callable, Iterable, Iterator

from syncplan.planning.filter_checks import expected_worse, not_estimated, start_up, start_up_worse
from syncplan.planning.flight_checks import (
    commands_saturated,
    lost_in_flight,
    meetings_missed,
    meetings_uncertain,
    phase_not_kept,
    separation_uncertain,
    start_uncertain,
    too_close_in_flight,
)
from syncplan.planning.judged_team import Finding, JudgedTeam, Verdict
from syncplan.planning.observability_checks import (
    error_undetermined,
    fragile_links,
    landmarks_hidden,
    lost_links,
    near_degenerate,
    needs_prior,
    not_certified,
    single_points_of_failure,
    unobservable,
    vehicles_hidden,
)
from syncplan.planning.path_checks import (
    in_keep_out,
    landmarks_too_close,
    outside_area,
    over_limit,
    strong_wind,
    vehicles_too_close,
)

# --- how the plan was found -----------------------------------------------------------------------


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


# --- the table ------------------------------------------------------------------------------------


CHECKS: dict[str, Callable[[JudgedTeam], Iterable[Finding]]] = {
    "unobservable": unobservable,
    "near-degenerate": near_degenerate,
    "needs-prior": needs_prior,
    "vehicles-too-close": vehicles_too_close,
    "landmark-too-close": landmarks_too_close,
    "outside-area": outside_area,
    "in-keep-out": in_keep_out,
    "over-limit": over_limit,
    "strong-wind": strong_wind,
    "landmark-hidden": landmarks_hidden,
    "vehicle-hidden": vehicles_hidden,
    "link-lost": lost_links,
    "link-fragile": fragile_links,
    "meetings-uncertain": meetings_uncertain,
    "separation-uncertain": separation_uncertain,
    "start-uncertain": start_uncertain,
    "start-up": start_up,
    "start-up-worse": start_up_worse,
    "lost-in-flight": lost_in_flight,
    "too-close-in-flight": too_close_in_flight,
    "phase-not-kept": phase_not_kept,
    "meetings-missed": meetings_missed,
    "commands-saturated": commands_saturated,
    "not-estimated": not_estimated,
    "expected-worse": expected_worse,
    "error-undetermined": error_undetermined,
    "single-point-of-failure": single_points_of_failure,
    "not-refined": not_refined,
    "cleared": cleared,
    "search-cut-short": search_cut_short,
    "centres-placed": centres_placed,
    "not-certified": not_certified,
    "bound-missing": bound_missing,
}
"""Each code with the check that yields its findings, in the order of the verdict."""


def verdict_of(judged: JudgedTeam) -> Verdict:
    """Return whether a judged team can be flown, with the findings of every check."""
    return Verdict(tuple(finding for check in CHECKS.values() for finding in check(judged)))
