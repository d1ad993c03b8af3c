"""The page on the verdict lists the codes that there are, with their levels."""

import re

from syncplan.planning.planner import plan
from syncplan.planning.verdict_checks import CHECKS
from tests.tools.scenarios import small
from tests.tools.serving import ROOT

ROW = re.compile(r"^\| `([a-z-]+)` \| (stop|warning|note) \|", re.MULTILINE)


def listed() -> dict[str, str]:
    """Levels by code, as the page lists them."""
    return dict(ROW.findall((ROOT / "docs" / "verdict.md").read_text(encoding="utf-8")))


def test_the_page_lists_every_code_in_order_and_its_level() -> None:
    assert list(listed()) == list(CHECKS)
    square = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
    broken = plan(
        small(
            formation={"centers_m": [[0.0, 0.0], [25.0, 0.0]]},
            landmarks_m=[[20.5, 0.0]],
            area_m=square,
            keep_out_m=[[[15.0, -5.0], [25.0, -5.0], [25.0, 5.0]]],
            min_separation_m=90.0,
        ),
        bound="never",
    )
    found = {one.code: one.level for one in broken.verdict.findings}
    assert len(found) >= 6
    assert found.items() <= listed().items()
