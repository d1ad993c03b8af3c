"""How far a phase may slip: before a contact is lost, and before two vehicles come too near.

Slipping the one or the other phase of a pair is the same up to a shift of time, and only one of
the two slips here: where both do, they share what is allowed.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import Orbits, phase, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.paths import NO_LANDMARKS
from syncplan.orbits.team import Team
from syncplan.synchronisation.phase_rules import closest_distance, rules_of

__all__ = ["phase_tolerances", "rule_residuals", "safe_slips"]


_SLIPS = 64
_BISECTIONS = 36

_STEPS = 400
_RESOLUTION = 1e-6
"""rad, below which a step of safe_slips is not worth another."""


def rule_residuals(orbits: Orbits, pairs: Index) -> Array:
    """Return (e,) rad in [-pi, pi): phi_b - phi_a - pi, or phi_a + phi_b - 2 beta - pi."""
    a, b = pairs[:, 0], pairs[:, 1]
    between = orbits.centers[b] - orbits.centers[a]
    bearing = np.arctan2(between[:, 1], between[:, 0])
    phases = phase(orbits, 0.0)
    same = orbits.senses[a] == orbits.senses[b]
    asked = np.where(same, phases[b] - phases[a], phases[a] + phases[b] - 2.0 * bearing)
    return wrap(asked - np.pi)


def phase_tolerances(team: Team, pairs: Index) -> Array:
    """Return (e,) rad: the smallest slip of either phase, either way, that loses all contact.

    Slipping one phase or the other is the same up to a shift of time. Pi where no slip does. The
    first loss is looked for in steps of pi / 64 and then bisected.
    """
    tolerance = np.full(len(pairs), np.pi)
    if len(pairs) == 0:
        return tolerance
    slips = np.linspace(0.0, np.pi, _SLIPS + 1)
    sides = np.array([1.0, -1.0])
    both = np.broadcast_to((sides[:, None] * slips).ravel(), (len(pairs), 2 * len(slips)))
    kept = _contact_when_slipped(team, pairs)(both).reshape(len(pairs), 2, -1)
    pair, side = np.nonzero(~kept.all(axis=2))
    first = np.argmin(kept[pair, side], axis=1)
    low, high = slips[np.maximum(first - 1, 0)], slips[first]
    in_contact = _contact_when_slipped(team, pairs[pair])
    for _ in range(_BISECTIONS if len(pair) else 0):
        middle = 0.5 * (low + high)
        held = in_contact((sides[side] * middle)[:, None])[:, 0]
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    np.minimum.at(tolerance, pair, low)
    return tolerance


def _contact_when_slipped(team: Team, pairs: Index) -> Callable[[Array], Flags]:
    """Whether pairs still meet when the second vehicle's phase slips, (e, k) of slip (e, k)."""
    orbits, sensors = team.orbits, team.sensors
    if not np.all(sensors.fields_of_view >= 2.0 * np.pi):
        return lambda slip: _seen_when_slipped(team, pairs, slip)
    rules = rules_of(orbits.centers, orbits.radii, orbits.senses, sensors.ranges, pairs)
    residual = rule_residuals(orbits, pairs)[:, None]
    return lambda slip: np.asarray(closest_distance(rules, residual + slip) <= rules.reach[:, None])


def _seen_when_slipped(team: Team, pairs: Index, slip: Array) -> Flags:
    """(e, k) whether a pair has a contact window either way."""
    number = slip.shape[1]
    first, second = np.repeat(pairs[:, 0], number), np.repeat(pairs[:, 1], number)
    index = np.concatenate([first, second])
    late = np.concatenate([np.zeros(len(first)), slip.ravel()])
    copies = team.only(index)
    slipped = replace(copies.orbits, phases=copies.orbits.phases + late)
    one, other = np.arange(len(first)), len(first) + np.arange(len(first))
    ways = (np.concatenate([one, other]), np.concatenate([other, one]))
    found = find_windows(replace(copies, orbits=slipped, landmarks=NO_LANDMARKS), ways)
    met = np.diff(found.first) > 0
    return (met[: len(first)] | met[len(first) :]).reshape(slip.shape)


def safe_slips(orbits: Orbits, pairs: Index, distance: float) -> Array:
    """Return (e,) rad: how far either phase may slip, either way, with all of `distance` m kept.

    Pi where any slip may be; 0 where they are too near as it is. With a distance of 0 it is the
    slip at which they would collide. A slip moves a vehicle by its radius times the slip at most,
    so that what the least distance has to spare tells how far to look next: nothing is stepped
    over, and the answer errs on the safe side.
    """
    if len(pairs) == 0:
        return np.zeros(0)
    rules = rules_of(orbits.centers, orbits.radii, orbits.senses, np.zeros(orbits.count), pairs)
    residual = rule_residuals(orbits, pairs)[:, None]
    sides = np.array([1.0, -1.0])
    reach = np.minimum(rules.radius_a, rules.radius_b)[:, None]
    slip = np.zeros((len(pairs), 2))
    for _ in range(_STEPS):
        spare = closest_distance(rules, residual + sides * slip) - distance
        step = np.where(slip < np.pi, np.maximum(spare, 0.0) / reach, 0.0)
        slip = np.minimum(slip + step, np.pi)
        if step.max() < _RESOLUTION:
            break
    return np.asarray(slip.min(axis=1))
