"""Options of a filter run: which filter, its gate, the number of trials and their length."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, Self, TypedDict

from syncplan.errors import InputError
from syncplan.estimation.filters import AUTO, FILTERS, FORMER_NAMES, FilterModel

MAX_TRIALS = 1_000_000
LARGEST_SEED = 2**63 - 1

REQUEST_KEYS: Mapping[str, str] = MappingProxyType(
    {
        "trials": "trials",
        "seed": "seed",
        "duration": "duration_s",
        "filter": "filter",
        "substeps": "substeps",
        "gate_probability": "gate_probability",
        "with_series": "series",
        "truth": "truth",
    }
)
"""Key of each option in requests to the service."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterOptions:
    """How the filter runs; raises InputError naming the option at fault.

    Attributes
    ----------
    trials : number of Monte Carlo trials
    seed : of all random numbers
    duration : s, of each run; the scenario's if None
    filter : name of the filter, see syncplan.estimation.filters.FILTERS, or `auto`: a validation
        then chooses by the plan's start-up index, all else runs `ekf`
    substeps : Euler sub-steps in a sample, for a filter that takes them
    gate_probability : of the innovation gate: the share of a consistent filter's bearings that it
        accepts; None for no gate
    with_series : whether errors and sigmas over time are kept
    truth : keys of the scenario that the simulated world has in place of its own, section by
        section as in the scenario's `truth`, over which they go
    model : former name of `filter`: `arc` for ekf, `euler` for paper; not kept
    """

    request_keys: ClassVar[Mapping[str, str]] = REQUEST_KEYS

    trials: int = 200
    seed: int = 0
    duration: float | None = None
    filter: str = AUTO
    substeps: int = 10
    gate_probability: float | None = None
    with_series: bool = False
    truth: Mapping[str, Any] | None = None
    model: str | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.trials <= MAX_TRIALS:
            raise InputError(f"{self.trials} given; allowed are 1 to {MAX_TRIALS}", key="trials")
        if not 0 <= self.seed <= LARGEST_SEED:
            raise InputError(f"{self.seed} given; allowed are 0 to {LARGEST_SEED}", key="seed")
        if self.model is not None:
            self._take_former_name(self.model)
        if self.filter not in (AUTO, *FILTERS):
            problem = f"{self.filter!r} is unknown; choose {' or '.join((AUTO, *FILTERS))}"
            raise InputError(problem, key="filter")
        if self.substeps < 1:
            raise InputError(f"{self.substeps} given, at least 1 is needed", key="substeps")
        if not isinstance(self.truth, Mapping | None):
            problem = f"{self.truth!r}: give keys of the scenario, such as {{'wind': {{...}}}}"
            raise InputError(problem, key="truth")
        gate = self.gate_probability
        if gate is not None and not 0.0 < gate < 1.0:
            raise InputError(f"{gate} is not between 0 and 1", key="gate_probability")

    def _take_former_name(self, name: str) -> None:
        """Set the filter of a former name; raises InputError where another one is asked for."""
        if name not in FORMER_NAMES:
            problem = f"{name!r} is unknown; choose {' or '.join(FORMER_NAMES)}, or give filter"
            raise InputError(problem, key="model")
        if self.filter not in (AUTO, FORMER_NAMES[name]):
            problem = f"{name!r} is {FORMER_NAMES[name]}, but the filter is {self.filter!r}"
            raise InputError(f"{problem}; leave model out", key="model")
        object.__setattr__(self, "filter", FORMER_NAMES[name])
        object.__setattr__(self, "model", None)

    @property
    def filter_model(self) -> FilterModel:
        """The filter that is chosen; ekf if none is."""
        return FILTERS["ekf" if self.filter == AUTO else self.filter]

    @property
    def motion_substeps(self) -> int:
        """Number of Euler sub-steps in a sample, 0 for exact arcs."""
        return self.filter_model.substeps(self.substeps)

    def as_request(self) -> dict[str, Any]:
        """Return the options as keys of a request to the service, None left out."""
        values = {key: getattr(self, name) for name, key in self.request_keys.items()}
        return {key: value for key, value in values.items() if value is not None}

    @classmethod
    def of_request(cls, request: Mapping[str, Any]) -> Self:
        """Return the options that a request names; it may have further keys."""
        keys = {**cls.request_keys, "model": "model"}
        return cls(**{name: request[key] for name, key in keys.items() if key in request})


class FilterChanges(TypedDict, total=False):
    """Options by name, as functions take them beside, or instead of, FilterOptions."""

    trials: int
    seed: int
    duration: float | None
    filter: str
    substeps: int
    gate_probability: float | None
    with_series: bool
    truth: Mapping[str, Any] | None
    model: str | None


def options_with(options: FilterOptions | None, changes: FilterChanges) -> FilterOptions:
    """Return the options, the defaults if None, with some replaced and all checked."""
    return replace(options or FilterOptions(), **changes)


def steps_in_run(duration: float, sample_time: float, period: float, count: int) -> int:
    """Return the whole samples in a run of `duration` s, within the same limits as a scenario's.

    Raises InputError where there are none or too many.
    """
    # not at the top: the command line reads the defaults, and starts without these
    from syncplan.orbits.sightings import steps_within
    from syncplan.scenario.rules import excess

    if not (math.isfinite(duration) and duration >= sample_time):
        raise InputError(
            f"{duration:g} s given; at least one sample time, {sample_time:g} s, is needed",
            key="duration",
        )
    problem = excess(duration, sample_time, period, count)
    if problem:
        raise InputError(problem, key="duration")
    return steps_within(duration, sample_time)
