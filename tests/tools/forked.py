"""Functions for a template process whose children do nothing."""

import time
from collections.abc import Iterator


def load() -> Iterator[None]:
    """Load nothing, in one stage."""
    yield


def load_for_long() -> Iterator[None]:
    """Load a first stage, and a second one that takes an hour."""
    yield
    time.sleep(3600.0)


def serve(_descriptor: int) -> None:
    """Be there."""
    time.sleep(3600.0)
