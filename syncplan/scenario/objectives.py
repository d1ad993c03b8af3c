"""Objectives of refinement: what each is called, means, and needs, known without any numerics.

The one table of them. Options, schemas, documents, tables and charts are derived from it; how each
is computed stands in syncplan.refinement.objective_forms. The names D-, E- and T-optimality are
those of experiment design: Pukelsheim, Optimal Design of Experiments (1993), chapter 6.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

PREDICTED_UP_TO = 24
"""Largest team whose predicted error is the objective unless another is named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureOfMerit:
    """A figure by which plans are compared.

    Attributes
    ----------
    name : in Python
    unit : of its values; empty for numbers without one
    label : row of a table
    caption : below its bars in a chart, one line or several; only for figures in m
    description : in the JSON schema; empty where the name says it all
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective(FigureOfMerit):
    """A figure of merit that refinement can improve.

    Attributes
    ----------
    title : what it is, for people who choose
    sentence : what it is, for people who read
    falls : whether smaller values are better
    predicted : whether it rests on the posterior bound, which takes long for large teams
    neglects_window_bound : whether its optimum may leave one vehicle badly determined, so that the
        worst window bound has to be a constraint from the start
    needs_observability : whether it has no finite value, or only 0, for plans that are not
        observable, and so cannot rank them
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
    """Return the objective of a team of `count` vehicles where none is named."""
    return OBJECTIVES["predicted_rms" if count <= PREDICTED_UP_TO else "logdet"]


def listed() -> str:
    """Return the names as prose: "a, b or c"."""
    *others, last = OBJECTIVES
    return f"{', '.join(others)} or {last}"
