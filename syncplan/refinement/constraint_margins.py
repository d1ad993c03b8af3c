"""How far circles are from violating each constraint, by the exact code."""

from dataclasses import dataclass

import numpy as np

from syncplan.orbits.circles import Orbits, relative_motion
from syncplan.orbits.contacts import landmark_gaps, least_distances
from syncplan.orbits.sightings import Sightings
from syncplan.planning.distance_limits import TOLERANCE
from syncplan.refinement.problem import RefineProblem


@dataclass(frozen=True, slots=True)
class ConstraintMargin:
    """How far one constraint is from being violated.

    Attributes
    ----------
    label : which constraint it is
    room : m to the limit, negative beyond it
    size : m that the room is compared with
    required : whether the user gave it; one that is not required only has to be met if the plan
        to be refined meets it
    stops : whether a plan that violates it is not to be flown
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
    """Return the margins of orbits: contacts, as `contact_margins` has them, distances, circles.

    Their order does not depend on the orbits.
    """
    return (
        *_contacts(problem, contact),
        *_separations(problem, orbits),
        *_clearances(problem, orbits),
        *_circles(problem, orbits),
    )


def contact_margins(problem: RefineProblem, orbits: Orbits, sightings: Sightings) -> list[float]:
    """Return by how many m each pair, then each landmark, to be kept stays within range.

    It has to for as many samples as it needs, of which the best count: with three needed, the third
    best. Minus the range where there are too few.
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
    kept = np.concatenate([problem.pairs, problem.anchors])
    needed = np.concatenate([problem.pair_samples, problem.anchor_samples]).astype(int)
    order = np.lexsort((sightings.steps, key))
    key, room, steps = key[order], room[order], sightings.steps[order]
    margins = []
    for (one, other), samples in zip(kept.tolist(), needed.tolist(), strict=True):
        begin, end = np.searchsorted(key, [one * bodies + other, one * bodies + other + 1])
        # both ways at one moment are one sample
        _, moment = np.unique(steps[begin:end], return_inverse=True)
        best = np.full(int(moment.max()) + 1 if end > begin else 0, -np.inf)
        np.maximum.at(best, moment, room[begin:end])
        best = np.sort(best)[::-1]
        reach = float(sensors.ranges[one])
        margins.append(float(best[samples - 1]) if len(best) >= samples else -reach)
    return margins


def _contacts(problem: RefineProblem, contact: list[float]) -> list[ConstraintMargin]:
    """Of every pair and landmark whose contact is kept."""
    names = problem.names
    kept = np.concatenate([problem.pairs, problem.anchors]).tolist()
    required = np.concatenate([problem.pair_margins, problem.anchor_margins]).tolist()
    return [
        ConstraintMargin(
            f"contact of {names[a]}-{names[b]}",
            room - margin,
            float(problem.sensors.ranges[a]),
            problem.margins_required and b < problem.orbits.count,
        )
        for (a, b), margin, room in zip(kept, required, contact, strict=True)
    ]


def _separations(problem: RefineProblem, orbits: Orbits) -> list[ConstraintMargin]:
    """Of every pair that could come nearer than the separation, however the circles move."""
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
    """Of every vehicle and landmark that could come nearer than the clearance.

    None is required: bounds may leave no way to clear a landmark that the plan passes too near.
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


def _circles(problem: RefineProblem, orbits: Orbits) -> list[ConstraintMargin]:
    """Of the area, the box and the radius of each vehicle."""
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
