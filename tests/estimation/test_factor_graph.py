"""The batch solution against GTSAM's; `tests.searches.batch` has many more cases."""

import pytest

from tests.tools.filter_scenes import BUT_CLOCKS, a_team, scene_of

pytest.importorskip("gtsam", reason="this platform has no GTSAM")

from tests.searches.batch import SAME, compare, draw


@pytest.mark.parametrize("estimated", [("speed_scale", "gusts"), BUT_CLOCKS])
def test_the_batch_solution_is_that_of_a_factor_graph(estimated: tuple[str, ...]) -> None:
    given = scene_of(a_team(estimated), 25, 1)
    found = compare(" and ".join(estimated), given, 25)
    assert found.same, found
    assert abs(found.cost) < 1e-8
    assert found.errors == len(given.setup.states.variances)
    assert SAME == 1e-6


def test_the_batch_solution_is_that_of_a_factor_graph_after_many_steps() -> None:
    # a case that the search met: 12 steps left it 1e-5 of a sigma away
    assert not draw(69478203456)[0]
