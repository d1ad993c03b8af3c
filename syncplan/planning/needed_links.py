"""Whether a team needs the links that it misses, and what it costs to be without them."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from syncplan.errors import NoSolutionError
from syncplan.observability.window_assessment import assess_remainder, assess_team
from syncplan.orbits.sightings import Loss, remainder_of
from syncplan.planning.judged_team import JudgedTeam
from syncplan.runtime.numerics import single_threaded_blas


@dataclass(frozen=True, slots=True)
class WithoutLinks:
    """A team without all sightings of some of its links.

    Attributes
    ----------
    needed : whether the team is not observable without them
    cost : in words, what is predicted of the worst vehicle, and of the one that loses most, with
        them and without; empty where nothing is predicted
    """

    needed: bool
    cost: str


@single_threaded_blas
def without_links(judged: JudgedTeam, links: Collection[tuple[int, int]]) -> WithoutLinks:
    """Return what is left of a team without some links, each a < b, all of them at once.

    Circles and limits are as before: what a verdict may stop anew is observability alone.
    """
    left = remainder_of(judged.team, Loss(links=tuple(links)))
    assessed = assess_team(judged.team, judged.scenario.window)
    observable = assess_remainder(assessed, left).observability.observable
    before = judged.prediction.rms
    if not observable or before is None:
        return WithoutLinks(needed=not observable, cost="")
    from syncplan.estimation.loss_bounds import LossBounds

    bounds = LossBounds.along(judged.team, judged.windows, judged.scenario.duration_s)
    try:
        after = bounds.after(left).rms_second_half()
    except NoSolutionError:
        return WithoutLinks(needed=False, cost="")
    worst = int(np.argmax(after - before))
    name = judged.scenario.vehicle_names[worst]
    cost = f"{before.max():.3g} -> {after.max():.3g} m of the worst vehicle"
    if worst != int(np.argmax(after)):
        cost += f", {before[worst]:.3g} -> {after[worst]:.3g} m of {name}"
    return WithoutLinks(needed=False, cost=cost)
