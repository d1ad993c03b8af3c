"""Timings of syncplan beside other ways to the same figures; see README.md."""

from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["Figure", "print_figures"]


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of a benchmark and what it should be.

    Attributes
    ----------
    what : what was measured
    value : s where the unit is "s", times as fast where it is "x", how many a second where it is
        "/s", megabytes where it is "MB", the exponent of n where it is "power", a plain number
        where empty
    unit : "s", "x", "/s", "%", "MB", "power", "times" (as long) or empty
    target : a least for ratios and rates, a most for all else; None where there is none
    """

    what: str
    value: float
    unit: str
    target: float | None = None

    @property
    def text(self) -> str:
        """The value with its unit, to three digits."""
        return _text(self.value, self.unit)

    @property
    def target_text(self) -> str:
        """The target with its sign, and whether it is missed; empty without one."""
        if self.target is None:
            return ""
        sign, met = ("<", self.value < self.target)
        if self.unit in ("x", "/s"):
            sign, met = (">=", self.value >= self.target)
        return f"{sign} {_text(self.target, self.unit)}" + ("" if met else ", missed")


def _text(value: float, unit: str) -> str:
    if unit == "s":
        return f"{value:.2f} s" if value >= 1.0 else f"{1e3 * value:.3g} ms"
    if unit == "power":
        return f"n^{value:.2f}"
    if unit == "times":
        return f"{value:.2f} times"
    number = f"{value:,.0f}" if value >= 100.0 or not unit else f"{value:.2g}"
    return f"{number} {unit}".strip()


def print_figures(figures: Iterable[Figure]) -> None:
    """Print a plain table: what, measured, target."""
    rows = [(figure.what, figure.text, figure.target_text) for figure in figures]
    width = max(len(what) for what, _, _ in rows)
    for what, measured, target in [("", "measured", "target"), *rows]:
        print(f"{what:{width}}  {measured:>12}  {target}".rstrip())
