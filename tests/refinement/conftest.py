"""Refinements for tests: short ones."""

from collections.abc import Iterator

import pytest

from syncplan.refinement import exact_search


@pytest.fixture(scope="module")
def short_exact_search() -> Iterator[None]:
    """Few measurements: for what is not about how good a plan the exact search finds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exact_search, "_MOST_LOOKS", 16)
        patch.setattr(exact_search, "_MOST_RUNS", 16)
        patch.setattr(exact_search, "_LEAST_RUNS", 16)
        yield
