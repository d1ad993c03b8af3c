"""Options of a filter run: which filter, its gate, the number of trials and their length."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from syncplan.errors import InputError
from syncplan.options import RunOptions, option
from syncplan.scenario.filters import (
    AUTO,
    FILTERS,
    FORMER_NAMES,
    FilterChoice,
    FilterModel,
    MotionName,
)

if TYPE_CHECKING:
    from syncplan.estimation.lane_filter import LaneFilter

MAX_TRIALS = 1_000_000
LARGEST_SEED = 2**63 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterOptions(RunOptions):
    """Options of a filter run; raises InputError naming the option at fault."""

    trials: int = option(
        200, "Number of Monte Carlo trials", example=200, often=True, ge=1, le=MAX_TRIALS
    )
    seed: int = option(0, "Seed of all random numbers", example=1, ge=0, le=LARGEST_SEED)
    duration: float | None = option(
        None,
        "Length of each run in s; the scenario's if not given",
        key="duration_s",
        flag="--duration",
        label="Length of a run",
        example=200.0,
        gt=0,
    )
    filter: FilterChoice = option(
        AUTO,
        "The filter. auto is the scenario's filter.kind; if it has none, a validation runs that of "
        "the plan's flights or, on paper, ekf if the start-up index clears the plan and robust if "
        "not, and every row of a sweep runs ekf",
    )
    substeps: int = option(
        10, "Euler sub-steps per sample; only for the filter named paper", ge=1, le=1000
    )
    gate_probability: float | None = option(
        None,
        "Probability of the innovation gate, the share of a consistent filter's sightings that it "
        "accepts, such as 0.999; no gate if not given",
        flag="--gate",
        example=0.999,
        gt=0,
        lt=1,
    )
    truth: Mapping[str, Any] | None = option(
        None,
        "Keys that replace the scenario's own in the simulated world alone, in addition to those "
        "of the scenario's truth; plan, prediction and filter keep the scenario's own values",
        example={"wind": {"gust_sigma_mps": 0.6}},
    )
    with_series: bool = option(False, "Add errors and sigmas over time to the report", key="series")
    model: MotionName | None = option(
        None, "Former name of filter: arc is ekf, euler is paper", former=True
    )

    def __post_init__(self) -> None:
        if self.model is not None:
            self._take_former_name(self.model)
        if not isinstance(self.truth, Mapping | None):
            problem = f"{self.truth!r}: give keys of the scenario, such as {{'wind': {{...}}}}"
            raise InputError(problem, key="truth")
        super(FilterOptions, self).__post_init__()

    def _take_former_name(self, name: str) -> None:
        """Set the filter of a former name; raises InputError if that is unknown or conflicts."""
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
        """The chosen filter; ekf if none is chosen."""
        return FILTERS["ekf" if self.filter == AUTO else self.filter]

    @property
    def motion_substeps(self) -> int:
        """Number of Euler sub-steps in a sample, 0 for exact arcs."""
        return self.filter_model.substeps(self.substeps)


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationOptions(FilterOptions):
    """Options of a validation, which may include worse worlds."""

    stress: bool = option(
        False,
        "Validate in worse worlds too: each stated sigma doubled, one at a time and all together; "
        "20 % of the sightings missed; 1 % of the bearings false",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions(FilterOptions):
    """Options of the validations in a sweep, which may have a further row."""

    connected: bool = option(
        False, "Add a row with a range that connects the team at every instant"
    )


def lane_filter_of(model: FilterModel) -> "LaneFilter":
    """Return the compiled filter of a model; loads numba."""
    module, _, name = model.kernel.partition(".")
    found: LaneFilter = getattr(import_module(f"{__package__}.{module}"), name)
    return found


def options_with(options: FilterOptions | None, changes: Mapping[str, Any]) -> FilterOptions:
    """Return the options, the defaults if None, with some replaced and all checked."""
    return replace(options or FilterOptions(), **changes)


def steps_in_run(duration: float, sample_time: float, period: float, count: int) -> int:
    """Return the number of whole samples in a run of `duration` s, within a scenario's limits.

    Raises InputError where there are none or too many.
    """
    # imported late: the command line reads the defaults and starts without these
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
