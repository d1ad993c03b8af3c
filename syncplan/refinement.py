"""Refinement: from a plan to the best plan the team can fly, judged by the exact code.

Variables are phases, centres and radii within their bounds; IPOPT improves a smooth form of the
objective from several starts; every candidate is then measured exactly, and the best that violates
nothing the input met comes back, judged afresh like any plan.
"""

import math
import os
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from syncplan.areas import Area
from syncplan.blas import single_threaded_blas
from syncplan.contacts import reachable_pairs
from syncplan.errors import NoSolutionError
from syncplan.loading import scenario_from, validation_fault
from syncplan.orbits import Orbits
from syncplan.planner import Plan, bound_is_affordable, judge, plan
from syncplan.refine_options import DEFAULT_BOX_M, Objective, RefineOptions
from syncplan.refining.measures import WINDOW_BOUND, Measurement, measure
from syncplan.refining.problem import Freedom, RefineProblem, circles_of, orbits_of
from syncplan.refining.record import RefinementRecord, StartRecord
from syncplan.scenario import Scenario
from syncplan.sightings import sample_sightings
from syncplan.sync import synchronise

if TYPE_CHECKING:
    from syncplan.refining.solver import SolverProgress
    from syncplan.refining.tasks import Attempt

__all__ = ["RefineProgress", "options_for", "problem_of", "refine"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
RefineProgress = Callable[[int, int, float], None]
"""Told of (start, iteration, the objective as the solver sees it)."""

PAIR_SAMPLES, ANCHOR_SAMPLES = 3, 2
"""Samples in contact that rank 3 of a vehicle link, rank 2 of a landmark link need."""

DEFAULT_MARGIN = 0.02
"""Share of the range by which contact stays within it."""

SAFE_SHARE = 0.5
"""Of the mean radius: the separation kept where none is asked for, if the plan has as much."""

PREDICTED_UP_TO = 24
"""Largest team whose predicted error is the objective unless another is asked for."""

_IMPROVED = 1e-9
_ACTIVE = 0.01


@single_threaded_blas
def refine(
    subject: Plan | Scenario,
    options: RefineOptions | None = None,
    *,
    workers: int | None = None,
    progress: RefineProgress | None = None,
    **changes: Any,
) -> Plan:
    """Return the best plan found near `subject`, never worse and never violating what it met.

    `options` default to the scenario's `refine` section; `changes` replace some of its keys
    (objective="logdet", starts=1, ...; see RefineOptions). `workers` is the number of processes,
    all cores if not given; it changes no result. The record of the search is the plan's
    `refinement`; where nothing better was found, it says why and the plan is the input's.

    Raises InputError for options that can't be used, NoSolutionError where constraints conflict,
    naming them.
    """
    given = subject if isinstance(subject, Plan) else plan(subject)
    chosen = options_for(given.scenario, options, changes)
    problem = problem_of(given, chosen)
    _refuse_conflicts(given, problem, chosen)
    predict = "rms" in problem.objective or bound_is_affordable(
        given.orbits.count, problem.duration, problem.sensors.sample_time
    )
    before = measure(problem, given.orbits, predict=predict)
    attempts, cut_short = _search(given, chosen, problem, before, predict, workers, progress)
    return _best(given, chosen, problem, before, attempts, cut_short)


def options_for(
    scenario: Scenario, options: RefineOptions | None, changes: dict[str, Any]
) -> RefineOptions:
    """Return the options to use, checked: those given or the scenario's, with some replaced.

    Raises InputError naming the option at fault.
    """
    base = options or scenario.refine or RefineOptions()
    values = base.model_dump(exclude_none=True, exclude_defaults=True)
    values.update({key: value for key, value in changes.items() if value is not None})
    try:
        return RefineOptions.model_validate(values)
    except ValidationError as error:
        validation_fault(error, RefineOptions, "")


def _objective(options: RefineOptions, count: int) -> Objective:
    if options.objective is not None:
        return options.objective
    return "predicted_rms" if count <= PREDICTED_UP_TO else "logdet"


# --- the problem ----------------------------------------------------------------------------------


def problem_of(given: Plan, options: RefineOptions) -> RefineProblem:
    """Return what `options` ask of a plan as arrays; margins no larger than it has them."""
    problem = _problem_as_asked(given, options)
    return _with_limits(problem, measure(problem, given.orbits, predict=False), options)


def _problem_as_asked(given: Plan, options: RefineOptions) -> RefineProblem:
    scenario, sensors = given.scenario, given.sensors
    area = Area.of(scenario.area_m, scenario.keep_out_m)
    samples = _samples_in_contact(given)
    listed = [(link.a, link.b) for link in given.links]
    pairs = _as_pairs([pair for pair in listed if pair in samples])
    held = [(link.a, link.b) for link in given.landmark_links]
    anchors = _as_pairs([pair for pair in held if pair in samples])
    reach = sensors.ranges[pairs].max(axis=1) if len(pairs) else np.zeros(0)
    return RefineProblem(
        names=(*scenario.vehicle_names, *scenario.landmark_names),
        orbits=given.orbits,
        landmarks=given.landmarks,
        sensors=sensors,
        noise=given.noise,
        window=scenario.window,
        duration=scenario.duration_s,
        freedom=_freedom(given, options, area),
        pairs=pairs,
        anchors=anchors,
        pair_samples=_needed(samples, pairs, PAIR_SAMPLES),
        anchor_samples=_needed(samples, anchors, ANCHOR_SAMPLES),
        pair_margins=_margins(options, reach),
        anchor_margins=_margins(options, sensors.ranges[anchors[:, 0]]),
        margins_required=options.margin_m is not None,
        min_separation=_separation(given),
        separation_required=scenario.min_separation_m > 0.0,
        area=area,
        objective=_objective(options, given.orbits.count),
        window_limit=math.inf,
    )


def _samples_in_contact(given: Plan) -> dict[tuple[int, int], int]:
    """Moments within the window at which each pair (a < b) is in contact, where there are any."""
    time = given.sensors.sample_time
    last = math.ceil(given.scenario.window / time - 1e-9) - 1
    seen = sample_sightings(given.windows, given.orbits.period, time, 0, last)
    a, b = np.minimum(seen.observers, seen.targets), np.maximum(seen.observers, seen.targets)
    moments = np.unique(np.column_stack([a, b, seen.steps]), axis=0)
    pairs, counts = np.unique(moments[:, :2], axis=0, return_counts=True)
    return {(int(i), int(j)): int(k) for (i, j), k in zip(pairs, counts, strict=True)}


def _as_pairs(pairs: list[tuple[int, int]]) -> Index:
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _needed(samples: dict[tuple[int, int], int], pairs: Index, wanted: int) -> Array:
    """What the rank needs, or as many as the plan has."""
    return np.array([min(wanted, samples[a, b]) for a, b in pairs.tolist()], dtype=float)


def _separation(given: Plan) -> float:
    """What was asked for, in m; else what the plan has, up to half its mean radius.

    Bearings tell most from nearby: without a floor, refinement would fly vehicles into each other.
    """
    asked = given.scenario.min_separation_m
    if asked > 0.0 or given.approach is None:
        return asked
    return min(given.approach.distance, SAFE_SHARE * float(given.orbits.radii.mean()))


def _margins(options: RefineOptions, reach: Array) -> Array:
    if options.margin_m is not None:
        return np.full(len(reach), options.margin_m)
    return DEFAULT_MARGIN * reach


def _freedom(given: Plan, options: RefineOptions, area: Area) -> Freedom:
    """Bounds of what varies; everything else, and the first vehicle's phase, stays as it is."""
    lower, upper = circles_of(given.orbits), circles_of(given.orbits)
    if "centers" in options.vary:
        box = options.center_box_m
        if box is None and area.inside is None:
            box = DEFAULT_BOX_M
        if box is not None:
            lower[:2] -= box
            upper[:2] += box
        else:
            assert area.inside is not None
            lower[:2] = area.inside.min(axis=0)[:, None]
            upper[:2] = area.inside.max(axis=0)[:, None]
    if options.radius_m is not None:
        lower[2], upper[2] = _radius_limits(given, options.radius_m)
    if "phases" in options.vary:
        # the first phase only turns the clock
        lower[3, 1:] -= np.pi
        upper[3, 1:] += np.pi
    return Freedom(lower, upper)


def _radius_limits(given: Plan, radii: tuple[float, float]) -> tuple[float, float]:
    """Radii within their own limits and those of speed."""
    limits, (least, most) = given.scenario.limits, radii
    if limits is not None and limits.speed_mps is not None:
        least = max(least, limits.speed_mps[0] / given.orbits.rate)
        most = min(most, limits.speed_mps[1] / given.orbits.rate)
    return least, max(least, most)


def _refuse_conflicts(given: Plan, problem: RefineProblem, options: RefineOptions) -> None:
    """Raise NoSolutionError if constraints rule each other out, whatever the circles."""
    conflicts = _link_conflicts(given, problem, options)
    if problem.area.limited:
        conflicts += _area_conflicts(problem)
    if conflicts:
        rest = f" (and {len(conflicts) - 3} more)" if len(conflicts) > 3 else ""
        raise NoSolutionError(f"constraints conflict: {'; '.join(conflicts[:3])}{rest}")


def _link_conflicts(given: Plan, problem: RefineProblem, options: RefineOptions) -> list[str]:
    """Links, kept or dropped, that range, margin and separation leave no distance for."""
    names, ranges = problem.names, problem.sensors.ranges
    wanted = [(one.a, one.b) for one in given.links]
    wanted += [(one.a, one.b) for one in given.dropped_links]
    conflicts = []
    for a, b in sorted(wanted):
        reach = float(ranges[[a, b]].max())
        margin = options.margin_m or 0.0
        less = f" less margin {margin:g} m" if margin else ""
        if margin >= reach:
            conflicts.append(
                f"link {names[a]}-{names[b]}: margin {margin:g} m leaves nothing of "
                f"range {reach:g} m"
            )
        elif given.scenario.min_separation_m > reach - margin:
            conflicts.append(
                f"link {names[a]}-{names[b]}: separation {problem.min_separation:g} m against "
                f"range {reach:g} m{less}"
            )
    return conflicts


def _area_conflicts(problem: RefineProblem) -> list[str]:
    names, freedom = problem.names, problem.freedom
    conflicts = []
    for k in range(problem.orbits.count):
        low, high = freedom.lower[:, k], freedom.upper[:, k]
        if not problem.area.has_room(float(low[2]), low[:2], high[:2]):
            where = f"x {low[0]:.4g} to {high[0]:.4g}, y {low[1]:.4g} to {high[1]:.4g} m"
            conflicts.append(
                f"{names[k]}: a circle of {low[2]:g} m finds no place inside area_m and clear of "
                f"keep_out_m with its centre in {where}"
            )
    return conflicts


def _with_limits(
    problem: RefineProblem, before: Measurement, options: RefineOptions
) -> RefineProblem:
    """The problem with margins no larger than the plan has, unless they were asked for.

    Landmarks are only to be kept: their margins are never more than the plan has. The window bound
    of the worst vehicle becomes a limit for objectives that may neglect it.
    """
    neglecting = problem.objective in ("trace", "min_eigenvalue")
    contacts = len(problem.pairs) + len(problem.anchors)
    rooms = np.array([one.room for one in before.slacks[:contacts]])
    asked = np.concatenate([problem.pair_margins, problem.anchor_margins])
    held = np.clip(asked + np.minimum(rooms, 0.0), 0.0, None)
    pairs, anchors = np.split(held, [len(problem.pairs)])
    return replace(
        problem,
        window_limit=before.figures.window_bound if neglecting else math.inf,
        pair_margins=pairs if options.margin_m is None else problem.pair_margins,
        anchor_margins=anchors,
    )


# --- search ---------------------------------------------------------------------------------------


def _search(
    given: Plan,
    options: RefineOptions,
    problem: RefineProblem,
    before: Measurement,
    predict: bool,
    workers: int | None,
    progress: RefineProgress | None,
) -> tuple[list["Attempt"], bool]:
    """Attempts from all starts; once more with the window bound as a limit if it got in the way."""
    from syncplan.refining.tasks import RefineTask, run_starts, searched_nearby

    began = time.monotonic()
    task = RefineTask(
        problem=problem,
        rule_phases=_rule_phases(given),
        nudged=not given.observable,
        before=before,
        seed=options.seed,
        predict=predict,
    )

    def report(start: int, at: "SolverProgress") -> None:
        if progress is not None:
            progress(start, at.iteration, _natural(problem, at.objective))

    def run(one: RefineTask) -> tuple[list["Attempt"], bool]:
        left = max(options.time_limit_s - (time.monotonic() - began), 0.0)
        return run_starts(
            one, options.starts, workers=workers or _cores(), time_limit=left, report=report
        )

    attempts, interrupted = run(task)
    over = interrupted or time.monotonic() - began >= options.time_limit_s
    if not over and _stopped_by_window_bound(attempts, before):
        limited = replace(problem, window_limit=before.figures.window_bound)
        again, interrupted = run(replace(task, problem=limited))
        attempts += again
    if not interrupted:
        attempts, interrupted = searched_nearby(task, attempts, began + options.time_limit_s)
    return attempts, interrupted or time.monotonic() - began >= options.time_limit_s


def _natural(problem: RefineProblem, objective: float) -> float:
    """The solver's objective (see syncplan.refining.smooth_objectives) in the figure's units."""
    if problem.objective == "logdet":
        return -objective * 3 * problem.orbits.count
    if problem.objective == "trace":
        return math.exp(min(-objective, 700.0))
    if problem.objective == "min_eigenvalue":
        spread = float(np.mean(1.0 / problem.sensors.bearing_sigmas**2))
        return math.exp(min(-objective, 700.0)) * spread
    return math.exp(min(objective, 700.0)) * problem.scale


def _stopped_by_window_bound(attempts: list["Attempt"], before: Measurement) -> bool:
    """Whether no attempt passes, and some do but for the window bound."""
    if not math.isfinite(before.figures.window_bound):
        return False
    ended = [one.violations for one in attempts if one.after is not None]
    return all(ended) and any(one == (WINDOW_BOUND,) for one in ended)


def _rule_phases(given: Plan) -> Array:
    """Phases on the rules, whatever those of the plan are."""
    pairs = _as_pairs([(link.a, link.b) for link in given.links])
    orbits, scenario = given.orbits, given.scenario
    return synchronise(
        orbits.centers,
        orbits.radii,
        orbits.senses,
        given.sensors.ranges,
        pairs,
        float(orbits.phases[0]),
        scenario.min_separation_m,
    ).phases


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


# --- result ---------------------------------------------------------------------------------------


def _best(
    given: Plan,
    options: RefineOptions,
    problem: RefineProblem,
    before: Measurement,
    attempts: list["Attempt"],
    cut_short: bool,
) -> Plan:
    from syncplan.refining.tasks import rank_of

    objective = problem.objective
    passed = [one for one in attempts if one.after is not None and not one.violations]
    best = min(passed, key=lambda one: rank_of(problem, one), default=None)
    cost = before.figures.cost(objective)
    allowed = cost - _IMPROVED * abs(cost) if math.isfinite(cost) else cost
    better = (
        best is not None and best.after is not None and best.after.figures.cost(objective) < allowed
    )
    record = RefinementRecord(
        options=options,
        objective=objective,
        improved=better,
        reason="" if better else _why_not(attempts, objective, cut_short),
        cut_short=cut_short,
        before=before.figures,
        after=before.figures,
        active=(),
        starts=tuple(_record(one, objective) for one in attempts),
    )
    if not better or best is None or best.after is None or best.circles is None:
        return replace(given, refinement=record)
    record = replace(record, after=best.after.figures, active=_active(best.after))
    orbits = orbits_of(best.circles, given.orbits)
    judged = judge(_moved(given, options, orbits), orbits)
    return replace(judged, refinement=record)


def _record(attempt: "Attempt", objective: Objective) -> StartRecord:
    run, after = attempt.run, attempt.after
    return StartRecord(
        start=attempt.start,
        status=run.status,
        iterations=run.iterations,
        violation=run.violation,
        dual_residual=run.dual_residual,
        value=None if after is None else float(getattr(after.figures, objective)),
        violations=attempt.violations,
        unmet=run.unmet,
    )


def _why_not(attempts: list["Attempt"], objective: Objective, cut_short: bool) -> str:
    if not attempts or all(one.after is None for one in attempts):
        return "time ran out before any start had a result" if cut_short else "no start converged"
    lost = [one.after.figures.rank for one in attempts if one.after is not None]
    if objective in ("logdet", "min_eigenvalue") and all(
        not math.isfinite(one.after.figures.logdet) for one in attempts if one.after is not None
    ):
        return (
            f"no result is observable (rank {max(lost)}), so {objective} can't tell them apart; "
            "give landmarks, or the objective predicted_rms"
        )
    if any(not one.violations for one in attempts if one.after is not None):
        within = " in the time there was" if cut_short else ""
        return f"no start found a better plan than the one given{within}"
    named = Counter(label for one in attempts for label in (*one.run.unmet, *one.violations))
    worst = ", ".join(label for label, _ in named.most_common(3))
    return f"every result violates what the plan met or can't be had: {worst}"


def _active(after: Measurement) -> tuple[str, ...]:
    return tuple(one.label for one in after.slacks if one.room <= _ACTIVE * one.size)


def _still_reachable(given: Plan, orbits: Orbits) -> list[tuple[int, int]]:
    """Dropped links whose circles still come within range."""
    a, b = reachable_pairs(orbits, np.zeros((0, 2)), given.sensors.ranges)
    near = {(min(i, j), max(i, j)) for i, j in zip(a.tolist(), b.tolist(), strict=True)}
    return [(one.a, one.b) for one in given.dropped_links if (one.a, one.b) in near]


def _moved(given: Plan, options: RefineOptions, orbits: Orbits) -> Scenario:
    """The scenario with the circles of the result; its links are written out, so that they stay."""
    scenario = given.scenario
    document = scenario.model_dump(exclude_none=True)
    names = scenario.vehicle_names
    centers = [(float(x), float(y)) for x, y in orbits.centers]
    formation = document["formation"]
    named = isinstance(scenario.formation.centers_m, dict)
    formation["centers_m"] = dict(zip(names, centers, strict=True)) if named else centers
    listed = [(one.a, one.b) for one in given.links]
    listed += _still_reachable(given, orbits)
    formation["links"] = [(names[a], names[b]) for a, b in sorted(listed)]
    if "radii" in options.vary:
        document["orbit"].pop("speed_mps", None)
        document["orbit"]["angular_rate_rad_s"] = float(orbits.rate)
        document["orbit"]["radius_m"] = [float(radius) for radius in orbits.radii]
    document["refine"] = options.model_dump(exclude_none=True)
    return scenario_from(document, max_vehicles=scenario.size)
