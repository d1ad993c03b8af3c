"""Guidance `mpc` in closed loop, with perfect estimates."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.guidance.flight_setup import FlightLimits
from syncplan.guidance.predictive_guidance import (
    SETTINGS,
    Decision,
    PredictiveGuidance,
    PredictiveOptions,
    Status,
)
from syncplan.orbits.circles import Orbits, heading, position
from tests.tools.exact_flights import (
    Flight,
    Hold,
    at_start,
    fly,
    narrow,
    paper_grid,
    predictive,
    tracking,
)
from tests.tools.predictive_check import DecisionCheck, check_decision

OPTIONS = PredictiveOptions()
STEP = 0.5
"""s, of the horizon at 0.2 rad/s."""

HOLD = Hold(vehicle=1, time=100.0, length=20.0)

LIMITS = {"default": None, "narrow": (2.0, 6.0, 0.8), "slow to turn": (2.0, 6.0, 0.4)}
"""Speeds in m/s and turn rate in rad/s, by name."""


def _limited(name: str) -> tuple[Orbits, FlightLimits]:
    orbits, limits = paper_grid()
    given = LIMITS[name]
    return orbits, limits if given is None else narrow(limits, *given)


def _checked(
    orbits: Orbits, limits: FlightLimits, hold: Hold | None, wind: Array | None = None
) -> tuple[Flight, list[DecisionCheck], list[Decision]]:
    """A flight from 95 s to 145 s, with what each decision breaks."""
    guidance, checks, decisions = PredictiveGuidance(orbits, limits), [], []
    winds = np.tile(np.zeros(2) if wind is None else wind, (orbits.count, 1))

    def seen(found: Decision, poses: Array, before: Array) -> None:
        checks.append(check_decision(found, STEP, poses, winds, before, limits, OPTIONS))
        decisions.append(found)

    guide = predictive(guidance, wind, seen)
    return fly(orbits, limits, guide, 5, 95.0, 145.0, hold, wind), checks, decisions


def _broken(checks: list[DecisionCheck]) -> float:
    """The worst of all constraints, in m/s, rad/s, m and rad alike."""
    return max(
        max(c.speed, c.turn_rate, c.speed_change, c.turn_rate_change, c.place, c.heading)
        for c in checks
    )


def _decide(guidance: PredictiveGuidance, time: float, poses: Array) -> Decision:
    still = np.zeros((len(poses), 2))
    return guidance.decide(time, poses, still, np.tile([4.0, 0.2], (len(poses), 1)))


def _strayed(orbits: Orbits, seed: int = 1) -> Array:
    generator = np.random.default_rng(seed)
    poses = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)])
    return np.asarray(poses + generator.normal(size=poses.shape) * [8.0, 8.0, 0.5])


@pytest.mark.parametrize("guidance", ["track", "mpc"])
def test_from_the_right_start_the_circle_is_kept_to_rounding(guidance: str) -> None:
    orbits, limits = paper_grid()
    laws = {
        "track": tracking(orbits, limits),
        "mpc": predictive(PredictiveGuidance(orbits, limits)),
    }
    flight = fly(orbits, limits, laws[guidance], 5, 0.0, 60.0)
    assert flight.off().max() < 1e-9 * orbits.radii.min()


@pytest.mark.parametrize("name", LIMITS)
def test_after_a_hold_phase_is_back_thirty_per_cent_sooner_than_by_tracking(name: str) -> None:
    orbits, limits = _limited(name)
    flight, checks, decisions = _checked(orbits, limits, HOLD)
    tracked = fly(orbits, limits, tracking(orbits, limits), 1, 95.0, 145.0, HOLD)
    assert flight.back_after(HOLD) < 0.7 * tracked.back_after(HOLD)
    assert flight.off()[-1].max() < 0.01 * orbits.radii.min()
    assert flight.least_separation() >= limits.separation
    assert _broken(checks) < 1e-9
    assert min(check.nearest for check in checks) >= limits.separation
    assert {s for one in decisions for s in one.status} == {Status.SOLVED, Status.HELD}


@pytest.mark.parametrize("name", ["default", "narrow"])
def test_neighbours_give_way_to_a_vehicle_that_is_held(name: str) -> None:
    """Circles 5 m apart; v2 is held where v1 and v5 would pass it at 5 m, 12 m are asked."""
    orbits, limits = _limited(name)
    near = replace(orbits, centers=orbits.centers * (45.0 / 70.0), phases=np.full(6, 0.3))
    limits = replace(limits, separation=12.0)
    hold = replace(HOLD, time=100.0)
    tracked = fly(near, limits, tracking(near, limits), 1, 95.0, 145.0, hold)
    flight, checks, _ = _checked(near, limits, hold)
    assert tracked.least_separation() < 6.0
    assert flight.least_separation() >= limits.separation
    assert _broken(checks) < 1e-9
    assert flight.back_after(hold) < 0.7 * tracked.back_after(hold)
    assert flight.off()[-1].max() < 0.01 * orbits.radii.min()


def test_a_flight_that_must_come_too_near_says_so() -> None:
    orbits, limits = paper_grid()
    poses = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)])
    poses[1, :2] = poses[0, :2] + [4.0, 0.0]
    found = _decide(PredictiveGuidance(orbits, limits), 0.0, poses)
    assert found.status.tolist() == [Status.NEAR] * 2 + [Status.SOLVED] * 4
    # after half a second at 8 m/s each they may be 12 m apart at best; at first 4 m
    assert np.all((found.shortfalls[:2] > 0.0) & (found.shortfalls[:2] < 8.0))


def test_in_a_wind_that_is_known_the_circle_is_kept_and_found_again_sooner() -> None:
    orbits, limits = paper_grid()
    wind = np.array([0.8, -0.6])
    flight, checks, _ = _checked(orbits, limits, None, wind)
    # commands are held for 0.5 s, within which the wanted heading bends a little
    assert flight.off().max() < 0.002 * orbits.radii.min()
    flight, checks, _ = _checked(orbits, limits, HOLD, wind)
    tracked = fly(orbits, limits, tracking(orbits, limits, wind), 1, 95.0, 145.0, HOLD, wind)
    assert flight.back_after(HOLD) < 0.7 * tracked.back_after(HOLD)
    assert flight.least_separation() >= limits.separation
    assert _broken(checks) < 1e-9


def test_circles_can_be_flown_elsewhere() -> None:
    orbits, limits = paper_grid()
    moved = np.tile([3.0, -2.0], (6, 1))
    poses, still = at_start(orbits, 7.0, np.zeros(2)), np.zeros((6, 2))
    poses[:, :2] += moved
    guidance = PredictiveGuidance(orbits, limits)
    plain = np.column_stack([orbits.speeds, orbits.turn_rates])
    found = guidance.decide(7.0, poses, still, plain, moved=moved)
    np.testing.assert_allclose(found.commands, plain, atol=1e-9)


def test_a_program_that_is_not_solved_is_refused_and_the_guess_flown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The guess, the tracking law or an interception, is within limits too."""
    monkeypatch.setitem(SETTINGS, "max_iter", 1)
    orbits, limits = paper_grid()
    poses = _strayed(orbits)
    found = _decide(PredictiveGuidance(orbits, limits), 0.0, poses)
    assert found.status.tolist() == [Status.REFUSED] * 6
    before, still = np.tile([4.0, 0.2], (6, 1)), np.zeros((6, 2))
    assert _broken([check_decision(found, STEP, poses, still, before, limits, OPTIONS)]) < 1e-9


@pytest.mark.parametrize("wind", [(0.0, 0.0), (0.6, -0.8)])
def test_guesses_alone_bring_a_vehicle_back_sooner_than_tracking(
    wind: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no program is solved, interceptions still are: they meet the plan in the wind."""
    monkeypatch.setitem(SETTINGS, "max_iter", 1)
    orbits, limits = paper_grid()
    blow = np.array(wind)
    flight, checks, _ = _checked(orbits, limits, HOLD, blow)
    tracked = fly(orbits, limits, tracking(orbits, limits, blow), 1, 95.0, 145.0, HOLD, blow)
    assert flight.back_after(HOLD) < 0.8 * tracked.back_after(HOLD)
    assert _broken(checks) < 1e-9


def test_a_decision_follows_from_estimates_and_memory_alone() -> None:
    """Another object with the same memory decides the same bytes, whatever it solved before."""
    orbits, limits = paper_grid()
    first, second = PredictiveGuidance(orbits, limits), PredictiveGuidance(orbits, limits)
    _decide(first, 0.0, _strayed(orbits, 1))
    _decide(second, 3.0, _strayed(orbits, 2))
    second.memory = first.memory
    poses = _strayed(orbits, 3)
    one, other = _decide(first, 0.5, poses), _decide(second, 0.5, poses)
    assert one.flights.tobytes() == other.flights.tobytes()
    assert one.flights.tobytes() != _decide(second, 1.0, poses).flights.tobytes()


def test_threads_decide_side_by_side_what_they_decide_alone() -> None:
    orbits, limits = paper_grid()

    def decisions(seed: int) -> bytes:
        guidance = PredictiveGuidance(orbits, limits)
        found = [_decide(guidance, 0.5 * k, _strayed(orbits, seed + k)) for k in range(20)]
        return b"".join(one.flights.tobytes() for one in found)

    seeds = [0, 100, 200]
    alone = [decisions(seed) for seed in seeds]
    with ThreadPoolExecutor(3) as pool:
        beside = list(pool.map(decisions, seeds))
    assert beside == alone


def test_a_single_vehicle_has_nobody_to_avoid() -> None:
    orbits, limits = paper_grid()
    one = np.array([1])
    parts = limits.least_speeds[one], limits.most_speeds[one], limits.most_turn_rates[one]
    alone = FlightLimits(*parts, separation=limits.separation)
    found = _decide(PredictiveGuidance(orbits.only(one), alone), 0.0, _strayed(orbits)[one])
    assert found.status.tolist() == [Status.SOLVED]
