"""How a flight is flown: the filter, the guidance, and all that goes wrong on the way."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeAlias

from syncplan.errors import InputError
from syncplan.estimation.filter_options import REQUEST_KEYS, FilterChanges, FilterOptions

OPEN_LOOP, TRACKING, AS_COMMANDED = 0, 1, 2
"""Where commands come from: the plan, the tracking law, or whoever wrote them last."""

DEFAULT_GATE = 0.9999
"""Probability of the innovation gate where bearings may be false."""

MOST_LATE = 1000

FLIGHT_REQUEST_KEYS: Mapping[str, str] = MappingProxyType(
    {
        **REQUEST_KEYS,
        "guidance": "guidance",
        "lose": "lose",
        "hold": "hold",
        "dropout": "dropout",
        "outliers": "outliers",
        "mistaken": "mistaken",
        "late": "late",
        "wind": "wind_mps",
    }
)
"""Key of each option in requests to the service."""


@dataclass(frozen=True, slots=True)
class GuidanceModel:
    """A guidance that can be chosen.

    Attributes
    ----------
    sentence : what it does
    mode : where the loop has its commands from
    work_per_s : operations of a vehicle's decisions in a second of flight; 0 where these are no
        work beside the filter's
    """

    sentence: str
    mode: int
    work_per_s: float = 0.0


GUIDANCES: Mapping[str, GuidanceModel] = MappingProxyType(
    {
        "track": GuidanceModel(
            "Steers to where the plan has the vehicle at each moment.", TRACKING
        ),
        "mpc": GuidanceModel(
            "Predicts, and keeps place, phase and separation within limits.",
            AS_COMMANDED,
            work_per_s=4e5,
        ),
        "none": GuidanceModel(
            "Open loop: the plan's speed and turn rate, whatever comes.", OPEN_LOOP
        ),
    }
)
"""By name."""

if TYPE_CHECKING:
    GuidanceChoice: TypeAlias = str
else:
    GuidanceChoice = Literal[tuple(GUIDANCES)]
"""A name in GUIDANCES: for models that check it and describe it in their JSON schemas."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions(FilterOptions):
    """How a flight is flown; raises InputError naming the option at fault.

    Attributes
    ----------
    guidance : a name in GUIDANCES
    lose, hold : events, as flight_events reads them
    dropout : share of sightings that are lost on their way
    outliers : share of bearings that are false: of nothing, anywhere in view
    mistaken : share of sightings that are of another vehicle in sight, if there is one, than the
        filter takes them for
    late : samples after which sightings arrive
    wind : m/s, the true wind; drawn by the scenario's wind.sigma_mps if None
    """

    request_keys: ClassVar[Mapping[str, str]] = FLIGHT_REQUEST_KEYS

    trials: int = 100
    guidance: str = "track"
    lose: tuple[str, ...] = ()
    hold: tuple[str, ...] = ()
    dropout: float = 0.0
    outliers: float = 0.0
    mistaken: float = 0.0
    late: int = 0
    wind: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        super(FlightOptions, self).__post_init__()
        if self.guidance not in GUIDANCES:
            problem = f"{self.guidance!r} is unknown; choose {' or '.join(GUIDANCES)}"
            raise InputError(problem, key="guidance")
        if self.filter_model.needs_truth:
            raise InputError(f"{self.filter} takes the truth; nobody can fly by it", key="filter")
        for name in ("dropout", "outliers", "mistaken"):
            share = getattr(self, name)
            if not 0.0 <= share < 1.0:
                raise InputError(f"{share:g} given; a share is from 0 to below 1", key=name)
        if self.outliers + self.mistaken >= 1.0:
            raise InputError("together with mistaken this is 1 or more", key="outliers")
        if not 0 <= self.late <= MOST_LATE:
            raise InputError(f"{self.late} given; allowed are 0 to {MOST_LATE} samples", key="late")
        wind = (0.0, 0.0) if self.wind is None else tuple(self.wind)
        if len(wind) != 2 or not all(map(math.isfinite, wind)):
            raise InputError(f"{self.wind} is no velocity; give x,y in m/s", key="wind")
        for name, example in (("lose", "v3@60"), ("hold", "v2@100:20")):
            if isinstance(getattr(self, name), str):
                problem = f"{getattr(self, name)!r}: must be a list of texts, such as [{example!r}]"
                raise InputError(problem, key=name)
        if self.gate_probability is None and self.outliers + self.mistaken > 0.0:
            object.__setattr__(self, "gate_probability", DEFAULT_GATE)

    @classmethod
    def of_request(cls, request: Mapping[str, Any]) -> Self:
        """Return the options that a request names; it may have further keys."""
        lists = {key: tuple(value) for key, value in request.items() if isinstance(value, list)}
        return super(FlightOptions, cls).of_request({**request, **lists})


class FlightChanges(FilterChanges, total=False):
    """Options by name, as functions take them beside, or instead of, FlightOptions."""

    guidance: str
    lose: tuple[str, ...]
    hold: tuple[str, ...]
    dropout: float
    outliers: float
    mistaken: float
    late: int
    wind: tuple[float, float] | None


def flight_options_with(options: FlightOptions | None, changes: FlightChanges) -> FlightOptions:
    """Return the options, the defaults if None, with some replaced and all checked."""
    return replace(options or FlightOptions(), **changes)
