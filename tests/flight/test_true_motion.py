"""How vehicles truly move, a sample at a time."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.flight.flight_setup import FlightSetup, Flown
from syncplan.flight.flying import flight_run
from syncplan.flight.true_motion import is_held, move_truly
from syncplan.planning.planner import plan
from tests.tools.inner_kernels import called_alone
from tests.tools.scenarios import changed

QUIET = {
    "motion": {"speed_sigma_mps": 0.0, "turn_rate_sigma_rad_s": 0.0},
    "initial_sigma": {"position_m": 1e-6, "heading_rad": 1e-6},
}
TIME = 0.1

move_alone, held_alone = called_alone(move_truly), called_alone(is_held)


@dataclass(frozen=True)
class Motion:
    """A trial at its start, and what is read as it moves."""

    setup: FlightSetup
    flown: Flown
    speeds: Array
    turn_rates: Array

    def move(self, step: int, *commands: tuple[float, float]) -> None:
        """Fly a sample; the first vehicles obey these commands, the others the plan's."""
        for i, command in enumerate(commands):
            self.flown.commands[i, :, 0] = command
        lanes = np.zeros(1, dtype=np.int8)
        move_alone(self.setup, self.flown, step, self.speeds, self.turn_rates, lanes)


def _motion(keys: dict[str, Any] | None = None, **options: Any) -> Motion:
    scenario = changed("paper-grid-same", **(keys or {}))
    run = flight_run(plan(scenario, bound="never", pilot=False), None, duration=20.0, **options)
    flown, readings, _ = run.team.begun(range(1))
    return Motion(run.team.setup, flown, readings.speeds[0], readings.turn_rates[0])


def _with(keys: dict[str, Any], **further: Any) -> dict[str, Any]:
    return {**keys, **{name: {**keys.get(name, {}), **one} for name, one in further.items()}}


def test_a_vehicle_flies_the_arc_of_its_command() -> None:
    found = _motion(QUIET)
    start = found.flown.path[0, 0, :, 0].copy()
    found.move(0, (5.0, 0.3))
    x, y, psi = found.flown.path[1, 0, :, 0]
    radius = 5.0 / 0.3
    assert psi == pytest.approx(start[2] + 0.03)
    assert x == pytest.approx(start[0] + radius * (np.sin(psi) - np.sin(start[2])), abs=1e-12)
    assert y == pytest.approx(start[1] - radius * (np.cos(psi) - np.cos(start[2])), abs=1e-12)


def test_commands_are_kept_within_limits_and_counted_where_they_are_at_one() -> None:
    limits = {"limits": {"speed_mps": [2.0, 5.0], "turn_rate_rad_s": 0.4}}
    found = _motion({**QUIET, **limits})
    commands = [(1.0, 0.1), (6.0, -0.1), (4.0, 0.5), (4.0, -0.5), (5.0, 0.1), (4.9, -0.39)]
    found.move(0, *commands)
    within = [(2.0, 0.1), (5.0, -0.1), (4.0, 0.4), (4.0, -0.4), (5.0, 0.1), (4.9, -0.39)]
    np.testing.assert_array_equal(found.flown.commands[..., 0], within)
    np.testing.assert_array_equal(found.flown.saturated[:, 0], [1, 1, 1, 1, 1, 0])
    np.testing.assert_array_equal(found.speeds[:, 0], [one[0] for one in within])


def test_a_response_lags_as_fine_euler_steps_of_it_do() -> None:
    """Means over a sample, and what is left at its end, are in closed form."""
    lag, parts, command = 0.35, 4000, np.array([6.0, 0.5])
    found = _motion(_with(QUIET, motion={"lag_s": lag}))
    response = found.flown.responses[0, :, 0].copy()
    for step in range(3):
        means = np.zeros(2)
        for _ in range(parts):
            before = response.copy()
            response += (TIME / parts) / lag * (command - response)
            means += 0.5 * (before + response) / parts
        found.move(step, tuple(command))
        np.testing.assert_allclose(found.flown.responses[0, :, 0], response, rtol=1e-4)
        read = [found.speeds[0, 0], found.turn_rates[0, 0]]
        np.testing.assert_allclose(read, means, rtol=1e-4)


def test_noise_is_of_what_is_done_where_readings_are_commanded() -> None:
    found = _motion({"motion": {"speed_sigma_mps": 0.2, "turn_rate_sigma_rad_s": 0.03}})
    start = found.flown.path[0, 0, 2, 0]
    found.move(0, (4.0, 0.2))
    assert (found.speeds[0, 0], found.turn_rates[0, 0]) == (4.0, 0.2)
    turned = (found.flown.path[1, 0, 2, 0] - start) / TIME
    assert turned == pytest.approx(0.2 - 0.03 * found.flown.turn_noise[0, 0, 0])
    way = found.flown.path[1, 0, :2, 0] - found.flown.path[0, 0, :2, 0]
    done = (4.0 - 0.2 * found.flown.speed_noise[0, 0, 0]) * TIME
    assert np.hypot(*way) == pytest.approx(done, rel=1e-4)


def test_noise_is_of_what_is_read_where_readings_are_measured() -> None:
    motion = {"speed_sigma_mps": 0.2, "turn_rate_sigma_rad_s": 0.03, "readings": "measured"}
    found = _motion({"motion": motion})
    start = found.flown.path[0, 0, 2, 0]
    found.move(0, (4.0, 0.2))
    assert found.speeds[0, 0] == 4.0 + 0.2 * found.flown.speed_noise[0, 0, 0]
    assert found.turn_rates[0, 0] == 0.2 + 0.03 * found.flown.turn_noise[0, 0, 0]
    assert (found.flown.path[1, 0, 2, 0] - start) / TIME == pytest.approx(0.2)


def test_constant_errors_scale_speeds_and_add_to_turn_rates() -> None:
    motion = {"speed_scale_sigma": 0.05, "turn_rate_bias_sigma_rad_s": 0.02}
    found = _motion(_with(QUIET, motion=motion))
    scale, bias = found.flown.scales[0, 0], found.flown.turn_biases[0, 0]
    assert min(abs(scale), abs(bias)) > 1e-4
    start = found.flown.path[0, 0, :, 0].copy()
    found.move(0, (4.0, 0.2))
    x, y, psi = found.flown.path[1, 0, :, 0] - start
    assert psi == pytest.approx((0.2 + bias) * TIME)
    chord = np.sinc(0.5 * psi / np.pi)
    assert np.hypot(x, y) == pytest.approx((1.0 + scale) * 4.0 * TIME * chord)
    assert (found.speeds[0, 0], found.turn_rates[0, 0]) == (4.0, 0.2)


def test_the_air_carries_vehicles_along() -> None:
    still, windy = _motion(QUIET), _motion(QUIET, wind=(1.5, -0.5))
    for motion in (still, windy):
        motion.move(0, (4.0, 0.2))
    carried = windy.flown.path[1, ..., 0] - still.flown.path[1, ..., 0]
    np.testing.assert_allclose(carried, np.tile([0.15, -0.05, 0.0], (6, 1)), atol=1e-12)


def test_gusts_differ_by_vehicle_and_sample() -> None:
    found = _motion(_with(QUIET, wind={"gust_sigma_mps": 0.5}))
    gusts = found.flown.drift[..., 0]
    assert gusts.shape == (201, 6, 2)
    before = found.flown.path[0].copy()
    found.move(0, *[(0.0, 0.0)] * 6)
    np.testing.assert_allclose(
        (found.flown.path[1] - before)[:, :2, 0], TIME * gusts[0], atol=1e-12
    )
    found.move(1, *[(0.0, 0.0)] * 6)
    moved = found.flown.path[2] - found.flown.path[1]
    np.testing.assert_allclose(moved[:, :2, 0], TIME * gusts[1], atol=1e-12)


def test_a_held_vehicle_stands_still_where_it_can() -> None:
    found = _motion(QUIET, hold=("v2@0.1:0.2",))
    for step in range(4):
        found.move(step, (4.0, 0.2), (4.0, 0.2))
    moved = np.abs(np.diff(found.flown.path[:5, 1, :, 0], axis=0)).max(axis=1)
    np.testing.assert_array_equal(moved > 0.0, [True, False, False, True])
    assert found.flown.saturated[1, 0] == 0


def test_a_held_vehicle_that_has_to_fly_turns_on_the_spot() -> None:
    limits = {"limits": {"speed_mps": [2.5, 5.0], "turn_rate_rad_s": 0.4}}
    found = _motion({**QUIET, **limits}, hold=("v2@0.1:0.2",))
    found.move(0, (4.0, 0.2), (4.0, 0.2))
    found.move(1, (4.0, 0.2), (4.0, 0.2))
    assert tuple(found.flown.commands[0, :, 0]) == (4.0, 0.2)
    assert tuple(found.flown.commands[1, :, 0]) == (2.5, 0.4)
    assert found.flown.saturated[1, 0] == 0


def test_a_hold_is_from_its_first_step_until_before_its_last() -> None:
    begin, end = np.array([[3, 10]]), np.array([[5, 12]])
    held = [step for step in range(15) if held_alone(begin, end, 0, step)]
    assert held == [3, 4, 10, 11]
