"""Which tests go to a process together, and which come first."""

from pathlib import PurePosixPath
from typing import Any

import pytest
from xdist.scheduler import LoadScopeScheduling

__all__ = ["Groups", "group_of", "rank_of"]

APART = (
    "tests/attacks/test_store_disk.py",
    "tests/crosschecks/test_others.py",
    "tests/documentation/test_docs.py::test_a_page_does_what_it_says",
    "tests/documentation/test_examples.py",
    "tests/observability/test_large_ranks.py",
    "tests/refinement/test_optimum.py",
    "tests/service/test_kept_databases.py",
    "tests/service/test_survival.py",
)
"""Files and tests that take long and share nothing: each test is a group of its own."""

PAGE = "tests/page"
FIRST_WINDOW = (
    *("adding", "editing", "handles", "kept_phases", "missions", "numbers", "page", "reloads"),
    *("saving", "tools"),
)
"""Files of the page that share one browser and one service; the others share another pair."""

SERVICE = "tests/service"
SERVED = (
    *("dashboard", "design_jobs", "figures", "given_plans", "kept_work", "owners", "recordings"),
    "routes",
)
"""Files that share a service."""

LONGEST = (
    "tests/refinement/test_optimum.py",
    "tests/documentation/test_examples.py::test_the_example_reaches_its_number[service_client]",
    PAGE,
    "tests/service/test_survival.py",
    "tests/service/test_kept_databases.py",
    "tests/documentation/test_docs.py::test_a_page_does_what_it_says",
    "tests/attacks",
    "tests/crosschecks/test_others.py",
    "tests/documentation",
    "tests/designs",
    "tests/client",
    "tests/estimation",
    "tests/refinement",
    "tests/flight",
    "tests/planning",
    "tests/cli",
    "tests/service",
    "tests/landmarks",
    "tests/observability",
)
"""Beginnings of names, the longest first: what begins last must not end long after all else."""


class Groups(LoadScopeScheduling):  # type: ignore[misc]
    """Hand out groups of tests in order, each to one process.

    xdist's own `loadgroup` marks groups in identifiers that pytest 9.2 no longer lets it change,
    and then keeps nothing together (pytest-dev/pytest-xdist, issue 1386).
    """

    def __init__(self, config: pytest.Config, log: Any) -> None:
        super().__init__(config, log)
        # not those of most tests first, but in the order in which they are collected
        config.option.loadscopereorder = False

    def _split_scope(self, nodeid: str) -> str:
        return group_of(nodeid)


def group_of(nodeid: str) -> str:
    """Return the group of a test: its file, where fixtures are made once, unless named above."""
    if nodeid.startswith(APART):
        return nodeid
    file = PurePosixPath(nodeid.partition("::")[0])
    name = file.stem.removeprefix("test_")
    if str(file.parent) == PAGE:
        return f"{PAGE} {name in FIRST_WINDOW}"
    if str(file.parent) == SERVICE and name in SERVED:
        return SERVICE
    return str(file)


def rank_of(nodeid: str) -> int:
    """Return how many kinds of tests begin before this one."""
    found = (k for k, beginning in enumerate(LONGEST) if nodeid.startswith(beginning))
    return next(found, len(LONGEST))
