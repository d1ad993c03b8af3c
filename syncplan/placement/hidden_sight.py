"""Sight in a drawing: which links and sightings obstacles hide, whatever senses and phases follow.

Circles within range need not see each other past an obstacle. No step of a drawing's improvement
looks at that; of the drawings that meet all demands, the one that hides least is taken.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import find_windows, outer_gaps
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.team import Team
from syncplan.placement.demands import Demands
from syncplan.placement.drawing import Drawing
from syncplan.synchronisation.contact_tables import seeing_team
from syncplan.synchronisation.sighted_phases import hidden_at_all_phases


def hidden_pairs(drawing: Drawing, links: Index) -> Index:
    """Return (k, 2) bodies within range that obstacles hide from each other at all phases.

    They are among the (e, 2) links and the drawing's sightings; bodies from n on are landmarks.
    """
    demands = drawing.demands
    if not demands.obstacles:
        return np.zeros((0, 2), dtype=np.int64)
    team = _seeing(demands, drawing.centers)
    reach = demands.ranges[links].max(axis=1)
    near = links[outer_gaps(drawing.centers, demands.radii, links) <= reach]
    vehicles, landmarks = drawing.sightings.T
    targets = demands.count + landmarks
    unseen = np.diff(find_windows(team, (vehicles, targets)).first) == 0
    sightings = np.column_stack([vehicles, targets])
    return np.concatenate([near[hidden_at_all_phases(team, near)], sightings[unseen]])


def _seeing(demands: Demands, centers: Array) -> Team:
    """The vehicles with all-round views, whose senses and phases are yet to be found."""
    count = demands.count
    orbits = Orbits(centers, demands.radii, np.ones(count), np.zeros(count), 1.0)
    sensors = Sensors(
        demands.ranges, np.full(count, 2.0 * np.pi), np.zeros(count), np.ones(count), 1.0
    )
    return seeing_team(orbits, sensors, demands.obstacles, demands.landmarks)
