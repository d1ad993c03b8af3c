"""The first scenarios of the search in tests/searches/search_refinements.py."""

import pytest

from tests.searches.search_refinements import search_one


@pytest.mark.long
def test_no_refinement_of_drawn_scenarios_breaks_anything_and_nearly_all_improve() -> None:
    findings = [search_one(number, starts=1) for number in range(4)]
    assert [one.faults for one in findings] == [[]] * len(findings)
    assert sum(one.improved for one in findings) >= 3
