"""Gaps of the truth: errors there are not known, and nothing else changes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.estimation.recorded_readings import clock_of, truth_known
from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.estimation.replay_tuning import tuned
from syncplan.estimation.replays import replay_with
from syncplan.estimation.trials import series
from syncplan.plotting.figures import specs_of
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import replay_document
from tests.tools.stories import shown

RECORDED = Path(__file__).parents[1] / "data" / "recordings"
OPTIONS = ReplayOptions(
    sample_time=0.2,
    bearing_sigma=0.03,
    range_sigma=0.1,
    speed_sigma=0.02,
    turn_rate_sigma=0.01,
    speed_scale_sigma=0.0,
    turn_rate_bias_sigma=0.0,
    window=5.0,
    with_series=True,
)


def recorded(name: str) -> Log:
    """A recording of two robots: `duplicates`, or `truth-gap`, the same without 13 s of truth."""
    return load_log(RECORDED / f"{name}.tar.xz")


def replayed(log: Log, **changes: Any) -> Replay:
    """A replay with options changed."""
    asked = replace(OPTIONS, **changes)
    return replay_with(log, asked.settings, asked.filter_options)


@pytest.fixture(scope="module")
def whole() -> Replay:
    """The recording with all its truth."""
    return replayed(recorded("duplicates"))


@pytest.fixture(scope="module")
def gapped() -> Replay:
    """The same with a gap."""
    return replayed(recorded("truth-gap"))


def test_each_sighting_counts_once_and_errors_are_those_of_the_clean_recording(
    whole: Replay,
) -> None:
    accuracy = whole.accuracy.overall()
    assert float(accuracy.position) == pytest.approx(0.0305, rel=0.02)
    assert float(accuracy.heading) == pytest.approx(0.00622, rel=0.02)
    assert whole.anees.value == pytest.approx(0.932, rel=0.02)


def test_where_the_truth_is_known_errors_are_those_with_the_whole_truth(
    whole: Replay, gapped: Replay
) -> None:
    assert gapped.unknown_truth_s == pytest.approx(12.8)
    errors, others = (series(one.result).mean_errors for one in (gapped, whole))
    np.testing.assert_allclose(errors[gapped.known], others[gapped.known], atol=1e-12)
    squares = np.square(others[1:][gapped.known[1:]])
    accuracy = gapped.accuracy.overall()
    expected = np.sqrt(squares[..., :2].sum(axis=2).mean())
    assert float(accuracy.position) == pytest.approx(expected, rel=1e-9)
    assert float(accuracy.heading) == pytest.approx(np.sqrt(squares[..., 2].mean()), rel=1e-9)
    notes = replay_document(gapped).notes
    assert [note for note in notes if "sigma" in note] == []


def test_windows_are_judged_as_with_the_whole_truth(whole: Replay, gapped: Replay) -> None:
    assert whole.seen is not None
    assert gapped.seen is not None
    assert gapped.seen.judged == whole.seen.judged
    assert gapped.seen.observable == whole.seen.observable
    # windows that begin in the gap are placed by odometry
    np.testing.assert_allclose(gapped.seen.position_sigmas, whole.seen.position_sigmas, rtol=0.1)


def test_a_run_that_would_begin_in_a_gap_begins_behind_it() -> None:
    log = recorded("truth-gap")
    settings = replace(OPTIONS.settings, portion=(1.0 / 3.0, 1.0))
    begun = replay_with(log, settings, OPTIONS.filter_options)
    whole = replay_with(log, OPTIONS.settings, OPTIONS.filter_options)
    assert begun.clock.begin - whole.clock.begin == pytest.approx(25.0)
    assert begun.known.all()
    ratio = begun.accuracy.overall().position / whole.accuracy.overall().position
    assert 0.5 < float(ratio) < 1.5


def test_a_fit_whose_rest_begins_in_a_gap_is_judged_behind_it() -> None:
    log, asked = recorded("truth-gap"), OPTIONS
    tuning = tuned(log, asked.settings, asked.filter_options)
    result = replay_with(log, asked.settings, asked.filter_options, tuning)
    assert float(result.accuracy.overall().position) < 0.1


def still(*times: float) -> Log:
    """Two robots that stand still and see nobody, with truth at these times."""
    truth = np.array([[time, 0.0, 0.0, 0.0] for time in times])
    moved = np.array([[time, 0.0, 0.0] for time in np.arange(0.0, times[-1] + 1.0)])
    none = np.zeros(0)
    seen = (none, none.astype(int), none, none)
    robots = [RobotLog(f"robot{k}", k, truth, moved, *seen) for k in (1, 2)]
    return Log("still", tuple(robots), (), none.astype(int), np.zeros((0, 2)))


def test_what_is_known_of_no_sample_is_null_and_the_rest_is_drawn() -> None:
    log = still(*np.arange(0.0, 14.0), 40.05)
    document = replay_document(replayed(log, sample_time=0.1, landmarks=()))
    for robot in document.robots:
        assert robot.rms_m == pytest.approx(0.0, abs=1e-9)
        assert (robot.rms_second_half_m, robot.final_error_m) == (None, None)
    assert specs_of(document, [])
    # no tenth sample is known, of which coverage is a share
    short = still(0.0, 0.1, 0.2, 0.3, 40.05)
    figures = replay_document(replayed(short, sample_time=0.1, landmarks=())).robots
    assert [robot.coverage_3sigma for robot in figures] == [None, None]
    # a column without any value is left out
    assert "2nd half" not in shown(document, 100)


def test_repeated_entries_of_the_truth_are_as_far_apart_as_single_ones() -> None:
    log = recorded("truth-gap")
    clock = clock_of(log, 0.01)
    repeated = replace(
        log, robots=tuple(replace(one, truth=np.repeat(one.truth, 3, axis=0)) for one in log.robots)
    )
    np.testing.assert_array_equal(truth_known(repeated, clock), truth_known(log, clock))


def test_axes_fit_what_is_known(whole: Replay, gapped: Replay) -> None:
    axes = []
    for one in (whole, gapped):
        layout = specs_of(replay_document(one), ["errors"])["errors"]["layout"]
        axes.append({key: axis.get("range") for key, axis in layout.items() if "axis" in key})
    assert axes[0].keys() == axes[1].keys()
    for key, ends in axes[0].items():
        assert (axes[1][key] is None) == (ends is None), key
        assert ends is None or None not in axes[1][key]
