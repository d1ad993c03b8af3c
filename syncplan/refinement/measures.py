"""What a refinement is judged by: exact figures of merit, and exact slack of every constraint.

Nothing here is smooth or relaxed: contact windows, sampled sightings, least distances, singular
values and the posterior bound are those of the plan itself. Positions are in the mean radius of
the plan that was refined, whatever radii have become.
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.bounds import posterior_bound, window_bound
from syncplan.observability.window_assessment import Assessment, assess_team
from syncplan.orbits.circles import Orbits
from syncplan.orbits.paths import relative_motion
from syncplan.orbits.separation import closest_approach, least_distances
from syncplan.orbits.sightings import Sightings, sightings_over
from syncplan.planning.figures_of_merit import Figures
from syncplan.refinement.problem import RefineProblem

__all__ = ["WINDOW_BOUND", "Measurement", "Slack", "measure"]


WINDOW_BOUND = "window bound of the worst vehicle"

_TOLERANCE = 1e-6
"""Relative slack of a constraint that counts as met: rounding of what is met exactly."""


@dataclass(frozen=True, slots=True)
class Slack:
    """How far a constraint is from being violated: `room` m, negative where it is.

    `size` m is what the room is to be seen against, `label` says which constraint. What the user
    asked for is `required`; the rest only has to be met where the plan to be refined met it.
    """

    label: str
    room: float
    size: float
    required: bool

    @property
    def met(self) -> bool:
        """Whether the constraint holds, up to rounding."""
        return self.room >= -_TOLERANCE * self.size


@dataclass(frozen=True, slots=True)
class Measurement:
    """Figures of merit and the slack of every constraint of one plan."""

    figures: Figures
    slacks: tuple[Slack, ...]

    def violations(self, before: "Measurement") -> list[str]:
        """Return labels of constraints that this violates though it must not.

        Those that are required or that `before` met, and those that it violates more than `before`.
        """
        labels = [
            after.label
            for after, first in zip(self.slacks, before.slacks, strict=True)
            if not after.met
            and (after.required or first.met or after.room < first.room - _TOLERANCE * first.size)
        ]
        limit = before.figures.window_bound * (1.0 + _TOLERANCE)
        if self.figures.window_bound > limit:
            labels.append(WINDOW_BOUND)
        if self.figures.rank < before.figures.rank:
            labels.append("rank")
        if before.figures.certified and not self.figures.certified:
            labels.append("certificate")
        return labels


def measure(problem: RefineProblem, orbits: Orbits, *, predict: bool = True) -> Measurement:
    """Return the figures and slacks of orbits; `predict` computes the posterior bound."""
    from syncplan.refinement.objective_forms import FORMS, MeasuredTeam

    team = problem.team.on(orbits)
    assessed = assess_team(team, problem.window)
    # judged as the plan is, in its own mean radius; measured in that of the plan refined
    judged, scaled = assessed.observability, assessed.measured_in(problem.scale)
    rms = _predicted(problem, assessed) if predict else np.full(team.count, np.nan)
    measured = MeasuredTeam(judged.observable, scaled.singular_values**2, rms)
    nearest = closest_approach(orbits)
    seen = assessed.sightings
    if problem.contact_span > problem.window:
        seen = sightings_over(team, assessed.windows, problem.contact_span)
    margins = contact_margins(problem, orbits, seen)
    figures = Figures(
        rank=judged.rank,
        certified=assessed.certificate.holds,
        window_bound=float(window_bound(judged).max()) if judged.observable else math.inf,
        least_distance=nearest.distance if nearest is not None else math.inf,
        contact_margin=min(margins, default=math.inf),
        objectives={name: form.exact(measured) for name, form in FORMS.items()},
    )
    slacks = [
        *_contact_slacks(problem, margins),
        *_separation_slacks(problem, orbits),
        *_circle_slacks(problem, orbits),
    ]
    return Measurement(figures, tuple(slacks))


def _predicted(problem: RefineProblem, assessed: Assessment) -> Array:
    """(n,) m: the posterior bound over the second half; infinite where it breaks down."""
    try:
        bound = posterior_bound(assessed.team, assessed.windows, problem.duration)
    except NoSolutionError:
        return np.full(assessed.team.count, np.inf)
    return bound.rms_second_half()


def contact_margins(problem: RefineProblem, orbits: Orbits, sightings: Sightings) -> list[float]:
    """Return by how many m each pair, then landmark, to be kept is within range for its samples.

    The samples needed are the best ones: with three needed, the third best counts. Minus the
    range where there are too few.
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
    wanted = np.concatenate([problem.pairs, problem.anchors])
    needed = np.concatenate([problem.pair_samples, problem.anchor_samples]).astype(int)
    order = np.lexsort((sightings.steps, key))
    key, room, steps = key[order], room[order], sightings.steps[order]
    margins = []
    for (one, other), samples in zip(wanted.tolist(), needed.tolist(), strict=True):
        begin, end = np.searchsorted(key, [one * bodies + other, one * bodies + other + 1])
        # both ways at one moment are one sample
        _, moment = np.unique(steps[begin:end], return_inverse=True)
        best = np.full(int(moment.max()) + 1 if end > begin else 0, -np.inf)
        np.maximum.at(best, moment, room[begin:end])
        best = np.sort(best)[::-1]
        reach = float(sensors.ranges[one])
        margins.append(float(best[samples - 1]) if len(best) >= samples else -reach)
    return margins


def _contact_slacks(problem: RefineProblem, found: list[float]) -> list[Slack]:
    names = problem.names
    wanted = np.concatenate([problem.pairs, problem.anchors]).tolist()
    asked = np.concatenate([problem.pair_margins, problem.anchor_margins]).tolist()
    return [
        Slack(
            f"contact of {names[a]}-{names[b]}",
            room - margin,
            float(problem.sensors.ranges[a]),
            problem.margins_required and b < problem.orbits.count,
        )
        for (a, b), margin, room in zip(wanted, asked, found, strict=True)
    ]


def _separation_slacks(problem: RefineProblem, orbits: Orbits) -> list[Slack]:
    """Of every pair that could come below the separation, however the circles move."""
    floor, names = problem.min_separation, problem.names
    pairs = problem.guarded_pairs()
    if len(pairs) == 0:
        return []
    motion = relative_motion(orbits, pairs[:, 0], pairs[:, 1])
    least, _ = least_distances(motion)
    return [
        Slack(
            f"separation of {names[a]}-{names[b]} ({floor:.3g} m)",
            float(distance) - floor,
            floor,
            problem.separation_required,
        )
        for (a, b), distance in zip(pairs.tolist(), least, strict=True)
    ]


def _circle_slacks(problem: RefineProblem, orbits: Orbits) -> list[Slack]:
    """Areas, boxes and radii of each vehicle."""
    names, freedom = problem.names, problem.freedom
    slacks = []
    if problem.area.limited:
        clear = problem.area.clearances(orbits.centers, orbits.radii)
        slacks += [
            Slack(f"area of {names[k]}", float(clear[k]), float(orbits.radii[k]), True)
            for k in range(orbits.count)
        ]
    held = np.concatenate([orbits.centers.T, orbits.radii[None]])
    room = np.minimum(held - freedom.lower[:3], freedom.upper[:3] - held)
    free = freedom.free[:3]
    for k in range(orbits.count):
        for what, rows in (("box", slice(0, 2)), ("radius", slice(2, 3))):
            if free[rows, k].any() and np.isfinite(room[rows, k][free[rows, k]]).any():
                least = float(room[rows, k][free[rows, k]].min())
                size = float((freedom.upper - freedom.lower)[rows, k][free[rows, k]].min()) / 2.0
                slacks.append(Slack(f"{what} of {names[k]}", least, size, True))
    return slacks
