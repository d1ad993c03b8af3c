"""Contact tables: contact time of a link in a turn, at every phase difference.

The relative motion of two vehicles and their views depend only on the difference of their
time-phases. So each link has one curve: contact time against the residual of its rule, found from
exact contact windows. The curve does not depend on the pair's place or orientation, so pairs of
equal geometry share it. A pair whose sight an obstacle may block has its own.

A phase tolerance is the shift of a phase at which contact or separation is lost. Shifting either
phase of a pair has the same effect, up to a shift of time. Only one of them shifts here; where both
do, they share the tolerance.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import NO_LANDMARKS, Orbits
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.noise import Noise
from syncplan.orbits.sight_lines import obstructible
from syncplan.orbits.team import Sensors, Team
from syncplan.synchronisation.phase_rules import Rules, closest_distance, phase_residuals, rules_of

SAMPLES = 1440
"""Number of residuals in a table."""

_STEP, _STEP_MANY = 4, 12
"""Stride of the residuals at which windows are found; the second is for more than a hundred links.
Near the longest contact all are found, and everywhere if those of the stride have no contact."""

_MANY = 100
_AROUND = 16
"""Number of residuals to either side of the best at which all windows are found."""

_DIGITS = 12
_CACHED = 2048
_TURN = 2.0 * np.pi
_NO_NOISE = Noise(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ContactTables:
    """Contact of e links, in either direction, over the residual of their rules.

    Attributes
    ----------
    share : (e, k) contact time over `attainable`, at residuals 2 pi j / k; 0 where there is none
    attainable : (e,) longest contact over all residuals, as a share of a period
    """

    share: Array
    attainable: Array

    def at(self, residual: Array) -> Array:
        """Return the shares (e, j) at residuals (e, j) rad, interpolated."""
        samples = self.share.shape[1]
        place = np.mod(residual, _TURN) * (samples / _TURN)
        below = np.floor(place).astype(np.int64)
        part, rows = place - below, np.arange(len(residual))[:, None]
        left = self.share[rows, below % samples]
        return np.asarray(left + part * (self.share[rows, (below + 1) % samples] - left))


def seeing_team(
    orbits: Orbits,
    sensors: Sensors,
    obstacles: tuple[Array, ...] = (),
    landmarks: Array = NO_LANDMARKS,
) -> Team:
    """Return a noise-free team for the computation of contacts."""
    return Team(orbits, landmarks, sensors, _NO_NOISE, obstacles=obstacles)


def tabulated_contact(rules: Rules, team: Team) -> ContactTables:
    """Return the contact tables of the links of `rules`; the team's own phases do not matter."""
    share, attainable = np.zeros((len(rules), SAMPLES)), np.zeros(len(rules))
    step = _STEP if len(rules) <= _MANY else _STEP_MANY
    senses, own_place = team.orbits.senses, obstructible(team, rules.a, rules.b)
    for link, (a, b) in enumerate(rules.edges):
        if own_place[link]:
            theta = np.array([rules.offset[link], 0.0])
            two = team.only(np.array([a, b]))
            by_rule = replace(two.orbits, phases=two.orbits.senses * theta, rate=1.0)
            share[link], attainable[link] = _tabulated(_contact_of(two.on(by_rule)), step)
            continue
        pair = (
            rules.distance[link],
            rules.radius_a[link],
            rules.radius_b[link],
            senses[a],
            senses[b],
            *(float(values[k]) for values in _seeing(team.sensors) for k in (a, b)),
        )
        # rounded before they are used, so that all pairs that share a table compute the same one
        share[link], attainable[link] = _table(tuple(float(f"{x:.{_DIGITS}g}") for x in pair), step)
    return ContactTables(share, attainable)


def _seeing(sensors: Sensors) -> tuple[Array, Array, Array]:
    return sensors.ranges, sensors.fields_of_view, sensors.boresights


@lru_cache(maxsize=_CACHED)
def _table(pair: tuple[float, ...], step: int) -> tuple[Array, float]:
    """Share and attainable contact of a pair, given by its geometry and sensors alone."""
    distance, *rest = pair
    radii, senses, ranges, views, boresights = np.array(rest).reshape(5, 2)
    # the centre of b lies along +x: at phases (0, pi), or (0, pi) mirrored, the rule holds
    orbits = Orbits(
        np.array([[0.0, 0.0], [distance, 0.0]]), radii, senses, np.array([0.0, np.pi]), 1.0
    )
    sensors = Sensors(ranges, views, boresights, np.ones(2), 1.0)
    return _tabulated(_contact_of(seeing_team(orbits, sensors)), step)


def _tabulated(contact: Callable[[Array], Array], step: int) -> tuple[Array, float]:
    """Share (k,) over the residual, and attainable share of a period, of one pair."""
    fine = np.linspace(0.0, _TURN, SAMPLES, endpoint=False)
    coarse = fine[::step]
    found = contact(coarse)
    if found.max() > 0.0:
        table = np.interp(fine, np.append(coarse, _TURN), np.append(found, found[0]))
        near = (step * np.argmax(found) + np.arange(-_AROUND, _AROUND + 1)) % SAMPLES
        table[near] = contact(fine[near])
    else:
        table = contact(fine)
    attainable = float(table.max())
    share = table / attainable if attainable > 0.0 else table
    share.flags.writeable = False
    return share, attainable


def _contact_of(team: Team) -> Callable[[Array], Array]:
    """Function from residuals (k,) rad to contact (k,) of a team of two, as shares of a period.

    The team's phases must meet its rule.
    """
    senses = team.orbits.senses
    both = np.array([[0, 1]])

    def contact(residual: Array) -> Array:
        # theta_a - theta_b grows as theta_b falls
        shift = -senses[1] * residual[None]
        return _time_in_either(windows_when_shifted(team, both, shift), len(residual)) / _TURN

    return contact


def windows_when_shifted(team: Team, pairs: Index, shift: Array) -> Windows:
    """Return the windows of pairs (e, 2) whose second vehicle's phase shifts by (e, k) rad.

    The first e k are those in which the first vehicle sees the second, the next e k the reverse.
    """
    number = shift.shape[1]
    first, second = np.repeat(pairs[:, 0], number), np.repeat(pairs[:, 1], number)
    index = np.concatenate([first, second])
    late = np.concatenate([np.zeros(len(first)), shift.ravel()])
    copies = team.only(index)
    shifted = replace(copies.orbits, phases=copies.orbits.phases + late)
    one, other = np.arange(len(first)), len(first) + np.arange(len(first))
    ways = (np.concatenate([one, other]), np.concatenate([other, one]))
    return find_windows(replace(copies, orbits=shifted, landmarks=NO_LANDMARKS), ways)


def seen_when_shifted(team: Team, pairs: Index, shift: Array) -> Flags:
    """Return (e, k) whether either of a pair sees the other at shifts of the second's phase."""
    met = np.diff(windows_when_shifted(team, pairs, shift).first) > 0
    return np.asarray((met[: shift.size] | met[shift.size :]).reshape(shift.shape))


def _time_in_either(windows: Windows, count: int) -> Array:
    """Time (count,) in rad, at rate 1, in which either vehicle of a pair sees the other."""
    row = np.repeat(np.arange(2 * count), np.diff(windows.first)) % count
    late = windows.ends > _TURN
    row = np.concatenate([row, row[late]])
    begins = np.concatenate([windows.starts, np.zeros(int(late.sum()))])
    ends = np.concatenate([np.minimum(windows.ends, _TURN), windows.ends[late] - _TURN])
    who, when = np.concatenate([row, row]), np.concatenate([begins, ends])
    step = np.repeat([1, -1], len(row))
    order = np.lexsort((-step, when, who))
    who, when = who[order], when[order]
    seen = np.cumsum(step[order])[:-1] > 0  # each row's steps sum to zero
    return np.asarray(np.bincount(who[:-1], np.diff(when) * seen, minlength=count), dtype=float)


def contact_of_pairs(team: Team, pairs: Index) -> Array:
    """Return the shares (e,) of a period in which either vehicle of pairs (e, 2) sees the other."""
    if len(pairs) == 0:
        return np.zeros(0)
    turning = team.on(replace(team.orbits, rate=1.0))
    windows = windows_when_shifted(turning, pairs, np.zeros((len(pairs), 1)))
    return _time_in_either(windows, len(pairs)) / _TURN


# --- tolerances ---------------------------------------------------------------------------------


_SHIFTS = 64
_PARTS, _DIVISIONS = np.linspace(0.0, 1.0, 9), 12

_STEPS = 400
_RESOLUTION = 1e-6
"""Step in rad below which separation_tolerances ends."""


def rule_residuals(orbits: Orbits, pairs: Index) -> Array:
    """Return the residuals (e,) in [-pi, pi) rad of the phases of pairs (e, 2) from their rules."""
    return phase_residuals(rules_of(orbits, np.zeros(orbits.count), pairs), orbits.phases)


def contact_tolerances(team: Team, pairs: Index) -> Array:
    """Return the smallest shift (e,) in rad of either phase, either way, that loses all contact.

    Pi where no shift does. The first loss is bracketed in steps of pi / 64; the step is then
    divided by eight again and again.
    """
    tolerance = np.full(len(pairs), np.pi)
    if len(pairs) == 0:
        return tolerance
    shifts = np.linspace(0.0, np.pi, _SHIFTS + 1)
    sides = np.array([1.0, -1.0])
    both = np.broadcast_to((sides[:, None] * shifts).ravel(), (len(pairs), 2 * len(shifts)))
    kept = _contact_when_shifted(team, pairs)(both).reshape(len(pairs), 2, -1)
    pair, side = np.nonzero(~kept.all(axis=2))
    first = np.argmin(kept[pair, side], axis=1)
    low, high = shifts[np.maximum(first - 1, 0)], shifts[first]
    in_contact = _contact_when_shifted(team, pairs[pair])
    place = np.arange(len(pair))
    for _ in range(_DIVISIONS if len(pair) else 0):
        tried = low[:, None] + (high - low)[:, None] * _PARTS
        lost = ~in_contact(sides[side][:, None] * tried[:, 1:-1])
        first = np.where(lost.any(axis=1), np.argmax(lost, axis=1), len(_PARTS) - 2)
        low, high = tried[place, first], tried[place, first + 1]
    np.minimum.at(tolerance, pair, low)
    return tolerance


def _contact_when_shifted(team: Team, pairs: Index) -> Callable[[Array], Flags]:
    """Function from shifts (e, k) rad of the second vehicle's phase to whether pairs still meet."""
    orbits, sensors = team.orbits, team.sensors
    if not np.all(sensors.fields_of_view >= 2.0 * np.pi):
        return lambda shift: seen_when_shifted(team, pairs, shift)
    rules = rules_of(orbits, sensors.ranges, pairs)
    residual, reach = phase_residuals(rules, orbits.phases)[:, None], rules.reach[:, None]
    hindered = np.flatnonzero(obstructible(team, pairs[:, 0], pairs[:, 1]))

    def met(shift: Array) -> Flags:
        found = np.asarray(closest_distance(rules, residual + shift) <= reach)
        if len(hindered):
            found[hindered] = seen_when_shifted(team, pairs[hindered], shift[hindered])
        return found

    return met


def separation_tolerances(orbits: Orbits, pairs: Index, distance: float) -> Array:
    """Return the shift (e,) rad of either phase, either way, up to which pairs stay apart.

    Apart means by `distance` m. Pi where any shift keeps them apart; 0 where they are nearer
    already. With a distance of 0 it is the shift at which they collide. A shift of a phase by s
    moves its vehicle by at most R s, so a step of the least distance beyond `distance`, over R,
    can't miss a conflict. The result errs on the safe side.
    """
    if len(pairs) == 0:
        return np.zeros(0)
    rules = rules_of(orbits, np.zeros(orbits.count), pairs)
    residual = phase_residuals(rules, orbits.phases)[:, None]
    sides = np.array([1.0, -1.0])
    lever = np.minimum(rules.radius_a, rules.radius_b)[:, None]
    shift = np.zeros((len(pairs), 2))
    for _ in range(_STEPS):
        spare = closest_distance(rules, residual + sides * shift) - distance
        step = np.where(shift < np.pi, np.maximum(spare, 0.0) / lever, 0.0)
        shift = np.minimum(shift + step, np.pi)
        if step.max() < _RESOLUTION:
            break
    return np.asarray(shift.min(axis=1))
