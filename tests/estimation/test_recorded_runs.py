"""Recordings at their own times: delays, distances, lasting errors, starts, one step at a time."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.cli.arguments import poses_of
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.online_filter import OnlineFilter
from syncplan.estimation.recorded_readings import clock_of, true_poses
from syncplan.estimation.recorded_run import filtered, run_of
from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import MOST_RUNS, tuned
from syncplan.estimation.replays import OPTIONS, online_filter_of, replay, steps_of
from syncplan.estimation.trials import series
from syncplan.orbits.circles import wrap
from syncplan.orbits.noise import Noise
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import replay_document
from tests.searches.recording import after_a_minute
from tests.tools.recordings import Recipe, with_robots, write_recording

ODD = Recipe(jitter=0.8, speed_sigma=0.1, turn_rate_sigma=0.02, bearing_sigma=0.02)
SIGMAS: dict[str, Any] = {
    "bearing_sigma": 0.02,
    "range_sigma": 0.05,
    "noise": Noise(0.1, 0.02, 0.01, 0.01),
    "speed_scale_sigma": 0.0,
    "turn_rate_bias_sigma": 0.0,
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return load_log(write_recording(tmp_path_factory.mktemp("odd") / "recording", ODD, seed=2))


def position_of(found: Replay) -> float:
    return float(found.accuracy.overall().position)


# --- distances and lasting errors -----------------------------------------------------------------


def test_distances_count_where_they_are_recorded(log: Log) -> None:
    without, given = replay(log, distances=False, **SIGMAS), replay(log, **SIGMAS)
    assert position_of(given) < 0.8 * position_of(without)
    assert set(without.counts) == {"bearing"}
    distances = given.counts["distance"]
    assert distances.used + distances.rejected == given.bearings.used + given.bearings.rejected
    assert given.nis.count == pytest.approx(given.bearings.nis.count + distances.nis.count, abs=1)
    document = replay_document(given)
    assert document.distances is not None
    assert document.distances.used == distances.used
    assert document.filter.range_sigma_m == 0.05
    unmeasured = with_robots(
        log, lambda robot: replace(robot, ranges=np.full(len(robot.times), np.nan))
    )
    bearings = replay(unmeasured, **SIGMAS)
    assert position_of(bearings) == position_of(without)
    document = replay_document(bearings)
    assert (document.distances, document.filter.range_sigma_m) == (None, None)
    blind = with_robots(
        log, lambda robot: replace(robot, bearings=np.full(len(robot.times), np.nan))
    )
    only = replay(blind, **SIGMAS)
    assert only.bearings.used == 0 < only.counts["distance"].used
    assert position_of(only) < 2.0 * position_of(without)


def test_lasting_errors_are_found(log: Log) -> None:
    def worn(robot: RobotLog) -> RobotLog:
        return replace(
            robot,
            odometry=robot.odometry * [1.0, 1.1, 1.0] + [0.0, 0.0, 0.03],
            bearings=robot.bearings + 0.05,
        )

    bent, sigmas = with_robots(log, worn), {"speed_scale": 0.1, "turn_rate_bias": 0.05}
    states = {f"{name}_sigma": sigma for name, sigma in sigmas.items()}
    given = {**SIGMAS, **states, "bearing_bias_sigma": 0.1}
    found = replay(bent, **given)
    true = {"speed_scale": 1.0 / 1.1 - 1.0, "turn_rate_bias": -0.03, "bearing_bias": 0.05}
    assert [one.name for one in found.lasting_errors] == [name for name in true for _ in range(3)]
    for one in found.lasting_errors:
        assert abs(one.value - true[one.name]) < 4.0 * one.sigma < 0.1 * 4.0
    assert position_of(found) < 0.5 * position_of(replay(bent, **SIGMAS))
    assert found.anees.verdict == "consistent"
    listed = replay_document(found).lasting_errors
    assert listed is not None
    assert (listed[3].name, listed[3].robot, listed[3].unit) == (
        "turn_rate_bias",
        "robot1",
        "rad/s",
    )


# --- the start ------------------------------------------------------------------------------------


def test_a_start_drawn_about_the_truth_is_found_again(log: Log) -> None:
    unsure = {**SIGMAS, "noise": Noise(0.1, 0.02, 1.0, 0.1), "with_series": True}
    found = replay(log, start="prior", seed=3, **unsure)
    errors = series(found.result)
    assert (errors.position_rms[0] > 0.1).all()
    np.testing.assert_allclose(errors.position_sigma[0], np.sqrt(2.0))
    np.testing.assert_allclose(errors.heading_sigma[0], 0.1)
    assert (errors.position_rms[-1] < 0.3).all()
    again = replay(log, start="prior", seed=3, **unsure)
    other = replay(log, start="prior", seed=4, **unsure)
    assert (series(again.result).mean_errors == errors.mean_errors).all()
    assert (series(other.result).mean_errors[0] != errors.mean_errors[0]).all()
    sure = replay(log, start="prior")
    assert (sure.noise.position_sigma, sure.noise.heading_sigma) == (5.0, 0.5)


def test_a_start_that_is_given_is_taken(log: Log) -> None:
    truth = true_poses(log, clock_of(log, 0.05))[0]
    off = np.add(truth, [0.3, -0.4, 0.05])
    given: dict[str, Any] = {"start": "given", "start_poses": off, "with_series": True}
    found = series(replay(log, **given).result)
    np.testing.assert_allclose(found.mean_errors[0], np.tile([0.3, -0.4, 0.05], (3, 1)))
    np.testing.assert_allclose(found.position_sigma[0], np.sqrt(2.0))


def test_starts_that_can_not_be_are_refused(log: Log, tmp_path: Path) -> None:
    poses = np.zeros((2, 3))
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"start": "somewhere"}, "start: 'somewhere' is unknown; choose truth or prior or given"),
        ({"start": "given"}, "start_poses: poses belong to a start that is given"),
        ({"start_poses": poses}, "start_poses: poses belong to a start that is given"),
        (
            {"start": "given", "start_poses": poses},
            r"start_poses: has shape \(2, 3\); needed are x",
        ),
        (
            {"start": "given", "start_poses": np.full((3, 3), np.nan)},
            "start_poses: holds a value that is not finite",
        ),
    ]
    for options, problem in wrong:
        with pytest.raises(InputError, match=problem):
            replay(log, **options)
    for text in ("1,2;3,4,5", "1,2,x"):
        with pytest.raises(InputError, match="x, y and heading of one robot are needed"):
            poses_of(text, "--start-poses")
    with pytest.raises(InputError, match="can't be read: No such file"):
        poses_of(str(tmp_path / "nowhere"), "--start-poses")


# --- progress -------------------------------------------------------------------------------------


def test_progress_counts_the_sightings(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("syncplan.estimation.recorded_run.LOOK_EVERY_S", 0.001)
    run = run_of(log, ReplaySettings(sample_time=0.001), FilterOptions(trials=1))
    counts: list[int] = []
    found = filtered(run, FilterOptions(trials=1), counts.append)
    assert counts == sorted(counts)
    assert 0 < counts[-1] <= len(run.sightings.times) == len(found.weights)


# --- fitted sigmas --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Log:
    recipe = replace(ODD, duration=120.0, bearing_sigma=0.05, speed_sigma=0.3, turn_rate_sigma=0.05)
    folder = tmp_path_factory.mktemp("long") / "recording"
    return load_log(write_recording(folder, replace(recipe, wild=0.01), seed=6))


@pytest.mark.long
def test_sigmas_and_delay_are_found_without_truth(long: Log) -> None:
    random = np.random.default_rng(1)

    def late(robot: RobotLog) -> RobotLog:
        noise = 0.2 * random.standard_normal(len(robot.times))
        return replace(robot, times=robot.times + 0.17, ranges=robot.ranges + noise)

    wrong = ReplaySettings(
        bearing_sigma=0.01, noise=Noise(1.0, 0.3, 0.01, 0.01), speed_scale_sigma=0.0
    )
    # where robots truly are does not count, but for the start
    found = tuned(with_robots(with_robots(long, late), _truth_moved), wrong, OPTIONS)
    after = found.after
    assert after.delay == pytest.approx(0.17, abs=0.02)
    assert after.bearing_sigma == pytest.approx(0.05, rel=0.15)
    assert after.range_sigma == pytest.approx(0.2, rel=0.25)
    assert after.noise.speed_sigma == pytest.approx(0.3, rel=0.3)
    assert after.noise.turn_rate_sigma == pytest.approx(0.05, rel=0.5)
    assert (found.bearing_growth, found.range_growth) == (1.0, 1.0)
    assert min(found.gain, found.verdict.gain) > 0.5
    assert found.accepted
    assert found.runs <= MOST_RUNS


def _truth_moved(robot: RobotLog) -> RobotLog:
    truth = robot.truth.copy()
    truth[200:, 1:3] += 50.0
    return replace(robot, truth=truth)


def test_sigmas_grow_where_errors_of_sightings_last(long: Log) -> None:
    random = np.random.default_rng(1)

    def lasting(robot: RobotLog) -> RobotLog:
        begin = robot.times - robot.times[0]
        errors = 0.15 * random.standard_normal((int(begin[-1] / 10.0) + 2, 10))
        same = errors[(begin / 10.0).astype(int), robot.subjects % 10]
        own = 0.1 * random.standard_normal(len(robot.times))
        return replace(robot, ranges=robot.ranges + same + own)

    found = tuned(with_robots(long, lasting), ReplaySettings(delay=0.1, sample_time=0.1), OPTIONS)
    assert found.range_growth > 2.0
    assert found.after.range_sigma > 0.3


def test_too_few_sightings_to_fit_to_are_refused(log: Log) -> None:
    with pytest.raises(InputError, match="0 sightings in its first third are too few"):
        replay(log, tune=True, landmarks=[], meetings=False)


# --- the robust filter ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("landmarks", "distances", "times", "seed"),
    # from both seeds the first fit is a wrong one that noise as large as assumed explains
    [([7, 15], False, 1.08, 11), (None, True, 1.02, 13)],
)
def test_a_far_start_is_found_among_wild_readings(
    landmarks: list[int] | None, distances: bool, times: float, seed: int, real: Log
) -> None:
    assert OPTIONS.filter == "robust"
    given: dict[str, Any] = {"landmarks": landmarks, "distances": distances, "window": 0.0}
    given["with_series"] = True
    known = after_a_minute(replay(real, **given))
    assert after_a_minute(replay(real, start="prior", seed=seed, **given)) < times * known


# --- one step at a time ---------------------------------------------------------------------------

WILD = replace(ODD, duration=80.0, wild=0.01)
UNSURE = {**SIGMAS, "noise": Noise(0.1, 0.02, 2.0, 0.2), "start": "prior", "sample_time": 0.5}


@pytest.fixture(scope="module")
def wild(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return load_log(write_recording(tmp_path_factory.mktemp("wild") / "recording", WILD, seed=5))


@pytest.mark.parametrize(
    ("filter_", "scale"), [("ekf", 0.0), ("second-order", 0.01), ("robust", 0.0), ("robust", 0.01)]
)
def test_stepped_through_a_recording_it_finds_what_a_replay_finds(
    wild: Log, filter_: str, scale: float
) -> None:
    """From a start that is thrown off, so that `robust` has to look for it for a minute."""
    settings = ReplaySettings(**{**UNSURE, "speed_scale_sigma": scale})
    options = FilterOptions(
        trials=1, filter=filter_, gate_probability=0.999, with_series=True, seed=3
    )
    run = run_of(wild, settings, options)
    whole = filtered(run, options)
    online = online_filter_of(run, options)
    compared = 0
    for step in steps_of(run):
        online.step(step.speeds, step.turn_rates, step.arrived, step.span)
        if step.sample >= 0:
            off = online.poses - whole.estimates[step.sample]
            off[:, 2] = wrap(off[:, 2])
            assert np.abs(off).max() < 1e-7
            compared += 1
    assert compared == run.clock.samples
    np.testing.assert_allclose(online.errors, whole.errors, rtol=0.0, atol=1e-9)
    sigmas = np.sqrt(np.diag(online.covariance))[3 * len(wild.robots) :]
    np.testing.assert_allclose(sigmas, whole.error_sigmas, rtol=1e-7)
    assert online.counts["accepted"] == whole.result.accepted[0]
    assert online.time == pytest.approx(float(run.setup.spans.sum()))


def test_robust_is_restored_in_the_middle_of_its_search(wild: Log) -> None:
    settings = ReplaySettings(**{**UNSURE, "speed_scale_sigma": 0.05})
    options = FilterOptions(trials=1, filter="robust", gate_probability=0.999, seed=3)
    run = run_of(wild, settings, options)
    first, steps = online_filter_of(run, options), list(steps_of(run))
    second: OnlineFilter | None = None
    for k, step in enumerate(steps):
        first.step(step.speeds, step.turn_rates, step.arrived, step.span)
        if second is not None:
            second.step(step.speeds, step.turn_rates, step.arrived, step.span)
        elif k == len(steps) // 3:
            second = online_filter_of(run, options)
            second.memory = {name: one.copy() for name, one in first.memory.items()}
    assert second is not None
    np.testing.assert_array_equal(second.poses, first.poses)
    np.testing.assert_array_equal(second.covariance, first.covariance)
