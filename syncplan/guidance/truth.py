"""The truth in flight: motion of vehicles, their sightings and their readings.

A target is sighted when it is within range, in view and not hidden, a sighting is due, and it is
neither missed nor lost on its way. Sightings differ between trials, but all lanes share their
rows: a pair that meets in any lane is recorded for all of them, as NaN where there is no sighting.

The random numbers of a sighting are those of its key: two normal ones for bearing and distance, one
that decides whether it is made, one that decides whether it is false. A compass has those of its
own vehicle as target.

A vehicle whose clock is off by delta measures the scene delta later, with all motion continued as
in the last sample; the stamp decides which bodies are in sight.

Vehicles obey commands late, with noise and errors, in moving air. A command (v, w), air speed and
turn rate, is kept within the limits. The response follows it with a first-order lag. Over a sample
T the vehicle flies the exact arc of its mean response,

    commanded    v = (1 + scale) (response - noise),    w = response - noise + bias
    measured     v = (1 + scale) response,              w = response + bias

and drifts with the air by T (wind + gust). Its reading is the mean response, with the noise where
readings are measured: the filter's motion from it, (1 + scale) v and w + bias, is off by the noise.

A held vehicle stands still over ground as far as its limits and the air allow: it commands the
least speed that it can fly and, if that is not zero, its largest turn rate.
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_setup import BEARING_KIND, COMPASS_KIND, DISTANCE_KIND, FilterSetup
from syncplan.estimation.kernels import Lanes, inner, linked
from syncplan.estimation.motion_kernels import shortening
from syncplan.guidance.flight_setup import Eyes, FlightSetup, Flown
from syncplan.guidance.keyed_noise import Word, normal_pair, uniform, words_at
from syncplan.orbits.contacts import BOUNDARY_SLACK

# --- motion ---------------------------------------------------------------------------------------


NEAR_SHARE = 1e-3
"""Share of the range between two limits within which a command is at one of them."""


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
    least, most = vehicles.least_speeds[i], vehicles.most_speeds[i]
    turn = vehicles.most_turn_rates[i]
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
    flight: FlightSetup, flown: Flown, step: int, speeds: Array, turn_rates: Array, lanes: Lanes
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


HALF_WORD = np.uint64(32)
LOW_HALF = np.uint64(0xFFFFFFFF)


@linked
def sight_truly(
    flight: FlightSetup, flown: Flown, step: int, setup: FilterSetup, sightings: Array, lanes: Lanes
) -> None:
    """Record the sightings of a step: their bodies in `setup`, their values in `sightings`."""
    eyes, mishaps = flight.eyes, flight.mishaps
    ranges, landmarks, gone = eyes.ranges, eyes.landmarks, mishaps.gone_from
    path, first, n = flown.path, setup.first, len(ranges)
    pose, away = path[step], flown.away
    for o in range(n):
        if gone[o] <= step:
            continue
        bearing = _is_due(flight, BEARING_KIND, o, step)
        distance = _is_due(flight, DISTANCE_KIND, o, step)
        compass = _is_due(flight, COMPASS_KIND, o, step)
        for t in range(n + len(landmarks)):
            if t == o:
                if compass:
                    _read_compass(flight, flown, step, o, setup, sightings, lanes)
                continue
            if gone[t] <= step or not (bearing or distance):
                continue
            near = _is_near(pose, landmarks, ranges[o], o, t, away, lanes)
            if near and _look(eyes, pose, o, away, lanes):
                b, d, taken = -1, -1, eyes.taken
                if bearing:
                    b = _new_row(flown, setup, BEARING_KIND, o, t, taken[BEARING_KIND, o])
                if distance:
                    d = _new_row(flown, setup, DISTANCE_KIND, o, t, taken[DISTANCE_KIND, o])
                _read(flight, flown, step, (o, t), (b, d), away, sightings)
    first[step + 1] = flown.places[1]
    seen, longest = flown.seen, flown.longest
    for i in range(n):
        if gone[i] <= step:
            continue
        for lane in range(len(lanes)):
            longest[i, lane] = max(longest[i, lane], step - seen[i, lane])


@inner
def _is_due(flight: FlightSetup, kind: int, o: int, step: int) -> bool:
    """Whether a vehicle measures a kind at a step."""
    eyes = flight.eyes
    if not np.isfinite(eyes.sigmas[kind, o]) or step % eyes.every[kind, o] != 0:
        return False
    return bool(step < flight.mishaps.blind_from[kind, o])


@inner
def _is_near(
    pose: Array, landmarks: Array, within: float, o: int, t: int, away: Array, lanes: Lanes
) -> bool:
    """Fill in `away`: way to the target, and whether in range; return whether in any lane."""
    n, found = len(pose), 0.0
    reach = (within * (1.0 + BOUNDARY_SLACK)) ** 2
    for lane in range(len(lanes)):
        if t < n:
            x, y = pose[t, 0, lane], pose[t, 1, lane]
        else:
            x, y = landmarks[t - n, 0], landmarks[t - n, 1]
        dx, dy = x - pose[o, 0, lane], y - pose[o, 1, lane]
        near = 1.0 if dx * dx + dy * dy <= reach else 0.0
        away[0, lane], away[1, lane], away[2, lane] = dx, dy, near
        found += near
    return bool(found > 0.0)


@inner
def _look(eyes: Eyes, pose: Array, o: int, away: Array, lanes: Lanes) -> bool:
    """Clear in `away` targets out of view or hidden; return whether any lane keeps one."""
    found = False
    for lane in range(len(lanes)):
        if away[2, lane] > 0.0 and not _in_view(eyes, o, pose, away[0, lane], away[1, lane], lane):
            away[2, lane] = 0.0
        found |= away[2, lane] > 0.0
    return found


@inner
def _in_view(eyes: Eyes, o: int, pose: Array, dx: float, dy: float, lane: int) -> bool:
    """Whether a body (dx, dy) from vehicle o, and within range, is in view and not hidden."""
    half = eyes.half_views[o]
    if half < math.pi:
        axis = pose[o, 2, lane] + eyes.boresights[o]
        ahead = dx * math.cos(axis) + dy * math.sin(axis)
        if ahead < (math.cos(half) - BOUNDARY_SLACK) * math.sqrt(dx * dx + dy * dy):
            return False
    return not _is_hidden(eyes, pose[o, 0, lane], pose[o, 1, lane], dx, dy)


@inner
def _is_hidden(eyes: Eyes, x: float, y: float, dx: float, dy: float) -> bool:
    """Whether the way (dx, dy) from a place crosses an obstacle or has its middle inside one."""
    for k in range(len(eyes.first_corner) - 1):
        begin, end = eyes.first_corner[k], eyes.first_corner[k + 1]
        before, inside = end - 1, False
        mid_x, mid_y = x + 0.5 * dx, y + 0.5 * dy
        for c in range(begin, end):
            ax, ay = eyes.corners[before, 0], eyes.corners[before, 1]
            bx, by = eyes.corners[c, 0], eyes.corners[c, 1]
            side_a, side_b = dx * (ay - y) - dy * (ax - x), dx * (by - y) - dy * (bx - x)
            ex, ey = bx - ax, by - ay
            side_s, side_e = ex * (y - ay) - ey * (x - ax), ex * (y + dy - ay) - ey * (x + dx - ax)
            if side_a * side_b < 0.0 and side_s * side_e < 0.0:
                return True
            if (ay > mid_y) != (by > mid_y) and mid_x < ax + ex * (mid_y - ay) / ey:
                inside = not inside
            before = c
        if inside:
            return True
    return False


@inner
def _read_compass(
    flight: FlightSetup,
    flown: Flown,
    step: int,
    o: int,
    setup: FilterSetup,
    sightings: Array,
    lanes: Lanes,
) -> None:
    """Record the compass reading of vehicle o."""
    sigma = flight.eyes.sigmas[COMPASS_KIND, o]
    s = _new_row(flown, setup, COMPASS_KIND, o, o, flight.eyes.taken[COMPASS_KIND, o])
    for lane in range(len(lanes)):
        words = words_at(flown.keys[lane], step, o, o)
        noise = normal_pair(words[0], words[1])[0]
        later = flown.clock_offsets[o, lane] / flight.time
        turned = later * (flown.path[step, o, 2, lane] - flown.path[step - 1, o, 2, lane])
        read = flown.path[step, o, 2, lane] + turned + sigma * noise
        sightings[s, lane] = read + _shift(flown.shifts[COMPASS_KIND], step, o, lane)


@inner
def _shift(shifts: Array, step: int, o: int, lane: int) -> float:
    """Error added to a kind of sighting that vehicle o makes at a step."""
    return float(shifts[min(step, len(shifts) - 1), o, lane])


@inner
def _new_row(flown: Flown, setup: FilterSetup, kind: int, o: int, t: int, sigma: float) -> int:
    """Begin a row of sightings; return its number."""
    s = flown.places[1]
    setup.observers[s], setup.targets[s], setup.kinds[s] = o, t, kind
    setup.variances[s] = sigma * sigma
    flown.places[1] += 1
    return int(s)


@linked
def _read(
    flight: FlightSetup,
    flown: Flown,
    step: int,
    pair: tuple[int, int],
    rows: tuple[int, int],
    away: Array,
    sightings: Array,
) -> None:
    """Record the readings of body t by vehicle o, where it is in sight.

    `rows` of `sightings` are those of bearing and distance, -1 for one that is not due.
    """
    (o, t), (b, d) = pair, rows
    eyes, mishaps, width = flight.eyes, flight.mishaps, away.shape[1]
    bearing_sigma, distance_sigma = eyes.sigmas[BEARING_KIND, o], eyes.sigmas[DISTANCE_KIND, o]
    bearing_shifts, distance_shifts = flown.shifts[BEARING_KIND], flown.shifts[DISTANCE_KIND]
    made = eyes.detection[o] * (1.0 - mishaps.dropout)
    for lane in range(width):
        bearing_read, distance_read = np.nan, np.nan
        if away[2, lane] > 0.0:
            words = words_at(flown.keys[lane], step, o, t)
            if uniform(words[2]) < made:
                noise = normal_pair(words[0], words[1])
                dx, dy, thrown, shown = _misread(
                    flight, flown.path, step, words[3], pair, away, lane
                )
                psi, later = flown.path[step, o, 2, lane], flown.clock_offsets[o, lane]
                if later != 0.0:
                    later /= flight.time
                    gone_x, gone_y, turned = _further(flown.path, step, o, later, lane)
                    psi += turned
                    dx, dy = dx - gone_x, dy - gone_y
                    if shown < len(eyes.ranges):
                        gone_x, gone_y, _ = _further(flown.path, step, shown, later, lane)
                        dx, dy = dx + gone_x, dy + gone_y
                bearing_read = math.atan2(dy, dx) - psi
                if thrown < 2.0 * math.pi:
                    bearing_read = eyes.boresights[o] + thrown
                shift = _shift(bearing_shifts, step, o, lane)
                bearing_read += shift + bearing_sigma * noise[0]
                distance_read = math.sqrt(dx * dx + dy * dy) + distance_sigma * noise[1]
                distance_read += _shift(distance_shifts, step, o, lane)
                flown.seen[o, lane] = step
                if t < len(eyes.ranges):
                    flown.seen[t, lane] = step
        if b >= 0:
            sightings[b, lane] = bearing_read
        if d >= 0:
            sightings[d, lane] = distance_read


@inner
def _further(path: Array, step: int, i: int, later: float, lane: int) -> tuple[float, float, float]:
    """Way, m, and turn, rad, of vehicle i in `later` samples, continued as in the last one."""
    dx = path[step, i, 0, lane] - path[step - 1, i, 0, lane]
    dy = path[step, i, 1, lane] - path[step - 1, i, 1, lane]
    turn = path[step, i, 2, lane] - path[step - 1, i, 2, lane]
    # from the middle of the last sample to the middle of the continuation
    cos, sin = math.cos(0.5 * turn * (1.0 + later)), math.sin(0.5 * turn * (1.0 + later))
    return later * (cos * dx - sin * dy), later * (sin * dx + cos * dy), later * turn


@inner
def _misread(
    flight: FlightSetup,
    path: Array,
    step: int,
    word: Word,
    pair: tuple[int, int],
    away: Array,
    lane: int,
) -> tuple[float, float, float, int]:
    """Way to the true target, direction in view of a false bearing (7: none), and that target.

    The vehicle mistaken for the target is the next one, by number, that is also in sight.
    """
    eyes, mishaps, pose, (o, t) = flight.eyes, flight.mishaps, path[step], pair
    chance = float(word >> HALF_WORD) / 4294967296.0
    where = (float(word & LOW_HALF) + 0.5) / 4294967296.0
    dx, dy = away[0, lane], away[1, lane]
    if chance < mishaps.outliers:
        return dx, dy, (2.0 * where - 1.0) * min(eyes.half_views[o], math.pi), t
    if chance < mishaps.outliers + mishaps.mistaken:
        n = len(eyes.ranges)
        for ahead in range(1, n):
            other = (t + ahead) % n
            if other in (o, t) or mishaps.gone_from[other] <= step:
                continue
            x, y = pose[other, 0, lane] - pose[o, 0, lane], pose[other, 1, lane] - pose[o, 1, lane]
            within = x * x + y * y <= eyes.ranges[o] ** 2
            if within and _in_view(eyes, o, pose, x, y, lane):
                return x, y, 7.0, other
    return dx, dy, 7.0, t
