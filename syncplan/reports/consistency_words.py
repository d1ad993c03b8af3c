"""ANEES and NIS in words: the figure, its interval, what that rests on, and the verdict."""

import math

from syncplan.estimation.consistency import FEWEST_TRIALS, TOLERANCE
from syncplan.reports.run_schemas import Spread

_MOST_DECIMALS = 9


def spread_figures(figure: Spread) -> tuple[str, str, str]:
    """Return value and ends of the interval with as many digits as their comparison needs.

    Rounded, they compare with each other and with the tolerated range as they do unrounded. Raises
    ValueError for a figure without an interval.
    """
    if figure.value is None or figure.band is None:
        raise ValueError("the figure has no interval")
    values = (figure.value, *figure.band)
    decimals = _decimals(max(abs(value) for value in values))
    while decimals < _MOST_DECIMALS and _compared(*values) != _compared(
        *(round(value, decimals) for value in values)
    ):
        decimals += 1
    shown = [f"{value:.{decimals}f}" for value in values]
    return shown[0], shown[1], shown[2]


def interval_words(figure: Spread) -> str:
    """Return the value with its interval and what that rests on, without the verdict."""
    if figure.value is None:
        return "no samples"
    if figure.band is None:
        runs = "trial" if figure.count == 1 else "trials"
        return f"{figure.value:.{_decimals(figure.value)}f} over {figure.count} {runs}"
    value, low, high = spread_figures(figure)
    if figure.basis is None:
        return f"{value}, 95 % band {low} to {high}"
    if figure.basis == "trials":
        return f"{value}, 95 % interval {low} to {high} over {figure.count} trials"
    return (
        f"{value}, 95 % interval {low} to {high} of one run, "
        f"{figure.count} chi-square degrees of freedom"
    )


def verdict_words(figure: Spread) -> str:
    """Return the verdict, and why there is none where there is none."""
    if figure.verdict != "unknown":
        return figure.verdict
    if figure.value is None:
        return "not judged"
    if figure.band is None:
        return f"not judged, at least {FEWEST_TRIALS} trials are needed"
    return "not judged, the interval is too wide: run more trials"


def _decimals(value: float) -> int:
    """Decimals of four significant digits; at least one, at most three."""
    return max(1, min(3, 3 - math.floor(math.log10(max(value, 1.0)))))


def _compared(value: float, low: float, high: float) -> tuple[bool, ...]:
    tolerated = (1.0 - TOLERANCE, 1.0 + TOLERANCE)
    ends = [end > limit for end in (low, high) for limit in tolerated]
    return (low < value, value < high, *ends)
