"""Table of the checks behind a verdict, and the checks on how the plan was found."""

from collections.abc import Callable, Iterable, Iterator

from syncplan.planning import (
    error_checks,
    filter_checks,
    flight_checks,
    observability_checks,
    path_checks,
    scenario_checks,
)
from syncplan.planning.judged_team import JudgedTeam, PlanFinding, PlanVerdict, Remark

# --- how the plan was found -----------------------------------------------------------------------


CENTRES_PLACED, CLEARED = "centres-placed", "cleared"
"""Codes of the two findings that are read back from plan files."""

PLACED = "the centres were found by placement; formation.centers_m of the plan's scenario has them"
"""Message of the finding `centres-placed`."""


def centres_placed(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the centres were found by placement."""
    if judged.centres_placed or judged.placement is not None:
        yield Remark("note", PLACED)


def not_refined(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that refinement found nothing better."""
    record = judged.refinement
    if record is not None and not record.improved:
        yield Remark("warning", f"not refined: {record.reason}; this is the plan that was given")


def cleared(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that refinement cleared distances or reached the purpose, at any cost."""
    record = judged.refinement
    if record is not None and record.cleared:
        yield Remark(
            "note",
            "the plan that was given came too near to vehicles, landmarks or areas, or missed its "
            "purpose; this one does not, or does so less, which counted before its figures",
        )


def search_cut_short(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that refinement was cut short."""
    record = judged.refinement
    if record is not None and record.improved and record.cut_short:
        yield Remark(
            "note", "the search for a better plan was cut short; this is the best it had found"
        )


def bound_missing(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that errors are not predicted, with the reason."""
    if judged.prediction.rms is None and judged.prediction.note:
        yield Remark("note", judged.prediction.note)


def bound_estimated(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that errors are predicted approximately, with the accuracy."""
    if judged.prediction.rms is not None and judged.prediction.note:
        yield Remark("note", judged.prediction.note)


# --- the table ------------------------------------------------------------------------------------


CHECKS: dict[str, Callable[[JudgedTeam], Iterable[Remark]]] = {
    "angle-sigma-large": scenario_checks.angle_sigmas_large,
    "flat-map": scenario_checks.flat_map,
    "slant-range": scenario_checks.slant_ranges,
    "unobservable": observability_checks.unobservable,
    "weakly-observable": observability_checks.weakly_observable,
    "needs-prior": observability_checks.needs_prior,
    "vehicles-too-close": path_checks.vehicles_too_close,
    "landmark-too-close": path_checks.landmarks_too_close,
    "outside-area": path_checks.outside_area,
    "in-keep-out": path_checks.in_keep_out,
    "purpose-missed": path_checks.purpose_missed,
    "over-limit": path_checks.over_limit,
    "landmark-hidden": observability_checks.landmarks_hidden,
    "vehicle-hidden": observability_checks.vehicles_hidden,
    "link-lost": observability_checks.lost_links,
    "link-fragile": observability_checks.fragile_links,
    "not-flown": flight_checks.not_flown,
    "flights-dropped": flight_checks.flights_dropped,
    "few-flights": flight_checks.few_flights,
    "lost-in-flight": flight_checks.lost_in_flight,
    "edge-near": path_checks.edge_near,
    "too-close-in-flight": flight_checks.too_close_in_flight,
    "phase-not-kept": flight_checks.phase_not_kept,
    "meetings-missed": flight_checks.meetings_missed,
    "commands-saturated": flight_checks.commands_saturated,
    error_checks.ERROR_ABOVE_PREDICTION: error_checks.error_above_prediction,
    "not-estimated": filter_checks.not_estimated,
    "expected-worse": filter_checks.expected_worse,
    "error-undetermined": observability_checks.error_undetermined,
    "single-point-of-failure": observability_checks.single_points_of_failure,
    "not-refined": not_refined,
    CLEARED: cleared,
    "search-cut-short": search_cut_short,
    CENTRES_PLACED: centres_placed,
    "not-certified": observability_checks.not_certified,
    "bound-missing": bound_missing,
    "bound-estimated": bound_estimated,
}
"""Check that yields the findings of each code, in the order of the verdict."""


def verdict_of(judged: JudgedTeam) -> PlanVerdict:
    """Return whether a judged team can be flown, with the findings of every check."""
    return PlanVerdict.of(
        (
            PlanFinding.of(code, remark)
            for code, check in CHECKS.items()
            for remark in check(judged)
        ),
        judged.borne_out,
    )
