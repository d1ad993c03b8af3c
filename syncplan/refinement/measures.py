"""What a refinement is judged by: exact figures of merit, and the margin of every constraint.

Nothing here is smooth or relaxed: contact windows, sampled sightings, least distances, singular
values and the posterior bound are those of the plan itself. Positions are in the mean radius of
the plan that is refined, even where radii have changed.
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import NoSolutionError
from syncplan.estimation.bounds import posterior_bound, window_bound
from syncplan.observability.window_assessment import Assessment, assess_team
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import closest_approach
from syncplan.orbits.sightings import sightings_over
from syncplan.planning.distance_limits import TOLERANCE
from syncplan.planning.figures_of_merit import Figures
from syncplan.refinement.constraint_margins import (
    ConstraintMargin,
    contact_margins,
    margins_of,
)
from syncplan.refinement.problem import RefineProblem

Standing = tuple[float, float]
"""Shortfall, cost; the lesser is the better."""

NO_STANDING: Standing = (math.inf, math.inf)
"""Of what is no plan at all."""

WINDOW_BOUND = "window bound of the worst vehicle"


@dataclass(frozen=True, slots=True)
class Measurement:
    """Figures of merit of one plan, and how far it is from violating each constraint."""

    figures: Figures
    margins: tuple[ConstraintMargin, ...]

    @property
    def shortfall(self) -> float:
        """What distances fall short of, as shares of what is asked, up to rounding; 0 if met."""
        short = sum(one.shortfall for one in self.margins if one.stops)
        return round(short / TOLERANCE) * TOLERANCE

    def standing(self, objective: str) -> Standing:
        """Return the key by which measurements are ordered: what is too near, then the cost."""
        return self.shortfall, self.figures.cost(objective)

    def violations(self, before: "Measurement") -> list[str]:
        """Return the labels of constraints that this plan violates although it must not.

        It must not violate what is required or what `before` met, nor anything more than `before`.
        The window bound is not compared where this plan clears what `before` came too near to.
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
    from syncplan.refinement.objective_forms import FORMS, MeasuredTeam

    team = problem.team.on(orbits)
    assessed = assess_team(team, problem.window)
    # judged as the plan is, in its own mean radius; measured in that of the plan refined
    judged, scaled = assessed.observability, assessed.measured_in(problem.scale)
    rms = _predicted(problem, assessed) if predict else np.full(team.count, np.nan)
    bounds = window_bound(judged) if judged.observable else np.full(team.count, np.inf)
    measured = MeasuredTeam(judged.observable, scaled.singular_values**2, bounds, rms)
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


def _predicted(problem: RefineProblem, assessed: Assessment) -> Array:
    """(n,) m: the posterior bound over the second half; infinite where it breaks down."""
    try:
        bound = posterior_bound(assessed.team, assessed.windows, problem.duration)
    except NoSolutionError:
        return np.full(assessed.team.count, np.inf)
    return bound.rms_second_half()
