"""Rows of sightings: derivatives by the state at time 0, in closed form.

The row of every sighting is referred to the initial state by the closed-form transition, so it has
six non-zeros (three for a landmark) and no matrix product is formed. With q the target's position
relative to the observer, g = dz / dq and dz / dpsi the slopes of syncplan.orbits.sighting_kinds, J
a quarter turn counter-clockwise and p(t) - p(0) the displacement of a vehicle:

    dz / dp_target     =  g                              and minus that for the observer
    dz / dpsi_target   =  g . J (p_t(t) - p_t(0))
    dz / dpsi_observer = -g . J (p_o(t) - p_o(0)) + dz / dpsi

For a bearing, g . J p is q . p / rho^2. Rows are divided by their sigma; positions are in mean
radii, so all columns are pure numbers. A sighting made with probability p counts as p of one: its
row is multiplied by sqrt(p).

A constant error that moves a vehicle by (dp, dpsi) has the entry -g . dp + dz / dpsi dpsi for the
observer and g . dp for the target (syncplan.orbits.error_states), in units of the error's own
sigma. A clock offset has the entry dz / dt for its observer's sightings, g . (v_t - v_o) +
dz / dpsi w_o with velocities v over ground and the observer's turn rate w_o. An error that varies
has a column only where it is added to the reading: its value at the time of the sighting. Other
varying errors act through the poses.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import body_paths
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.orbits.sighting_kinds import (
    SIGHTING_KINDS,
    of_targets,
    sigmas_by_kind,
    slopes_by_kind,
    turns_by_kind,
)
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team

NEAREST = 1e-3
"""Distance, as a share of the mean radius, below which sightings are weighted down."""


@dataclass(frozen=True, slots=True)
class SightingRows:
    """Rows of sightings by poses and errors.

    A column may occur twice in a row, such as that of a wind common to both vehicles: its entries
    add up. The entry of a missing state is zero, and its column is that of some other state.

    Attributes
    ----------
    entries : (s, 6 + e) whitened: the observer's three, the target's three, then errors
    columns : (s, 6 + e) column of each entry in the team's state
    """

    entries: Array
    columns: Index

    @property
    def observers(self) -> Index:
        """(s,) vehicle of the first three entries."""
        return self.columns[:, 0] // 3

    @property
    def targets(self) -> Index:
        """(s,) vehicle of the next three; arbitrary if the target is a landmark."""
        return self.columns[:, 3] // 3

    def of(self, which: Index | slice) -> "SightingRows":
        """Return a selection of the rows."""
        return SightingRows(self.entries[which], self.columns[which])


@dataclass(frozen=True, slots=True)
class _Slopes:
    """Derivatives of sightings over their sigmas."""

    by_place: Array  # (2, s) by the target's place, 1/m
    by_heading: Array  # (s,) by the observer's heading
    weights: Array  # (s,)
    moved: tuple[Array, Array]  # (2, s) m, displacements of observer and target


def sighting_rows(team: Team, sightings: Sightings, scale: float | None = None) -> Array:
    """Return (s, 6) rows referred to time 0, over sigma: the observer's three, the target's three.

    Positions are in mean radii, or in `scale` m; a landmark's three are zero. A sighting from
    nearer than NEAREST mean radii is weighted down in proportion: its bearing turns faster than any
    estimate can follow, and one such row would drown all others in rounding. At distance zero
    there is no bearing. Equations (5) to (9) of the paper, in closed form.
    """
    return _pose_rows(team, sightings, _slopes(team, sightings), scale)


def state_rows(
    team: Team, sightings: Sightings, layout: StateLayout, scale: float | None = None
) -> SightingRows:
    """Return the rows of `sighting_rows` with the columns of the errors in a layout.

    Gusts act through the poses and have no column.
    """
    slopes = _slopes(team, sightings)
    return _wide(team, sightings, layout, slopes, _pose_rows(team, sightings, slopes, scale))


def error_moves(
    team: Team, sightings: Sightings, layout: StateLayout, ways: Array, six: Array
) -> SightingRows:
    """Return rows of functions of poses, with the columns of the constant errors in a layout.

    Each function is the target's place relative to the observer along `ways`, (2, s) 1/m; `six`,
    (s, 6), holds its derivatives by the poses at time 0.
    """
    none = np.zeros(len(six))
    slopes = _Slopes(by_place=ways, by_heading=none, weights=none, moved=(none, none))
    return _wide(team, sightings, layout, slopes, six)


def pose_columns(sightings: Sightings, count: int) -> Index:
    """Return (s, 6) columns of the poses of observer and target; the observer's for a landmark."""
    targets = np.where(sightings.targets < count, sightings.targets, sightings.observers)
    poses = np.arange(3 * count).reshape(-1, 3)
    return poses.take(np.column_stack([sightings.observers, targets]), axis=0).reshape(-1, 6)


def dense_rows(rows: SightingRows, size: int) -> Array:
    """Return the rows as a dense matrix (s, size)."""
    # entries are summed: a column may occur twice in a row
    places = np.arange(len(rows.entries))[:, None] * size + rows.columns
    dense = np.bincount(places.ravel(), rows.entries.ravel(), len(places) * size)
    return np.asarray(dense.reshape(-1, size), dtype=float)


def _wide(
    team: Team, sightings: Sightings, layout: StateLayout, slopes: _Slopes, six: Array
) -> SightingRows:
    entries, columns = [six], [pose_columns(sightings, team.count)]
    if not layout.names:
        return SightingRows(six, columns[0])
    observers, targets, count = sightings.observers, sightings.targets, team.count
    among = np.where(targets < count, targets, observers)
    times = np.asarray(sightings.steps * team.sensors.sample_time, dtype=float)
    kinds, none = np.array(list(SIGHTING_KINDS)), np.zeros(len(sightings.steps))
    # functions that are no sightings have zero weights, and no clock stamps them
    delays = slopes.weights.any() and any(ERROR_STATES[name].delays for name in layout.names)
    rates = _rates(team, sightings, slopes) if delays else none
    for name in layout.names:
        state = ERROR_STATES[name]
        if not state.constant and (not state.shifts or not slopes.weights.any()):
            continue
        place = layout.columns[name]
        shifted = slopes.weights * (kinds[sightings.kinds] == state.shifts)
        for vehicles, sign in ((observers, -1.0), (among, 1.0)):
            moves = state.moves(team.orbits, vehicles, times)
            entry = sign * np.einsum("cs,acs->sa", slopes.by_place, moves[:, :2])
            if sign < 0.0:
                entry += (slopes.by_heading * moves[:, 2]).T
                entry += shifted[:, None]
                entry += (rates if state.delays else none)[:, None]
            else:
                entry[targets >= count] = 0.0
            own = place[vehicles]
            has = own >= 0
            entry *= np.where(has, layout.sigmas[np.where(has, own - 3 * count, 0)], 0.0)
            entries.append(entry)
            columns.append(np.where(has, own, 3 * vehicles[:, None]))
    return SightingRows(np.concatenate(entries, axis=1), np.concatenate(columns, axis=1))


def _rates(team: Team, sightings: Sightings, slopes: _Slopes) -> Array:
    """Derivatives (s,) of sightings by time, over their sigmas."""
    orbits = team.orbits
    tau = sightings.steps * (orbits.rate * team.sensors.sample_time)
    _, cosine, sine = body_paths(orbits, team.landmarks)
    there, here = (
        np.cos(tau) * sine[own].T - np.sin(tau) * cosine[own].T
        for own in (sightings.targets, sightings.observers)
    )
    along = np.sum(slopes.by_place * (there - here), axis=0)
    turning = orbits.senses[sightings.observers] * slopes.by_heading
    return np.asarray(orbits.rate * (along + turning))


def _pose_rows(team: Team, sightings: Sightings, slopes: _Slopes, scale: float | None) -> Array:
    unit = float(team.orbits.radii.mean()) if scale is None else scale
    slope, (own, other) = slopes.by_place, slopes.moved
    rows = np.empty((len(sightings.steps), 6))
    rows[:, 0] = slope[0] * -unit
    rows[:, 1] = slope[1] * -unit
    rows[:, 2] = -(slope[1] * own[0] - slope[0] * own[1]) + slopes.by_heading
    rows[:, 3] = slope[0] * unit
    rows[:, 4] = slope[1] * unit
    rows[:, 5] = slope[1] * other[0] - slope[0] * other[1]
    rows[sightings.targets >= team.count, 3:] = 0.0
    return rows


def relative_places(team: Team, sightings: Sightings) -> tuple[Array, tuple[Array, Array]]:
    """Return (2, s) m: each target relative to its observer, and what both have moved since 0."""
    orbits = team.orbits
    observers, targets = sightings.observers, sightings.targets
    # cosines and sines once for each sample: sightings share them
    first = int(sightings.steps.min(initial=0))
    samples = np.arange(first, int(sightings.steps.max(initial=0)) + 1)
    tau = samples * (orbits.rate * team.sensors.sample_time)
    cos, sin = np.stack([np.cos(tau), np.sin(tau)]).take(sightings.steps - first, axis=1)
    ways = [np.ascontiguousarray(part.T) for part in body_paths(orbits, team.landmarks)]
    here, here_cos, here_sin = (part.take(observers, axis=1) for part in ways)
    there, there_cos, there_sin = (part.take(targets, axis=1) for part in ways)
    relative = (there - here) + (there_cos - here_cos) * cos + (there_sin - here_sin) * sin
    turned = cos - 1.0
    moved = here_cos * turned + here_sin * sin, there_cos * turned + there_sin * sin
    return relative, moved


def _slopes(team: Team, sightings: Sightings) -> _Slopes:
    orbits, observers = team.orbits, sightings.observers
    q, moved = relative_places(team, sightings)
    nearest = NEAREST * float(orbits.radii.mean())
    weight = np.minimum(1.0, np.sqrt(q[0] * q[0] + q[1] * q[1]) / nearest)
    weight /= sigmas_by_kind(team.sensors, sightings.kinds, observers)
    _of_those_made(weight, team, sightings)
    return _Slopes(
        by_place=slopes_by_kind(sightings.kinds, q, weight),
        by_heading=turns_by_kind(sightings.kinds) * weight,
        weights=weight,
        moved=moved,
    )


def _of_those_made(weight: Array, team: Team, sightings: Sightings) -> None:
    """Apply detection probabilities in place; readings without a target ignore nearness."""
    alone = ~of_targets(sightings.kinds)
    if alone.any():
        observers = sightings.observers[alone]
        weight[alone] = 1.0 / sigmas_by_kind(team.sensors, sightings.kinds[alone], observers)
    detection = np.where(alone, 1.0, team.sensors.detection[sightings.observers])
    if np.any(detection < 1.0):
        weight *= np.sqrt(detection)
