"""Rows of sightings against central differences of readings on paths flown with errors."""

import numpy as np

from syncplan.arrays import Array
from syncplan.observability.referred_rows import NEAREST, dense_rows, sighting_rows, state_rows
from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, measured_by_kind, sigmas_by_kind
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from tests.tools.draws import draw_equipped_team, sightings_of

KINDS = np.array(list(SIGHTING_KINDS))


def _errors(layout: StateLayout, state: Array, name: str) -> Array:
    """(n, axes) each vehicle's own in a state, 0 where it has none."""
    columns = layout.columns.get(name, np.full((layout.count, len(ERROR_STATES[name].axes)), -1))
    return np.where(columns >= 0, state[columns], 0.0)


def _flown(orbits: Orbits, layout: StateLayout, state: Array, times: Array) -> Array:
    """(n, s, 3) poses at times (s,) from a state in m, rad and the errors' units: exact arcs."""
    poses = state[: 3 * layout.count].reshape(-1, 3, 1)
    rate = orbits.turn_rates[:, None] + _errors(layout, state, "turn_rate_bias")
    speed = (1.0 + _errors(layout, state, "speed_scale")) * orbits.speeds[:, None]
    psi = poses[:, 2] + rate * times
    wind = _errors(layout, state, "wind")[:, :, None] * times
    x = poses[:, 0] + speed / rate * (np.sin(psi) - np.sin(poses[:, 2])) + wind[:, 0]
    y = poses[:, 1] + speed / rate * (np.cos(poses[:, 2]) - np.cos(psi)) + wind[:, 1]
    return np.stack([x, y, psi], axis=2)


def _readings(team: Team, seen: Sightings, layout: StateLayout, state: Array) -> Array:
    """(s,) what is measured on the paths from a state."""
    seconds = np.asarray(seen.steps * team.sensors.sample_time, dtype=float)
    seconds = seconds + _errors(layout, state, "clock_offset")[seen.observers, 0]
    times, place = np.unique(seconds, return_inverse=True)
    flown = _flown(team.orbits, layout, state, times)
    still = np.broadcast_to(team.landmarks[:, None], (len(team.landmarks), len(times), 2))
    places = np.concatenate([flown[:, :, :2], still])
    q = places[seen.targets, place] - places[seen.observers, place]
    read = measured_by_kind(seen.kinds, q.T, flown[seen.observers, place, 2])
    for name in ("bearing_bias", "bearing_walk"):
        shift = _errors(layout, state, name)[seen.observers, 0]
        read = read + shift * (KINDS[seen.kinds] == "bearing")
    return np.asarray(read)


def _numeric(team: Team, seen: Sightings, layout: StateLayout) -> Array:
    """The whitened matrix by central differences, positions in mean radii, errors in sigmas."""
    start = np.column_stack([position(team.orbits, 0.0), heading(team.orbits, 0.0)])
    state = np.r_[start.ravel(), np.zeros(len(layout.sigmas))]
    unit = float(team.orbits.radii.mean())
    scales = np.r_[np.tile([unit, unit, 1.0], team.count), layout.sigmas]
    own = seen.observers == seen.targets
    made = np.where(own, 1.0, np.sqrt(team.sensors.detection[seen.observers]))
    weights = made / sigmas_by_kind(team.sensors, seen.kinds, seen.observers)
    h = 1e-5
    columns = []
    for step in h * np.diag(scales):
        ahead, behind = (_readings(team, seen, layout, state + s * step) for s in (1.0, -1.0))
        change = ahead - behind
        change = np.where(KINDS[seen.kinds] == "distance", change, wrap(change))
        columns.append(weights * change / (2.0 * h))
    return np.column_stack(columns)


def _from_afar(team: Team, seen: Sightings) -> Sightings:
    """The sightings that are not so near that differences of bearings mean nothing."""
    places = position(team.orbits, seen.steps * team.sensors.sample_time)
    still = np.broadcast_to(team.landmarks, (len(places), *team.landmarks.shape))
    bodies, row = np.concatenate([places, still], axis=1), np.arange(len(places))
    near = np.hypot(*(bodies[row, seen.targets] - bodies[row, seen.observers]).T)
    own = seen.observers == seen.targets
    return seen.only(own | (near > 50.0 * NEAREST * team.orbits.radii.mean()))


def test_rows_are_the_derivatives_of_readings_by_poses_and_errors() -> None:
    kinds, errors = set[str](), set[str]()
    for seed in range(60):
        team = draw_equipped_team(np.random.default_rng(seed))
        seen, layout = _from_afar(team, sightings_of(team, 40)), layout_of(team)
        rows = state_rows(team, seen, layout)
        numeric = _numeric(team, seen, layout)
        largest = np.abs(numeric).max(axis=0, initial=0.0)
        off = np.abs(dense_rows(rows, layout.size) - numeric)
        assert np.all(off <= 1e-5 * largest + 1e-6)
        np.testing.assert_array_equal(rows.entries[:, :6], sighting_rows(team, seen))
        kinds |= set(KINDS[seen.kinds])
        errors |= {name for name in layout.names if largest[layout.columns[name]].any()}
    assert kinds == set(KINDS)
    # gusts act through the poses and have no column of their own
    assert errors == set(ERROR_STATES) - {"gusts"}
