"""The robust filter: it finds itself where it is lost, whatever runs beside it."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.estimation.trials import MonteCarloResult
from syncplan.planning.planner import plan
from tests.searches.search_thrown import FAR, THROWS, WITHIN, throw, thrown_draw
from tests.tools.scenarios import example


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
    for found in thrown_draw(number, seed=0, trials=3, throws=THROWS):
        assert np.all(found.after <= WITHIN), found


def test_throws_are_as_far_as_they_say() -> None:
    generator = np.random.default_rng(0)
    moved = {name: throw(name, 3, 5, generator) for name in THROWS}
    for name, off in moved.items():
        places = np.hypot(off[:, 0], off[:, 1])
        np.testing.assert_allclose(places.max(axis=0), FAR)
        assert np.sum(places > 0.0) == (5 if name == "one" else 15)
        assert np.all(off[:, 2] == 0.0) == (name != "turned")
    np.testing.assert_array_equal(moved["together"][0], moved["together"][2])


def test_a_run_shorter_than_a_period_is_the_second_order_filters() -> None:
    robust, second = (flown(40, 3, filter=name) for name in ("robust", "second-order"))
    np.testing.assert_array_equal(robust.final_errors, second.final_errors)
    assert np.all(np.isfinite(robust.final_errors))


def test_a_trial_does_not_depend_on_those_beside_it() -> None:
    period = round(plan(example("paper-grid-same")).team.orbits.period / 0.1)
    few, many = (flown(period + 20, trials, filter="robust") for trials in (3, 19))
    np.testing.assert_array_equal(few.final_errors, many.final_errors[:3])
