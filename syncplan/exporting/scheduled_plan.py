"""The plan that an export writes, with its duration, its altitudes and its place on Earth."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.exporting import format_table
from syncplan.exporting.exported_files import file_names, file_title
from syncplan.orbits.circles import heading, position
from syncplan.planning.plans import Plan
from syncplan.scenario.ground import lat_lon_of
from syncplan.scenario.models import GeoOrigin
from syncplan.scenario.specification import per_vehicle

# --- schedule -----------------------------------------------------------------------------------


MOST_POINTS = 2_000_000
"""Most poses, waypoints or pieces written for all vehicles together."""

_SLIVER = 1e-9


@dataclass(frozen=True, slots=True)
class ScheduledPlan:
    """A plan and how it is flown.

    Attributes
    ----------
    plan : plan whose orbits are flown
    options : options of the export
    altitudes : altitude of each vehicle in m above the ground at the origin
    duration : length of the run in s, from time 0
    title, labels : parts of file names that stand for the plan and for each vehicle
    """

    plan: Plan
    options: format_table.ExportOptions
    altitudes: tuple[float, ...]
    duration: float
    title: str
    labels: tuple[str, ...]

    @property
    def names(self) -> list[str]:
        """Names of the vehicles."""
        return self.plan.scenario.vehicle_names

    @property
    def autopilot(self) -> format_table.Autopilot:
        """Autopilot of the missions."""
        return format_table.AUTOPILOTS[self.options.autopilot]

    @property
    def vehicle(self) -> format_table.Vehicle:
        """Kind of vehicle."""
        return format_table.VEHICLES[self.options.vehicle]

    @property
    def is_copter(self) -> bool:
        """Whether ArduPilot's Copter flies the vehicles."""
        return self.autopilot.loiter_turns and not self.vehicle.holds_airspeed

    @property
    def turns(self) -> int:
        """Whole turns that cover the duration."""
        return max(1, math.ceil(self.duration / self.plan.orbits.period - _SLIVER))

    @property
    def origin(self) -> GeoOrigin:
        """Point on Earth at [0, 0]; raises InputError if the scenario has none."""
        if self.plan.scenario.geo_origin is None:
            raise InputError(
                "is missing, and this export needs it: give the scenario "
                "geo_origin: {lat_deg: 47.4, lon_deg: 8.5, alt_m: 488}",
                key="geo_origin",
            )
        return self.plan.scenario.geo_origin


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses of n vehicles at k times: times (k,) s, positions (k, n, 2) m, headings (k, n) rad."""

    times: Array
    positions: Array
    headings: Array


def stated_altitude(plan: Plan, options: format_table.ExportOptions) -> float | list[float] | None:
    """Return the altitude in m of all, or of each vehicle; None where neither argument gives one.

    That of the options counts before that of the plan's scenario.
    """
    return plan.scenario.altitude_m if options.altitude_m is None else options.altitude_m


def scheduled(plan: Plan, options: format_table.ExportOptions, altitude: float) -> ScheduledPlan:
    """Return a plan as it is written; `altitude` in m applies where none is stated."""
    scenario, turns = plan.scenario, options.turns
    stated = stated_altitude(plan, options)
    lowest = per_vehicle(altitude if stated is None else stated, scenario.size)
    period = plan.orbits.period
    duration = scenario.duration_s if options.duration is None else options.duration
    if turns is None and duration > format_table.MOST_TURNS * period:
        raise InputError(
            f"{duration:g}: must be at most {format_table.MOST_TURNS * period:.6g}, "
            f"{format_table.MOST_TURNS:,} turns",
            key="duration",
        )
    return ScheduledPlan(
        plan=plan,
        options=options,
        altitudes=tuple(least + k * options.altitude_step_m for k, least in enumerate(lowest)),
        duration=duration if turns is None else turns * period,
        title=file_title(scenario.name),
        labels=tuple(file_names(scenario.vehicle_names)),
    )


def sampled_poses(flown: ScheduledPlan) -> Poses:
    """Return the poses every sample time, the first at 0, headings not wrapped.

    Raises InputError if there would be more than two million poses.
    """
    step = flown.options.sample_time_s or flown.plan.scenario.sample_time
    count = math.floor(flown.duration / step + _SLIVER) + 1
    check_amount("poses", count * flown.plan.orbits.count, "sample_time_s", step)
    times = step * np.arange(count, dtype=np.float64)
    return Poses(times, position(flown.plan.orbits, times), heading(flown.plan.orbits, times))


def check_amount(what: str, total: int, key: str, value: float) -> None:
    """Raise InputError, naming the option `key`, if a total of points is too large to write."""
    if total > MOST_POINTS:
        raise InputError(
            f"{value:g}: makes {total:,} {what}, and at most {MOST_POINTS:,} are written; "
            "give a larger one, or a shorter duration",
            key=key,
        )


def places_of(flown: ScheduledPlan, points: Array) -> Array | None:
    """Return (..., 2) latitudes and longitudes of points, or None if no origin is known."""
    known = flown.plan.scenario.geo_origin
    return None if known is None else lat_lon_of(known, points)


def start_of(plan: Plan) -> datetime | None:
    """Return the moment of time 0 in UTC, or None if the scenario gives none.

    Raises InputError for a moment that in UTC lies before the year 1 or after 9999.
    """
    given = plan.scenario.start_time
    try:
        return None if given is None else datetime.fromisoformat(given).astimezone(UTC)
    except OverflowError:
        raise InputError(
            f"{given}: in UTC it must be from the year 1 to 9999", key="start_time"
        ) from None


def start_second(flown: ScheduledPlan) -> datetime | None:
    """Return the first whole second in UTC at or after time 0, or None if there is none."""
    start = start_of(flown.plan)
    if start is None or start.microsecond == 0:
        return start
    try:
        return start.replace(microsecond=0) + timedelta(seconds=1)
    except OverflowError:
        return None


def moment(start: datetime, seconds: float) -> str:
    """Return the moment `seconds` after `start` as RFC 3339 in UTC, to the microsecond.

    Raises InputError past the year 9999.
    """
    try:
        then = start + timedelta(seconds=seconds)
    except OverflowError:
        raise InputError(
            f"{start.isoformat()}: the run would end past the year 9999", key="start_time"
        ) from None
    return then.isoformat(timespec="microseconds").replace("+00:00", "Z")
