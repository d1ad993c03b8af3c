"""The table of checks that a verdict is made of."""

from collections.abc import Callable, Iterable

from syncplan.planning.findings import Finding, Verdict
from syncplan.planning.flight_checks import (
    commands_saturated,
    lost_in_flight,
    meetings_missed,
    phase_not_kept,
    too_close_in_flight,
)
from syncplan.planning.judged_team import JudgedTeam
from syncplan.planning.link_checks import (
    fragile_links,
    landmarks_hidden,
    lost_links,
    vehicles_hidden,
)
from syncplan.planning.loss_checks import single_points_of_failure
from syncplan.planning.neglect_checks import expected_worse, not_estimated
from syncplan.planning.observability_checks import (
    error_undetermined,
    near_degenerate,
    needs_prior,
    not_certified,
    unobservable,
)
from syncplan.planning.path_checks import (
    in_keep_out,
    landmarks_too_close,
    outside_area,
    vehicles_too_close,
)
from syncplan.planning.room_checks import (
    meetings_uncertain,
    separation_uncertain,
    start_uncertain,
)
from syncplan.planning.search_checks import (
    bound_missing,
    centres_placed,
    cleared,
    not_refined,
    search_cut_short,
)
from syncplan.planning.speed_checks import over_limit, strong_wind
from syncplan.planning.start_up_checks import start_up, start_up_worse

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
