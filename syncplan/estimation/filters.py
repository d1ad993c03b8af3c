"""The table of filters; command line, service and reports take their names from here.

A new filter is its kernel, as a LaneFilter in a module of this package, and a line of FILTERS.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from syncplan.estimation.lane_filter import LaneFilter

__all__ = ["FILTERS", "FilterModel", "FilterName"]


@dataclass(frozen=True, slots=True)
class FilterModel:
    """A filter that can be chosen.

    Attributes
    ----------
    sentence : what it does
    takes_substeps : whether it integrates by the sub-steps that are asked for
    second_order : whether sightings have second-order noise, see `second_order`
    finds_start : whether its covariance holds only when a period has passed, as it looks for its
        start until then
    kernel : where its LaneFilter is, a module of this package and a name in it
    augmented : where that with further states is
    """

    sentence: str
    takes_substeps: bool = False
    second_order: bool = False
    finds_start: bool = False
    kernel: str = "extended_filter.EXTENDED"
    augmented: str = "augmented_filter.AUGMENTED"

    def substeps(self, wanted: int) -> int:
        """Return the number of Euler sub-steps in a sample, 0 for exact arcs."""
        return wanted if self.takes_substeps else 0

    @property
    def lane_filter(self) -> "LaneFilter":
        """The compiled filter of poses; loads numba."""
        return _loaded(self.kernel)

    @property
    def augmented_lane_filter(self) -> "LaneFilter":
        """The compiled filter that has further states, or misses sightings; loads numba."""
        return _loaded(self.augmented)


def _loaded(place: str) -> "LaneFilter":
    module, _, name = place.partition(".")
    found: LaneFilter = getattr(import_module(f"syncplan.estimation.{module}"), name)
    return found


FILTERS: Mapping[str, FilterModel] = MappingProxyType(
    {
        "arc": FilterModel("Integrates its readings along exact arcs."),
        "euler": FilterModel(
            "Integrates its readings by Euler sub-steps, as the paper's Algorithm 1.",
            takes_substeps=True,
        ),
        "second-order": FilterModel(
            "Takes a sighting's curvature for further noise of it: safe from an uncertain start.",
            second_order=True,
        ),
        "robust": FilterModel(
            "Second-order, then from the batch solution over the first period; begins again where "
            "it is lost.",
            second_order=True,
            finds_start=True,
            kernel="robust_filter.ROBUST",
            augmented="robust_filter.ROBUST_AUGMENTED",
        ),
    }
)
"""By name, the default first."""

if TYPE_CHECKING:
    FilterName: TypeAlias = str
else:
    FilterName = Literal[tuple(FILTERS)]
"""A name in FILTERS, for models that check it and describe it in their JSON schema."""
