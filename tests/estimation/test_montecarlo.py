"""Monte Carlo runs: reproducible to the byte, true to their definitions, honest about sigma."""

import threading
from collections.abc import Callable
from dataclasses import fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation import montecarlo
from syncplan.estimation.consistency import anees, coverage, nis
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import MotionModel
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.reference_filter import predict, update
from syncplan.estimation.trial_chunks import StoppedError
from syncplan.estimation.trials import MonteCarloResult, accuracy, merge, series
from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.noise import Noise
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Team
from tests.searches.search_consistency import believing

Scene = tuple[Team, Sightings, int]

CENTERS = np.array([[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]], dtype=float)
LANDMARKS = np.array([[190.0, 0.0], [190.0, 70.0]])
NOISE = Noise(speed_sigma=0.1, turn_rate_sigma=0.01, position_sigma=5.0, heading_sigma=0.1)


def paper_grid(steps: int, bearing_sigma: float = 0.1, noise: Noise = NOISE) -> Scene:
    """Team, sightings and steps on the paper's grid."""
    n = len(CENTERS)
    opposite = np.array([0.0, np.pi, 0.0, np.pi, 0.0, np.pi])
    orbits = Orbits(CENTERS, np.full(n, 20.0), np.ones(n), 0.3 + opposite, 0.2)
    sensors = Sensors(
        ranges=np.full(n, 50.0),
        fields_of_view=np.full(n, 2.0 * np.pi),
        boresights=np.zeros(n),
        bearing_sigmas=np.full(n, bearing_sigma),
        sample_time=0.1,
    )
    windows = find_windows(Team(orbits, LANDMARKS, sensors, noise))
    sightings = sample_sightings(windows, orbits.period, sensors, 1, steps)
    return Team(orbits, LANDMARKS, sensors, noise), sightings, steps


def flown(
    scene: Scene,
    trials: int,
    seed: int,
    *,
    first_trial: int = 0,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> MonteCarloResult:
    """The result of trials in a scene."""
    options = FilterOptions(trials=trials, seed=seed, **changes)
    return run_trials(*scene, options, first_trial=first_trial, threads=threads, progress=progress)


def bytes_of(result: MonteCarloResult) -> list[bytes]:
    """All the arrays of a result, and where its branches stand."""
    values = [getattr(result, field.name) for field in fields(result)]
    arrays = [value.tobytes() for value in values if isinstance(value, np.ndarray)]
    for branch in result.branches:
        arrays += [bytes([branch.level, branch.index]), branch.sums.tobytes()]
        arrays.append(branch.error_sums.tobytes())
    return arrays


@pytest.fixture(scope="module")
def run() -> MonteCarloResult:
    return flown(paper_grid(60), 150, 5, with_series=True, threads=1)


@pytest.mark.parametrize("threads", [2, 3])
def test_the_same_seed_gives_the_same_bytes_on_any_number_of_threads(
    run: MonteCarloResult, threads: int
) -> None:
    again = flown(paper_grid(60), 150, 5, with_series=True, threads=threads)
    assert bytes_of(again) == bytes_of(run)


@pytest.mark.parametrize("cuts", [[0, 16, 150], [0, 48, 64, 144, 150], [0, 112, 128, 150]])
def test_parts_run_elsewhere_merge_to_the_bytes_of_the_whole(
    run: MonteCarloResult, cuts: list[int]
) -> None:
    parts = [
        flown(paper_grid(60), end - start, 5, first_trial=start, with_series=True)
        for start, end in pairwise(cuts)
    ]
    assert bytes_of(merge(parts)) == bytes_of(run)
    assert bytes_of(merge([merge(parts[:-1]), parts[-1]])) == bytes_of(run)


def test_a_shorter_run_is_the_beginning_of_a_longer_one(run: MonteCarloResult) -> None:
    short = flown(paper_grid(60), 37, 5)
    assert short.final_errors.tobytes() == run.final_errors[:37].tobytes()
    assert short.nees.tobytes() == run.nees[:37].tobytes()


def test_parts_that_do_not_follow_each_other_are_refused() -> None:
    scene = paper_grid(5)
    first, other = flown(scene, 20, 5), flown(scene, 4, 5, first_trial=32)
    with pytest.raises(InputError, match="32, expected 20"):
        merge([first, other])
    with pytest.raises(InputError, match="seed"):
        merge([first, flown(scene, 4, 6, first_trial=32)])
    with pytest.raises(InputError, match="not a multiple of 16"):
        flown(scene, 4, 5, first_trial=20)


def plain_trial(scene: Scene, seed: int, trial: int, substeps: int) -> tuple[Array, Array]:
    """Errors (steps, n, 3) and sampled NEES of one trial, drawn and filtered plainly."""
    team, sightings, steps = scene
    orbits, landmarks, sensors, noise = team.orbits, team.landmarks, team.sensors, team.noise
    random = np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed).spawn(trial + 1)[trial])
    )
    n, dt = orbits.count, sensors.sample_time
    sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    times = np.arange(steps + 1) * dt
    truth = np.concatenate([position(orbits, times), heading(orbits, times)[..., None]], axis=2)
    x = truth[0] + sigmas * random.standard_normal((n, 3))
    speeds = orbits.speeds + noise.speed_sigma * random.standard_normal((steps, n))
    turns = orbits.turn_rates + noise.turn_rate_sigma * random.standard_normal((steps, n))
    slips = random.standard_normal(len(sightings.steps))
    motion = MotionModel(dt, substeps, noise.speed_sigma**2, noise.turn_rate_sigma**2)
    P = np.diag(np.tile(sigmas**2, n))
    errors, nees = [], []
    for k in range(1, steps + 1):
        x, P = predict(x, P, speeds[k - 1], turns[k - 1], motion)
        for s in np.flatnonzero(sightings.steps == k):
            o, t = sightings.observers[s], sightings.targets[s]
            place = truth[k, t, :2] if t < n else landmarks[t - n]
            away = place - truth[k, o, :2]
            sigma = sensors.bearing_sigmas[o]
            z = np.arctan2(away[1], away[0]) - truth[k, o, 2] + sigma * slips[s]
            x, P, _, _ = update(x, P, o, t, z, sigma, landmarks)
        error = x - truth[k]
        error[:, 2] = wrap(error[:, 2])
        errors.append(error)
        if k % 10 == 0 or k == steps:
            nees.append(error.ravel() @ np.linalg.solve(P, error.ravel()))
    return np.array(errors), np.array(nees)


@pytest.mark.parametrize(("model", "substeps"), [("ekf", 0), ("paper", 4)])
def test_a_trial_is_drawn_from_the_seeds_child_in_the_documented_order(
    model: str, substeps: int
) -> None:
    scene = paper_grid(55)
    result = flown(scene, 19, 11, filter=model, substeps=max(substeps, 1))
    errors, nees = plain_trial(scene, 11, 17, substeps)
    np.testing.assert_allclose(result.final_errors[17], errors[-1], atol=1e-9)
    np.testing.assert_allclose(result.mean_squares[17], (errors**2).mean(axis=0), atol=1e-9)
    late = errors[[k - 1 for k in range(1, 56) if 2 * k > 55]]
    np.testing.assert_allclose(result.late_mean_squares[17], (late**2).mean(axis=0), atol=1e-9)
    assert len(nees) == result.nees_samples[17] == 6
    assert result.coverage_samples == 3 * 6
    assert result.nees[17] == pytest.approx(nees.mean(), rel=1e-9)


def test_series_and_totals_tell_the_same_errors(run: MonteCarloResult) -> None:
    over_time, total = series(run), accuracy(run)
    assert over_time.position_rms.shape == (61, 6)
    rms = np.sqrt((over_time.position_rms[1:] ** 2).mean(axis=0))
    np.testing.assert_allclose(rms, total.position, rtol=1e-12)
    rms_heading = np.sqrt((over_time.heading_rms[1:] ** 2).mean(axis=0))
    np.testing.assert_allclose(rms_heading, total.heading, rtol=1e-12)
    np.testing.assert_allclose(
        over_time.mean_errors[-1], run.final_errors.mean(axis=0), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(over_time.position_sigma[0], 5.0 * np.sqrt(2.0))
    np.testing.assert_allclose(over_time.heading_sigma[0], 0.1)
    np.testing.assert_allclose(total.position**2, total.x**2 + total.y**2)
    overall = total.overall()
    assert overall.position == pytest.approx(np.sqrt((total.position**2).mean()))


def test_a_run_without_series_says_so() -> None:
    with pytest.raises(InputError, match="with_series=True"):
        series(flown(paper_grid(5), 3, 1))


def test_with_precise_bearings_the_filter_is_consistent() -> None:
    noise = Noise(0.1, 0.01, position_sigma=0.5, heading_sigma=0.1)
    result = flown(paper_grid(600, bearing_sigma=0.01, noise=noise), 300, 2)
    judged = anees(result.nees, 18)
    assert judged.verdict == "consistent"
    assert judged.band[0] < judged.value < judged.band[1]
    assert (judged.count, judged.basis) == (300, "trials")
    assert judged.band[1] - judged.band[0] < 0.08
    innovations = nis(result.nis_sums, result.accepted)
    assert innovations.value == pytest.approx(1.0, abs=0.01)
    assert innovations.value == result.nis_sums.sum() / result.accepted.sum()
    share = coverage(result.covered, result.coverage_samples)
    assert share.mean() == pytest.approx(0.9973, abs=0.001)


def test_sigmas_that_are_all_believed_too_small_scale_nees_and_leave_the_errors() -> None:
    scene = paper_grid(120)
    team, sightings, steps = scene
    true, options = flown(scene, 32, 4), FilterOptions(trials=32, seed=4)
    sure = run_trials(team, sightings, steps, options, believed=believing(team, 0.8))
    # gains rest on ratios of variances alone
    np.testing.assert_allclose(sure.final_errors, true.final_errors, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sure.nees, true.nees / 0.64, rtol=1e-9)
    np.testing.assert_allclose(sure.nis_sums, true.nis_sums / 0.64, rtol=1e-9)
    same = run_trials(team, sightings, steps, options, believed=team)
    assert bytes_of(same) == bytes_of(true)


def test_believed_sigmas_are_checked_too() -> None:
    team, sightings, steps = paper_grid(5)
    with pytest.raises(InputError, match="must be positive"):
        run_trials(team, sightings, steps, FilterOptions(), believed=believing(team, 0.0))


def test_a_gate_turns_away_its_share_of_good_bearings() -> None:
    noise = Noise(0.1, 0.01, position_sigma=0.5, heading_sigma=0.1)
    scene = paper_grid(300, bearing_sigma=0.01, noise=noise)
    result = flown(scene, 64, 2, gate_probability=0.95)
    assert np.all(result.accepted + result.gated == len(scene[1].steps))
    share = result.gated.sum() / (result.gated + result.accepted).sum()
    assert share == pytest.approx(0.05, abs=0.01)


def test_an_interrupt_propagates_and_leaves_the_queued_chunks_undone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: list[Any] = []
    chunk = montecarlo._chunk

    def counted(run: Any, trials: range, stop: threading.Event) -> MonteCarloResult:
        started.append((run, trials, stop))
        return chunk(run, trials, stop)

    def interrupt(done: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(montecarlo, "_chunk", counted)
    with pytest.raises(KeyboardInterrupt):
        flown(paper_grid(20), 16_000, 1, threads=2, progress=interrupt)
    assert len(started) < 10
    with pytest.raises(StoppedError):
        chunk(*started[0])


def test_progress_counts_up_to_the_number_of_trials() -> None:
    done: list[int] = []
    flown(paper_grid(5), 35, 1, first_trial=16, progress=done.append)
    assert done == [16, 32, 35]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("steps", 0),
        ("trials", 0),
        ("threads", 0),
        ("seed", -1),
        ("substeps", 0),
        ("first_trial", 8),
        ("first_trial", -16),
        ("model", "midpoint"),
        ("gate_probability", 1.0),
    ],
)
def test_arguments_out_of_range_are_named(key: str, value: Any) -> None:
    team, sightings, steps = paper_grid(5)
    scene = team, sightings, value if key == "steps" else steps
    changes = {"trials": 4, "seed": 1} | ({} if key == "steps" else {key: value})
    with pytest.raises(InputError) as caught:
        flown(scene, **changes)
    assert caught.value.key == key


def test_a_bearing_sigma_of_zero_is_refused() -> None:
    with pytest.raises(InputError, match="must be positive"):
        flown(paper_grid(5, bearing_sigma=0.0), 4, 1)


def test_sightings_of_bodies_that_do_not_exist_are_refused() -> None:
    team, sightings, steps = paper_grid(40)
    blind = replace(team, landmarks=team.landmarks[:0])
    with pytest.raises(InputError, match=r"sightings\.targets: index 6 is outside 0\.\.5"):
        flown((blind, sightings, steps), 4, 1)


def test_without_motion_noise_nothing_breaks() -> None:
    still = Noise(speed_sigma=0.0, turn_rate_sigma=0.0, position_sigma=0.1, heading_sigma=0.01)
    result = flown(paper_grid(300, bearing_sigma=0.01, noise=still), 16, 1)
    assert np.all(result.nees_samples == 30)
    assert np.abs(result.final_errors).max() < 0.5
