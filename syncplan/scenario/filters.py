"""The table of filters, from which scenario, command line, service and reports take the names.

A new filter is a line of FILTERS. One with a different correction has a flag here, such as
`second_order`, that syncplan.estimation.correction_kernels reads; flights then have it too. One
that runs differently has a kernel, a LaneFilter in a module of syncplan.estimation. Flights do not
run that kernel: syncplan.guidance.closed_loop steps the extended filter.
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
    phrase : short description that follows the name
    sentence : description that stands alone
    takes_substeps : whether it integrates by the requested sub-steps
    second_order : whether sightings have second-order noise, see `second_order_variance`
    finds_start : whether it searches for its start during the first period, so that its covariance
        holds only afterwards
    needs_truth : whether it needs the true states of a trial and so can't run on recordings
    kernel : its LaneFilter: a module of syncplan.estimation and a name in it
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
        """Integration of its readings, as a name in FORMER_NAMES."""
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
"""Filters by name, the simplest first."""

FOR_RECORDINGS = tuple(name for name, one in FILTERS.items() if not one.needs_truth)
"""Names of the filters that run on recordings."""

AUTO = "auto"
"""Choice of the filter by flights of the plan or, on paper, by its start-up index."""

FORMER_NAMES: Mapping[str, str] = MappingProxyType({"arc": "ekf", "euler": "paper"})
"""Filters by their former names, which denote the integration of readings."""

if TYPE_CHECKING:
    FilterName: TypeAlias = str
    FilterChoice: TypeAlias = str
    FlightFilterChoice: TypeAlias = str
    MotionName: TypeAlias = str
    RecordingFilterName: TypeAlias = str
else:
    # models check names against these and list them in their JSON schemas
    FilterName = Literal[tuple(FILTERS)]
    FilterChoice = Literal[(AUTO, *FILTERS)]
    FlightFilterChoice = Literal[(AUTO, *FOR_RECORDINGS)]
    MotionName = Literal[tuple(FORMER_NAMES)]
    RecordingFilterName = Literal[FOR_RECORDINGS]
