"""The filter one step at a time finds what it finds of a whole recording."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.online_filter import OnlineFilter
from syncplan.estimation.recorded_run import filtered, run_of
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replays import online_filter_of, steps_of
from syncplan.orbits.circles import wrap
from syncplan.orbits.noise import Noise
from syncplan.recordings.log import Log
from syncplan.recordings.recording_formats import load_log
from tests.tools.recordings import Recipe, write_recording

ODD = Recipe(
    duration=80.0, jitter=0.8, speed_sigma=0.1, turn_rate_sigma=0.02, bearing_sigma=0.02, wild=0.01
)
SIGMAS: dict[str, Any] = {
    "bearing_sigma": 0.02,
    "range_sigma": 0.05,
    "noise": Noise(0.1, 0.02, 2.0, 0.2),
    "turn_rate_bias_sigma": 0.0,
    "start": "prior",
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    folder: Path = tmp_path_factory.mktemp("online") / "recording"
    return load_log(write_recording(folder, ODD, seed=5))


@pytest.mark.parametrize(
    ("filter_", "scale"), [("ekf", 0.0), ("second-order", 0.01), ("robust", 0.0), ("robust", 0.01)]
)
def test_stepped_through_a_recording_it_finds_what_a_replay_finds(
    log: Log, filter_: str, scale: float
) -> None:
    """From a start that is thrown off, so that `robust` has to look for it for a minute."""
    settings = ReplaySettings(sample_time=0.5, speed_scale_sigma=scale, **SIGMAS)
    options = FilterOptions(
        trials=1, filter=filter_, gate_probability=0.999, with_series=True, seed=3
    )
    run = run_of(log, settings, options)
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
    sigmas = np.sqrt(np.diag(online.covariance))[3 * len(log.robots) :]
    np.testing.assert_allclose(sigmas, whole.error_sigmas, rtol=1e-7)
    assert online.counts["accepted"] == whole.result.accepted[0]
    assert online.time == pytest.approx(float(run.setup.spans.sum()))


def test_robust_is_restored_in_the_middle_of_its_search(log: Log) -> None:
    settings = ReplaySettings(sample_time=0.5, **SIGMAS)
    options = FilterOptions(trials=1, filter="robust", gate_probability=0.999, seed=3)
    run = run_of(log, settings, options)
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
