"""Kernels of a single team that steers: its circles kept in contact, and its next commands.

They are those of `closed_loop`, for one lane and without the truth.
"""

from syncplan.arrays import Array, Index
from syncplan.estimation.lane_filter import Lanes, compiled
from syncplan.flight.flight_setup import Circles, Contact, Law
from syncplan.flight.seeking import move_circles
from syncplan.flight.tracking_law import track


@compiled
def keep_contact(
    contact: Contact,
    states: Index,
    P: Array,
    step: int,
    heard: Index,
    moved: Array,
    sought: Index,
    lanes: Lanes,
) -> None:
    """Move circles as `seeking` has it."""
    move_circles(contact, states, P, step, heard, moved, sought, lanes)


@compiled
def steer(
    circles: Circles,
    law: Law,
    bounds: tuple[Array, Array, Array],
    time: float,
    x: Array,
    errors: Array,
    columns: Index,
    moved: Array,
    commands: Array,
    lanes: Lanes,
) -> None:
    """Fill in commands (n, 2, lanes) of the tracking law, within bounds (n,).

    `bounds` are the least and largest speeds, and the largest turn rates.
    """
    track(circles, law, time, x, errors, columns, moved, commands, lanes)
    least, most, turn = bounds
    for i in range(len(x)):
        for lane in range(len(lanes)):
            v, w = commands[i, 0, lane], commands[i, 1, lane]
            commands[i, 0, lane] = min(max(v, least[i]), most[i])
            commands[i, 1, lane] = min(max(w, -turn[i]), turn[i])
