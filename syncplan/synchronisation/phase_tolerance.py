"""Phase tolerances: how far a phase may shift before contact or separation is lost.

Shifting one phase of a pair or the other is the same up to a shift of time, and only one of the
two shifts here: where both do, they share the tolerance.
"""

from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import Orbits
from syncplan.orbits.sight_lines import obstructible
from syncplan.orbits.team import Team
from syncplan.synchronisation.contact_tables import seen_when_shifted
from syncplan.synchronisation.phase_rules import Rules, closest_distance, phase_residuals, rules_of

_SHIFTS = 64
_BISECTIONS = 36

_STEPS = 400
_RESOLUTION = 1e-6
"""rad: separation_tolerances ends when its steps are smaller."""


def rule_residuals(orbits: Orbits, pairs: Index) -> Array:
    """Return (e,) rad in [-pi, pi): how far the phases of the pairs (e, 2) are from their rules."""
    return phase_residuals(_rules(orbits, np.zeros(orbits.count), pairs), orbits.phases)


def _rules(orbits: Orbits, reach: Array, pairs: Index) -> Rules:
    return rules_of(orbits.centers, orbits.radii, orbits.senses, reach, pairs)


def contact_tolerances(team: Team, pairs: Index) -> Array:
    """Return (e,) rad: the smallest shift of either phase, either way, that loses all contact.

    Pi where no shift does. The first loss is bracketed in steps of pi / 64, then bisected.
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
    for _ in range(_BISECTIONS if len(pair) else 0):
        middle = 0.5 * (low + high)
        held = in_contact((sides[side] * middle)[:, None])[:, 0]
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    np.minimum.at(tolerance, pair, low)
    return tolerance


def _contact_when_shifted(team: Team, pairs: Index) -> Callable[[Array], Flags]:
    """Whether pairs still meet when the second vehicle's phase shifts by (e, k) rad: (e, k)."""
    orbits, sensors = team.orbits, team.sensors
    if not np.all(sensors.fields_of_view >= 2.0 * np.pi):
        return lambda shift: seen_when_shifted(team, pairs, shift)
    rules = _rules(orbits, sensors.ranges, pairs)
    residual, reach = phase_residuals(rules, orbits.phases)[:, None], rules.reach[:, None]
    hindered = np.flatnonzero(obstructible(team, pairs[:, 0], pairs[:, 1]))

    def met(shift: Array) -> Flags:
        found = np.asarray(closest_distance(rules, residual + shift) <= reach)
        if len(hindered):
            found[hindered] = seen_when_shifted(team, pairs[hindered], shift[hindered])
        return found

    return met


def separation_tolerances(orbits: Orbits, pairs: Index, distance: float) -> Array:
    """Return (e,) rad: how far either phase may shift, either way, and stay `distance` m apart.

    Pi where any shift keeps them apart; 0 where they are nearer already. With a distance of 0 it
    is the shift at which they collide. A phase that shifts by s moves its vehicle by R s at most,
    so the least distance beyond `distance`, over R, is a step that can't miss a conflict; the
    answer errs on the safe side.
    """
    if len(pairs) == 0:
        return np.zeros(0)
    rules = _rules(orbits, np.zeros(orbits.count), pairs)
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
