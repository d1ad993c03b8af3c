"""Figures of merit of a plan, and the objectives among them, which a refinement can improve.

Each has one table, from which options, schemas, documents, tables and charts are derived;
syncplan.refinement.nlp computes the objectives. The names D-, E- and T-optimality are those of
experiment design: Pukelsheim, Optimal Design of Experiments (1993), chapter 6.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from syncplan.phrases import metres

PREDICTED_UP_TO = 24
"""Largest team whose default objective is the predicted error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureOfMerit:
    """A figure by which plans are compared.

    Attributes
    ----------
    name : name in Python
    unit : unit of its values; empty for numbers without one
    label : label of its row in a table
    caption : text below its bars in a chart, one line or several; only for figures in m
    description : description in the JSON schema; empty where the name suffices
    finite : whether it has a finite value for every plan; documents write null for others
    """

    name: str
    unit: str = ""
    label: str
    caption: str = ""
    description: str = ""
    finite: bool = False

    @property
    def key(self) -> str:
        """Key in JSON: the name with its unit."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

    @property
    def heading(self) -> str:
        """Label with its unit."""
        return f"{self.label}, {self.unit}" if self.unit else self.label

    def words(self, value: float | bool | None) -> str:
        """Return a value in words."""
        if value is None:
            return "-"
        if isinstance(value, bool):
            return "holds" if value else "does not hold"
        return metres(value) if self.unit == "m" else f"{value:.4g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective(FigureOfMerit):
    """A figure of merit that refinement can improve.

    Attributes
    ----------
    title : short name in a list of choices
    sentence : description in running text
    falls : whether smaller values are better
    predicted : whether it rests on the posterior bound, which takes long for large teams
    neglects_window_bound : whether its optimum may leave one vehicle badly determined, so that the
        worst window bound has to be a constraint from the start
    needs_observability : whether it is infinite or 0 for plans that are not observable, and so
        cannot rank them
    """

    title: str
    sentence: str
    falls: bool
    predicted: bool = False
    neglects_window_bound: bool = False
    needs_observability: bool = False


_TABLE = (
    Objective(
        name="predicted_rms",
        unit="m",
        label="predicted error, all",
        caption="predicted RMS,\nall vehicles",
        description="Of all vehicles, over the second half",
        title="predicted error of the team",
        sentence="the predicted error of all vehicles",
        falls=True,
        predicted=True,
    ),
    Objective(
        name="worst_predicted_rms",
        unit="m",
        label="predicted error, worst",
        caption="predicted RMS,\nworst vehicle",
        description="Of the worst vehicle",
        title="predicted error of the worst vehicle",
        sentence="the predicted error of the worst vehicle",
        falls=True,
        predicted=True,
    ),
    Objective(
        name="logdet",
        label="log determinant",
        description="Of the windowed information; null if unobservable",
        title="information (log-determinant)",
        sentence="the log determinant of the windowed information (D-optimality)",
        falls=False,
        needs_observability=True,
    ),
    Objective(
        name="min_eigenvalue",
        label="smallest eigenvalue",
        finite=True,
        title="least-known motion (smallest eigenvalue)",
        sentence="the smallest eigenvalue of the windowed information (E-optimality)",
        falls=False,
        neglects_window_bound=True,
        needs_observability=True,
    ),
    Objective(
        name="trace",
        label="trace",
        finite=True,
        title="information (trace)",
        sentence="the trace of the windowed information (T-optimality)",
        falls=False,
        neglects_window_bound=True,
    ),
)

OBJECTIVES: Mapping[str, Objective] = MappingProxyType({one.name: one for one in _TABLE})

if TYPE_CHECKING:
    ObjectiveName = str
else:
    ObjectiveName = Literal[tuple(OBJECTIVES)]


def default_objective(count: int) -> Objective:
    """Return the default objective of a team of `count` vehicles."""
    return OBJECTIVES["predicted_rms" if count <= PREDICTED_UP_TO else "logdet"]


def listed() -> str:
    """Return the names as prose: "a, b or c"."""
    *others, last = OBJECTIVES
    return f"{', '.join(others)} or {last}"


# --- figures of one plan --------------------------------------------------------------------------


_VERDICTS = (
    FigureOfMerit(name="rank", label="rank", finite=True),
    FigureOfMerit(name="certified", label="certificate", finite=True),
    FigureOfMerit(name="meetings", label="meetings a period"),
    FigureOfMerit(
        name="least_tolerance",
        unit="rad",
        label="least phase tolerance",
        description="How far a phase may slip before a link is lost, for the link nearest to that",
    ),
)
_WINDOW_BOUND = FigureOfMerit(
    name="window_bound",
    unit="m",
    label="window bound, worst",
    caption="bound of one window,\nworst vehicle",
    description="Of the worst vehicle; null if unobservable",
)
DISTANCES = (
    FigureOfMerit(
        name="least_distance",
        unit="m",
        label="least separation",
        caption="least distance\nof two vehicles",
        description="The closest two vehicles come",
    ),
    FigureOfMerit(
        name="widest_meeting",
        unit="m",
        label="closest approach, widest meeting",
        caption="closest approach,\nwidest meeting",
        description="Closest approach of the linked vehicles that come the least close",
    ),
    FigureOfMerit(
        name="contact_margin",
        unit="m",
        label="contact margin",
        caption="contact margin",
        description="Margin by which the link or landmark nearest to being lost stays within range",
    ),
)
"""Figures in metres that are not errors."""

_ERRORS = tuple(one for one in OBJECTIVES.values() if one.unit)
_INFORMATION = tuple(one for one in OBJECTIVES.values() if not one.unit)

FIGURES: tuple[FigureOfMerit, ...] = (
    *_VERDICTS,
    *_INFORMATION,
    _WINDOW_BOUND,
    *_ERRORS,
    *DISTANCES,
)
"""Figures in the order of the JSON document."""

ROWS: tuple[FigureOfMerit, ...] = (
    *_VERDICTS,
    *_ERRORS,
    _WINDOW_BOUND,
    *_INFORMATION,
    *DISTANCES,
)
"""Figures in the order of tables and charts: errors in metres first."""


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of merit of one plan; each objective is also an attribute by its name.

    Attributes
    ----------
    rank, certified : rank of the windowed matrix, and whether the certificate holds
    window_bound : bound of the worst vehicle in m; infinite if unobservable
    least_distance : closest approach of two vehicles in m; infinite for one vehicle
    contact_margin : margin in m by which the link or landmark nearest to being lost stays within
        range for the samples it needs; infinite where none must be kept
    objectives : value of each objective by name, positions in the mean radius of the plan that was
        refined; logdet is -inf if unobservable, predicted errors are NaN if not computed
    meetings : number of pairs of vehicles that meet; NaN if not computed, like those below
    least_tolerance : least phase tolerance of a link in rad
    widest_meeting : largest closest approach of a link's vehicles in m
    """

    rank: int
    certified: bool
    window_bound: float
    least_distance: float
    contact_margin: float
    objectives: Mapping[str, float]
    meetings: float = math.nan
    least_tolerance: float = math.nan
    widest_meeting: float = math.nan

    def __getattr__(self, name: str) -> float:
        if name in OBJECTIVES:
            return self.objectives[name]
        raise AttributeError(f"{type(self).__name__} has no figure {name!r}")

    def cost(self, objective: str) -> float:
        """Return the value of the named objective, negated if larger is better."""
        value = self.objectives[objective]
        return value if OBJECTIVES[objective].falls else -value
