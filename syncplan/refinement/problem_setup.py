"""Setup of the problem from a plan and options: bounds, margins, separation, and conflicts.

Limits that the scenario and the options leave open come from the plan, so that a refinement never
gives up what the plan has.
"""

import math
from dataclasses import replace

import numpy as np

from syncplan.arrays import as_pairs
from syncplan.errors import NoSolutionError
from syncplan.orbits.sightings import sightings_over
from syncplan.phrases import Places
from syncplan.planning.judged_team import landmark_limit, purpose_measure, separation_limit
from syncplan.planning.plans import Plan
from syncplan.refinement.measures import Measurement, measure
from syncplan.refinement.problem import Freedom, RefineProblem, circles_of
from syncplan.scenario.areas import Area
from syncplan.scenario.models import DEFAULT_BOX_M, RefineOptions
from syncplan.scenario.objectives import OBJECTIVES, Objective, default_objective

PAIR_SAMPLES, ANCHOR_SAMPLES = 3, 2
"""Samples in contact that a vehicle link of rank 3 and a landmark link of rank 2 need."""

DEFAULT_MARGIN = 0.02
"""Share of the range by which contact stays within it where no margin is given."""

FIELD_POINTS = 1000
"""Number of points of the area's grid that the solver sees, about."""

SAFE_SHARE = 0.5
"""Share of the mean radius: the largest separation that is kept where none is given."""


def problem_of(given: Plan, options: RefineOptions) -> RefineProblem:
    """Return the problem that a plan and options pose; margins not given are at most the plan's."""
    problem = _problem_as_given(given, options)
    return _with_limits(problem, measure(problem, given.orbits, predict=False), options)


def _problem_as_given(given: Plan, options: RefineOptions) -> RefineProblem:
    scenario, sensors = given.scenario, given.sensors
    area = Area.of(scenario.area_m, scenario.keep_out_m)
    samples = _samples_in_contact(given)
    links = [(one.a, one.b) for one in (*given.links, *given.landmark_links)]
    kept = as_pairs([pair for pair in links if pair in samples])
    of_vehicles = kept[:, 1] < given.team.count
    # as many samples as the rank needs, or as the plan has, if fewer
    wanted = np.where(of_vehicles, PAIR_SAMPLES, ANCHOR_SAMPLES)
    had = np.array([samples[a, b] for a, b in kept.tolist()], dtype=float)
    margins = DEFAULT_MARGIN * np.append(sensors.ranges, np.zeros(len(given.landmarks)))[kept].max(
        axis=1
    )
    if options.margin_m is not None:
        margins[of_vehicles] = options.margin_m
    return RefineProblem(
        names=(*scenario.vehicle_names, *scenario.landmark_names),
        team=given.team,
        window=scenario.window,
        duration=scenario.duration_s,
        freedom=_freedom(given, options, area),
        objective=_objective(options, given.orbits.count),
        kept=kept,
        kept_samples=np.minimum(wanted, had),
        kept_margins=margins,
        margins_required=options.margin_m is not None,
        min_separation=_separation(given),
        separation_limit=separation_limit(scenario),
        landmark_limit=landmark_limit(scenario),
        area=area,
        purpose=purpose_measure(scenario, FIELD_POINTS),
        window_limit=math.inf,
    )


def _objective(options: RefineOptions, count: int) -> Objective:
    """Objective given, or the default for a team of this size."""
    if options.objective is not None:
        return OBJECTIVES[options.objective]
    return default_objective(count)


def _samples_in_contact(given: Plan) -> dict[tuple[int, int], int]:
    """Number of samples at which each pair (a < b) is in contact, over at least a period."""
    span = max(given.scenario.window, given.orbits.period)
    seen = sightings_over(given.team, given.windows, span)
    a, b = np.minimum(seen.observers, seen.targets), np.maximum(seen.observers, seen.targets)
    moments = np.unique(np.column_stack([a, b, seen.steps]), axis=0)
    pairs, counts = np.unique(moments[:, :2], axis=0, return_counts=True)
    return {(int(i), int(j)): int(k) for (i, j), k in zip(pairs, counts, strict=True)}


def _separation(given: Plan) -> float:
    """Least separation in m: as given, or else the plan's, up to half its mean radius.

    Bearings are most informative from nearby: without a floor, refinement would fly vehicles into
    each other.
    """
    required = given.scenario.separation
    if required > 0.0 or given.approach is None:
        return required
    return min(given.approach.distance, SAFE_SHARE * float(given.orbits.radii.mean()))


def _freedom(given: Plan, options: RefineOptions, area: Area) -> Freedom:
    """Bounds of the values that vary; all others stay fixed, as does the first vehicle's phase."""
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
        # changing the first phase as well would only shift time 0
        lower[3, 1:] -= np.pi
        upper[3, 1:] += np.pi
    return Freedom(lower, upper)


def _radius_limits(given: Plan, radii: tuple[float, float]) -> tuple[float, float]:
    """Least and largest radius in m within the radii given and the limits of speed."""
    limits, (least, most) = given.scenario.limits, radii
    if limits is not None and limits.speed_mps is not None:
        least = max(least, limits.speed_mps[0] / given.orbits.rate)
        most = min(most, limits.speed_mps[1] / given.orbits.rate)
    return least, most


def refuse_conflicts(given: Plan, problem: RefineProblem, options: RefineOptions) -> None:
    """Raise NoSolutionError if constraints conflict, so that no circles can meet them all."""
    conflicts = [*_speed_conflicts(given, options), *_link_conflicts(given, problem, options)]
    if problem.area.limited:
        conflicts += _area_conflicts(problem)
    if conflicts:
        rest = f" (and {len(conflicts) - 3} more)" if len(conflicts) > 3 else ""
        raise NoSolutionError(f"constraints conflict: {'; '.join(conflicts[:3])}{rest}")


def _speed_conflicts(given: Plan, options: RefineOptions) -> list[str]:
    """Conflict of radii that are all flown at speeds outside the limits."""
    limits, rate = given.scenario.limits, given.orbits.rate
    if options.radius_m is None or limits is None or limits.speed_mps is None:
        return []
    slowest, fastest = (rate * radius for radius in options.radius_m)
    if slowest <= limits.speed_mps[1] and fastest >= limits.speed_mps[0]:
        return []
    return [
        f"radii of {options.radius_m[0]:g} to {options.radius_m[1]:g} m at {rate:g} rad/s mean "
        f"{slowest:g} to {fastest:g} m/s against limits.speed_mps {limits.speed_mps[0]:g} to "
        f"{limits.speed_mps[1]:g}"
    ]


def _link_conflicts(given: Plan, problem: RefineProblem, options: RefineOptions) -> list[str]:
    """Conflicts of links, kept or dropped, without any distance between separation and range."""
    names, ranges = problem.names, problem.sensors.ranges
    listed = [(one.a, one.b) for one in given.links]
    listed += [(one.a, one.b) for one in given.dropped_links]
    conflicts = []
    for a, b in sorted(listed):
        reach = float(ranges[[a, b]].max())
        margin = options.margin_m or 0.0
        less = f" less margin {margin:g} m" if margin else ""
        if margin >= reach:
            conflicts.append(
                f"link {names[a]}-{names[b]}: margin {margin:g} m leaves nothing of "
                f"range {reach:g} m"
            )
        elif given.scenario.separation > reach - margin:
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
        if not problem.area.has_room((float(low[2]), float(high[2])), low[:2], high[:2]):
            ends = low[:2].tolist(), high[:2].tolist()
            where = " to ".join(f"({Places(ends).words(end)})" for end in ends)
            conflicts.append(
                f"{names[k]}: no place for a circle of {low[2]:g} m inside area_m and clear of "
                f"keep_out_m with its centre from {where} m"
            )
    return conflicts


def _with_limits(
    problem: RefineProblem, before: Measurement, options: RefineOptions
) -> RefineProblem:
    """Problem with margins that the plan meets, except given ones of vehicle links.

    For objectives that neglect it, the window bound of the worst vehicle becomes a constraint,
    unless the plan itself falls short of a least distance.
    """
    rooms = np.array([one.room for one in before.margins[: len(problem.kept)]])
    held = np.clip(problem.kept_margins + np.minimum(rooms, 0.0), 0.0, None)
    limited = problem.objective.neglects_window_bound and before.shortfall == 0.0
    of_vehicles = problem.kept[:, 1] < problem.orbits.count
    stated = of_vehicles & (options.margin_m is not None)
    return replace(
        problem,
        window_limit=before.figures.window_bound if limited else math.inf,
        kept_margins=np.where(stated, problem.kept_margins, held),
    )
