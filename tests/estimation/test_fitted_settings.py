"""Fits to recordings: judged by sightings that the filter is not given, refused where no better."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.recorded_readings import clock_of
from syncplan.estimation.recorded_run import BLOCK_S, filtered, lasting_of, run_of
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import FIT_SHARE, FITTED, point_of, settings_at
from syncplan.estimation.replays import OPTIONS, replay, replay_with
from syncplan.estimation.trials import series
from syncplan.estimation.withheld_sightings import UNTOLD, Predictions, judged, predictions_of
from syncplan.orbits.circles import wrap
from syncplan.orbits.noise import Noise
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import ReplayDocument, replay_document
from tests.searches.tuning import compared
from tests.tools.recordings import Recipe, part_of, with_robots, write_csv, write_recording
from tests.tools.stories import shown

RECIPE = Recipe(duration=120.0, period=0.1, speed_sigma=0.3, turn_rate_sigma=0.05)
FIT: dict[str, Any] = {
    "distances": False,
    "speed_scale_sigma": 0.0,
    "turn_rate_bias_sigma": 0.0,
    "sample_time": 0.1,
}
EKF = FilterOptions(trials=1, filter="ekf")


@pytest.fixture(scope="module")
def white(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Bearings with errors of their own, sigma 0.05 rad."""
    folder = tmp_path_factory.mktemp("white") / "recording"
    return load_log(write_recording(folder, replace(RECIPE, bearing_sigma=0.05), seed=6))


@pytest.fixture(scope="module")
def lasting(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Bearings whose errors of a target, sigma 0.05 rad, last for 10 s; and 0.005 rad beside."""
    folder = tmp_path_factory.mktemp("lasting") / "recording"
    log = load_log(write_recording(folder, replace(RECIPE, bearing_sigma=0.005), seed=6))
    random = np.random.default_rng(1)

    def off(robot: RobotLog) -> RobotLog:
        block = ((robot.times - robot.times[0]) // BLOCK_S).astype(int)
        errors = 0.05 * random.standard_normal((block[-1] + 1, 10))
        return replace(robot, bearings=robot.bearings + errors[block, robot.subjects % 10])

    return with_robots(log, off)


@pytest.fixture(scope="module")
def walking(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Bearings with errors of a robot that walk, 0.1 rad and 5 s; and 0.02 rad beside."""
    folder = tmp_path_factory.mktemp("walking") / "recording"
    recipe = replace(RECIPE, duration=300.0, bearing_sigma=0.02)
    log = load_log(write_recording(folder, recipe, seed=6))
    random = np.random.default_rng(2)

    def off(robot: RobotLog) -> RobotLog:
        times, row = np.unique(robot.times, return_inverse=True)
        errors = 0.1 * random.standard_normal(len(times))
        for k, kept in enumerate(np.exp(-np.diff(times) / 5.0)):
            errors[k + 1] = kept * errors[k] + np.sqrt(1.0 - kept**2) * errors[k + 1]
        return replace(robot, bearings=robot.bearings + errors[row])

    return with_robots(log, off)


def settings(bearing_sigma: float, speed_sigma: float = 0.3, **others: Any) -> ReplaySettings:
    noise = Noise(speed_sigma, 0.05, 0.01, 0.01)
    return ReplaySettings(bearing_sigma=bearing_sigma, noise=noise, **{**FIT, **others})


def test_settings_are_those_of_their_point() -> None:
    given, names = ReplaySettings(delay=0.3), tuple(FITTED)
    point = point_of(given, names)
    found = settings_at(given, names, point)
    assert found.noise.speed_sigma == pytest.approx(given.noise.speed_sigma, rel=1e-12)
    np.testing.assert_allclose(point_of(found, names), point, rtol=1e-12)
    # a step of 1 is a sigma e times as large, and no point is out of all bounds
    assert settings_at(given, names, point + 1.0).range_sigma == pytest.approx(0.4 * np.e)
    assert settings_at(given, names, point + 900.0).bearing_sigma == 3.0
    assert settings_at(given, names, point - 900.0).noise.turn_rate_sigma == 1e-4


# --- sightings that the filter is not given -------------------------------------------------------


def test_every_sighting_is_withheld_once(white: Log) -> None:
    given = settings(0.05)
    every = predictions_of(white, given, EKF, (0, 1, 2), 3, 30.0)
    one = predictions_of(white, given, EKF, (1,), 3, 30.0)
    count = len(run_of(white, given, EKF).sightings.times)
    assert len(every.names) == len(set(every.names.tolist())) == count
    assert set(one.names.tolist()) < set(every.names.tolist())
    # a stated delay moves times, not names
    late = predictions_of(white, replace(given, delay=0.04), EKF, (1,), 3, 30.0)
    assert len(one.among(late).names) > 0.98 * len(one.names)


def test_a_withheld_sighting_teaches_the_filter_nothing(white: Log) -> None:
    shifted = with_robots(white, lambda robot: replace(robot, bearings=robot.bearings + 0.01))
    blind = []
    for log in (white, shifted):
        run = run_of(log, settings(0.05), EKF)
        variances = UNTOLD[run.sightings.kinds]
        setup = run.setup._replace(variances=variances)
        blind.append(filtered(replace(run, setup=setup), EKF))
    first, second = blind
    np.testing.assert_allclose(
        wrap(second.innovations - first.innovations), np.full(len(variances), 0.01), atol=1e-5
    )
    alone = replay(white, EKF, **{**_given(settings(0.05)), "landmarks": [], "meetings": False})
    np.testing.assert_allclose(
        first.result.final_errors, alone.result.final_errors, atol=1e-3, rtol=1e-3
    )


def test_predictions_are_what_the_filter_expects(white: Log) -> None:
    found = predictions_of(white, settings(0.05), EKF, (0, 1, 2), 3, 30.0)
    # the mean log-density of normal errors is their entropy, less for what poses are off
    alone = predictions_of(white, settings(5.0), EKF, (0, 1, 2), 3, 30.0)
    most = -np.log(0.05 * np.sqrt(2.0 * np.pi * np.e))
    assert most - 0.5 < float(found.scores.mean()) < most
    assert float(alone.scores.mean()) < float(found.scores.mean()) - 2.0
    verdict = judged(alone, found, white=True)
    assert verdict.is_better
    assert not judged(found, alone, white=True).is_better
    assert verdict.gain == pytest.approx(float((found.scores - alone.scores).mean()))


def test_the_same_predictions_are_no_better() -> None:
    times = np.arange(0.0, 300.0, 0.5)
    one = Predictions(
        names=np.arange(len(times)),
        times=times,
        kinds=np.zeros(len(times), np.int64),
        errors=np.random.default_rng(0).uniform(-1.0, 1.0, len(times)),
        scores=np.zeros(len(times)),
    )
    same = judged(one, one, white=True)
    assert (same.gain, same.error_ratio, same.is_better) == (0.0, 1.0, False)
    likelier = replace(one, scores=one.scores + 1.0)
    assert judged(one, likelier, white=True).is_better
    # where innovations are not white, likelier is not enough
    closer = replace(likelier, errors=0.9 * one.errors)
    assert judged(one, closer, white=False).is_better
    assert judged(one, closer, white=False).error_ratio == pytest.approx(0.9)
    wider = replace(likelier, errors=1.01 * one.errors)
    assert not judged(one, wider, white=True).is_better
    rest = replace(one, names=one.names + 100)
    assert judged(one, rest, white=True).gain == 0.0
    assert judged(None, one, white=True).is_better
    assert not judged(one, None, white=True).is_better


# --- errors that last -----------------------------------------------------------------------------


def test_errors_that_last_are_found_by_their_sums(white: Log, lasting: Log) -> None:
    for log, sigma, lasts in ((white, 0.05, False), (lasting, 0.05, True)):
        run = run_of(log, settings(sigma), EKF)
        found = lasting_of(run, filtered(run, EKF), 0)
        assert found.lasts is lasts
        assert (found.growth > 1.5) is lasts
    run = run_of(white, settings(0.05), EKF)
    made = filtered(run, EKF)
    equal = replace(
        made, innovations=np.ones(len(made.weights)), weights=np.ones(len(made.weights))
    )
    seen = run.sightings
    block = (seen.times // BLOCK_S).astype(int)
    _, counts = np.unique([seen.observers, seen.targets, block], axis=1, return_counts=True)
    # k equal ones add up to k, not root k
    expected = float(np.sum(counts**2) / np.sum(counts))
    assert lasting_of(run, equal, 0).ratio == pytest.approx(expected)


def test_a_fit_to_errors_that_last_does_no_harm(lasting: Log) -> None:
    found = replay(lasting, tune=True, **_given(settings(0.15)))
    tuning = found.tuning
    assert tuning is not None
    # the fit follows the errors: white noise of a tenth of them makes innovations likeliest
    assert tuning.after.bearing_sigma < 0.01
    assert tuning.verdict.error_ratio > 1.0
    assert not tuning.accepted
    assert found.settings.bearing_sigma == 0.15
    rest = {**_given(settings(0.15))}
    known = replay(lasting, **rest, with_series=True)
    begin = round(tuning.duration / 0.1)
    given = np.sqrt(np.mean(series(known.result).position_rms[begin:] ** 2))
    assert float(found.accuracy.overall().position) <= 1.02 * given


@pytest.mark.long
def test_a_bearing_walk_is_fitted_and_taken_where_it_is_better(walking: Log) -> None:
    found = replay(walking, tune=True, **_given(settings(0.02)))
    tuning = found.tuning
    assert tuning is not None
    assert tuning.accepted
    after = tuning.after
    assert after.bearing_sigma == pytest.approx(0.02, rel=0.25)
    assert after.bearing_walk_sigma == pytest.approx(0.1, rel=0.4)
    assert 2.0 < after.bearing_walk_time < 12.0
    assert tuning.bearing_growth == 1.0
    assert found.settings.bearing_walk_sigma == after.bearing_walk_sigma
    record = replay_document(found).as_json()["tuning"]
    assert record["after"]["bearing_walk_sigma_rad"] == after.bearing_walk_sigma
    assert "bearing_walk_sigma_rad" not in record["before"]
    rest = replace(settings(0.02, window=0.0), portion=(FIT_SHARE, 1.0))
    plain = replay_with(walking, rest, OPTIONS)
    assert found.accuracy.overall().position < plain.accuracy.overall().position


def _given(chosen: ReplaySettings) -> dict[str, Any]:
    return {**FIT, "bearing_sigma": chosen.bearing_sigma, "noise": chosen.noise, "window": 0.0}


def test_a_fit_that_is_no_better_is_refused_and_said_to_be(
    white: Log, tmp_path: Path, printed: Any
) -> None:
    words = (
        *("--tune", "--no-distances", "--speed-scale-sigma", "0"),
        *("--turn-rate-bias-sigma-rad-s", "0", "--sample-time-s", "0.1"),
        *("--bearing-sigma-rad", "0.05", "--speed-sigma-mps", "0.3"),
        *("--turn-rate-sigma-rad-s", "0.05", "--window-s", "0"),
    )
    folder = write_csv(white, tmp_path / "white")
    report = json.loads(printed("replay", str(folder), *words))
    tuning, whole = report["tuning"], clock_of(white, 0.1)
    assert report["begin_s"] == pytest.approx(whole.begin + whole.duration / 3.0, abs=0.11)
    assert report["duration_s"] == pytest.approx(whole.duration * 2.0 / 3.0, abs=0.21)
    # what was given is true: no fit can be better, and nothing walks
    assert tuning["accepted"] is False
    assert report["filter"]["bearing_sigma_rad"] == 0.05 == tuning["before"]["bearing_sigma_rad"]
    assert tuning["after"]["bearing_sigma_rad"] != 0.05
    assert "bearing_walk_sigma_rad" not in tuning["after"]
    refused = "the fit is refused, the rest runs with those that were given: with it, sightings of"
    assert any(note.startswith(refused) for note in report["notes"])
    out = shown(ReplayDocument.model_validate(report), 100)
    assert "fitted to the first 39.9 s, and refused" in " ".join(out.split())
    assert "bearing_sigma_rad" in out


def test_lasting_errors_are_named_in_place_of_smaller_sigmas(white: Log, lasting: Log) -> None:
    found = replay(lasting, OPTIONS, **_given(settings(0.08)))
    assert found.bearings.nis.verdict == "conservative"
    notes = [note for note in replay_document(found).notes if note.startswith("bearings")]
    assert len(notes) == 1
    assert "but their errors last: sums over 10 s are" in notes[0]
    assert "a smaller sigma would make the filter surer than it is" in notes[0]
    wide = replay(white, OPTIONS, **_given(settings(0.2)))
    assert any("their sigma may be less than 0.2 rad" in n for n in replay_document(wide).notes)


@pytest.mark.long
def test_a_fit_to_real_robots_does_no_harm(real: Log) -> None:
    """A part where settings that were fitted would do harm; all splits: tests.searches.tuning."""
    split = compared(part_of(real, 0.75, 0.9), [7, 15], distances=True)
    given, fitted = (one.accuracy.overall().position for one in (split.given, split.fitted))
    assert fitted > 2.0 * given
    assert split.does_no_harm
