"""Records of a plan: its refinement, with each start and figures before and after; its flights."""

import math
from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from pydantic import Field

from syncplan import __version__
from syncplan.documents import Document, DocumentPart, OrAbsent, Words
from syncplan.orbits.circles import Orbits
from syncplan.phrases import metres, percent
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.objectives import Figures
from syncplan.scenario.quantities import Many
from syncplan.scenario.specification import Scenario


class StartResult(DocumentPart):
    """Result of one start of the solver."""

    start: int = Field(description="0: the plan; 1: the rules desynchronised; then random ones")
    status: Words = Field(description="IPOPT's return status")
    iterations: int
    constraint_violation: float | None = Field(description="At the end, as IPOPT scales it")
    dual_infeasibility: float | None = Field(description="At the end, as IPOPT scales it")
    value: float | None = Field(description="Exact objective of the best candidate")
    violations: list[Words] = Field(
        description="Constraints that the input met and the candidate violates"
    )
    unmet: list[Words] = Field(description="Constraints that the solver could not meet")


@dataclass(frozen=True, slots=True)
class RefinementRecord:
    """Record of a plan's refinement.

    Attributes
    ----------
    options : as used; None for a plan read from a file
    objective : name of the figure that was improved
    improved : whether the plan is better than the input; if not, it is the input
    reason : why nothing better was found; empty if something was
    cut_short : whether the time limit or Ctrl-C ended the search
    before, after : exact figures of merit, positions in the input's mean radius
    active : constraints that the result meets with hardly any margin
    starts : results of the starts, in order
    expected_before : m, expected RMS error of all vehicles in the input, if its filter leaves out
        errors; None if it leaves out none or no bound is computed
    cleared : whether the result keeps distances or the purpose that the input did not, whatever
        its figures
    """

    options: RefineOptions | None
    objective: str
    improved: bool
    reason: str
    cut_short: bool
    before: Figures
    after: Figures
    active: tuple[str, ...]
    starts: tuple[StartResult, ...]
    expected_before: float | None = None
    cleared: bool = False


# --- flights --------------------------------------------------------------------------------------

OPEN_LOOP = "none"
"""Guidance of flights in open loop."""

_NO_EFFECT = (
    *("name", "refine", "geo_origin", "start_time", "purpose", "area_m", "keep_out_m"),
    *("landmark_clearance_m", "window_s", "altitude_m"),
)
"""Keys of a scenario that no flight depends on; the verdict judges them on paper."""

Interval = tuple[float, float]
"""Ends of a 95 % interval."""


class PhasesFlown(Document):
    """Flight of one vehicle over the second half of all trials."""

    name: str
    phase_rms_s: float = Field(description="RMS of the phase error, ahead of the plan or behind it")
    phase_worst_s: float = Field(description="Largest phase error in any trial")
    tracking_rms_m: float = Field(description="RMS distance from the place in the plan")
    speed_mps: tuple[float, float] = Field(
        description="Least and largest airspeed that was commanded, once a steady state is "
        "reached, holds apart: what it needs in the wind"
    )
    rms_m: OrAbsent[float] = Field(
        default=None,
        description="RMS position error of the estimates; missing where a filter broke down, and "
        "in older files, as the next two",
    )
    rms_interval_m: OrAbsent[Interval] = Field(
        default=None, description="95 % interval of rms_m, from the spread over flights"
    )
    bound_rms_m: OrAbsent[float] = Field(
        default=None, description="Of the bound along the paths truly flown"
    )


class MeetingsFlown(DocumentPart):
    """Meetings of a pair of the plan: two vehicles, or a vehicle and a landmark."""

    between: tuple[str, str]
    meetings: int = Field(description="In the plan, in each trial")
    kept_share: float = Field(
        description="Share of the meetings in all trials in which a sighting was made"
    )


class FlownPlan(Document):
    """Results of flying the plan under the conditions of its scenario."""

    digest: OrAbsent[str] = Field(
        default=None,
        description="Of the scenario, the orbits, this record and the version of syncplan: flights "
        "count for a plan that they fit; missing in older files",
    )
    trials: int
    seed: int
    duration_s: float
    guidance: str
    filter: str
    gate_probability: OrAbsent[float] = Field(
        default=None, description="Of the innovation gate; missing without one"
    )
    chosen_because: OrAbsent[Words] = Field(default=None, description="Reason for this filter")
    events: Many[Words] = Field(description="Losses and holds in every trial")
    filter_lost_share: float
    out_of_contact_share: float
    least_separation_m: tuple[float, float] | None = Field(
        description="Of the median and of the worst trial; null for a single vehicle"
    )
    too_close_share: float | None = Field(
        description="Share of trials below min_separation_m or, where that is not given, below a "
        "tenth of the mean radius; null for 0. In older files null where none is given"
    )
    vehicles: Many[PhasesFlown] = Field(description="Those that are there to the end")
    meetings_kept: Many[MeetingsFlown] = Field(
        default_factory=list, description="Of each pair that meets; empty in older files"
    )
    saturated_share: OrAbsent[float] = Field(
        default=None,
        description="Share of samples with a command at a limit; missing in older files",
    )
    rms_m: OrAbsent[float] = Field(
        default=None,
        description="RMS position error of all vehicles' estimates, second half; missing where a "
        "filter broke down, and in older files",
    )
    rms_interval_m: OrAbsent[Interval] = Field(default=None, description="95 % interval of rms_m")
    filter_lost_interval: OrAbsent[Interval] = Field(
        default=None,
        description="95 % interval of the share (Clopper and Pearson); missing in older files",
    )
    out_of_contact_interval: OrAbsent[Interval] = Field(default=None, description="Likewise")
    too_close_interval: OrAbsent[Interval] = Field(
        default=None, description="Likewise; missing where no distance is too near"
    )
    anees: OrAbsent[float] = Field(
        default=None,
        description="Average NEES over its dimension, 1 for a consistent filter; missing where a "
        "filter broke down, and in older files",
    )
    anees_interval: OrAbsent[Interval] = Field(default=None, description="95 % interval of anees")

    def bears_out(self, scenario: Scenario) -> bool:
        """Return whether the flights are those of the scenario: steered, whole and undisturbed."""
        whole = self.duration_s == scenario.duration_s
        return whole and self.guidance != OPEN_LOOP and not self.events

    def error_of(self, name: str) -> str:
        """Return a vehicle's RMS error in m with its 95 % interval; empty if it is not known."""
        for vehicle in self.vehicles:
            if vehicle.name == name and vehicle.rms_m is not None:
                return _with_interval(vehicle.rms_m, vehicle.rms_interval_m)
        return ""

    @property
    def line(self) -> str:
        """The result of the flights, in one line."""
        flights = "1 flight" if self.trials == 1 else f"{self.trials} flights"
        said = [f"guidance {self.guidance}"]
        if self.vehicles:
            squares = sum(each.tracking_rms_m**2 for each in self.vehicles) / len(self.vehicles)
            worst = max(self.vehicles, key=lambda vehicle: vehicle.phase_rms_s)
            said.append(f"{math.sqrt(squares):.3g} m off the plan (RMS)")
            said.append(f"phase at most {worst.phase_rms_s:.3g} s off (RMS, {worst.name})")
        if self.meetings_kept:
            least = min(self.meetings_kept, key=lambda pair: pair.kept_share)
            share, pair = percent(least.kept_share), "-".join(least.between)
            said.append(f"each pair keeps at least {share} of its meetings ({pair})")
        if self.least_separation_m is not None:
            said.append(f"least separation {metres(self.least_separation_m[1], 3)} m")
        if self.error:
            said.append(f"error {self.error} m (RMS, 95 % interval)")
        lost = percent(self.filter_lost_share, self.filter_lost_interval)
        said.append(f"filter {self.filter} lost in {lost}")
        return f"flown, {flights} of {self.duration_s:g} s: {', '.join(said)}"

    @property
    def error(self) -> str:
        """RMS error of all vehicles in m with its 95 % interval; empty if it is not known."""
        return "" if self.rms_m is None else _with_interval(self.rms_m, self.rms_interval_m)


def _with_interval(value: float, interval: Interval | None) -> str:
    if interval is None:
        return f"{value:.3g}"
    low, high = interval
    return f"{value:.3g} ({low:.3g} to {high:.3g})"


def flight_digest(scenario: Scenario, orbits: Orbits, record: FlownPlan) -> str:
    """Return the digest of a record of flights and of all that they depend on.

    Keys of the scenario that no flight depends on are left out.
    """
    circles = orbits.centers, orbits.radii, orbits.senses, orbits.phases, [orbits.rate]
    parts = [
        __version__,
        scenario.model_dump_json(exclude=set(_NO_EFFECT), exclude_none=True),
        repr([np.asarray(values, dtype=float).tolist() for values in circles]),
        record.model_dump_json(exclude={"digest"}),
    ]
    return sha256("\n".join(parts).encode()).hexdigest()[:32]
