"""Exact measures of a refinement: figures of merit, and the margin of every constraint.

Nothing here is smooth or relaxed: contact windows, sampled sightings, least distances, singular
values and the posterior bound are those of the plan itself. Positions are in the mean radius of
the plan that is refined, even where radii have changed.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.bounds import posterior_bound, window_bound
from syncplan.observability.rank import Assessment, assess_team
from syncplan.orbits.circles import Orbits, relative_motion
from syncplan.orbits.contacts import (
    closest_approach,
    find_windows,
    landmark_gaps,
    least_distances,
    met_pairs,
)
from syncplan.orbits.sightings import Sightings, sightings_over
from syncplan.planning.judged_team import TOLERANCE
from syncplan.refinement.problem import WINDOW_BOUND, RefineProblem
from syncplan.scenario.objectives import Figures
from syncplan.synchronisation.contact_tables import contact_tolerances

# --- margins --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ConstraintMargin:
    """Margin of one constraint.

    Attributes
    ----------
    label : name of the constraint
    room : m to the limit, or a share of the area; negative beyond it
    size : scale with which the room is compared, in the same unit
    required : whether the user gave it; any other has to be met only if the plan to be refined
        meets it
    stops : whether a plan that violates it must not be flown
    """

    label: str
    room: float
    size: float
    required: bool
    stops: bool = False

    @property
    def met(self) -> bool:
        """Whether the constraint holds, up to rounding."""
        return self.room >= -TOLERANCE * self.size

    @property
    def shortfall(self) -> float:
        """Share of the constraint's size by which it is violated; 0 where it is met."""
        return 0.0 if self.met else -self.room / self.size

    def smaller_than(self, other: "ConstraintMargin") -> bool:
        """Return whether there is less room than in `other`, by more than rounding."""
        return self.room < other.room - TOLERANCE * other.size


def margins_of(
    problem: RefineProblem, orbits: Orbits, contact: list[float]
) -> tuple[ConstraintMargin, ...]:
    """Return the margins of orbits: contacts, distances, the purpose, circles.

    `contact` is the result of `contact_margins`. The order does not depend on the orbits.
    """
    return (
        *_contacts(problem, contact),
        *_separations(problem, orbits),
        *_clearances(problem, orbits),
        *_purpose(problem, orbits),
        *_circles(problem, orbits),
    )


def contact_margins(problem: RefineProblem, orbits: Orbits, sightings: Sightings) -> list[float]:
    """Return the margins in m by which the contacts to be kept stay within range, in their order.

    A contact has to stay within range for as many samples as it needs, of which the best count:
    with three needed, the third best. Minus the range where there are too few.
    """
    n, sensors = orbits.count, problem.sensors
    a = np.minimum(sightings.observers, sightings.targets)
    b = np.maximum(sightings.observers, sightings.targets)
    tau = sightings.steps.astype(float) * (orbits.rate * sensors.sample_time)
    motion = relative_motion(orbits, sightings.observers, sightings.targets, problem.landmarks)
    away = motion.at(tau[:, None])[:, 0]
    room = sensors.ranges[sightings.observers] - np.hypot(away[:, 0], away[:, 1])
    bodies = n + len(problem.landmarks)
    key = a * bodies + b
    kept, needed = problem.kept, problem.kept_samples.astype(int)
    order = np.lexsort((sightings.steps, key))
    key, room, steps = key[order], room[order], sightings.steps[order]
    margins = []
    for (one, other), samples in zip(kept.tolist(), needed.tolist(), strict=True):
        begin, end = np.searchsorted(key, [one * bodies + other, one * bodies + other + 1])
        # both directions of sight at one moment are one sample
        _, moment = np.unique(steps[begin:end], return_inverse=True)
        best = np.full(int(moment.max()) + 1 if end > begin else 0, -np.inf)
        np.maximum.at(best, moment, room[begin:end])
        best = np.sort(best)[::-1]
        reach = float(sensors.ranges[one])
        margins.append(float(best[samples - 1]) if len(best) >= samples else -reach)
    return margins


def _contacts(problem: RefineProblem, contact: list[float]) -> list[ConstraintMargin]:
    """Margins of all contacts to be kept."""
    names = problem.names
    return [
        ConstraintMargin(
            f"contact of {names[a]}-{names[b]}",
            room - margin,
            float(problem.sensors.ranges[a]),
            problem.margins_required and b < problem.orbits.count,
        )
        for (a, b), margin, room in zip(
            problem.kept.tolist(), problem.kept_margins.tolist(), contact, strict=True
        )
    ]


def _separations(problem: RefineProblem, orbits: Orbits) -> list[ConstraintMargin]:
    """Margins of all pairs that could come nearer than the separation, however circles move."""
    pairs, names = problem.guarded_pairs(), problem.names
    if len(pairs) == 0:
        return []
    floor = max(problem.min_separation, problem.separation_limit.least(orbits.radii))
    motion = relative_motion(orbits, pairs[:, 0], pairs[:, 1])
    least, _ = least_distances(motion)
    return [
        ConstraintMargin(
            f"separation of {names[a]}-{names[b]} ({floor:.3g} m)",
            float(distance) - floor,
            floor,
            bool(problem.separation_limit.stated),
            stops=True,
        )
        for (a, b), distance in zip(pairs.tolist(), least, strict=True)
    ]


def _clearances(problem: RefineProblem, orbits: Orbits) -> list[ConstraintMargin]:
    """Margins of all vehicles and landmarks that could come nearer than the clearance.

    None is required: bounds may leave no way to clear a landmark that the plan passes too closely.
    """
    names, count = problem.names, orbits.count
    floor = problem.landmark_limit.least(orbits.radii)
    gaps = landmark_gaps(orbits.centers, orbits.radii, problem.landmarks)
    return [
        ConstraintMargin(
            f"clearance of {names[k]} from {names[count + landmark]} ({floor:.3g} m)",
            float(gaps[k, landmark]) - floor,
            floor,
            required=False,
            stops=True,
        )
        for k, landmark in problem.guarded_landmarks().tolist()
    ]


def _purpose(problem: RefineProblem, orbits: Orbits) -> list[ConstraintMargin]:
    """Margin of the purpose, which is to be served to the last digit; a plan may just miss it."""
    purpose = problem.purpose
    if purpose is None:
        return []
    room = purpose.room(orbits.centers, orbits.radii) - TOLERANCE * purpose.size
    return [ConstraintMargin("purpose", room, purpose.size, required=False, stops=True)]


def _circles(problem: RefineProblem, orbits: Orbits) -> list[ConstraintMargin]:
    """Margins of the area, the box and the radius of each vehicle."""
    names, freedom = problem.names, problem.freedom
    margins = []
    if problem.area.limited:
        clear = problem.area.path_clearances(orbits.centers, orbits.radii).min(axis=0)
        margins += [
            ConstraintMargin(f"area of {names[k]}", float(clear[k]), float(radius), True, True)
            for k, radius in enumerate(orbits.radii)
        ]
    held = np.concatenate([orbits.centers.T, orbits.radii[None]])
    room = np.minimum(held - freedom.lower[:3], freedom.upper[:3] - held)
    free = freedom.free[:3]
    for k in range(orbits.count):
        for what, rows in (("box", slice(0, 2)), ("radius", slice(2, 3))):
            if free[rows, k].any() and np.isfinite(room[rows, k][free[rows, k]]).any():
                least = float(room[rows, k][free[rows, k]].min())
                size = float((freedom.upper - freedom.lower)[rows, k][free[rows, k]].min()) / 2.0
                margins.append(ConstraintMargin(f"{what} of {names[k]}", least, size, True))
    return margins


# --- measurements ---------------------------------------------------------------------------------


Standing = tuple[float, float]
"""(shortfall, cost); smaller is better."""

NO_STANDING: Standing = (math.inf, math.inf)
"""Worst standing: that of a candidate that is no valid plan."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """Figures of merit of one plan, and its margin of each constraint."""

    figures: Figures
    margins: tuple[ConstraintMargin, ...]

    @property
    def shortfall(self) -> float:
        """Total shortfall of distances, as shares of those required, up to rounding; 0 if met."""
        short = sum(one.shortfall for one in self.margins if one.stops)
        return round(short / TOLERANCE) * TOLERANCE

    def standing(self, objective: str) -> Standing:
        """Return the key that orders measurements: shortfall of distances, then cost."""
        return self.shortfall, self.figures.cost(objective)

    def violations(self, before: "Measurement") -> list[str]:
        """Return the labels of the constraints that this plan must meet but violates.

        It must not violate what is required or what `before` met, nor anything more than `before`.
        The window bound is not compared where this plan has a smaller shortfall than `before`.
        """
        labels = [
            after.label
            for after, first in zip(self.margins, before.margins, strict=True)
            if not after.met and (after.required or first.met or after.smaller_than(first))
        ]
        limit = before.figures.window_bound * (1.0 + TOLERANCE)
        if self.figures.window_bound > limit and self.shortfall >= before.shortfall:
            labels.append(WINDOW_BOUND)
        if self.figures.rank < before.figures.rank:
            labels.append("rank")
        if before.figures.certified and not self.figures.certified:
            labels.append("certificate")
        return labels


def measure(problem: RefineProblem, orbits: Orbits, *, predict: bool = True) -> Measurement:
    """Return the figures and margins of orbits; `predict` computes the posterior bound."""
    from syncplan.refinement.nlp import FORMS, MeasuredTeam

    team = problem.team.on(orbits)
    assessed = assess_team(team, problem.window)
    # judged like any plan, in its own mean radius; measured in that of the plan to be refined
    judged, scaled = assessed.observability, assessed.measured_in(problem.scale)
    rms = _predicted(problem, assessed) if predict else np.full(team.count, np.nan)
    bounds = window_bound(judged) if judged.observable else np.full(team.count, np.inf)
    measured = MeasuredTeam(judged.observable, scaled.singular_values**2, rms)
    nearest = closest_approach(orbits)
    seen = assessed.sightings
    if problem.contact_span > problem.window:
        seen = sightings_over(team, assessed.windows, problem.contact_span)
    contact = contact_margins(problem, orbits, seen)
    figures = Figures(
        rank=judged.rank,
        certified=assessed.certificate.holds,
        window_bound=float(bounds.max()),
        least_distance=nearest.distance if nearest is not None else math.inf,
        contact_margin=min(contact, default=math.inf),
        objectives={name: form.exact(measured) for name, form in FORMS.items()},
    )
    return Measurement(figures, margins_of(problem, orbits, contact))


def with_meetings(problem: RefineProblem, orbits: Orbits, figures: Figures) -> Figures:
    """Return the figures with those of meetings, which the search does without: they take long.

    Tolerance and widest meeting are those of the links that the problem keeps.
    """
    team = problem.team.on(orbits)
    pairs = problem.kept[problem.kept[:, 1] < team.count]
    least, _ = least_distances(relative_motion(orbits, pairs[:, 0], pairs[:, 1]))
    return replace(
        figures,
        meetings=len(met_pairs(team, find_windows(team))),
        least_tolerance=float(np.min(contact_tolerances(team, pairs), initial=math.inf)),
        widest_meeting=float(np.max(least)) if len(pairs) else math.inf,
    )


def _predicted(problem: RefineProblem, assessed: Assessment) -> Array:
    """Posterior bound (n,) in m over the second half; infinite where the recursion fails."""
    try:
        bound = posterior_bound(assessed.team, assessed.windows, problem.duration)
    except NoSolutionError:
        return np.full(assessed.team.count, np.inf)
    return bound.rms_second_half()
