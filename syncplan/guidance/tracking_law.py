"""The tracking law: commands from an estimate, towards the plan's present place.

With the plan's present place p and velocity V over ground, estimates marked ^, e = p - p^ and the
estimated velocity of the air w^ (wind and the vehicle's own gust, where these are states),

    u   = V + e kp, at most `closing` m/s of it, - w^        wanted velocity through the air
    v   = |u| cos(turn), not below 0                         turn = direction of u - psi^, wrapped
    w   = k_psi turn + rate at which V - w^ turns

so in steady wind the circle is kept over ground. Near the plan, errors a along and c across follow
a' = -kp a, c'' + k_psi c' + k_psi kp c = 0, which is critically damped at k_psi = 4 kp; this is the
law of Kanayama with K_x = kp, K_theta = k_psi / v and K_y = k_psi kp / v^2. Far from it the vehicle
heads for its place. All estimates are those of the filter, and commands are kept within limits.

Source: Kanayama, Kimura, Miyazaki, Noguchi (1990), A stable tracking control method for an
autonomous mobile robot, equation 8.

To keep in contact, circles move to their anchors where places are uncertain. A vehicle is sure to
meet its anchor while some standard deviations of its place relative to the anchor, in the direction
of the anchor, stay within the slack of their meeting. Otherwise its circle moves towards the anchor
by the difference, and so does every circle anchored in it: a part of the team that has lost its
landmarks moves as one and stays together. Once a sighting has reduced the uncertainty, the circles
return to their places.

Moving takes time. The uncertainty that counts is therefore that of the place `lead` s from now
without a sighting, given the present uncertainty of the air's velocity.
"""

import math

from syncplan.arrays import Array, Index
from syncplan.estimation.correction_kernels import NONE, Correction
from syncplan.estimation.filter_setup import DRIFT, States
from syncplan.estimation.kernels import Lanes, inner, lean
from syncplan.guidance.flight_setup import Circles, Contact, Law

STILL = 0.05
"""Share of the plan's speed below which the direction of V - w^ is meaningless."""


@inner
def command_plan(circles: Circles, commands: Array, lanes: Lanes) -> None:
    """Command the plan's own speeds and turn rates."""
    for i in range(len(circles.radii)):
        for lane in range(len(lanes)):
            commands[i, 0, lane] = circles.rate * circles.radii[i]
            commands[i, 1, lane] = circles.rate * circles.senses[i]


@inner
def _air_at(x: Array, i: int, axis: int, states: States, lane: int) -> float:
    """Velocity of the air at vehicle i along an axis, in m/s."""
    air = 0.0
    for m in range(states.first[i], states.first[i + 1]):
        if states.acts[m] == DRIFT and states.axes[m, 0] == axis:
            air += x[states.columns[m], lane]
    return air


@inner
def track(
    circles: Circles,
    law: Law,
    time: float,
    x: Array,
    states: States,
    moved: Array,
    commands: Array,
    lanes: Lanes,
) -> None:
    """Fill in commands (n, 2, lanes) from the estimate x (3n + e, lanes) at `time` s.

    Circles are `moved` (n, 2, lanes) m from their places.
    """
    for i in range(len(commands)):
        rate, radius = circles.senses[i] * circles.rate, circles.radii[i]
        phase, r = circles.phases[i] + rate * time, 3 * i
        cos, sin = math.cos(phase), math.sin(phase)
        place_x, place_y = (
            circles.centers[i, 0] + radius * cos,
            circles.centers[i, 1] + radius * sin,
        )
        along_x, along_y = -rate * radius * sin, rate * radius * cos
        bent_x, bent_y = -rate * rate * radius * cos, -rate * rate * radius * sin
        still = (STILL * rate * radius) ** 2
        for lane in range(len(lanes)):
            air_x, air_y = _air_at(x, i, 0, states, lane), _air_at(x, i, 1, states, lane)
            near_x = law.place_gain * (place_x + moved[i, 0, lane] - x[r, lane])
            near_y = law.place_gain * (place_y + moved[i, 1, lane] - x[r + 1, lane])
            size = math.sqrt(near_x * near_x + near_y * near_y)
            share = min(1.0, law.closing_speeds[i] / max(size, 1e-12))
            free_x, free_y = along_x - air_x, along_y - air_y
            want_x, want_y = free_x + share * near_x, free_y + share * near_y
            turn = math.atan2(want_y, want_x) - x[r + 2, lane]
            turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
            square = free_x * free_x + free_y * free_y
            ahead = (free_x * bent_y - free_y * bent_x) / square if square > still else rate
            speed = math.sqrt(want_x * want_x + want_y * want_y)
            commands[i, 0, lane] = speed * max(math.cos(turn), 0.0)
            commands[i, 1, lane] = ahead + law.heading_gain * turn


# --- commands within limits -----------------------------------------------------------------------


@lean
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


# --- circles that move to their anchors -----------------------------------------------------------


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
    """Add the dependence of vehicle i's place ahead, in a direction, on states; return the count.

    Common states count only if the place is taken `apart`, not relative to another vehicle.
    """
    for axis in range(2):
        columns[count], entries[count, 0] = 3 * i + axis, sign * toward[axis]
        count += 1
    lead, gust_lead = leads
    for m in range(states.first[i], states.first[i + 1]):
        if states.acts[m] == DRIFT and (apart or not states.common[m]):
            columns[count] = states.columns[m]
            ahead = gust_lead if states.columns[m] >= states.first_changing else lead
            entries[count, 0] = sign * ahead * toward[states.axes[m, 0]]
            count += 1
    return count


@lean
def move_circles(
    contact: Contact,
    states: States,
    P: Array,
    step: int,
    heard: Index,
    moved: Array,
    sought: Index,
    work: Correction,
    lanes: Lanes,
) -> None:
    """Update the shifts `moved` (n, 2, lanes) m of circles from the covariance P, a lower triangle.

    `heard` (n, lanes) are the steps of each vehicle's last processed sighting; `sought` (n, lanes)
    counts steps with a shift of its own; `work` is scratch.
    """
    n, leads, anchors = len(heard), (contact.lead, contact.gust_lead), contact.anchors
    columns, entries = work.columns, work.entries
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
                    spread += entries[a, 0] * entries[b, 0] * P[r, q, lane]
            missing = contact.sigmas * math.sqrt(max(spread, 0.0)) - anchors.slacks[i]
            by = min(max(missing, 0.0), anchors.most[i])
            if step - heard[i, lane] > contact.patience:
                by = anchors.furthest[i]
            if by > 0.0:
                sought[i, lane] += contact.look_every
            for axis in range(2):
                with_anchor = moved[anchor, axis, lane] if anchor < n else 0.0
                moved[i, axis, lane] = with_anchor + by * toward[axis]
