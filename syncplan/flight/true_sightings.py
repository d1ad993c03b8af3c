"""Who truly sees whom in flight, and what they read.

A target is sighted when it is within range, in view and not hidden, its vehicle's turn to look has
come, and the sighting is neither missed nor lost on its way. Trials differ in that, lanes do not: a
pair that meets in any lane is recorded for all of them, as NaN where there is no sighting.

Numbers of a sighting are those of its key: two normal ones for bearing and distance, one that
decides whether it is made, one that decides whether it is false. A compass has those of its own
vehicle as target.

A vehicle whose clock is off by delta reads what is there delta later, when all go on as in the last
sample; who is in sight is decided by the stamp.
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_setup import (
    BEARING_KIND,
    COMPASS_KIND,
    DISTANCE_KIND,
    FilterSetup,
)
from syncplan.estimation.kernels import Lanes, inner, lean
from syncplan.flight.flight_setup import Eyes, FlightSetup, Flown
from syncplan.flight.keyed_noise import Word, normal_pair, uniform, words_at
from syncplan.orbits.contacts import BOUNDARY_SLACK

HALF_WORD = np.uint64(32)
LOW_HALF = np.uint64(0xFFFFFFFF)


@lean
def sight_truly(
    flight: FlightSetup,
    flown: Flown,
    step: int,
    setup: FilterSetup,
    sightings: Array,
    lanes: Lanes,
) -> None:
    """Record the sightings of a step: of what, in `setup`, and what they read, in `sightings`."""
    eyes, mishaps = flight.eyes, flight.mishaps
    ranges, landmarks, gone = eyes.ranges, eyes.landmarks, mishaps.gone_from
    every, sigmas, blind = eyes.every, eyes.sigmas, mishaps.blind_from
    path, first, n = flown.path, setup.first, len(ranges)
    pose, away = path[step], flown.away
    for o in range(n):
        if gone[o] <= step:
            continue
        bearing = _is_due(every, sigmas, blind, BEARING_KIND, o, step)
        distance = _is_due(every, sigmas, blind, DISTANCE_KIND, o, step)
        compass = _is_due(every, sigmas, blind, COMPASS_KIND, o, step)
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
def _is_due(every: Index, sigmas: Array, blind: Index, kind: int, o: int, step: int) -> bool:
    """Whether a vehicle measures a kind at a step."""
    if not np.isfinite(sigmas[kind, o]) or step % every[kind, o] != 0:
        return False
    return bool(step < blind[kind, o])


@inner
def _is_near(
    pose: Array, landmarks: Array, within: float, o: int, t: int, away: Array, lanes: Lanes
) -> bool:
    """Fill in the way to the target and, as its third, whether it is in range; in any lane."""
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
    """Leave in sight what is in view and not hidden of what is in range; in any lane."""
    found = False
    for lane in range(len(lanes)):
        if away[2, lane] > 0.0 and not _in_view(eyes, o, pose, away[0, lane], away[1, lane], lane):
            away[2, lane] = 0.0
        found |= away[2, lane] > 0.0
    return found


@inner
def _in_view(eyes: Eyes, o: int, pose: Array, dx: float, dy: float, lane: int) -> bool:
    """Whether what is (dx, dy) from vehicle o, and within range, is in view and not hidden."""
    half = eyes.half_views[o]
    if half < math.pi:
        axis = pose[o, 2, lane] + eyes.boresights[o]
        ahead = dx * math.cos(axis) + dy * math.sin(axis)
        if ahead < (math.cos(half) - BOUNDARY_SLACK) * math.sqrt(dx * dx + dy * dy):
            return False
    return not _is_hidden(eyes, pose[o, 0, lane], pose[o, 1, lane], dx, dy)


@inner
def _is_hidden(eyes: Eyes, x: float, y: float, dx: float, dy: float) -> bool:
    """Whether an obstacle is between a place and one (dx, dy) from it: it crosses an edge."""
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
    """Record what vehicle o reads of its own heading."""
    sigma = flight.eyes.sigmas[COMPASS_KIND, o]
    s = _new_row(flown, setup, COMPASS_KIND, o, o, flight.eyes.taken[COMPASS_KIND, o])
    for lane in range(len(lanes)):
        words = words_at(flown.keys[lane], step, o, o)
        noise = normal_pair(words[0], words[1])[0]
        later = flown.clock_offsets[o, lane] / flight.time
        turned = later * (flown.path[step, o, 2, lane] - flown.path[step - 1, o, 2, lane])
        sightings[s, lane] = flown.path[step, o, 2, lane] + turned + sigma * noise


@inner
def _new_row(flown: Flown, setup: FilterSetup, kind: int, o: int, t: int, sigma: float) -> int:
    """Begin a row of sightings; return its number."""
    s = flown.places[1]
    setup.observers[s], setup.targets[s], setup.kinds[s] = o, t, kind
    setup.variances[s] = sigma * sigma
    flown.places[1] += 1
    return int(s)


@lean
def _read(
    flight: FlightSetup,
    flown: Flown,
    step: int,
    pair: tuple[int, int],
    rows: tuple[int, int],
    away: Array,
    sightings: Array,
) -> None:
    """Record what vehicle o reads of body t, where it is in sight.

    `rows` of `sightings` are those of bearing and distance, -1 for one that is not due.
    """
    (o, t), (b, d) = pair, rows
    eyes, mishaps, width = flight.eyes, flight.mishaps, away.shape[1]
    bearing_sigma, distance_sigma = eyes.sigmas[BEARING_KIND, o], eyes.sigmas[DISTANCE_KIND, o]
    shifts = flown.bearing_shifts[min(step, len(flown.bearing_shifts) - 1)]
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
                bearing_read += shifts[o, lane] + bearing_sigma * noise[0]
                distance_read = math.sqrt(dx * dx + dy * dy) + distance_sigma * noise[1]
                flown.seen[o, lane] = step
                if t < len(eyes.ranges):
                    flown.seen[t, lane] = step
        if b >= 0:
            sightings[b, lane] = bearing_read
        if d >= 0:
            sightings[d, lane] = distance_read


@inner
def _further(path: Array, step: int, i: int, later: float, lane: int) -> tuple[float, float, float]:
    """How far vehicle i goes on in `later` samples, m, and turns, rad, as in the last sample."""
    dx = path[step, i, 0, lane] - path[step - 1, i, 0, lane]
    dy = path[step, i, 1, lane] - path[step - 1, i, 1, lane]
    turn = path[step, i, 2, lane] - path[step - 1, i, 2, lane]
    # from the middle of the last sample to the middle of what follows
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
    """The way to what is truly sighted, the direction in view of a false bearing, or 7, and what.

    What is taken for the target is the next vehicle, by number, that is in sight as well.
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
