"""Searches for cases that break a promise: drawn by number, judged one by one and all together.

    python -m tests.searches
    python -m tests.searches lost phases --draws 40 --first 1000
    python -m tests.searches --minutes 40

A search is a module of this package with a `SEARCH`; `lost.hardly` is the `HARDLY` of `lost`. The
same number draws the same case on any machine. Continuous integration has the numbers from 0 on,
`make check-all` fresh ones. The chance of refusing sound code counts where draws are fresh alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeVar

import numpy as np

__all__ = ["SEARCHES", "Search", "most_of", "outside", "search_of"]

SEARCHES = (
    *("survival", "upgrade", "contract", "designs", "equipment", "refinements", "clearances"),
    *("flights", "holds", "windy", "robust", "lost", "thrown", "predictions"),
    *("neglect", "weak", "truth", "consistency", "batch", "recording", "tuning", "losses"),
    *(
        "verdicts",
        "large_ranks",
        "lumps",
        "counterexamples",
        "phases",
        "sight_lines",
        "field_files",
    ),
)
"""What runs where no search is named; `requests` measures memory and has to run alone."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Search(Generic[T]):
    """How cases are drawn and judged.

    Attributes
    ----------
    draw : returns the faults and the figures of the case of a number
    judge : prints a table of the figures by number and returns the faults of all together, given
        the chance at which it may refuse sound code, 0 where the draws are fixed
    draws : number of cases of continuous integration
    """

    draw: Callable[[int], tuple[Sequence[str], T]]
    judge: Callable[[Mapping[int, T], float], Sequence[str]]
    draws: int


def search_of(name: str) -> Search[Any]:
    """Return the search of a name; ValueError where there is none."""
    module, _, variant = name.partition(".")
    try:
        search = getattr(import_module(f"{__name__}.{module}"), variant.upper() or "SEARCH")
    except (ImportError, AttributeError) as error:
        raise ValueError(f"no search {name}: {error}") from None
    assert isinstance(search, Search)
    return search


def most_of(count: int, share: float, chance: float) -> float:
    """Return how many of `count` cases may fail where a `share` of all cases may."""
    from scipy.stats import binom

    return float(binom.isf(chance, count, share)) if chance else share * count


def outside(values: Any, low: float, high: float, chance: float) -> bool:
    """Return whether a mean lies outside of its limits, by more than the values' spread explains.

    Not finite is outside; of two values nothing more can be said.
    """
    from scipy.stats import norm

    values = np.asarray(values, dtype=np.float64)
    mean, slack = float(values.mean()), 0.0
    if chance:
        spread = values.std(ddof=1) if len(values) > 2 else np.inf
        slack = float(norm.isf(chance) * spread / np.sqrt(len(values)))
    return not (np.isfinite(mean) and low - slack <= mean <= high + slack)
