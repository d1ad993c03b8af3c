"""The sparse rank of large teams, beside the dense one, which decides for small teams."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.observability.multifrontal import dissected, factored
from syncplan.observability.rank import assess_team
from syncplan.observability.spectrum import DENSE_STATES
from syncplan.orbits.team import Team
from tests.searches.large_ranks import EVERY_KIND, assessed_by, differences, draw_large
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, small

UNTIED = 26112896
"""Draw in which states shared by all are the only tie of a part to those eliminated around it."""


def _grid(count: int, direction: str) -> Team:
    """A square grid of so many."""
    scenario = small(
        orbit=circling(direction=direction),
        formation={
            "shape": "grid",
            "count": count,
            "columns": int(np.sqrt(count)),
            "spacing_m": 70.0,
        },
        landmarks_m=[[-40.0, 0.0], [-40.0, 70.0]],
        duration_s=40.0,
    )
    return plan(scenario, bound="never", single_points=False).team


@pytest.mark.parametrize("count", [100, pytest.param(400, marks=pytest.mark.long)])
@pytest.mark.parametrize("direction", ["ccw", "alternate"])
def test_grids_of_hundreds_have_the_dense_rank_and_motions(direction: str, count: int) -> None:
    assert differences(_grid(count, direction)) == []


@pytest.mark.parametrize("number", [*range(14), UNTIED])
def test_drawn_teams_have_the_dense_rank_and_motions(number: int) -> None:
    assert differences(draw_large(number)) == []


def test_an_alternating_grid_of_many_loses_a_stretch_of_each_row_and_column() -> None:
    team = _grid(400, "alternate")
    found = assess_team(team, team.orbits.period).observability
    assert found.state_dim > DENSE_STATES
    # of 20 columns and 20 rows each can shift against the one before, but the two rows that see a
    # landmark stay where they are
    assert found.state_dim - found.rank == 19 + 18
    assert found.gap > 1e6


def test_a_dissection_holds_each_vehicle_once_and_cuts_leave_no_link_between_halves() -> None:
    generator = np.random.default_rng(5)
    for _ in range(50):
        count = int(generator.integers(1, 300))
        places = generator.uniform(0.0, 1.0, (count, 2))
        reach = generator.uniform(0.5, 3.0) / np.sqrt(count)
        apart = np.hypot(*(places[:, None] - places[None]).T)
        links = np.argwhere(np.triu(apart < reach, 1))
        parts = dissected(places, links)
        assert sorted(np.concatenate(parts).tolist()) == list(range(count))
    places = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0)), axis=-1).reshape(-1, 2)
    apart = np.abs(places[:, None] - places[None]).sum(axis=2)
    links = np.argwhere(np.triu(apart == 1.0))
    blocks = [(pair, np.ones((1, 2))) for pair in links]
    fronts = factored(blocks, dissected(places, links), 900).fronts
    # the last cut is a column of 30; no half meets more than its four sides
    assert len(fronts[-1].own) + len(fronts[-1].aside) == 30
    assert max(len(front.own) + len(front.later) for front in fronts) < 4 * 30


def test_small_teams_have_all_singular_values_and_large_ones_the_extremes() -> None:
    team = _grid(100, "ccw")
    dense = assessed_by(team, EVERY_KIND).observability
    sparse = assessed_by(team, 0).observability
    assert np.isfinite(dense.singular_values).all()
    known = np.flatnonzero(np.isfinite(sparse.singular_values))
    assert known.tolist() == [0, 299]
    assert sparse.condition_number == pytest.approx(dense.condition_number, rel=1e-11)


def test_vehicles_without_any_sighting_are_moved_by_their_own_null_vectors() -> None:
    team = _grid(100, "ccw")
    blind = replace(team, sensors=replace(team.sensors, ranges=np.full(100, 1e-3)))
    found = assessed_by(blind, 0).observability
    assert found.rank == 0
    assert len(found.null_space) == 300
    np.testing.assert_allclose(found.moved, 1.0)


def test_a_factor_solves_with_its_columns_without_a_pivot_at_zero() -> None:
    generator = np.random.default_rng(7)
    rows = generator.standard_normal((9, 6))
    rows[:, 4] = rows[:, 1] + rows[:, 2]
    factor = factored([(np.arange(6), rows)], [np.arange(3), np.arange(3, 6)], 6)
    assert factor.aside.tolist() == [4]
    kept = rows[:, [0, 1, 2, 3, 5]]
    side = generator.standard_normal((6, 2))
    inside = side[[0, 1, 2, 3, 5]]
    squared = factor.solve(factor.solve_transposed(side))
    np.testing.assert_allclose(squared[[0, 1, 2, 3, 5]], np.linalg.solve(kept.T @ kept, inside))
    np.testing.assert_array_equal(squared[4], 0.0)
    inverse = np.linalg.inv(kept.T @ kept)
    np.testing.assert_allclose(factor.variances()[[0, 1, 2, 3, 5]], np.diagonal(inverse))
    ((columns, vectors),) = factor.null_vectors()
    np.testing.assert_allclose(rows[:, columns] @ vectors, 0.0, atol=1e-12)
