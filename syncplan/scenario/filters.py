"""The table of filters; scenario, command line, service and reports take their names from here.

A new filter is a line of FILTERS. One that corrects in another way has a flag here, as
`second_order`, that syncplan.estimation.correction_kernels and the pilot look at: then flights have
it, too. One that runs in another way has a kernel, a LaneFilter in a module of syncplan.estimation.
Flights do not run that kernel: syncplan.flight.closed_loop steps the extended filter.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, TypeAlias


@dataclass(frozen=True, slots=True)
class FilterModel:
    """A filter that can be chosen.

    Attributes
    ----------
    phrase : what it is, after its name
    sentence : what it does
    takes_substeps : whether it integrates by the sub-steps that are asked for
    second_order : whether sightings have second-order noise, see `second_order`
    finds_start : whether its covariance holds only when a period has passed, as it looks for its
        start until then
    needs_truth : whether it takes the true states of a trial: it does not run on recordings
    kernel : where its LaneFilter is, a module of syncplan.estimation and a name in it
    """

    phrase: str
    sentence: str
    takes_substeps: bool = False
    second_order: bool = False
    finds_start: bool = False
    needs_truth: bool = False
    kernel: str = "lane_filter.EXTENDED"

    @property
    def motion(self) -> str:
        """How it integrates its readings, a name in FORMER_NAMES."""
        return "euler" if self.takes_substeps else "arc"

    def substeps(self, wanted: int) -> int:
        """Return the number of Euler sub-steps in a sample, 0 for exact arcs."""
        return wanted if self.takes_substeps else 0


FILTERS: Mapping[str, FilterModel] = MappingProxyType(
    {
        "ekf": FilterModel(
            "the extended Kalman filter",
            "Extended Kalman filter: takes sightings for linear at its estimate.",
        ),
        "second-order": FilterModel(
            "which takes a sighting's curvature for noise",
            "Takes a sighting's curvature for further noise: from a start known to 5 m, none lost.",
            second_order=True,
        ),
        "robust": FilterModel(
            "which looks for its start and begins again where it is lost",
            "Second-order for a period, then from the most likely start; begins again where lost.",
            second_order=True,
            finds_start=True,
            kernel="robust_filter.ROBUST",
        ),
        "paper": FilterModel(
            "the paper's Algorithm 1",
            "The paper's Algorithm 1: extended, integrates its readings by Euler sub-steps.",
            takes_substeps=True,
        ),
        "ideal": FilterModel(
            "linearised at the truth, which shows what is attainable",
            "Linearised at the truth, which only a simulation knows: what is attainable at best.",
            needs_truth=True,
            kernel="lane_filter.IDEAL",
        ),
    }
)
"""By name, the simplest first."""

FOR_RECORDINGS = tuple(name for name, one in FILTERS.items() if not one.needs_truth)
"""Names of those that run on recordings."""

AUTO = "auto"
"""In place of a name: the filter that the start-up index of a plan calls for."""

FORMER_NAMES: Mapping[str, str] = MappingProxyType({"arc": "ekf", "euler": "paper"})
"""Filters by how they integrate readings, as they were named at first."""

if TYPE_CHECKING:
    FilterName: TypeAlias = str
    FilterChoice: TypeAlias = str
    FlightFilterChoice: TypeAlias = str
    MotionName: TypeAlias = str
    RecordingFilterName: TypeAlias = str
else:
    # for models, which check names by them and list them in their JSON schemas
    FilterName = Literal[tuple(FILTERS)]
    FilterChoice = Literal[(AUTO, *FILTERS)]
    FlightFilterChoice = Literal[(AUTO, *FOR_RECORDINGS)]
    MotionName = Literal[tuple(FORMER_NAMES)]
    RecordingFilterName = Literal[FOR_RECORDINGS]
