"""Trials with lasting errors, moving air and missed sightings: what is true and what is read."""

import io
from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation import trial_readings
from syncplan.estimation.consistency import anees
from syncplan.estimation.drawn_errors import motion_in_air
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import (
    DISTANCE_KIND,
)
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.estimation.trials import MonteCarloResult, merge, pack, series, state_series, unpack
from syncplan.orbits.circles import heading, position, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.sighting_kinds import of_targets
from syncplan.orbits.team import Team
from tests.estimation.test_montecarlo import bytes_of
from tests.tools.filter_scenes import ALL, Scene, a_team, quiet, scene_of, true_state
from tests.tools.reference_filter import displacement, moved_state, sighted

NOISELESS = Noise(0.0, 0.0, 0.0, 0.0)
TINY = 1e-12


def without_noise(team: Team) -> Team:
    tiny = np.full(team.count, TINY)
    sure = replace(
        team.sensors,
        bearing_sigmas=tiny,
        range_sigmas=tiny,
        compass_sigmas=tiny,
        detection=np.ones(team.count),
    )
    return replace(team, noise=NOISELESS, sensors=sure)


def samples_of(given: Scene) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """(s,) sample of each sighting."""
    first = given.setup.first
    return np.repeat(np.arange(len(first) - 1), np.diff(first))


def strayed(team: Team, lane: int, duration: float = 40.0) -> tuple[float, float]:
    """How far, in m and rad, a vehicle that knows all errors strays from the truth at most."""
    steps, n = round(duration / team.sensors.sample_time), team.count
    setup, readings, truth = scene_of(team, steps, lane + 1)
    state, place, turn = true_state(truth, 0, lane), 0.0, 0.0
    np.testing.assert_allclose(readings.initial[..., lane].ravel(), state[: 3 * n], atol=1e-12)
    for k in range(1, steps + 1):
        speeds, turns = readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane]
        state, true = moved_state(state, speeds, turns, setup), true_state(truth, k, lane)
        state[3 * n :] = true[3 * n :]
        off = (state - true)[: 3 * n].reshape(n, 3)
        place = max(place, float(np.abs(off[:, :2]).max()))
        turn = max(turn, float(np.abs(wrap(off[:, 2])).max()))
    return place, turn


@pytest.mark.parametrize(
    ("errors", "most"),
    [
        (ErrorSigmas({"wind": 1.0}), 1e-4),
        (
            ErrorSigmas(
                {"wind": 1.0, "gusts": 0.3, "speed_scale": 0.05, "turn_rate_bias": 0.02},
                gust_time=4.0,
            ),
            0.02,
        ),
    ],
)
def test_who_knows_all_errors_and_starts_right_hardly_strays(
    errors: ErrorSigmas, most: float
) -> None:
    team = without_noise(a_team(ALL))
    team = replace(team, errors=replace(errors, estimated=ALL))
    for lane in range(2):
        place, turn = strayed(team, lane)
        assert turn < 1e-9
        assert place < most


def test_a_drift_of_any_name_moves_the_air(monkeypatch: pytest.MonkeyPatch) -> None:
    leeway = replace(ERROR_STATES["wind"], common=False, sigma=lambda team: np.ones(team.count))
    monkeypatch.setattr(trial_readings, "ERROR_STATES", {"leeway": leeway})
    assert trial_readings.in_moving_air(quiet(a_team(())))


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
    team = without_noise(a_team(ALL, fov=np.radians(250.0)))
    sigmas = {**team.errors.sigmas, "clock_offset": 0.0}
    given = scene_of(replace(team, errors=replace(team.errors, sigmas=sigmas)), 30, 2)
    setup, readings, truth = given
    places, step = (setup.kinds, setup.observers, setup.targets), samples_of(given)
    seen = np.argwhere(~np.isnan(readings.sightings))
    assert len(seen) > 100
    for s, lane in seen:
        kind, o, t = (int(one[s]) for one in places)
        expected, _ = sighted(true_state(truth, step[s], lane), kind, o, t, setup)
        off = readings.sightings[s, lane] - expected
        assert abs(off if kind == DISTANCE_KIND else float(wrap(off))) < 1e-9


def test_a_sighting_reads_what_is_there_when_the_observers_clock_shows_its_stamp() -> None:
    errors = ErrorSigmas({"clock_offset": 0.2}, estimated=("clock_offset",))
    team = quiet(without_noise(a_team(())), errors)
    given = scene_of(team, 30, 2)
    setup, readings, truth = given
    gaps = []
    for s, k in enumerate(samples_of(given).tolist()):
        kind, o, t = (int(one[s]) for one in (setup.kinds, setup.observers, setup.targets))
        then = 0.1 * k + truth.constants[o, 1]
        places = np.concatenate([position(team.orbits, then), team.landmarks])
        psi, q = heading(team.orbits, then)[o], places[t] - places[o]
        there = (np.arctan2(q[1], q[0]) - psi, np.hypot(*q), psi)[kind]
        state, read = true_state(truth, k, 1), (readings.speeds[k - 1], readings.turn_rates[k - 1])
        known, unknown = (
            sighted(one, kind, o, t, setup, (read[0][:, 1], read[1][:, 1]))[0]
            for one in (state, np.append(state[:9], np.zeros(3)))
        )
        off = np.array([readings.sightings[s, 1], known, unknown]) - there
        gaps.append(np.abs(off if kind == DISTANCE_KIND else wrap(off)))
    read, known, unknown = np.max(gaps, axis=0)
    assert read < 1e-9
    assert known < 0.02 < 0.2 < unknown


@pytest.mark.parametrize("most", [0.2, 6.0])
def test_motion_through_the_air_is_that_of_its_formulas(most: float) -> None:
    orbits, time, steps = a_team(()).orbits, 0.1, 150
    drift = np.random.default_rng(5).uniform(-most, most, (steps + 1, orbits.count, 2, 3))
    flown = motion_in_air(orbits, time, steps, drift)
    at = np.clip(np.arange(-2, steps + 2), 0, steps)
    ground = np.diff(position(orbits, time * np.arange(-2, steps + 3)), axis=0)
    x, y = np.moveaxis(ground[..., None] - time * drift[at], 2, 0)
    b = np.unwrap(np.arctan2(y, x), axis=0)
    psi = (5.0 * (b[1:-2] + b[2:-1]) - (b[:-3] + b[3:])) / 8.0
    np.testing.assert_allclose(np.diff(flown.headings, axis=0), np.diff(psi, axis=0), atol=1e-12)
    np.testing.assert_allclose(wrap(flown.headings - psi), 0.0, atol=1e-9)
    turns = np.diff(psi, axis=0)
    np.testing.assert_allclose(flown.turn_rates, turns / time, atol=1e-11)
    speeds = np.hypot(x, y)[2:-2] / (time * np.sinc(0.5 * turns / np.pi))
    np.testing.assert_allclose(flown.speeds, speeds, rtol=1e-12)


def test_errors_are_drawn_with_their_sigmas_and_gusts_with_their_correlation() -> None:
    team = a_team(ALL)
    truth, sigmas = scene_of(team, 400, 60).truth, layout_of(team).sigmas
    constant = np.sqrt(np.mean(truth.constants**2, axis=1))
    np.testing.assert_allclose(constant / sigmas[: len(constant)], 1.0, atol=0.35)
    gusts, *walks = np.split(truth.changing, [6, 7], axis=1)
    assert np.mean(gusts**2) == pytest.approx(0.3**2, rel=0.1)
    lagged = np.mean(gusts[20:] * gusts[:-20]) / np.mean(gusts**2)
    assert lagged == pytest.approx(np.exp(-2.0 / 4.0), abs=0.08)
    for walk, sigma, time in zip(walks, (0.04, 0.03), (2.0, 0.5), strict=True):
        assert np.mean(walk**2) == pytest.approx(sigma**2, rel=0.2)
        lagged = np.mean(walk[5:] * walk[:-5]) / np.mean(walk**2)
        assert lagged == pytest.approx(np.exp(-0.5 / time), abs=0.1)


def test_a_key_that_is_added_leaves_all_draws_before_its_own() -> None:
    names = ("speed_scale", "turn_rate_bias")
    plain = quiet(a_team((), detection=1.0))
    errors = ErrorSigmas({"speed_scale": 0.05, "turn_rate_bias": 0.02}, estimated=names)
    biased = replace(plain, errors=errors)
    missed = replace(plain, sensors=replace(plain.sensors, detection=np.full(3, 0.5)))
    calm, loud, rare = (scene_of(one, 30, 3) for one in (plain, biased, missed))
    expected, found = calm.readings, loud.readings
    np.testing.assert_array_equal(found.initial, expected.initial)
    np.testing.assert_array_equal(found.sightings, expected.sightings)
    scales, biases = np.split(loud.truth.constants, 2)
    speeds = plain.orbits.speeds[:, None]
    slower, turned = speeds / (1.0 + scales) - speeds, -biases
    for off, known in (
        (found.speeds - expected.speeds, slower),
        (found.turn_rates - expected.turn_rates, turned),
    ):
        np.testing.assert_allclose(off, np.broadcast_to(known, off.shape), atol=1e-12)
    np.testing.assert_array_equal(rare.readings.speeds, expected.speeds)
    there = ~np.isnan(rare.readings.sightings)
    assert 0.3 < there.mean() < 0.8
    np.testing.assert_array_equal(rare.readings.sightings[there], expected.sightings[there])


def test_bearing_and_distance_are_missed_together_and_a_compass_never() -> None:
    given = scene_of(replace(a_team((), detection=0.6), errors=ErrorSigmas()), 300, 4)
    setup, missed = given.setup, np.isnan(given.readings.sightings)
    own = ~of_targets(setup.kinds)
    assert own.any()
    assert not missed[own].any()
    assert not missed[setup.observers == 0].any()
    key = np.stack([samples_of(given), setup.observers, setup.targets])
    pairs = 1 + np.flatnonzero(np.all(key[:, 1:] == key[:, :-1], axis=0))
    assert len(pairs) > 50
    np.testing.assert_array_equal(missed[pairs], missed[pairs - 1])
    assert missed[(setup.observers > 0) & ~own].mean() == pytest.approx(0.4, abs=0.06)


def test_who_is_in_view_is_decided_by_the_true_heading() -> None:
    team = a_team(("wind",), fov=np.radians(120.0), detection=1.0)
    sigmas = {**team.errors.sigmas, "wind": 2.0, "gusts": 0.0}
    given = scene_of(replace(team, errors=replace(team.errors, sigmas=sigmas)), 200, 3)
    setup, missed = given.setup, np.isnan(given.readings.sightings)
    step, poses, observers = samples_of(given), given.truth.poses, setup.observers
    fixed = np.broadcast_to(setup.landmarks, (201, 2, 2))
    places = np.concatenate([poses[..., :2, 0], fixed], axis=1)
    q = places[step, setup.targets] - places[step, observers]
    ahead = poses[step, observers, 2] + team.sensors.boresights[observers, None]
    off = wrap(np.arctan2(q[:, 1], q[:, 0])[:, None] - ahead)
    seen = of_targets(setup.kinds)
    np.testing.assert_array_equal(missed[seen], (np.abs(off) > np.radians(60.0))[seen])
    assert not missed[~seen].any()
    assert np.any(missed[seen].any(axis=1) & ~missed[seen].all(axis=1))


def run_of(team: Team, steps: int, trials: int, **options: object) -> MonteCarloResult:
    seen = possible_sightings(team, find_windows(team), steps)
    return run_trials(team, seen, steps, FilterOptions(trials=trials, **options))  # type: ignore[arg-type]


def test_states_have_a_series_that_sums_up_to_their_errors() -> None:
    team = a_team(ALL)
    whole, sigmas = run_of(team, 40, 40, seed=5, with_series=True), layout_of(team).sigmas
    assert whole.state_squares.shape == whole.states_covered.shape == (40, len(sigmas))
    over_time = state_series(whole)
    assert over_time.rms.shape == (41, len(sigmas))
    np.testing.assert_allclose(
        np.mean(over_time.rms[1:] ** 2, axis=0), whole.state_squares.mean(axis=0)
    )
    np.testing.assert_allclose(over_time.sigma[0], sigmas)
    assert series(whole).position_rms.shape == (41, 3)


def test_an_archive_from_before_there_were_further_states_loads() -> None:
    part = run_of(replace(a_team(()), errors=ErrorSigmas()), 40, 16, seed=5)
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
    team = a_team(ALL)
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
