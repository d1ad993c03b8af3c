"""How vehicles keep in contact: circles move to their anchors where places are uncertain.

A vehicle is sure to meet its anchor while its place relative to it, in the direction of the anchor,
stays known to some standard deviations within the slack of their meeting. Where it is not, its
circle is moved towards the anchor by what is missing, and so is every circle that is anchored in
it: a part of the team that has lost its landmarks moves as one and stays together. As soon as a
sighting has told where vehicles are, their circles are back in their places.

It takes time to move. So what counts is how well the place would be known `lead` s from now without
a sighting, with the air's velocity as unsure as it is.
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_frame import GUST, WIND
from syncplan.estimation.lane_filter import Lanes, compiled, inner
from syncplan.flight.flight_setup import Contact

MOST_ENTRIES = 10
"""Of a row: places of both, the wind, gusts of both."""


@inner
def _fill_row(
    states: Index,
    i: int,
    anchor: int,
    leads: tuple[float, float],
    toward: Array,
    row: tuple[Index, Array],
) -> int:
    """Fill in how the distance ahead of vehicle i from its anchor hangs on states; how many do."""
    (columns, entries), (lead, gust_lead) = row, leads
    n, count = len(states), 0
    for axis in range(2):
        columns[count], entries[count] = 3 * i + axis, toward[axis]
        count += 1
        if states[i, GUST + axis] >= 0:
            columns[count], entries[count] = states[i, GUST + axis], gust_lead * toward[axis]
            count += 1
        if anchor < n:
            columns[count], entries[count] = 3 * anchor + axis, -toward[axis]
            count += 1
            if states[anchor, GUST + axis] >= 0:
                columns[count] = states[anchor, GUST + axis]
                entries[count] = -gust_lead * toward[axis]
                count += 1
        elif states[i, WIND + axis] >= 0:
            columns[count], entries[count] = states[i, WIND + axis], lead * toward[axis]
            count += 1
    return count


@compiled
def move_circles(
    contact: Contact,
    states: Index,
    P: Array,
    step: int,
    heard: Index,
    moved: Array,
    sought: Index,
    lanes: Lanes,
) -> None:
    """Move circles, `moved` (n, 2, lanes) m, by what the covariance P now says, a lower triangle.

    `states` are the columns of AugmentedSetup, `heard` (n, lanes) the steps of the last sighting of
    each vehicle that was taken in; `sought` (n, lanes) counts steps.
    """
    n = len(states)
    leads = contact.lead, contact.gust_lead
    row = np.zeros(MOST_ENTRIES, dtype=np.int64), np.zeros(MOST_ENTRIES)
    for i in contact.order:
        anchor, toward = contact.anchors[i], contact.toward[i]
        if anchor < 0:
            moved[i] = 0.0
            continue
        count = _fill_row(states, i, anchor, leads, toward, row)
        columns, entries = row
        for lane in range(len(lanes)):
            spread = 0.0
            for a in range(count):
                for b in range(count):
                    r, q = max(columns[a], columns[b]), min(columns[a], columns[b])
                    spread += entries[a] * entries[b] * P[r, q, lane]
            missing = contact.sigmas * math.sqrt(max(spread, 0.0)) - contact.slacks[i]
            by = min(max(missing, 0.0), contact.most[i])
            if step - heard[i, lane] > contact.patience:
                by = contact.furthest[i]
            if by > 0.0:
                sought[i, lane] += contact.look_every
            for axis in range(2):
                with_anchor = moved[anchor, axis, lane] if anchor < n else 0.0
                moved[i, axis, lane] = with_anchor + by * toward[axis]
