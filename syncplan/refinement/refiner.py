"""Refinement of a plan to the best plan near it, judged by the exact code.

Variables are phases, centres and radii within their bounds. IPOPT improves a smooth form of the
objective from several starts. Every candidate is then measured exactly. The best that violates
nothing the input met is judged afresh, like any plan, and returned.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from syncplan.arrays import Array, as_pairs
from syncplan.documents import finite_or_none
from syncplan.errors import InputError
from syncplan.options import lists_options
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import reachable_pairs
from syncplan.planning.judged_team import bound_is_affordable
from syncplan.planning.plan_files import PlanSubject, planned
from syncplan.planning.plan_records import RefinementRecord, StartResult
from syncplan.planning.planner import BoundChoice, Pilot, judge, with_flights
from syncplan.planning.plans import Plan
from syncplan.refinement.measures import Measurement, measure, with_meetings
from syncplan.refinement.problem import WINDOW_BOUND, RefineProblem, orbits_of
from syncplan.refinement.problem_setup import problem_of, refuse_conflicts
from syncplan.runtime.machine import single_threaded_blas, usable_cores
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.objectives import Figures, Objective, default_objective
from syncplan.scenario.quantities import validation_fault
from syncplan.scenario.specification import Scenario
from syncplan.synchronisation.phases import synchronise

if TYPE_CHECKING:
    from syncplan.refinement.ipopt import SolverProgress
    from syncplan.refinement.parallel_starts import Attempt
    from syncplan.runtime.task_crew import EarlierSearch

RefineProgress = Callable[[int, int, float], None]
"""Callback that receives the start, the iteration and the solver's value of the objective."""


@dataclass(frozen=True, slots=True)
class BetterPlan:
    """The best plan found so far, better than the one given, as the search measured it.

    Attributes
    ----------
    scenario, orbits : as those of the plan that the search returns if it ends with this one
    before, after : exact figures of merit of the plan given, and of this one
    """

    scenario: Scenario
    orbits: Orbits
    before: Figures
    after: Figures


_IMPROVED = 1e-9
"""Least relative gain that counts as better."""

_CUT_SHORT = "the search was cut short; give it more time (time_limit_s)"

_NO_RESULT = (
    "the search was cut short before any start had a result; give it more time (time_limit_s)"
)

_ACTIVE = 0.01
"""Room, as a share of a constraint's size, up to which it counts as active."""


@lists_options(RefineOptions)
@single_threaded_blas
def refine(
    subject: PlanSubject,
    options: RefineOptions | None = None,
    *,
    workers: int | None = None,
    bound: BoundChoice = "auto",
    pilot: Pilot = True,
    progress: RefineProgress | None = None,
    better: Callable[[BetterPlan], None] | None = None,
    earlier: "EarlierSearch | None" = None,
    **changes: Any,
) -> Plan:
    """Return the best plan found near `subject`: never worse, and violating nothing it met.

    Where `subject` brings vehicles too near to each other, to landmarks or to areas, a plan that
    clears them is better, whatever its figures.

    `options` default to the scenario's `refine` section; `changes` replace some of its keys
    (objective="logdet", starts=1, ...; see RefineOptions). `workers` is the number of processes,
    by default one per core; it changes no result. `better` is called with each plan that is the
    best so far. `earlier` holds what an interrupted search kept: its starts are not repeated, and
    the result is that of an uninterrupted search. `bound` and `pilot` are those of `plan`. The
    plan's `refinement` records the search. Where nothing better was found, the record says why, and
    the plan is the input.

    Raises InputError for options that cannot be used, and NoSolutionError, naming the constraints,
    where they conflict.
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} given, at least 1 is needed", key="workers")
    if options is not None and not isinstance(options, RefineOptions):
        raise InputError("must be RefineOptions; give single keys by name", key="options")
    given = planned(subject, bound=bound)
    began = time.monotonic()
    chosen = options_for(given.scenario, options, changes)
    problem = problem_of(given, chosen)
    refuse_conflicts(given, problem, chosen)
    predict = problem.objective.predicted or bound_is_affordable(given.team, problem.duration)
    before = measure(problem, given.orbits, predict=predict)
    figures = with_meetings(problem, given.orbits, before.figures)
    before = replace(before, figures=figures)
    case = _Case(given, chosen, problem, before, predict, began)
    attempts, cut_short = _search(case, workers, progress, better, earlier)
    return with_flights(_best(case, attempts, cut_short, bound), pilot)


def options_for(
    scenario: Scenario, options: RefineOptions | None, changes: dict[str, Any]
) -> RefineOptions:
    """Return valid options: those given, or the scenario's, with some replaced.

    Raises InputError naming the option at fault.
    """
    base = options or scenario.refine or RefineOptions()
    values = base.model_dump(exclude_none=True, exclude_defaults=True)
    changed = {key: value for key, value in changes.items() if value is not None}
    if "vary" in changed:
        # drop the limits of values that no longer vary, unless they are given as well
        for variable, limit in (("centers", "center_box_m"), ("radii", "radius_m")):
            if variable not in changed["vary"]:
                values.pop(limit, None)
    values.update(changed)
    try:
        return RefineOptions.model_validate(values)
    except ValidationError as error:
        validation_fault(error, RefineOptions, "")


@dataclass(frozen=True, slots=True)
class _Case:
    """A plan, its refinement problem and its own measurement, with the bound if `predict`.

    The time of the search counts from `began` (monotonic), so it includes that measurement.
    """

    given: Plan
    options: RefineOptions
    problem: RefineProblem
    before: Measurement
    predict: bool
    began: float


# --- search ---------------------------------------------------------------------------------------


def _search(
    case: _Case,
    workers: int | None,
    progress: RefineProgress | None,
    better: Callable[[BetterPlan], None] | None,
    earlier: "EarlierSearch | None",
) -> tuple[list["Attempt"], bool]:
    """Attempts from all starts, and whether the search was cut short.

    If only the window bound keeps attempts from passing, all starts run again with it as a
    constraint.
    """
    from syncplan.refinement.nlp import FORMS
    from syncplan.refinement.parallel_starts import (
        Attempt,
        RefineTask,
        keeper,
        kept_attempts,
        run_starts,
        searched_nearby,
    )

    began = case.began - (0.0 if earlier is None else earlier.spent_s)
    problem, options, before = case.problem, case.options, case.before
    in_units = FORMS[problem.objective.name].in_units
    task = RefineTask(
        problem=problem,
        rule_phases=_rule_phases(case.given),
        nudged=not case.given.observable,
        before=before,
        seed=options.seed,
        predict=case.predict,
    )

    def report(start: int, at: "SolverProgress") -> None:
        if progress is not None:
            progress(start, at.iteration, in_units(problem, at.objective))

    known: list[Attempt] = []

    def hear(made: Sequence["Attempt"]) -> None:
        best = _improving(case, known)
        known.extend(made)
        found = _improving(case, known)
        if better is not None and found is not None and found is not best:
            better(_better_plan(case, found))

    def run(one: RefineTask, first: int) -> tuple[list["Attempt"], bool]:
        keep = keeper(earlier, first)
        kept = kept_attempts(earlier, one, range(first, first + options.starts))
        hear(kept)

        def found(made: Attempt) -> None:
            keep(made)
            hear([made])

        left = max(options.time_limit_s - (time.monotonic() - began), 0.0)
        return run_starts(
            one,
            options.starts,
            workers=workers or usable_cores(),
            time_limit=left,
            report=report,
            found=found,
            earlier=kept,
        )

    attempts, interrupted = run(task, 0)
    over = interrupted or time.monotonic() - began >= options.time_limit_s
    if not over and _stopped_by_window_bound(attempts, before):
        limited = replace(problem, window_limit=before.figures.window_bound)
        again, interrupted = run(replace(task, problem=limited), options.starts)
        attempts += [replace(one, start=one.start + options.starts) for one in again]
    if not interrupted:
        attempts, interrupted = searched_nearby(task, attempts, began + options.time_limit_s)
        hear(attempts)
    return attempts, interrupted or time.monotonic() - began >= options.time_limit_s


def _stopped_by_window_bound(attempts: list["Attempt"], before: Measurement) -> bool:
    """Whether no attempt passes, and some fail only on the window bound."""
    if not math.isfinite(before.figures.window_bound):
        return False
    ended = [one.violations for one in attempts if one.after is not None]
    return all(ended) and any(one == (WINDOW_BOUND,) for one in ended)


def _rule_phases(given: Plan) -> Array:
    """Phases that meet the rules, whatever those of the plan."""
    pairs = as_pairs([(link.a, link.b) for link in given.links])
    orbits, scenario = given.orbits, given.scenario
    return synchronise(
        orbits.centers,
        orbits.radii,
        orbits.senses,
        given.sensors.ranges,
        pairs,
        float(orbits.phases[0]),
        scenario.separation,
        sensors=given.sensors,
        obstacles=given.team.obstacles,
    ).phases


# --- result ---------------------------------------------------------------------------------------


def _best(case: _Case, attempts: list["Attempt"], cut_short: bool, bound: BoundChoice) -> Plan:
    """Plan of the best attempt that passes and improves, or else the one given; with the record.

    The plan is judged afresh: only its circles come from the search.
    """
    given, before = case.given, case.before
    objective, neglect = case.problem.objective, given.prediction.neglect
    best = _improving(case, attempts)
    record = RefinementRecord(
        options=case.options,
        objective=objective.name,
        improved=best is not None,
        reason=""
        if best is not None
        else _why_not(attempts, objective, given.observability.state_dim, cut_short),
        cut_short=cut_short,
        before=before.figures,
        after=before.figures,
        active=(),
        starts=tuple(_record(one, objective) for one in attempts),
        expected_before=None if neglect is None else neglect.expected_of_all,
    )
    if best is None or best.after is None:
        return replace(given, refinement=record)
    better = _better_plan(case, best)
    steady = given.prediction.steady is not None
    judged = judge(better.scenario, better.orbits, bound=bound, steady=steady)
    record = replace(
        record,
        cleared=best.after.shortfall < before.shortfall,
        after=better.after,
        active=_active(best.after),
    )
    return replace(
        judged, refinement=record, placement=given.placement, centres_placed=given.centres_placed
    )


def _improving(case: _Case, attempts: Sequence["Attempt"]) -> "Attempt | None":
    """Best attempt that passes, if it is better than the plan given."""
    from syncplan.refinement.parallel_starts import rank_of

    passed = [one for one in attempts if one.after is not None and not one.violations]
    best = min(passed, key=lambda one: rank_of(case.problem, one), default=None)
    short, cost = case.before.standing(case.problem.objective.name)
    allowed = cost - _IMPROVED * abs(cost) if math.isfinite(cost) else cost
    better = best is not None and rank_of(case.problem, best)[1] < (short, allowed)
    return best if better else None


def _better_plan(case: _Case, attempt: "Attempt") -> BetterPlan:
    """Plan of an attempt that has a result."""
    assert attempt.circles is not None
    assert attempt.after is not None
    orbits = orbits_of(attempt.circles, case.given.orbits)
    moved = _moved(case.given, case.options, orbits)
    after = with_meetings(case.problem, orbits, attempt.after.figures)
    return BetterPlan(moved, orbits, case.before.figures, after)


def _record(attempt: "Attempt", objective: Objective) -> StartResult:
    run, after = attempt.run, attempt.after
    value = None if after is None else after.figures.objectives[objective.name]
    return StartResult(
        start=attempt.start,
        status=run.status,
        iterations=run.iterations,
        constraint_violation=finite_or_none(run.violation),
        dual_infeasibility=finite_or_none(run.dual_residual),
        value=None if value is None else finite_or_none(value),
        violations=list(attempt.violations),
        unmet=list(run.unmet),
    )


def _why_not(
    attempts: list["Attempt"], objective: Objective, state_dim: int, cut_short: bool
) -> str:
    if not attempts or all(one.after is None for one in attempts):
        return _NO_RESULT if cut_short else "no start converged"
    rank = max(one.after.figures.rank for one in attempts if one.after is not None)
    if objective.needs_observability and rank < state_dim:
        return (
            f"no result is observable (rank {rank}), so {objective.name} cannot rank them; "
            f"give landmarks, or the objective {default_objective(0).name}"
        )
    if any(not one.violations for one in attempts if one.after is not None):
        reason = "no start found a better plan than the one given"
        return f"{reason}; {_CUT_SHORT}" if cut_short else reason
    named = Counter(label for one in attempts for label in (*one.run.unmet, *one.violations))
    worst = ", ".join(label for label, _ in named.most_common(3))
    reason = f"every result violates a constraint: {worst}"
    return f"{reason}; {_CUT_SHORT}" if cut_short else reason


def _active(after: Measurement) -> tuple[str, ...]:
    return tuple(one.label for one in after.margins if one.room <= _ACTIVE * one.size)


def _still_reachable(given: Plan, orbits: Orbits) -> list[tuple[int, int]]:
    """Links, kept or dropped, whose circles still come within range."""
    a, b = reachable_pairs(orbits, given.sensors.ranges)
    near = {(min(i, j), max(i, j)) for i, j in zip(a.tolist(), b.tolist(), strict=True)}
    listed = [(one.a, one.b) for one in given.links]
    listed += [(one.a, one.b) for one in given.dropped_links]
    return [pair for pair in listed if pair in near]


def _moved(given: Plan, options: RefineOptions, orbits: Orbits) -> Scenario:
    """Scenario with the circles of the result, its links listed so that they stay the same."""
    scenario = given.scenario
    document = scenario.model_dump(exclude_none=True)
    names = scenario.vehicle_names
    centers = [(float(x), float(y)) for x, y in orbits.centers]
    formation = document["formation"]
    named = isinstance(scenario.formation.centers_m, dict)
    formation["centers_m"] = dict(zip(names, centers, strict=True)) if named else centers
    listed = sorted(_still_reachable(given, orbits))
    formation["links"] = [(names[a], names[b]) for a, b in listed]
    if "radii" in options.vary:
        document["orbit"].pop("speed_mps", None)
        document["orbit"]["angular_rate_rad_s"] = float(orbits.rate)
        document["orbit"]["radius_m"] = [float(radius) for radius in orbits.radii]
    document["refine"] = options.model_dump(exclude_none=True)
    return scenario_from(document, max_vehicles=scenario.size)
