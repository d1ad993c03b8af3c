"""How vehicles keep in contact: circles move to their anchors where places are uncertain.

A vehicle is sure to meet its anchor while its place relative to it, in the direction of the anchor,
stays known to some standard deviations within the slack of their meeting. Where it is not, its
circle is moved towards the anchor by what is missing, and so is every circle that is anchored in
it: a part of the team that has lost its landmarks moves as one and stays together. As soon as a
sighting has shown where vehicles are, their circles are back in their places.

It takes time to move. So what counts is how well the place would be known `lead` s from now without
a sighting, with the air's velocity as unsure as it is.
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.correction_kernels import NONE, most_entries
from syncplan.estimation.filter_setup import DRIFT, States
from syncplan.estimation.kernels import Lanes, inner, kernel
from syncplan.flight.flight_setup import Contact


@inner
def _add_place(
    i: int,
    sign: float,
    apart: bool,
    states: States,
    leads: tuple[float, float],
    toward: Array,
    columns: Index,
    entries: Array,
    count: int,
) -> int:
    """Add how the place ahead of vehicle i, in a direction, hangs on states; return the count.

    What all vehicles share counts only where the place is taken `apart` from the others'.
    """
    for axis in range(2):
        columns[count], entries[count] = 3 * i + axis, sign * toward[axis]
        count += 1
    lead, gust_lead = leads
    for m in range(states.first[i], states.first[i + 1]):
        if states.acts[m] == DRIFT and (apart or not states.common[m]):
            columns[count] = states.columns[m]
            ahead = gust_lead if states.columns[m] >= states.first_changing else lead
            entries[count] = sign * ahead * toward[states.axes[m, 0]]
            count += 1
    return count


@kernel
def move_circles(
    contact: Contact,
    states: States,
    P: Array,
    step: int,
    heard: Index,
    moved: Array,
    sought: Index,
    lanes: Lanes,
) -> None:
    """Move circles, `moved` (n, 2, lanes) m, by what the covariance P now says, a lower triangle.

    `heard` (n, lanes) are the steps of the last sighting of each vehicle that was taken in;
    `sought` (n, lanes) counts steps.
    """
    n, leads, anchors = len(heard), (contact.lead, contact.gust_lead), contact.anchors
    most = most_entries(states)
    columns, entries = np.zeros(most, dtype=np.int64), np.zeros(most)
    for i in anchors.order:
        anchor, toward = anchors.bodies[i], anchors.toward[i]
        if anchor < 0:
            moved[i] = 0.0
            continue
        apart = anchor >= n
        count = _add_place(i, 1.0, apart, states, leads, toward, columns, entries, NONE)
        if not apart:
            count = _add_place(anchor, -1.0, apart, states, leads, toward, columns, entries, count)
        for lane in range(len(lanes)):
            spread = 0.0
            for a in range(count):
                for b in range(count):
                    r, q = max(columns[a], columns[b]), min(columns[a], columns[b])
                    spread += entries[a] * entries[b] * P[r, q, lane]
            missing = contact.sigmas * math.sqrt(max(spread, 0.0)) - anchors.slacks[i]
            by = min(max(missing, 0.0), anchors.most[i])
            if step - heard[i, lane] > contact.patience:
                by = anchors.furthest[i]
            if by > 0.0:
                sought[i, lane] += contact.look_every
            for axis in range(2):
                with_anchor = moved[anchor, axis, lane] if anchor < n else 0.0
                moved[i, axis, lane] = with_anchor + by * toward[axis]
