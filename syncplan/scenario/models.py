"""The sections of a scenario: circles, formation and sensor, each checked by itself.

Keys carry their unit in their name. Unknown keys are errors, numbers are finite, and every
message names the key, its value and what is allowed.
"""

import math
import re
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, Strict, ValidationInfo, field_validator, model_validator

from syncplan.scenario.altitudes import HIGHEST_M, LOWEST_M
from syncplan.scenario.formations import ShapeName
from syncplan.scenario.objectives import (
    OBJECTIVES,
    PREDICTED_UP_TO,
    ObjectiveName,
    default_objective,
)
from syncplan.scenario.quantities import (
    Angle,
    Latitude,
    Length,
    ListedOrNamed,
    ListedOrNamedPlaces,
    Longitude,
    Many,
    Name,
    OneOrMany,
    Pair,
    Section,
    fault,
    instead_of,
)

# --- limits and refinement ------------------------------------------------------------------------


DEFAULT_BOX_M = 5.0
"""Distance a centre may move each way where neither a box nor an area is given."""

Variable = Literal["phases", "centers", "radii"]
Bounds = Annotated[tuple[Length, Length], Strict(False)]
Speed = Annotated[float, Field(ge=1e-9, le=1e6)]
Speeds = Annotated[tuple[Speed, Speed], Strict(False)]


def _described_objectives() -> str:
    """Description of the objectives and of the default."""
    each = "; ".join(f"{one.name}, {one.sentence}" for one in OBJECTIVES.values())
    small, large = default_objective(PREDICTED_UP_TO), default_objective(PREDICTED_UP_TO + 1)
    return (
        f"What to improve: {each}. If not given, {small.name} for teams of up to "
        f"{PREDICTED_UP_TO} and {large.name} for larger ones. Only predicted errors count what the "
        "filter estimates beside the poses"
    )


class Limits(Section):
    """Limits of the vehicles' speed and turn rate."""

    speed_mps: Speeds | None = Field(
        default=None, description="Least and largest speed along the circle", examples=[[3.0, 6.0]]
    )
    turn_rate_rad_s: Annotated[float, Field(gt=0, le=1e4)] | None = Field(
        default=None, description="Largest turn rate", examples=[0.5]
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _check_order("speed_mps", self.speed_mps)
        return self


class RefineOptions(Section):
    """Options of a refinement: variables, limits, objective, effort."""

    vary: Many[Variable] = Field(
        default=["phases", "centers"],
        description="Variables: phases, centers, radii",
        examples=[["phases", "centers"]],
        json_schema_extra={"minItems": 1, "uniqueItems": True},
    )
    center_box_m: Annotated[float, Field(gt=0, le=1e7)] | None = Field(
        default=None,
        description="Largest move of each centre along x and along y; "
        f"{DEFAULT_BOX_M:g} if neither this nor area_m is given",
        examples=[5.0],
    )
    radius_m: Bounds | None = Field(
        default=None, description="Least and largest radius", examples=[[15.0, 25.0]]
    )
    objective: ObjectiveName | None = Field(
        default=None,
        description=_described_objectives(),
        examples=["predicted_rms"],
    )
    margin_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None,
        description="How far within range meetings stay; a fiftieth of the range if not given",
        examples=[1.0],
    )
    time_limit_s: Annotated[float, Field(gt=0, le=1e6)] = Field(
        default=60.0, description="Wall time after which the best plan so far is taken"
    )
    starts: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=4,
        description="Starting points: the plan, the rules desynchronised, then random ones",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=0, description="Seed of the starting points"
    )

    @model_validator(mode="after")
    def _agreeing(self) -> Self:
        if not self.vary:
            raise fault("vary", "is empty; name at least one of phases, centers, radii")
        if len(set(self.vary)) < len(self.vary):
            raise fault("vary", "names one value twice", self.vary)
        _check_order("radius_m", self.radius_m)
        if self.radius_m is not None and "radii" not in self.vary:
            raise fault("radius_m", "does nothing unless vary names radii")
        if self.radius_m is None and "radii" in self.vary:
            raise fault("radius_m", "is missing: vary names radii; give [least, largest]")
        if self.center_box_m is not None and "centers" not in self.vary:
            raise fault("center_box_m", "does nothing unless vary names centers")
        return self


def _check_order(key: str, limits: tuple[float, float] | None) -> None:
    if limits is not None and limits[0] > limits[1]:
        raise fault(key, "the least is larger than the largest", list(limits))


# --- place on Earth -------------------------------------------------------------------------------


Altitude = Annotated[float, Field(ge=LOWEST_M, le=HIGHEST_M)]


class GeoOrigin(Section):
    """Point on Earth (WGS 84) where the plane has [0, 0]."""

    lat_deg: Latitude = Field(description="Latitude, positive north", examples=[47.3977])
    lon_deg: Longitude = Field(description="Longitude, positive east", examples=[8.5456])
    alt_m: Altitude = Field(
        default=0.0,
        description="Altitude above mean sea level, used by autopilots as that of home",
        examples=[488.0],
    )


# --- circles, formation, sensor -------------------------------------------------------------------


MAX_VEHICLES = 10_000
"""Largest team accepted unless the caller says otherwise."""

SPEED_AGREEMENT = 1e-6
"""Relative difference up to which speed and rate times radius agree."""

Interval = Annotated[float, Field(ge=1e-6, le=1e6)]
"""Time between sightings or readings in s."""

Rate = Annotated[float, Field(ge=1e-6, le=1e4)]


def check_interval(key: str, interval: float, sample_time: float) -> None:
    """Raise the fault if an interval in s is not a whole number of samples."""
    samples = interval / sample_time
    if round(samples) < 1 or abs(samples - round(samples)) > 1e-6 * samples:
        raise fault(
            key,
            f"is not a multiple of sample_time_s, {sample_time:g} s; readings are taken at samples",
            interval,
        )


def _given(*keys: str, absent: Iterable[str] = ()) -> dict[str, Any]:
    """JSON Schema of a mapping where `keys` have values and `absent` ones are absent or null."""
    null: dict[str, Any] = {"type": "null"}
    present: dict[str, Any] = {key: {"not": null} for key in keys}
    return {"required": list(keys), "properties": {**present, **dict.fromkeys(absent, null)}}


class Orbit(Section):
    """The circles: radius, common angular rate, senses and phases."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [_given("angular_rate_rad_s"), _given("speed_mps")]}
    )

    radius_m: OneOrMany[Length] = Field(
        description="Radius of the circles, one value or one per vehicle", examples=[20.0]
    )
    angular_rate_rad_s: Rate | None = Field(
        default=None, description="Common angular rate of all vehicles", examples=[0.2]
    )
    speed_mps: OneOrMany[Speed] | None = Field(
        default=None, description="Speed along the circle, instead of the rate", examples=[4.0]
    )
    direction: OneOrMany[Literal["ccw", "cw", "alternate"]] = Field(
        default="ccw",
        description="Sense of turning: ccw, cw, alternate, or a list with ccw or cw per vehicle",
        examples=["ccw"],
    )
    first_phase_rad: Angle = Field(
        default=0.0, description="Phase of the first vehicle at time 0", examples=[0.3]
    )
    desync_rad: OneOrMany[Angle] = Field(
        default=0.0,
        description="Offset of each vehicle's phase from the exact rule",
        examples=[0.1],
    )

    @field_validator("direction")
    @classmethod
    def _list_has_no_alternate(cls, value: Any) -> Any:
        if isinstance(value, list) and "alternate" in value:
            raise fault("", "alternate stands alone; a list has ccw or cw for each vehicle")
        return value

    @model_validator(mode="after")
    def _one_rate(self) -> Self:
        radii = self.radius_m if isinstance(self.radius_m, list) else [self.radius_m]
        if self.angular_rate_rad_s is None and self.speed_mps is None:
            raise fault("angular_rate_rad_s", "is missing: give it, or speed_mps")
        if self.speed_mps is None:
            return self
        speeds = self.speed_mps if isinstance(self.speed_mps, list) else [self.speed_mps]
        count = max(len(speeds), len(radii), 1)
        if len(speeds) not in (1, count) or len(radii) not in (1, count):
            raise fault(
                "speed_mps", f"has {len(speeds)} values for {len(radii)} radii", self.speed_mps
            )
        speeds, radii = _spread(speeds, count), _spread(radii, count)
        rate = self.angular_rate_rad_s or speeds[0] / radii[0]
        for speed, radius in zip(speeds, radii, strict=True):
            if abs(speed - rate * radius) > SPEED_AGREEMENT * speed:
                raise fault("speed_mps", self._disagreement(speed, radius), self.speed_mps)
        if not 1e-6 <= rate <= 1e4:
            raise fault("speed_mps", f"gives {rate:g} rad/s; allowed are 1e-6 to 1e4")
        return self

    def _disagreement(self, speed: float, radius: float) -> str:
        if self.angular_rate_rad_s is not None:
            product = self.angular_rate_rad_s * radius
            return (
                f"disagrees with angular_rate_rad_s {self.angular_rate_rad_s:g} x radius_m "
                f"{radius:g} = {product:g} m/s; give one of the two"
            )
        return (
            f"{speed:g} m/s on a radius of {radius:g} m turns at another angular rate than the "
            "first vehicle: meetings are periodic only with one common rate; give "
            "angular_rate_rad_s instead"
        )

    @property
    def rate(self) -> float:
        """Common angular rate in rad/s."""
        if self.angular_rate_rad_s is not None:
            return self.angular_rate_rad_s
        speed = self.speed_mps[0] if isinstance(self.speed_mps, list) else self.speed_mps
        radius = self.radius_m[0] if isinstance(self.radius_m, list) else self.radius_m
        return float(speed or 0.0) / radius


_DEGREES = "centers_lat_lon_deg"
_SHAPED = ("shape", "count", "columns", "spacing_m", "gap_m")


class Formation(Section):
    """Centres of circles (listed, a shape, or yet to be found), and the pairs to synchronise."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [
                _given("centers_m", absent=(_DEGREES, *_SHAPED)),
                _given(_DEGREES, absent=("centers_m", *_SHAPED)),
                _given("shape", "count", "spacing_m", absent=("centers_m", _DEGREES, "gap_m")),
                _given("shape", "count", "gap_m", absent=("centers_m", _DEGREES, "spacing_m")),
                _given(
                    "links",
                    absent=("centers_m", _DEGREES, "shape", "columns", "spacing_m", "gap_m"),
                ),
            ]
        }
    )

    centers_m: ListedOrNamed | None = Field(
        default=None,
        description="Centres [x, y]: a list (vehicles are v1, v2, ...) or a mapping of names",
        examples=[[[0.0, 0.0], [70.0, 0.0]]],
    )
    centers_lat_lon_deg: ListedOrNamedPlaces | None = instead_of("centers_m")
    shape: ShapeName | None = Field(
        default=None, description="A shape instead of centers_m", examples=["ring"]
    )
    count: Annotated[int, Field(ge=1, le=10_000_000)] | None = Field(
        default=None, description="Number of vehicles, where the centres are not listed"
    )
    spacing_m: Length | None = Field(
        default=None, description="Distance of neighbouring centres of the shape", examples=[70.0]
    )
    gap_m: Length | None = Field(
        default=None,
        description="Gap between neighbouring circles of the shape, instead of its spacing",
        examples=[30.0],
    )
    columns: Annotated[int, Field(ge=1, le=10_000_000)] | None = Field(
        default=None,
        description="Width of grid and hex rows; nearly square if not given",
        examples=[3],
    )
    names: Many[Name] | None = Field(
        default=None, description="Names of the vehicles, instead of v1, v2, ...", examples=[["a"]]
    )
    links: Many[Pair] | None = Field(
        default=None,
        description="Pairs to synchronise; every pair that can come within range if not given. "
        "Without centers_m and shape, centres are found for these pairs",
        examples=[[["v1", "v2"]]],
    )

    @model_validator(mode="after")
    def _one_way_to_place(self, info: ValidationInfo) -> Self:
        lengths = {"spacing_m": self.spacing_m, "gap_m": self.gap_m}
        shape_keys = {"columns": self.columns, **lengths}
        if self.centers_m is not None:
            others = {"shape": self.shape, "count": self.count, **shape_keys}
            extra = [key for key, value in others.items() if value]
            if extra:
                raise fault(extra[0], "can't be combined with centers_m; give one of the two")
            if not self.centers_m:
                raise fault("centers_m", "is empty; a formation has at least one vehicle")
            if isinstance(self.centers_m, dict) and self.names is not None:
                raise fault("names", "can't be combined with centers_m that already gives names")
        elif self.shape is not None:
            if self.count is None:
                raise fault("count", f"is missing: shape {self.shape} needs count and spacing_m")
            if self.spacing_m is None and self.gap_m is None:
                raise fault("spacing_m", f"is missing: shape {self.shape} needs spacing_m or gap_m")
            if self.spacing_m is not None and self.gap_m is not None:
                raise fault("gap_m", "can't be combined with spacing_m; give one of the two")
        else:
            extra = [key for key, value in shape_keys.items() if value]
            if extra:
                raise fault(extra[0], "needs a shape; give shape too")
            if not self.links:
                raise fault(
                    "centers_m",
                    "is missing: list the centres, give shape, count and spacing_m, or give links "
                    "to have centres found",
                )
        if self.names is not None and not self.names:
            raise fault("names", "is empty; name each vehicle, or leave it out")
        _check_team_size(self, info)
        return self

    @property
    def placed(self) -> bool:
        """Whether the keys give the centres; otherwise syncplan.placement finds them."""
        return self.centers_m is not None or self.spacing_m is not None

    @property
    def size(self) -> int:
        """Number of vehicles."""
        if self.centers_m is not None:
            return len(self.centers_m)
        return self.count or len(self.vehicle_names)

    @property
    def vehicle_names(self) -> list[str]:
        """Names of the vehicles in order: as listed, v1, v2, ..., or as the links name them."""
        if isinstance(self.centers_m, dict):
            return list(self.centers_m)
        if self.names is not None:
            return self.names
        count = self.count if self.centers_m is None else len(self.centers_m)
        if count is not None:
            return [f"v{k + 1}" for k in range(count)]
        named = list(dict.fromkeys(name for pair in self.links or [] for name in pair))
        if all(re.fullmatch(r"v[1-9]\d*", name) for name in named):
            named.sort(key=lambda name: int(name[1:]))
        return named


def _check_team_size(formation: Formation, info: ValidationInfo) -> None:
    limit = (info.context or {}).get("max_vehicles", MAX_VEHICLES)
    if formation.size > limit:
        raise fault(
            "count" if formation.centers_m is None else "centers_m",
            f"{formation.size} vehicles are more than the limit of {limit}; "
            "raise it with --max-vehicles (library: max_vehicles=, service: SYNCPLAN_MAX_VEHICLES)",
        )


class BearingWalk(Section):
    """A sensor's own slowly varying bearing error: a first-order Gauss-Markov process."""

    sigma_rad: Annotated[float, Field(ge=0, le=math.pi)] = Field(
        default=0.0,
        description="Standard deviation of the bearing error that changes",
        examples=[0.02],
    )
    time_s: Annotated[float, Field(ge=1e-3, le=1e6)] = Field(
        default=10.0, description="Time over which its correlation falls to 1/e", examples=[30.0]
    )


class Sensor(Section):
    """A vehicle's sensor, which sights other vehicles and landmarks in range and field of view."""

    range_m: Length = Field(description="Largest distance seen", examples=[50.0])
    fov_deg: Annotated[float, Field(gt=0, le=360)] = Field(
        default=360.0, description="Full angle of the field of view", examples=[150.0]
    )
    boresight_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=0.0,
        description="Middle of the field of view from the heading, counter-clockwise",
        examples=[90.0],
    )
    bearing_sigma_rad: Annotated[float, Field(ge=1e-6, le=math.pi)] = Field(
        default=0.05, description="Standard deviation of a bearing", examples=[0.1]
    )
    sample_time_s: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        default=0.1,
        description="Time between samples of the filter and its motion readings, common to all "
        "vehicles",
        examples=[0.1],
    )
    interval_s: Interval | None = Field(
        default=None,
        description="Time between sightings of one target, a multiple of sample_time_s; "
        "sample_time_s if not given",
        examples=[0.5],
    )
    detection_probability: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None,
        description="Share of the sightings within range and view that are made; all if not given",
        examples=[0.9],
    )
    range_sigma_m: Annotated[float, Field(ge=1e-6, le=1e6)] | None = Field(
        default=None,
        description="Standard deviation of a distance, where each sighting measures it too",
        examples=[0.3],
    )
    bearing_bias_sigma_rad: Annotated[float, Field(ge=0, le=math.pi)] | None = Field(
        default=None,
        description="Standard deviation of the sensor's own bearing error, constant in a run; no "
        "such error if not given",
        examples=[0.02],
    )
    bearing_walk: BearingWalk | None = Field(
        default=None,
        description="The sensor's own bearing error that changes slowly; no such error if not "
        "given",
        examples=[{"sigma_rad": 0.02, "time_s": 30.0}],
    )

    @property
    def bearing_walk_sigma(self) -> float:
        """Standard deviation in rad of the slowly varying bearing error; 0 if there is none."""
        return self.bearing_walk.sigma_rad if self.bearing_walk else 0.0

    @model_validator(mode="after")
    def _whole_interval(self) -> Self:
        if self.interval_s is not None:
            check_interval("interval_s", self.interval_s, self.sample_time_s)
        return self


def _spread(values: list[float], count: int) -> list[float]:
    return values * count if len(values) == 1 else values
