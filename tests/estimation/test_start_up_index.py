"""The start-up index; `test_wide_bounds` has it against a plain recursion of the filter."""

from dataclasses import replace

import numpy as np

from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.covariances import Foreseen
from syncplan.estimation.start_up_index import index_of_run, lines_of_sight, second_order_terms
from syncplan.orbits.sighting_kinds import COMPASS, place_of
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from syncplan.planning.planner import plan
from tests.tools.scenarios import example, small


def _seen(team: Team, observers: list[int], targets: list[int], step: int) -> Sightings:
    number = np.full(len(observers), step)
    return Sightings(number, np.array(observers), np.array(targets), np.zeros_like(number))


def test_a_compass_leaves_nothing_out() -> None:
    team = plan(small(heading_sigma_rad=0.1), bound="never").team
    seen = Sightings(*np.array([[3], [1], [1], [place_of(COMPASS)]]))
    functions, sizes = second_order_terms(team, seen, 20.0)
    np.testing.assert_array_equal(functions, 0.0)
    foreseen = Foreseen(np.ones((3, 1)), np.ones(1))
    assert index_of_run(team, seen, sizes, foreseen).value == 0.0


def test_the_bound_is_the_same_with_and_without_its_index() -> None:
    grid = plan(example("paper-grid-same"), bound="never")
    plain = posterior_bound(grid.team, grid.windows, 60.0)
    indexed = posterior_bound(grid.team, grid.windows, 60.0, start_up=True)
    assert plain.start_up is None
    np.testing.assert_array_equal(plain.position_variance, indexed.position_variance)


def test_the_index_vanishes_with_the_initial_sigmas_and_the_noise() -> None:
    grid = plan(example("paper-grid-same"), bound="never")
    noise = replace(
        grid.noise, speed_sigma=0.0, turn_rate_sigma=0.0, position_sigma=0.0, heading_sigma=0.0
    )
    exact = replace(grid.team, noise=noise)
    found = posterior_bound(exact, grid.windows, 20.0, start_up=True).start_up
    assert found is not None
    assert found.value == 0.0


def test_a_landmark_on_the_path_leaves_the_index_finite() -> None:
    made = plan(small(landmarks_m=[[20.005, 0.0], [0.0, 45.0]]), bound="never")
    start = replace(made.orbits, phases=np.zeros(2))
    found = posterior_bound(made.team.on(start), made.windows, 40.0, start_up=True).start_up
    assert found is not None
    assert 0.0 < found.value < 1e9
    through = _seen(made.team.on(start), [0], [2], step=0)
    np.testing.assert_array_equal(lines_of_sight(made.team.on(start), through, 20.0)[0], 0.0)
