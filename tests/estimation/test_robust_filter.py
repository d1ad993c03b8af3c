"""The robust filter: it finds itself where it is lost, whatever runs beside it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import State, start_of
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.rivals import CLEARLY, Rivals
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.estimation.trials import MonteCarloResult
from syncplan.planning.validation import validate
from syncplan.scenario.loading import load_scenario
from tests.searches.thrown import WITHIN, throw_off
from tests.tools.filter_scenes import scene_of
from tests.tools.on_paper import plan
from tests.tools.scenarios import example

HARD = Path(__file__).parents[1] / "data" / "hard"


def flown(steps: int, trials: int, **changes: object) -> MonteCarloResult:
    """Trials of the paper's grid from 15 m and 0.3 rad."""
    made = plan(example("paper-grid-same"))
    noise = replace(made.noise, position_sigma=15.0, heading_sigma=0.3)
    team = replace(made.team, noise=noise)
    seen = possible_sightings(team, made.windows, steps)
    options = FilterOptions(trials=trials, **changes)  # type: ignore[arg-type]
    return run_trials(team, seen, steps, options)


@pytest.mark.parametrize("number", [0, 1])
def test_a_team_thrown_off_in_mid_run_is_found_within_two_periods(number: int) -> None:
    for name, thrown in throw_off(number, trials=3).items():
        assert np.all(thrown <= WITHIN), name


def test_a_run_shorter_than_a_period_is_the_second_order_filters() -> None:
    robust, second = (flown(40, 3, filter=name) for name in ("robust", "second-order"))
    np.testing.assert_array_equal(robust.final_errors, second.final_errors)
    assert np.all(np.isfinite(robust.final_errors))


def test_a_trial_does_not_depend_on_those_beside_it() -> None:
    period = round(plan(example("paper-grid-same")).team.orbits.period / 0.1)
    few, many = (flown(period + 20, trials, filter="robust") for trials in (3, 19))
    np.testing.assert_array_equal(few.final_errors, many.final_errors[:3])


def rivals_of(trials: int, known: Callable[[State], None]) -> Rivals:
    """The paper's grid from 1 m and 0.03 rad: trials half a period on their way, and a rival each.

    `known` makes the rival of the state at time 0, in place.
    """
    made = plan(example("paper-grid-same"))
    noise = replace(made.noise, position_sigma=1.0, heading_sigma=0.03)
    team = replace(made.team, noise=noise)
    steps = round(0.5 * team.orbits.period / 0.1)
    setup, readings, _ = scene_of(team, steps, trials, seed=5, filter="ekf")
    present, rival = (start_of(setup, readings) for _ in range(2))
    known(rival)
    rivals = Rivals.of(np.arange(trials), present, rival, 0)
    for end in (steps // 3, steps):
        rivals.advance(setup, readings, end)
    return rivals


def test_the_ratio_of_likelihoods_has_expectation_one_while_the_estimate_is_right() -> None:
    def less_sure(state: State) -> None:
        state[0][::3] += 0.5
        state[1][:] *= 1.1

    leads = rivals_of(1200, less_sure).lead
    ratios = np.exp(leads)
    assert np.std(leads) > 0.3
    assert abs(ratios.mean() - 1.0) < 4.0 * ratios.std() / np.sqrt(len(ratios))


def test_of_two_estimates_the_one_that_is_off_loses() -> None:
    def off(state: State) -> None:
        state[0][0, ::2] += 40.0

    rivals = rivals_of(32, off)
    assert np.all(rivals.lead[::2] < -CLEARLY)
    # the others are the same estimate
    np.testing.assert_array_equal(rivals.lead[1::2], 0.0)
    kept = rivals.take(rivals.undecided)
    np.testing.assert_array_equal(kept.lanes, np.arange(1, 32, 2))
    swapped = Rivals.of(rivals.lanes, rivals.rival, rivals.present, 0)
    swapped.lead = -rivals.lead
    np.testing.assert_array_equal(swapped.ahead, rivals.lead < -CLEARLY)


def test_a_rival_that_has_broken_down_is_dropped() -> None:
    def broken(state: State) -> None:
        state[0][0, 0] = np.nan

    assert rivals_of(2, broken).lead[0] == -np.inf


def test_a_good_estimate_is_not_given_up() -> None:
    made = plan(load_scenario(HARD / "robust-loses-a-good-estimate.json"))
    robust, second = (
        validate(made, trials=20, seed=2, filter=name) for name in ("robust", "second-order")
    )
    overall = robust.accuracy.overall().position
    assert overall < 1.05 * second.accuracy.overall().position
    assert robust.anees.verdict == "consistent"
