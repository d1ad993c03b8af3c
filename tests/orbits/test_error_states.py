"""Errors that last: their columns against finite differences of paths that are integrated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from syncplan.arrays import Array
from syncplan.observability.referred_rows import dense_rows, sighting_rows, state_rows
from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from tests.tools.draws import draw_team, sightings_of

CONSTANT = [name for name, state in ERROR_STATES.items() if state.constant]
ALL = ErrorSigmas(
    {"wind": 0.8, "gusts": 0.2, "speed_scale": 0.02, "turn_rate_bias": 0.005, "clock_offset": 0.1}
)


def _flown(orbits: Orbits, errors: dict[str, Array], time: float) -> Array:
    """(n, 3) poses after `time` s of readings as on the circles, by integration."""
    wind = errors.get("wind", np.zeros(2))
    scale, bias = errors.get("speed_scale", 0.0), errors.get("turn_rate_bias", 0.0)

    def rates(_: float, flat: Array) -> Array:
        psi = flat.reshape(-1, 3)[:, 2]
        speed = (1.0 + scale) * orbits.speeds
        turn = orbits.turn_rates + bias
        return np.column_stack(
            [speed * np.cos(psi) + wind[0], speed * np.sin(psi) + wind[1], turn]
        ).ravel()

    start = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)])
    solved = solve_ivp(rates, (0.0, time), start.ravel(), method="DOP853", rtol=1e-11, atol=1e-11)
    return np.asarray(solved.y[:, -1].reshape(-1, 3))


def _disturbed(seed: int) -> Team:
    team = draw_team(np.random.default_rng(seed))
    sensors = replace(
        team.sensors,
        range_sigmas=np.array(0.3),
        compass_sigmas=np.array(0.05),
        bearing_bias_sigmas=np.where(np.arange(team.count) % 2, 0.02, 0.0),
        bearing_walk_sigmas=np.where(np.arange(team.count) % 2, 0.0, 0.03),
        bearing_walk_times=np.array(7.0),
    )
    return replace(team, sensors=sensors, errors=replace(ALL, estimated=tuple(ERROR_STATES)))


def _measured(team: Team, s: int, seen: Sightings, poses: Array, biases: Array) -> float:
    o, t = int(seen.observers[s]), int(seen.targets[s])
    name = list(SIGHTING_KINDS)[int(seen.kinds[s])]
    there = poses[t, :2] if t < team.count else team.landmarks[t - team.count]
    value = float(SIGHTING_KINDS[name].measured(there - poses[o, :2], poses[o, 2]))
    return value + (biases[o] if name == "bearing" else 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_columns_of_errors_are_the_derivatives_of_sightings_along_an_integrated_path(
    seed: int,
) -> None:
    team = _disturbed(seed)
    orbits, layout = team.orbits, layout_of(team)
    seen = sightings_of(team, round(0.8 * orbits.period / team.sensors.sample_time))
    wide = state_rows(team, seen, layout)
    dense, rows = dense_rows(wide, layout.size), sighting_rows(team, seen)
    labels = layout.labels([str(k) for k in range(team.count)])
    random = np.random.default_rng(seed)
    h, checked = 1e-6, 0
    for s in random.choice(len(seen.steps), 8, replace=False).tolist():
        time = float(seen.steps[s]) * team.sensors.sample_time
        name = list(SIGHTING_KINDS)[int(seen.kinds[s])]
        sigma = SIGHTING_KINDS[name].sigmas(team.sensors)[seen.observers[s]]
        if np.abs(rows[s]).max() * sigma > 20.0:
            continue  # so near that it is weighted down, or not to be differentiated
        for column, sigma_state in enumerate(layout.sigmas):
            kind, _, vehicle = labels[column].replace("turn rate", "turn_rate").partition(" of ")
            kind = kind.replace(" ", "_")
            values = []
            for step in (h, -h):
                errors: dict[str, Array] = {}
                then = time
                biases = np.zeros(team.count)
                if kind.startswith("wind"):
                    errors["wind"] = step * np.eye(2)["xy".index(kind[-1])]
                elif kind in ("bearing_bias", "bearing_walk"):
                    biases[int(vehicle)] = step
                elif kind in ("speed_scale", "turn_rate_bias"):
                    errors[kind] = step * (np.arange(team.count) == int(vehicle))
                elif kind == "clock_offset" and int(vehicle) == seen.observers[s]:
                    then = time + step
                values.append(_measured(team, s, seen, _flown(orbits, errors, then), biases))
            change = values[0] - values[1]
            if name != "distance":
                change = float(wrap(change))
            expected = change / (2.0 * h) / sigma * sigma_state
            found = dense[s, 3 * team.count + column]
            assert found == pytest.approx(expected, rel=2e-3, abs=2e-4)
            checked += 1
    assert checked > 30


def test_rows_by_poses_are_those_of_a_team_without_errors() -> None:
    team = _disturbed(2)
    seen = sightings_of(team, 40)
    wide = state_rows(team, seen, layout_of(team))
    np.testing.assert_array_equal(wide.entries[:, :6], sighting_rows(team, seen))
    alone = state_rows(team, seen, layout_of(team, []))
    assert alone.entries.shape[1] == 6


def test_states_follow_the_poses_in_the_order_of_the_table() -> None:
    team = _disturbed(2)
    layout, n = layout_of(team), team.count
    changing = [name for name in ERROR_STATES if name not in CONSTANT]
    assert layout.names == (*CONSTANT, *changing)
    labels = layout.labels([f"v{k + 1}" for k in range(n)])
    assert labels[:4] == ["wind x", "wind y", "speed scale of v1", "speed scale of v2"]
    walking = [label for label in labels if label.startswith("bearing walk")]
    assert walking == [f"bearing walk of v{k + 1}" for k in range(n) if not k % 2]
    assert labels[-len(walking) :] == walking
    assert labels[-len(walking) - 2 :][:2] == [f"gusts x of v{n}", f"gusts y of v{n}"]
    biased = [label for label in labels if label.startswith("bearing bias")]
    assert biased == [f"bearing bias of v{k + 1}" for k in range(n) if k % 2]
    assert layout.size == 3 * n + len(labels) == 3 * n + 2 + 2 * n + n + n + 2 * n
    assert layout_of(team, ["wind"]).size == 3 * n + 2


def test_a_sensor_without_a_bias_has_no_state_and_no_column() -> None:
    team = _disturbed(2)
    layout = layout_of(team, ["bearing_bias"])
    seen = sightings_of(team, 40)
    dense = dense_rows(state_rows(team, seen, layout), layout.size)
    unbiased = seen.observers % 2 == 0
    assert np.all(dense[unbiased, 3 * team.count :] == 0.0)
    assert np.any(dense[~unbiased, 3 * team.count :] != 0.0)
