"""Trials with lasting errors, moving air and missed sightings: what is true and what is read."""

import io
from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation.air_motion import motion_in_air
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    augmented_setup_of,
)
from syncplan.estimation.consistency import anees
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import _setup, run_trials
from syncplan.estimation.reference_filter import displacement
from syncplan.estimation.reference_states import moved_state, sighted
from syncplan.estimation.trial_archive import pack, unpack
from syncplan.estimation.trial_readings import TrialReadings, possible_sightings
from syncplan.estimation.trials import MonteCarloResult, merge, series, state_series
from syncplan.orbits.circles import heading, position, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.sighting_kinds import of_targets
from syncplan.orbits.team import Team
from tests.estimation.test_further_states import a_team
from tests.estimation.test_montecarlo import bytes_of

NOISELESS = Noise(0.0, 0.0, 0.0, 0.0)
TINY = 1e-12


def readings_of(team: Team, steps: int, lanes: int) -> tuple[AugmentedSetup, AugmentedReadings]:
    seen = possible_sightings(team, find_windows(team), steps)
    poses, layout = _setup(team, seen, steps, FilterOptions()), layout_of(team)
    readings = TrialReadings.of(team, poses, layout, 3).disturbed(range(lanes))
    return augmented_setup_of(poses, layout), readings


def without_noise(team: Team) -> Team:
    sure = replace(
        team.sensors,
        bearing_sigmas=np.full(team.count, TINY),
        range_sigmas=np.full(team.count, TINY),
        detection=np.ones(team.count),
    )
    return replace(team, noise=NOISELESS, sensors=sure)


def strayed(team: Team, lane: int, duration: float = 40.0) -> tuple[float, float]:
    """How far, in m and rad, a vehicle that knows all errors strays from the truth at most."""
    steps = round(duration / team.sensors.sample_time)
    setup, readings = readings_of(team, steps, lane + 1)
    start = readings.initial[..., lane].ravel()
    state = np.concatenate([start, readings.constants[:, lane], readings.changing[0, :, lane]])
    place, turn, n = 0.0, 0.0, team.count
    for k in range(1, steps + 1):
        speeds, turns = readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane]
        state = moved_state(state, speeds, turns, setup)
        state[setup.first_changing :] = readings.changing[k, :, lane]
        poses = state[: 3 * n].reshape(n, 3)
        place = max(place, float(np.abs(poses[:, :2] - setup.poses.truth[k, :, :2]).max()))
        off = wrap(poses[:, 2] - readings.headings[k, :, lane])
        turn = max(turn, float(np.abs(off).max()))
    return place, turn


@pytest.mark.parametrize(
    ("errors", "most"),
    [
        (ErrorSigmas(speed_scale=0.05, turn_rate_bias=0.02), 1e-9),
        (ErrorSigmas(wind=1.0), 1e-4),
        (ErrorSigmas(gust=0.3, gust_time=4.0), 0.02),
        (ErrorSigmas(1.0, 0.3, 4.0, speed_scale=0.05, turn_rate_bias=0.02), 0.02),
    ],
)
def test_who_knows_all_errors_and_starts_right_hardly_strays(
    errors: ErrorSigmas, most: float
) -> None:
    team = without_noise(a_team(tuple(ERROR_STATES)))
    team = replace(team, errors=replace(errors, estimated=tuple(ERROR_STATES)))
    for lane in range(2):
        place, turn = strayed(team, lane)
        assert turn < 1e-9
        assert place < most


def test_along_the_readings_in_wind_one_strays_by_fourth_order_in_the_sample_time() -> None:
    orbits, wind = a_team(()).orbits, np.array([1.5, -0.7])
    off = []
    for time in (0.4, 0.2):
        steps = round(40.0 / time)
        flown = motion_in_air(orbits, time, steps, wind.reshape(1, 1, 2, 1))
        x = np.concatenate([position(orbits, 0.0), flown.headings[0]], axis=1)
        for k in range(steps):
            speeds, turns = flown.speeds[k, :, 0], flown.turn_rates[k, :, 0]
            x[:, :2] += displacement(x[:, 2], speeds, turns, time) + time * wind
            x[:, 2] += time * turns
            if (k + 1) * time == 30.0:
                off.append(np.abs(x[:, :2] - position(orbits, 30.0)).max())
    assert off[0] < 0.02
    assert off[0] / off[1] == pytest.approx(16.0, rel=0.3)


def test_sightings_without_noise_are_what_a_filter_that_knows_all_errors_expects() -> None:
    team = without_noise(a_team(tuple(ERROR_STATES), fov=np.radians(250.0)))
    team = replace(team, errors=replace(team.errors, clock_offset=0.0))
    setup, readings = readings_of(team, 30, 2)
    poses, checked = setup.poses, 0
    for k in range(1, 31):
        true = poses.truth[k].copy()
        for lane in range(2):
            true[:, 2] = readings.headings[k, :, lane]
            errors = [readings.constants[:, lane], readings.changing[k, :, lane]]
            state = np.concatenate([true.ravel(), *errors])
            for s in range(poses.first[k], poses.first[k + 1]):
                o, t, kind = (int(one[s]) for one in (poses.observers, poses.targets, poses.kinds))
                expected, _ = sighted(state, kind, o, t, setup)
                reading = float(readings.sightings[s, lane])
                if not np.isnan(reading) and kind < 2:
                    off = reading - expected
                    assert abs(off if kind == 1 else float(wrap(off))) < 1e-9
                    checked += 1
    assert checked > 100


def test_a_sighting_reads_what_is_there_when_the_observers_clock_shows_its_stamp() -> None:
    team = without_noise(a_team(("clock_offset",)))
    errors = ErrorSigmas(clock_offset=0.2, estimated=("clock_offset",))
    plain = replace(team.sensors, bearing_bias_sigmas=np.zeros(3), bearing_walk_sigmas=np.zeros(3))
    team = replace(team, errors=errors, sensors=plain)
    setup, readings = readings_of(team, 30, 2)
    poses, off, most = setup.poses, [], 0.0
    for k in range(1, 31):
        for s in range(poses.first[k], poses.first[k + 1]):
            o, t, kind = (int(one[s]) for one in (poses.observers, poses.targets, poses.kinds))
            then = 0.1 * k + readings.constants[o, 1]
            places = np.concatenate([position(team.orbits, then), team.landmarks])
            psi, q = heading(team.orbits, then)[o], places[t] - places[o]
            there = (np.arctan2(q[1], q[0]) - psi, np.hypot(*q), psi)[kind]
            state = np.concatenate([poses.truth[k].ravel(), readings.constants[:, 1]])
            read = readings.speeds[k - 1, :, 1], readings.turn_rates[k - 1, :, 1]
            expected, _ = sighted(state, kind, o, t, setup, read)
            still, _ = sighted(np.append(state[:9], np.zeros(3)), kind, o, t, setup, read)
            compass = 0.1 if kind == 2 else 1e-9
            reading = float(readings.sightings[s, 1])
            gaps = [reading - there, expected - there, still - there]
            gaps = [abs(gap if kind == 1 else float(wrap(gap))) for gap in gaps]
            assert gaps[0] < compass * 5.0
            off.append(gaps[1])
            most = max(most, gaps[2])
    assert max(off) < 0.02 < 0.2 < most


def test_without_wind_headings_are_tangents_and_speeds_are_those_of_the_circles() -> None:
    orbits = a_team(()).orbits
    flown = motion_in_air(orbits, 0.1, 50, np.zeros((1, 1, 2, 1)))
    off = wrap(flown.headings[..., 0] - heading(orbits, 0.1 * np.arange(51)))
    np.testing.assert_allclose(off, 0.0, atol=1e-10)
    np.testing.assert_allclose(flown.speeds[..., 0], np.tile(orbits.speeds, (50, 1)), rtol=1e-10)
    np.testing.assert_allclose(
        flown.turn_rates[..., 0], np.tile(orbits.turn_rates, (50, 1)), rtol=1e-8
    )


def test_in_wind_the_air_velocity_is_that_over_ground_less_the_wind() -> None:
    orbits, wind = a_team(()).orbits, np.array([1.5, -0.7])
    flown = motion_in_air(orbits, 1e-3, 2000, wind.reshape(1, 1, 2, 1))
    ahead = heading(orbits, 1e-3 * np.arange(2001))
    ground = orbits.speeds[:, None] * np.stack([np.cos(ahead), np.sin(ahead)], axis=-1)
    air = ground - wind
    off = wrap(flown.headings[..., 0] - np.arctan2(air[..., 1], air[..., 0]))
    np.testing.assert_allclose(off, 0.0, atol=1e-6)
    middle = np.hypot(*np.moveaxis(0.5 * (air[1:] + air[:-1]), -1, 0))
    np.testing.assert_allclose(flown.speeds[..., 0], middle, rtol=1e-6)


def test_errors_are_drawn_with_their_sigmas_and_gusts_with_their_correlation() -> None:
    team = a_team(tuple(ERROR_STATES))
    _, readings = readings_of(team, 400, 60)
    layout = layout_of(team)
    constant = (
        np.sqrt(np.mean(readings.constants**2, axis=1)) / layout.sigmas[: len(readings.constants)]
    )
    np.testing.assert_allclose(constant, 1.0, atol=0.35)
    gusts, walks = np.split(readings.changing, [6], axis=1)
    assert np.mean(gusts**2) == pytest.approx(0.3**2, rel=0.1)
    lagged = np.mean(gusts[20:] * gusts[:-20]) / np.mean(gusts**2)
    assert lagged == pytest.approx(np.exp(-2.0 / 4.0), abs=0.08)
    for k, (sigma, time) in enumerate([(0.04, 2.0), (0.03, 0.5)]):
        walk = walks[:, k]
        assert np.mean(walk**2) == pytest.approx(sigma**2, rel=0.2)
        lagged = np.mean(walk[5:] * walk[:-5]) / np.mean(walk**2)
        assert lagged == pytest.approx(np.exp(-0.5 / time), abs=0.1)


def test_a_key_that_is_added_leaves_all_draws_before_its_own() -> None:
    team = a_team(())
    plain = replace(team, errors=ErrorSigmas())
    plain = replace(
        plain,
        sensors=replace(
            plain.sensors,
            detection=np.ones(3),
            bearing_bias_sigmas=np.zeros(3),
            bearing_walk_sigmas=np.zeros(3),
        ),
    )
    _, quiet = readings_of(plain, 30, 3)
    biased = replace(
        plain,
        errors=ErrorSigmas(
            speed_scale=0.05, turn_rate_bias=0.02, estimated=("speed_scale", "turn_rate_bias")
        ),
    )
    _, loud = readings_of(biased, 30, 3)
    np.testing.assert_array_equal(loud.initial, quiet.initial)
    np.testing.assert_array_equal(loud.sightings, quiet.sightings)
    scales, biases = loud.constants[:3], loud.constants[3:]
    speeds = plain.orbits.speeds[:, None]
    np.testing.assert_allclose(
        loud.speeds - quiet.speeds,
        np.broadcast_to(speeds / (1.0 + scales) - speeds, (30, 3, 3)),
        atol=1e-12,
    )
    np.testing.assert_allclose(
        loud.turn_rates - quiet.turn_rates, np.broadcast_to(-biases, (30, 3, 3)), atol=1e-12
    )
    missed = replace(plain, sensors=replace(plain.sensors, detection=np.full(3, 0.5)))
    _, rare = readings_of(missed, 30, 3)
    np.testing.assert_array_equal(rare.speeds, quiet.speeds)
    there = ~np.isnan(rare.sightings)
    assert 0.3 < there.mean() < 0.8
    np.testing.assert_array_equal(rare.sightings[there], quiet.sightings[there])


def test_bearing_and_distance_are_missed_together_and_a_compass_never() -> None:
    team = replace(a_team((), detection=0.6), errors=ErrorSigmas())
    setup, readings = readings_of(team, 300, 4)
    poses, missed = setup.poses, np.isnan(readings.sightings)
    step = np.repeat(np.arange(len(poses.first) - 1), np.diff(poses.first))
    own = ~of_targets(poses.kinds)
    assert own.any()
    assert not missed[own].any()
    assert not missed[poses.observers == 0].any()
    key = [step, poses.observers, poses.targets]
    pairs = [s for s in range(1, len(step)) if all(one[s] == one[s - 1] for one in key)]
    assert len(pairs) > 50
    np.testing.assert_array_equal(missed[pairs], missed[np.array(pairs) - 1])
    some = (poses.observers > 0) & ~own
    assert missed[some].mean() == pytest.approx(0.4, abs=0.06)


def test_who_is_in_view_is_decided_by_the_true_heading() -> None:
    team = a_team(("wind",), fov=np.radians(120.0), detection=1.0)
    team = replace(team, errors=replace(team.errors, wind=2.0, gust=0.0))
    setup, readings = readings_of(team, 200, 3)
    poses, missed = setup.poses, np.isnan(readings.sightings)
    step = np.repeat(np.arange(len(poses.first) - 1), np.diff(poses.first))
    places = np.concatenate(
        [poses.truth[..., :2], np.broadcast_to(poses.landmarks, (201, 2, 2))], axis=1
    )
    q = places[step, poses.targets] - places[step, poses.observers]
    off = wrap(
        np.arctan2(q[:, 1], q[:, 0])[:, None]
        - readings.headings[step, poses.observers]
        - team.sensors.boresights[poses.observers, None]
    )
    seen = of_targets(poses.kinds)
    np.testing.assert_array_equal(missed[seen], (np.abs(off) > np.radians(60.0))[seen])
    assert not missed[~seen].any()
    assert np.any(missed[seen].any(axis=1) & ~missed[seen].all(axis=1))


def run(team: Team, trials: int, **changes: object) -> MonteCarloResult:
    seen = possible_sightings(team, find_windows(team), 40)
    first = int(changes.pop("first_trial", 0))  # type: ignore[call-overload]
    options = FilterOptions(trials=trials, seed=5, with_series=True)
    return run_trials(team, seen, 40, options, first_trial=first, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("estimated", [(), tuple(ERROR_STATES)])
def test_parts_merge_to_the_bytes_of_the_whole_and_survive_the_archive(
    estimated: tuple[str, ...],
) -> None:
    team = a_team(estimated)
    whole = run(team, 40, threads=1)
    parts = [run(team, 16, threads=2), run(team, 24, first_trial=16)]
    again = merge([unpack(pack(part)) for part in parts])
    assert bytes_of(again) == bytes_of(whole)
    assert again.branches[0].error_sums.tobytes() == whole.branches[0].error_sums.tobytes()
    e = len(layout_of(team).sigmas)
    assert whole.state_squares.shape == whole.states_covered.shape == (40, e)
    over_time = state_series(again)
    assert over_time.rms.shape == (41, e)
    np.testing.assert_allclose(
        np.mean(over_time.rms[1:] ** 2, axis=0), whole.state_squares.mean(axis=0)
    )
    np.testing.assert_allclose(over_time.sigma[0], layout_of(team).sigmas)
    assert series(again).position_rms.shape == (41, 3)


def test_an_archive_from_before_there_were_further_states_loads() -> None:
    plain = replace(a_team(()), errors=ErrorSigmas())
    part = run(plain, 16)
    with np.load(io.BytesIO(pack(part))) as stored:
        kept = {
            name: stored[name]
            for name in stored
            if "state" not in name and "error_sums" not in name
        }
    buffer = io.BytesIO()
    np.savez(buffer, **kept)
    old = unpack(buffer.getvalue())
    assert bytes_of(old)[:5] == bytes_of(part)[:5]
    assert merge([old]).state_squares.size == 0


def test_a_filter_that_knows_of_errors_is_consistent_and_one_that_does_not_is_sure_and_wrong() -> (
    None
):
    team = a_team(tuple(ERROR_STATES))
    small = replace(team, noise=Noise(0.1, 0.01, 0.3, 0.03))
    seen = possible_sightings(small, find_windows(small), 300)
    options = FilterOptions(trials=160, seed=2)
    knowing = run_trials(small, seen, 300, options)
    judged = anees(knowing.nees, 9)
    assert judged.verdict == "consistent", judged
    assert knowing.states_covered.mean() == pytest.approx(0.9973, abs=0.004)
    blind = replace(small, errors=replace(small.errors, estimated=()))
    lost = run_trials(blind, seen, 300, options)
    assert anees(lost.nees, 9).value > 3.0
    assert lost.state_squares.shape == (160, 0)
    # what is drawn is the same: only the filter differs
    believed = run_trials(blind, seen, 300, options, believed=small)
    assert believed.final_errors.tobytes() == knowing.final_errors.tobytes()


def test_constant_errors_that_are_not_estimated_disturb_the_filter_of_poses() -> None:
    team = a_team((), detection=1.0)
    team = replace(team, errors=ErrorSigmas(speed_scale=0.05, turn_rate_bias=0.02))
    seen = possible_sightings(team, find_windows(team), 100)
    found = run_trials(team, seen, 100, FilterOptions(trials=64, seed=2))
    quiet = replace(team, errors=ErrorSigmas())
    none = np.zeros(3)
    sensors = replace(quiet.sensors, bearing_bias_sigmas=none, bearing_walk_sigmas=none)
    quiet = replace(quiet, sensors=sensors)
    calm = run_trials(quiet, seen, 100, FilterOptions(trials=64, seed=2))
    assert anees(found.nees, 9).value > 1.3 * anees(calm.nees, 9).value
