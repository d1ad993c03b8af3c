"""The batch solution against GTSAM's; `tests.searches.search_batch` has many more cases."""

import pytest

from syncplan.orbits.error_states import ERROR_STATES
from tests.estimation.test_further_states import a_team, scene_of

pytest.importorskip("gtsam", reason="this platform has no GTSAM")

from tests.searches.search_batch import SAME, compare

BUT_CLOCKS = tuple(name for name in ERROR_STATES if name != "clock_offset")
"""Errors that the graphs have; how a clock offset moves what is seen is exact about 0 alone."""


@pytest.mark.parametrize("estimated", [(), ("speed_scale", "gusts"), BUT_CLOCKS])
def test_the_batch_solution_is_that_of_a_factor_graph(estimated: tuple[str, ...]) -> None:
    setup, readings = scene_of(a_team(estimated), 45, 1)
    found = compare(" and ".join(estimated), setup, readings, 45)
    assert found.same, found
    assert abs(found.cost) < 1e-8
    assert found.errors == len(setup.variances)
    assert SAME == 1e-6
