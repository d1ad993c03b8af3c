"""Figures of merit of a plan: what a refinement compares before and after."""

from collections.abc import Mapping
from dataclasses import dataclass

from syncplan.scenario.objectives import OBJECTIVES, FigureOfMerit

_VERDICTS = (
    FigureOfMerit(name="rank", label="rank", finite=True),
    FigureOfMerit(name="certified", label="certificate", finite=True),
)
_WINDOW_BOUND = FigureOfMerit(
    name="window_bound",
    unit="m",
    label="window bound, worst",
    caption="bound of one window,\nworst vehicle",
    description="Of the worst vehicle; null if unobservable",
)
_GEOMETRY = (
    FigureOfMerit(
        name="least_distance",
        unit="m",
        label="least distance",
        caption="least distance\nof two vehicles",
        description="The closest two vehicles come",
    ),
    FigureOfMerit(
        name="contact_margin",
        unit="m",
        label="contact margin",
        caption="contact margin",
        description="By how much the link or landmark nearest to being lost stays within range",
    ),
)
_ERRORS = tuple(one for one in OBJECTIVES.values() if one.unit)
_INFORMATION = tuple(one for one in OBJECTIVES.values() if not one.unit)

FIGURES: tuple[FigureOfMerit, ...] = (
    *_VERDICTS,
    *_INFORMATION,
    _WINDOW_BOUND,
    *_ERRORS,
    *_GEOMETRY,
)
"""In the order of the JSON document."""

ROWS: tuple[FigureOfMerit, ...] = (
    *_VERDICTS,
    *_ERRORS,
    _WINDOW_BOUND,
    *_INFORMATION,
    *_GEOMETRY,
)
"""In the order of tables and charts: errors in metres first."""


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of merit of one plan; each objective's is an attribute of its name, too.

    Attributes
    ----------
    rank, certified : of the windowed matrix, and whether the certificate holds
    window_bound : m, worst vehicle's; infinite where unobservable
    least_distance : m, the closest two vehicles come; infinite for one vehicle
    contact_margin : m, by which the link or landmark that is nearest to being lost stays within
        range for the samples it needs; infinite where none is to be kept
    objectives : every objective's value by its name, positions in the refined plan's mean radius:
        logdet is -inf where unobservable, predicted errors are NaN where not computed
    """

    rank: int
    certified: bool
    window_bound: float
    least_distance: float
    contact_margin: float
    objectives: Mapping[str, float]

    def __getattr__(self, name: str) -> float:
        if name in OBJECTIVES:
            return self.objectives[name]
        raise AttributeError(f"{type(self).__name__} has no figure {name!r}")

    def cost(self, objective: str) -> float:
        """Return the value of the objective of that name; negated where larger is better."""
        value = self.objectives[objective]
        return value if OBJECTIVES[objective].falls else -value
