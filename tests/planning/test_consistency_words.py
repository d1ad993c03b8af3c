"""Reports of validations: what they say of the filter's consistency and of trials far off."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from syncplan.estimation.consistency import TOLERANCE
from syncplan.planning.validation import Validation, validate
from syncplan.reports.run_figures import Spread, interval_words, spread_figures, verdict_words
from syncplan.reports.validation_report import ValidationDocument, validation_document
from tests.tools.scenarios import changed, example


def _spread(value: float | None, band: tuple[float, float] | None = None, **keys: Any) -> Spread:
    keys = {"verdict": "unknown", "count": 200} | keys
    return Spread.model_validate({"value": value, "band": band, **keys})


@pytest.fixture(scope="module")
def far_off() -> Validation:
    """Five vehicles whose start is known to 10 m alone: some trials are lost."""
    start = {"position_m": 10.0, "heading_rad": 0.2}
    return validate(changed("five-ring", initial_sigma=start), trials=64, seed=2, filter="ekf")


def test_words_say_what_the_interval_rests_on_and_why_there_is_none() -> None:
    band = (1.0102, 1.0571)
    of_trials = _spread(1.0326, band, basis="trials", verdict="consistent")
    assert interval_words(of_trials) == "1.033, 95 % interval 1.010 to 1.057 over 200 trials"
    assert verdict_words(of_trials) == "consistent"
    one_run = _spread(1.0, (0.5, 2.0), basis="chi-square", count=15)
    assert interval_words(one_run).endswith("of one run, 15 chi-square degrees of freedom")
    assert interval_words(_spread(1.0, band)) == "1.000, 95 % band 1.010 to 1.057"
    assert interval_words(_spread(1.2, basis="trials", count=1)) == "1.200 over 1 trial"
    assert "at least 10 trials" in verdict_words(_spread(1.2, basis="trials", count=1))
    assert "run more trials" in verdict_words(_spread(1.2, (0.5, 3.0), basis="trials"))
    assert (interval_words(_spread(None)), verdict_words(_spread(None))) == (
        "no samples",
        "not judged",
    )


def test_figures_have_the_digits_that_their_comparison_needs() -> None:
    assert spread_figures(_spread(1.11, (1.10004, 1.12))) == ("1.11000", "1.10004", "1.12000")
    assert spread_figures(_spread(0.95, (0.90004, 1.0))) == ("0.95000", "0.90004", "1.00000")
    assert spread_figures(_spread(1.00001, (1.0, 1.00002))) == ("1.00001", "1.00000", "1.00002")
    assert spread_figures(_spread(70.71, (21.3, 163.4))) == ("70.7", "21.3", "163.4")


@given(st.lists(st.integers(1, 3 * 10**6), min_size=3, max_size=3, unique=True))
def test_rounded_figures_compare_as_the_figures_do(drawn: list[int]) -> None:
    low, value, high = sorted(one / 1e6 for one in drawn)
    assume(low < value < high)
    shown = [float(one) for one in spread_figures(_spread(value, (low, high)))]
    assert shown[1] < shown[0] < shown[2]
    for limit in (1.0 - TOLERANCE, 1.0 + TOLERANCE):
        assert (shown[1] > limit) == (low > limit)
        assert (shown[2] > limit) == (high > limit)


def test_a_report_holds_medians_and_shares_of_its_trials(far_off: Validation) -> None:
    report = validation_document(far_off)
    squares = far_off.result.late_mean_squares
    errors = np.sqrt(squares[..., 0] + squares[..., 1])
    assert far_off.predicted is not None
    over = [errors > factor * far_off.predicted for factor in (3.0, 10.0)]
    for k, vehicle in enumerate(report.vehicles):
        assert vehicle.median_rms_second_half_m == pytest.approx(np.median(errors[:, k]))
        assert vehicle.share_over_3_predicted == np.mean(over[0][:, k])
        assert vehicle.share_over_10_predicted == np.mean(over[1][:, k])
    assert report.overall.share_over_3_predicted == np.mean(over[0].any(axis=1)) > 0.05
    assert report.overall.share_over_10_predicted == np.mean(over[1].any(axis=1))


def test_where_few_trials_make_up_the_rms_a_note_says_so(far_off: Validation) -> None:
    report = validation_document(far_off)
    assert report.anees.verdict == "optimistic"
    first, second = report.notes
    assert first.startswith(f"the filter is optimistic (ANEES {interval_words(report.anees)})")
    share = report.overall.share_over_3_predicted
    assert share is not None
    assert second.startswith(f"in {100.0 * share:.3g} % of the trials some vehicle is off by more")
    assert "the median trial has" in second
    calm = validation_document(validate(example("paper-grid-same"), trials=20, seed=1))
    assert not calm.notes


def test_without_a_prediction_there_are_medians_and_no_shares(far_off: Validation) -> None:
    overall = validation_document(replace(far_off, predicted=None)).overall
    assert overall.median_rms_second_half_m is not None
    assert overall.share_over_3_predicted is overall.share_over_10_predicted is None


def test_a_single_trial_is_not_called_consistent() -> None:
    one = validate(example("paper-grid-same"), trials=1, duration=20.0)
    report = validation_document(one).as_json()
    assert report["anees"] == {
        "value": one.anees.value,
        "band": None,
        "verdict": "unknown",
        "count": 1,
        "basis": "trials",
    }
    assert ValidationDocument.model_validate(json.loads(json.dumps(report))).as_json() == report


def test_sigmas_of_an_unobservable_plan_hold_while_the_start_is_known_well() -> None:
    """And the note says when: it is not the missing rank alone that makes them wrong."""
    verdicts = {}
    for sigma in (1.0, 20.0):
        start = {"position_m": sigma, "heading_rad": 0.02 * sigma}
        scenario = changed("paper-grid-alternate", initial_sigma=start)
        report = validation_document(validate(scenario, trials=60, seed=3))
        verdicts[sigma] = report.anees.verdict
        assert "they hold where initial_sigma is true, small against" in report.notes[0]
        assert ("Here they do not hold" in report.notes[0]) == (sigma == 20.0)
    assert verdicts == {1.0: "consistent", 20.0: "optimistic"}
