"""Options of a flight: filter, guidance, losses, holds, faulty sightings and wind."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, TypeAlias

from syncplan.errors import InputError
from syncplan.estimation.filter_options import MAX_TRIALS, FilterOptions
from syncplan.options import option
from syncplan.scenario.filters import AUTO, FILTERS, FlightFilterChoice

OPEN_LOOP, TRACKING, AS_COMMANDED = 0, 1, 2
"""Sources of commands: the plan, the tracking law, or the commands written last."""

DEFAULT_GATE = 0.9999
"""Probability of the innovation gate where bearings may be false."""


@dataclass(frozen=True, slots=True)
class GuidanceModel:
    """Guidance that a flight can choose.

    Attributes
    ----------
    sentence : description in one sentence
    mode : source of the loop's commands
    work_per_s : operations of a vehicle's decisions in a second of flight; 0 where they are
        negligible beside the filter's
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
            "Open loop: the plan's speed and turn rate, without corrections.", OPEN_LOOP
        ),
    }
)
"""Guidances by name."""

if TYPE_CHECKING:
    GuidanceChoice: TypeAlias = str
else:
    GuidanceChoice = Literal[tuple(GUIDANCES)]
"""Name in GUIDANCES, for models that check it and describe it in their JSON schemas."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions(FilterOptions):
    """Options of a flight; raises InputError naming the option at fault.

    `lose` and `hold` are events in the format of flight_events.
    """

    trials: int = option(
        100,
        "Number of flights",
        label="Flights",
        example=100,
        often=True,
        ge=1,
        le=MAX_TRIALS,
    )
    filter: FlightFilterChoice = option(
        AUTO,
        "The filter. auto is the scenario's filter.kind; if it has none, that of the plan's "
        "flights or, on paper, robust",
    )
    gate_probability: float | None = option(
        None,
        "Probability of the innovation gate, such as 0.999; if not given, no gate, or "
        f"{DEFAULT_GATE:g} where bearings may be false",
        flag="--gate",
        example=0.999,
        gt=0,
        lt=1,
    )
    with_series: bool = option(
        False,
        "Add figures over time to the report, and the tracks of the first trials",
        key="series",
    )
    guidance: GuidanceChoice = option(
        "track",
        "How vehicles steer. "
        + " ".join(f"{name}: {one.sentence}" for name, one in GUIDANCES.items()),
        often=True,
    )
    lose: tuple[str, ...] = option(
        (),
        "Vehicle (v3@60), sensor (sensor:v3@60) or landmark (L1@60) that is lost, with the time of "
        "the loss in s",
        label="Lost on the way",
        often=True,
        example=["v2@30"],
    )
    hold: tuple[str, ...] = option(
        (),
        "Vehicle to hold: v2@100:20 holds v2 from 100 s on for 20 s. A held vehicle stands still "
        "in the air, or circles if it has a least speed, and drifts with the wind",
        label="Held on the way",
        often=True,
        example=["v1@20:5"],
    )
    dropout: float = option(
        0.0, "Share of sightings that are lost on their way", label="Lost sightings", ge=0, lt=1
    )
    outliers: float = option(
        0.0,
        "Share of bearings that are false, anywhere in view",
        label="False bearings",
        ge=0,
        lt=1,
    )
    mistaken: float = option(
        0.0,
        "Share of sightings whose true target is a vehicle in sight other than the assumed one",
        label="Mistaken identities",
        ge=0,
        lt=1,
    )
    late: int = option(
        0, "Samples after which sightings arrive", label="Delay of sightings", ge=0, le=1000
    )
    wind: tuple[float, float] | None = option(
        None,
        "True wind x,y in m/s, such as 1.5,0; drawn by the scenario's wind.sigma_mps if not given",
        key="wind_mps",
        flag="--wind",
        often=True,
        example=[1.5, 0.0],
    )

    def __post_init__(self) -> None:
        if self.filter in FILTERS and FILTERS[self.filter].needs_truth:
            raise InputError(
                f"{self.filter} needs the truth, which no flight has; choose another", key="filter"
            )
        super(FlightOptions, self).__post_init__()
        if self.outliers + self.mistaken >= 1.0:
            raise InputError("together with mistaken this is 1 or more", key="outliers")
        wind = (0.0, 0.0) if self.wind is None else tuple(self.wind)
        if len(wind) != 2 or not all(map(math.isfinite, wind)):
            raise InputError(f"{self.wind} is not a velocity; give x,y in m/s", key="wind")
        for name, example in (("lose", "v3@60"), ("hold", "v2@100:20")):
            if isinstance(getattr(self, name), str):
                problem = f"{getattr(self, name)!r}: must be a list of texts, such as [{example!r}]"
                raise InputError(problem, key=name)
        if self.gate_probability is None and self.outliers + self.mistaken > 0.0:
            object.__setattr__(self, "gate_probability", DEFAULT_GATE)

    @property
    def conditions(self) -> list[str]:
        """Faults of sightings and the wind, in words; empty if none are requested."""
        shares = {
            "of the sightings are lost on their way": self.dropout,
            "of the bearings are false": self.outliers,
            "of the sightings are of another vehicle, if one is in sight": self.mistaken,
        }
        found = [f"{100.0 * share:g} % {what}" for what, share in shares.items() if share]
        if self.late:
            found.append(f"sightings arrive {self.late} samples late")
        if self.wind is not None:
            found.append("the wind is {:g}, {:g} m/s".format(*self.wind))
        return found
