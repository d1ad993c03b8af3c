"""The first scenarios of the searches of refinements in tests/searches."""

import pytest

from tests.searches.search_clearances import clear_one
from tests.searches.search_refinements import search_one


@pytest.mark.long
def test_no_refinement_of_drawn_scenarios_breaks_anything_and_nearly_all_improve() -> None:
    findings = [search_one(number, starts=1) for number in range(4)]
    assert [one.faults for one in findings] == [[]] * len(findings)
    assert sum(one.improved for one in findings) >= 3


@pytest.mark.long
def test_no_refinement_of_drawn_scenarios_passes_a_landmark_nearer_than_asked() -> None:
    findings = [clear_one(number, starts=1) for number in range(1, 6)]
    assert [one.faults for one in findings] == [[]] * len(findings)
    assert not any(one.too_near for one in findings)
    assert any(one.before < one.asked for one in findings)
    assert any(one.orbited for one in findings)
