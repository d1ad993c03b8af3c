"""The compiled tracking law against the one to read, and how soon it brings a vehicle back."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.flight.flying import flight_run
from syncplan.guidance.flight_setup import FlightLimits
from syncplan.guidance.reference_tracking import tracking_commands, tracking_gains
from syncplan.guidance.tracking_law import command_plan, track
from syncplan.orbits.circles import heading, perpendicular, position, unit
from syncplan.planning.plan_flights import FlightRun
from tests.tools.exact_flights import fly, paper_grid, tracking
from tests.tools.inner_kernels import called_alone
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed

LANES = np.zeros(1, dtype=np.int8)

track_alone = called_alone(track)


def _run(**keys: Any) -> FlightRun:
    return flight_run(
        plan(changed("windy-grid", **keys), bound="never", pilot=False), duration=20.0
    )


def _commands(run: FlightRun, time: float, x: Array, errors: Array, moved: Array) -> Array:
    setup, found = run.team.setup, np.zeros((len(x), 2, 1))
    state, states = np.append(x, errors)[:, None], run.team.filter_setup().states
    track_alone(setup.circles, setup.law, time, state, states, moved, found, LANES)
    return found[..., 0]


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"wind": {"gust_sigma_mps": 0.3}},
        {"wind": {"gust_sigma_mps": 0.3}, "filter": {"estimate": ["gusts"]}},
        {"filter": {"estimate": "none"}},
        {"motion": {"lag_s": 1.5}, "limits": {"speed_mps": [1.0, 5.0]}},
    ],
)
def test_commands_are_those_of_the_law_to_read(keys: dict[str, Any]) -> None:
    run, generator = _run(**keys), np.random.default_rng(5)
    layout, orbits, n = run.team.layout, run.plan.orbits, run.plan.team.count
    endless = np.full(n, np.inf)
    free = FlightLimits(-endless, endless, endless, 0.0)
    delay = run.plan.sensors.sample_time + (run.plan.scenario.motion.lag_s or 0.0)
    gains = tracking_gains(orbits, run.limits, delay)
    for _ in range(30):
        time = float(generator.uniform(0.0, 100.0))
        x = np.column_stack([position(orbits, time), heading(orbits, time)])
        x += generator.normal(size=(n, 3)) * generator.choice([0.1, 30.0]) * [1.0, 1.0, 0.1]
        errors = generator.normal(size=len(layout.sigmas))
        moved = generator.normal(size=(n, 2))
        winds = np.zeros((n, 2))
        for name in {"wind", "gusts"} & set(layout.columns):
            for (i, axis), column in np.ndenumerate(layout.columns[name]):
                winds[i, axis] += errors[column - 3 * n] if column >= 0 else 0.0
        seen = x - np.column_stack([moved, np.zeros(n)])
        wanted = tracking_commands(orbits, free, gains, time, seen, winds)
        found = _commands(run, time, x, errors, moved[..., None])
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (1.5, -0.7)])
def test_a_vehicle_in_place_flies_its_circle_over_ground(wind: tuple[float, float]) -> None:
    """Commands are what the velocity through the air is and how it turns, by differences."""
    run, time, step = _run(), 7.3, 1e-5
    orbits, air = run.plan.orbits, np.array(wind)

    def through(at: float) -> Array:
        ahead = (orbits.senses * orbits.speeds)[:, None] * perpendicular(
            (position(orbits, at) - orbits.centers) / orbits.radii[:, None]
        )
        return np.asarray(ahead - air)

    before, now, after = (through(time + k * step) for k in (-1, 0, 1))
    psi = np.arctan2(now[:, 1], now[:, 0])
    turned = np.arctan2(after[:, 1], after[:, 0]) - np.arctan2(before[:, 1], before[:, 0])
    x = np.column_stack([position(orbits, time), psi])
    found = _commands(run, time, x, air, np.zeros((6, 2, 1)))
    np.testing.assert_allclose(found[:, 0], np.hypot(*now.T), rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], turned / (2.0 * step), rtol=1e-6)


def test_open_loop_is_the_plans_own_speed_and_turn_rate() -> None:
    run, found = _run(orbit={"direction": "alternate"}), np.zeros((6, 2, 1))
    called_alone(command_plan)(run.team.setup.circles, found, LANES)
    expected = np.column_stack([run.plan.orbits.speeds, run.plan.orbits.turn_rates])
    np.testing.assert_allclose(found[..., 0], expected, rtol=1e-12)
    assert {-1.0, 1.0} == set(run.plan.orbits.senses.tolist())


def test_commands_stay_within_limits_wherever_a_vehicle_is() -> None:
    orbits, limits = paper_grid()
    generator, guide = np.random.default_rng(1), tracking(orbits, limits)
    for _ in range(50):
        poses = generator.normal(size=(6, 3)) * [100.0, 100.0, 3.0]
        speeds, turn_rates = guide(12.3, poses, poses, np.zeros(6, dtype=bool)).T
        assert np.all((limits.least_speeds <= speeds) & (speeds <= limits.most_speeds))
        assert np.all(np.abs(turn_rates) <= limits.most_turn_rates)


def test_commands_that_act_late_lower_both_gains() -> None:
    orbits, limits = paper_grid()
    at_once, late = (tracking_gains(orbits, limits, delay) for delay in (0.0, 2.0))
    assert at_once.heading == pytest.approx(8.0 * orbits.rate)
    assert late.heading == pytest.approx(0.25)
    for gains in (at_once, late):
        assert gains.heading == pytest.approx(4.0 * gains.place)


def test_no_vehicle_closes_in_faster_than_limits_leave() -> None:
    orbits, limits = paper_grid()
    for most, closing in ((1.5, 0.5), (1.1, 0.25), (5.0, 1.0)):
        changed_limits = replace(limits, most_speeds=most * orbits.speeds)
        found = tracking_gains(orbits, changed_limits).closing_speeds
        np.testing.assert_allclose(found, closing * orbits.speeds)


@pytest.mark.parametrize("across", [False, True])
def test_an_offset_goes_at_the_rate_that_the_gains_say(across: bool) -> None:
    """Along the track as exp(-kp t), across it critically damped: (1 + q t) exp(-q t), q = 2 kp."""
    orbits, limits = paper_grid()
    gains, off, begin = tracking_gains(orbits, limits), 0.02, 3.0
    ahead = unit(heading(orbits, begin))
    way = perpendicular(ahead) if across else ahead
    poses = np.column_stack([position(orbits, begin), heading(orbits, begin)])
    poses[:, :2] += off * way
    flight = fly(orbits, limits, tracking(orbits, limits), 1, begin, begin + 6.0, start=poses)
    left, time = flight.off(), flight.times - begin
    rate = 2.0 * gains.place
    expected = (1.0 + rate * time) * np.exp(-rate * time) if across else np.exp(-gains.place * time)
    # commands are held for a sample of 0.1 s
    np.testing.assert_allclose(left / off, np.tile(expected[:, None], 6), atol=0.05)
