"""How vehicles truly move: they obey commands late, with noise and errors, in moving air.

A command (v, w), air speed and turn rate, is kept within the limits. The response follows it with a
first-order lag. Over a sample T the vehicle flies the exact arc of its mean response,

    commanded    v = (1 + scale) (response - noise),    w = response - noise + bias
    measured     v = (1 + scale) response,              w = response + bias

and drifts with the air by T (wind + gust). Its reading is the mean response, with the noise where
readings are measured: what the filter makes of it, (1 + scale) v and w + bias, is off by the noise.

A vehicle that is held stands still over ground as far as its limits and the air let it: it
commands the least speed that it can fly and, if that is not zero, its largest turn rate.
"""

import math

from syncplan.arrays import Array, Index
from syncplan.estimation.kernels import Lanes, inner
from syncplan.estimation.motion_kernels import shortening
from syncplan.flight.flight_setup import FlightSetup, Flown

NEAR_SHARE = 1e-3
"""Of the range between two limits: so near to one a command is at it."""


@inner
def is_held(held_from: Index, held_until: Index, i: int, step: int) -> bool:
    """Return whether vehicle i is held at a step."""
    held = False
    for k in range(held_from.shape[1]):
        held |= held_from[i, k] <= step < held_until[i, k]
    return held


@inner
def _obey(flight: FlightSetup, flown: Flown, i: int, step: int, lanes: Lanes) -> None:
    """Keep the commands of vehicle i within its limits, and count where they are at one."""
    vehicles, mishaps = flight.response, flight.mishaps
    least, most, turn = (
        vehicles.least_speeds[i],
        vehicles.most_speeds[i],
        vehicles.most_turn_rates[i],
    )
    late = 2 * step > flight.steps
    held = is_held(mishaps.held_from, mishaps.held_until, i, step)
    there = mishaps.gone_from[i] > step
    for lane in range(len(lanes)):
        v, w = flown.commands[i, 0, lane], flown.commands[i, 1, lane]
        if held:
            v, w = least, (turn if least > 0.0 else 0.0)
        v, w = min(max(v, least), most), min(max(w, -turn), turn)
        flown.commands[i, 0, lane], flown.commands[i, 1, lane] = v, w
        if held or not there:
            continue
        near = NEAR_SHARE * (most - least)
        if v <= least + near or v >= most - near or abs(w) >= turn - NEAR_SHARE * 2.0 * turn:
            flown.saturated[i, lane] += 1
        if late:
            flown.slowest[i, lane] = min(flown.slowest[i, lane], v)
            flown.fastest[i, lane] = max(flown.fastest[i, lane], v)


@inner
def move_truly(
    flight: FlightSetup,
    flown: Flown,
    step: int,
    speeds: Array,
    turn_rates: Array,
    lanes: Lanes,
) -> None:
    """Move all vehicles through the sample that begins at `step`; fill in readings (n, lanes)."""
    time, vehicles = flight.time, flight.response
    air = flown.drift[min(step, len(flown.drift) - 1)]
    noisy = 0.0 if vehicles.measured else 1.0
    for i in range(len(flown.scales)):
        _obey(flight, flown, i, step, lanes)
        before, after = flown.path[step, i], flown.path[step + 1, i]
        drift = air[min(i, len(air) - 1)]
        for lane in range(len(lanes)):
            v, w = flown.commands[i, 0, lane], flown.commands[i, 1, lane]
            late_v, late_w = flown.responses[i, 0, lane] - v, flown.responses[i, 1, lane] - w
            flown.responses[i, 0, lane] = v + vehicles.left * late_v
            flown.responses[i, 1, lane] = w + vehicles.left * late_w
            v, w = v + vehicles.mean_left * late_v, w + vehicles.mean_left * late_w
            noise_v = vehicles.speed_sigma * flown.speed_noise[step, i, lane]
            noise_w = vehicles.turn_rate_sigma * flown.turn_noise[step, i, lane]
            speeds[i, lane] = v + (1.0 - noisy) * noise_v
            turn_rates[i, lane] = w + (1.0 - noisy) * noise_w
            done = (1.0 + flown.scales[i, lane]) * (v - noisy * noise_v)
            turn = (w - noisy * noise_w + flown.turn_biases[i, lane]) * time
            chord = done * time * shortening(0.5 * turn, 0)[0]
            ahead = before[2, lane] + 0.5 * turn
            after[0, lane] = before[0, lane] + chord * math.cos(ahead) + time * drift[0, lane]
            after[1, lane] = before[1, lane] + chord * math.sin(ahead) + time * drift[1, lane]
            after[2, lane] = before[2, lane] + turn
