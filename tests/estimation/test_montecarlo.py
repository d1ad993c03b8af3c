"""Monte Carlo runs: reproducible to the byte, also in parts, and honest about sigma."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.estimation import montecarlo
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import StoppedError, run_trials
from syncplan.estimation.trial_readings import TrialReadings
from syncplan.estimation.trials import MonteCarloResult, accuracy, merge, pack, series, unpack
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.noise import Noise
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Team
from syncplan.planning.plans import Plan
from syncplan.planning.validation import trial_run, validate
from syncplan.reports.validation_report import validation_document
from syncplan.runtime.files import as_text
from tests.estimation.test_filter import filtered
from tests.searches.consistency import believing
from tests.tools.filter_scenes import scene_of
from tests.tools.on_paper import plan
from tests.tools.scenarios import example, small

Scene = tuple[Team, Sightings, int]


@cache
def _grid() -> Plan:
    return plan(example("paper-grid-same"), bound="never", pilot=False)


def paper_grid(steps: int, bearing_sigma: float = 0.1, noise: Noise | None = None) -> Scene:
    """Team, sightings and steps on the paper's grid."""
    made = _grid()
    sensors = replace(made.sensors, bearing_sigmas=np.full(6, bearing_sigma))
    team = replace(made.team, sensors=sensors, noise=noise or made.noise)
    return team, sample_sightings(made.windows, made.orbits.period, sensors, 1, steps), steps


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


def test_the_same_seed_gives_the_same_bytes_on_any_number_of_threads(run: MonteCarloResult) -> None:
    again = flown(paper_grid(60), 150, 5, with_series=True, threads=3)
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


def test_parts_that_do_not_follow_each_other_are_refused() -> None:
    scene = paper_grid(5)
    first, other = flown(scene, 20, 5), flown(scene, 4, 5, first_trial=32)
    with pytest.raises(InputError, match="32, expected 20"):
        merge([first, other])
    with pytest.raises(InputError, match="seed"):
        merge([first, flown(scene, 4, 6, first_trial=32)])
    with pytest.raises(InputError, match="not a multiple of 16"):
        flown(scene, 4, 5, first_trial=20)


def test_a_trial_is_drawn_from_the_seeds_child_in_the_documented_order() -> None:
    team, _, steps = paper_grid(55)
    setup, readings, truth = scene_of(team, steps, 19, seed=11)
    child, n = np.random.SeedSequence(11).spawn(18)[17], team.count
    random, noise = np.random.Generator(np.random.PCG64(child)), team.noise
    poses = truth.poses[..., 0]
    sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    initial = poses[0] + sigmas * random.standard_normal((n, 3))
    speeds = team.orbits.speeds + noise.speed_sigma * random.standard_normal((steps, n))
    turns = team.orbits.turn_rates + noise.turn_rate_sigma * random.standard_normal((steps, n))
    slips = np.sqrt(setup.variances) * random.standard_normal(len(setup.variances))
    for found, expected in zip(readings[:3], (initial, speeds, turns), strict=True):
        np.testing.assert_allclose(found[..., 17], expected, atol=1e-12)
    exact = TrialReadings.of(team, poses, setup, layout_of(team), 11).sightings
    np.testing.assert_allclose(readings.sightings[:, 17], exact + slips, atol=1e-12)


def test_figures_of_a_trial_are_means_of_its_statistics() -> None:
    scene = paper_grid(55)
    result = flown(scene, 19, 11, gate_probability=0.9)
    given = scene_of(scene[0], 55, 19, seed=11, gate_probability=0.9)
    *_, found = filtered(given)
    means = (
        (result.final_errors, found.final),
        (result.mean_squares, found.squares / 55),
        (result.late_mean_squares, found.late_squares / 28),
    )
    for one, other in means:
        np.testing.assert_allclose(one, np.moveaxis(other.reshape(6, 3, 19), -1, 0), rtol=1e-12)
    np.testing.assert_allclose(result.nees, found.nees / 6, rtol=1e-12)
    assert np.all(result.nees_samples == 6)
    assert result.coverage_samples == 3 * 6
    np.testing.assert_array_equal(result.covered, found.covered.reshape(6, 3, 19).sum(axis=1).T)
    counts = result.nis_sums, result.accepted, result.gated
    np.testing.assert_array_equal(counts, (found.nis, found.accepted, found.gated))


def test_series_and_totals_state_the_same_errors(run: MonteCarloResult) -> None:
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


def test_an_interrupt_propagates_and_leaves_the_queued_chunks_undone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: list[Any] = []
    chunk = montecarlo._chunk

    def counted(*given: Any) -> MonteCarloResult:
        started.append(given)
        return chunk(*given)

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
    ("key", "value"), [("steps", 0), ("threads", 0), ("first_trial", 8), ("first_trial", -16)]
)
def test_arguments_out_of_range_are_named(key: str, value: Any) -> None:
    team, sightings, steps = paper_grid(5)
    scene = team, sightings, value if key == "steps" else steps
    changes = {"trials": 4, "seed": 1} | ({} if key == "steps" else {key: value})
    with pytest.raises(InputError) as caught:
        flown(scene, **changes)
    assert caught.value.key == key


def test_sigmas_of_zero_are_refused() -> None:
    with pytest.raises(InputError, match="must be positive"):
        flown(paper_grid(5, bearing_sigma=0.0), 4, 1)
    team, sightings, steps = paper_grid(5)
    with pytest.raises(InputError, match="must be positive"):
        run_trials(team, sightings, steps, FilterOptions(), believed=believing(team, 0.0))


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


# --- parts that are kept as bytes -----------------------------------------------------------------


@pytest.mark.parametrize("with_series", [False, True])
def test_a_run_in_parts_gives_the_report_of_the_whole_to_the_byte(with_series: bool) -> None:
    flown = plan(example("biased-grid"))
    whole = validate(flown, trials=70, seed=3, duration=20.0, with_series=with_series)
    run = trial_run(flown, trials=70, seed=3, duration=20.0, with_series=with_series)
    cuts = [(0, 16), (16, 48), (64, 6)]
    parts = [unpack(pack(run.part(first, count, threads=1))) for first, count in cuts]
    reports = [
        as_text(validation_document(each).as_json()) for each in (whole, run.concluded(parts))
    ]
    assert reports[0] == reports[1]


def test_a_missing_part_is_refused() -> None:
    run = trial_run(example("paper-grid-same"), trials=32, duration=2.0)
    part = run.part(0, 16)
    with pytest.raises(InputError, match="16 from 0 on given, of 32"):
        run.concluded([part])


@pytest.mark.parametrize("data", [b"", b"nothing", b"PK\x03\x04 an archive cut short"])
def test_bytes_that_are_no_part_are_refused(data: bytes) -> None:
    with pytest.raises(InputError, match="not a part of a run"):
        unpack(data)


def test_every_fault_of_a_scenario_is_listed_with_its_key_and_value() -> None:
    orbit = {"radius_m": -1.0, "direction": "up", "angular_rate_rad_s": 0.2, "colour": 3}
    with pytest.raises(InputError) as caught:
        small(orbit=orbit)
    faults = caught.value.faults
    assert [(one.key, one.value) for one in faults if "unknown" in one.problem] == [
        ("orbit.colour", "")
    ]
    assert {one.key: one.value for one in faults}["orbit.radius_m"] == "-1.0"
    assert len(faults) >= 3
    assert f"and {len(faults) - 1} more" in str(caught.value)
