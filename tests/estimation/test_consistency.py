"""ANEES and NIS: their intervals hold what they should as often as said; verdicts in proportion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from syncplan.arrays import Array
from syncplan.estimation.consistency import (
    FEWEST_TRIALS,
    TOLERANCE,
    WIDEST,
    anees,
    chi_square_band,
    gate_threshold,
    interval_of_mean,
    nis,
    recorded_anees,
    recorded_nis,
)
from syncplan.estimation.trials import TrialErrors

SAMPLES = st.lists(st.integers(0, 1000), min_size=2, max_size=40).filter(lambda x: len(set(x)) > 1)


def _statistic(samples: Array, mean: float) -> float:
    """-2 log of the empirical likelihood of a mean, by bisection for Owen's multiplier."""
    away = samples - mean
    count = len(samples)
    low, high = (1.0 / count - 1.0) / away.max(), (1.0 / count - 1.0) / away.min()
    for _ in range(200):
        middle = 0.5 * (low + high)
        if np.sum(away / (1.0 + middle * away)) > 0.0:
            low = middle
        else:
            high = middle
    return float(2.0 * np.log1p(low * away).sum())


def test_both_ends_have_the_stated_likelihood() -> None:
    rng = np.random.default_rng(3)
    for samples in (rng.normal(1.0, 0.2, 200), rng.gamma(0.3, 5.0, 40), rng.gamma(9.0, 1.0, 12)):
        ends = interval_of_mean(samples)
        limit = student.ppf(0.975, len(samples) - 1) ** 2
        for end in ends:
            assert _statistic(samples, end) == pytest.approx(limit, rel=1e-6)


@given(SAMPLES, st.integers(1, 50), st.integers(-100, 100))
def test_the_interval_moves_scales_and_turns_with_its_samples(
    drawn: list[int], scale: int, shift: int
) -> None:
    samples = np.array(drawn, dtype=float)
    low, high = interval_of_mean(samples)
    slack = 1e-6
    assert samples.min() - slack <= low <= samples.mean() + slack
    assert samples.mean() - slack <= high <= samples.max() + slack
    moved = interval_of_mean(scale * samples + shift)
    assert moved == pytest.approx((scale * low + shift, scale * high + shift), abs=50 * slack)
    assert interval_of_mean(-samples) == pytest.approx((-high, -low), abs=slack)
    assert interval_of_mean(samples[::-1]) == pytest.approx((low, high), abs=slack)


def test_equal_samples_have_an_interval_of_no_width() -> None:
    assert interval_of_mean(np.full(20, 1.3)) == pytest.approx((1.3, 1.3))
    assert interval_of_mean(np.zeros(20)) == (0.0, 0.0)


@pytest.mark.parametrize("count", [10, 200])
def test_the_interval_of_skewed_samples_misses_their_mean_as_often_as_said(count: int) -> None:
    drawn = np.random.default_rng(8).gamma(9.0, 1.0 / 9.0, (1000, count))
    ends = np.array([interval_of_mean(samples) for samples in drawn])
    missed = np.mean((ends[:, 0] > 1.0) | (ends[:, 1] < 1.0))
    # ten samples show less of a tail than there is
    assert 0.03 < missed < (0.09 if count == 10 else 0.07)


def test_the_band_is_that_of_chi_square_tables() -> None:
    low, high = chi_square_band(10)
    assert (10 * low, 10 * high) == pytest.approx((3.247, 20.483), abs=5e-4)
    low, high = chi_square_band(10_000_000)
    slack = 1.959964 * np.sqrt(2.0 / 10_000_000)
    assert (low, high) == pytest.approx((1.0 - slack, 1.0 + slack), abs=1e-6)
    assert gate_threshold(0.999) == pytest.approx(10.828, abs=5e-4)
    assert gate_threshold(None) == np.inf


GATES = pytest.mark.parametrize("probability", [None, 0.999, 0.9])


def _honest_squares(count: int, probability: float | None) -> np.ndarray:
    drawn = np.random.default_rng(7).standard_normal(2 * count) ** 2
    return drawn[drawn <= gate_threshold(probability)][:count]


@GATES
@pytest.mark.parametrize("count", [5, 40])
def test_nis_of_one_honest_recording_misses_1_as_often_as_said(
    probability: float | None, count: int
) -> None:
    sums = _honest_squares(1000 * count, probability).reshape(-1, count).sum(axis=1)
    judged = [recorded_nis(float(total), count, probability) for total in sums]
    assert np.mean([nis.value for nis in judged]) == pytest.approx(1.0, abs=0.05)
    outside = np.mean([not nis.band[0] <= 1.0 <= nis.band[1] for nis in judged])
    assert outside == pytest.approx(0.05, abs=0.03)
    assert {nis.basis for nis in judged} == {"chi-square"}


@GATES
def test_nis_of_many_honest_innovations_has_a_narrow_interval(probability: float | None) -> None:
    squares = _honest_squares(1_000_000, probability)
    judged = recorded_nis(float(squares.sum()), len(squares), probability)
    assert judged.verdict == "consistent"
    assert judged.band[1] - judged.band[0] < 0.006
    # the same innovations as a thousand trials: their spread says the same
    sums, counts = squares.reshape(1000, 1000).sum(axis=1), np.full(1000, 1000.0)
    over_trials = nis(sums, counts, probability)
    assert over_trials.value == pytest.approx(judged.value, rel=1e-12)
    assert over_trials.band == pytest.approx(judged.band, abs=1.5e-4)


def test_nis_weighs_trials_by_their_innovations() -> None:
    rng = np.random.default_rng(5)
    counts = rng.integers(1, 9, (1000, 60))
    sums = 2.0 * rng.gamma(0.5 * counts)
    judged = [nis(one, count) for one, count in zip(sums, counts, strict=True)]
    assert judged[0].value == pytest.approx(sums[0].sum() / counts[0].sum())
    outside = np.mean([not nis.band[0] <= 1.0 <= nis.band[1] for nis in judged])
    assert outside == pytest.approx(0.05, abs=0.02)


def test_verdicts_name_the_side_of_the_interval() -> None:
    assert anees(np.full(100, 18.0), 18).verdict == "consistent"
    assert anees(np.full(100, 22.0), 18).verdict == "optimistic"
    assert anees(np.full(100, 14.0), 18).verdict == "conservative"
    assert anees(np.full(3, np.nan), 18).verdict == "unknown"
    assert nis(np.zeros(20), np.zeros(20)).verdict == "unknown"
    assert recorded_nis(0.0, 0).verdict == "unknown"
    assert recorded_anees(np.nan, 18).verdict == "unknown"
    assert anees(np.append(np.full(11, 18.0), np.nan), 18).count == 11


def test_a_difference_within_tolerance_is_none_however_many_trials_show_it() -> None:
    rng = np.random.default_rng(2)
    nees = 18.0 * rng.gamma(36.0, 1.0 / 36.0, 100_000)
    for mean, verdict in ((1.03, "consistent"), (0.95, "consistent"), (1.12, "optimistic")):
        judged = anees(mean * nees, 18)
        assert not judged.band[0] <= 1.0 <= judged.band[1]
        assert judged.verdict == verdict
        assert (judged.band[0] > 1.0 + TOLERANCE) == (verdict == "optimistic")


def test_a_few_lost_trials_make_a_filter_optimistic_where_student_would_shrug() -> None:
    nees = np.random.default_rng(4).gamma(36.0, 1.0 / 36.0, 200)
    nees[:3] = 50.0, 400.0, 5000.0
    half = student.ppf(0.975, 199) * nees.std(ddof=1) / np.sqrt(200)
    assert nees.mean() - half < 0.0
    judged = anees(nees, 1)
    assert judged.verdict == "optimistic"
    assert judged.band[0] > 1.2


def test_too_few_trials_and_too_wide_an_interval_show_nothing() -> None:
    few = anees(np.linspace(0.9, 1.1, FEWEST_TRIALS - 1), 1)
    assert few.value == pytest.approx(1.0)
    assert (few.count, few.basis) == (FEWEST_TRIALS - 1, "trials")
    assert few.verdict == "unknown"
    assert np.isnan(few.band).all()
    assert anees(np.linspace(0.9, 1.1, FEWEST_TRIALS), 1).verdict == "consistent"
    wide = anees(np.linspace(0.1, 1.9, FEWEST_TRIALS), 1)
    assert wide.band[1] - wide.band[0] > WIDEST
    assert wide.verdict == "unknown"


def test_a_recordings_interval_is_the_chi_square_one_of_its_states() -> None:
    judged = recorded_anees(18.0, 9)
    low, high = chi_square_band(9)
    assert judged.band == pytest.approx((2.0 / high, 2.0 / low))
    assert (judged.count, judged.basis, judged.verdict) == (9, "chi-square", "consistent")
    assert recorded_anees(20.0, 9).verdict == "consistent"
    assert recorded_anees(24.0, 9).verdict == "optimistic"


def test_medians_and_trials_over_a_limit_are_those_of_the_trials() -> None:
    errors = np.array([[1.0, 2.0], [3.0, 2.0], [40.0, 2.5], [2.0, 9.0]])
    each = TrialErrors(errors**2)
    np.testing.assert_allclose(each.median(), [2.5, 2.25])
    rms = sorted(np.sqrt((row**2).mean()) for row in errors)
    assert each.overall_median() == pytest.approx((rms[1] + rms[2]) / 2.0)
    limits = np.array([2.5, 5.0])
    over = [[False, False], [True, False], [True, False], [False, True]]
    np.testing.assert_array_equal(each.over(limits), over)
