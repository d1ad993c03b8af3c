"""The kernel of a single team that steers: that of `closed_loop`, without the truth."""

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import States
from syncplan.estimation.kernels import Lanes, kernel
from syncplan.flight.flight_setup import Circles, Law
from syncplan.flight.tracking_law import track


@kernel
def steer(
    circles: Circles,
    law: Law,
    time: float,
    x: Array,
    bounds: tuple[Array, Array, Array],
    states: States,
    moved: Array,
    commands: Array,
    lanes: Lanes,
) -> None:
    """Fill in commands (n, 2, lanes) of the tracking law, within bounds (n,).

    `bounds` are the least and largest speeds, and the largest turn rates.
    """
    track(circles, law, time, x, states, moved, commands, lanes)
    least, most, turn = bounds
    for i in range(len(commands)):
        for lane in range(len(lanes)):
            v, w = commands[i, 0, lane], commands[i, 1, lane]
            commands[i, 0, lane] = min(max(v, least[i]), most[i])
            commands[i, 1, lane] = min(max(w, -turn[i]), turn[i])
