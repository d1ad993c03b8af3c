"""The scenario: what a user says of a formation, checked. One model for files and for the service.

Keys carry their unit in their name. Unknown keys are errors, numbers are finite, and every
message names the key, its value and what is allowed.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from syncplan.checks import (
    check_extent,
    check_landmarks,
    check_lengths,
    check_links,
    check_names,
    check_samples,
    check_shared_circles,
)
from syncplan.formation import SHAPES, shape_centers
from syncplan.quantities import (
    Angle,
    Length,
    ListedOrNamed,
    Name,
    OneOrMany,
    Pair,
    Point,
    StartTime,
    Title,
    fault,
)

__all__ = [
    "MAX_VEHICLES",
    "Formation",
    "InitialSigma",
    "Motion",
    "Orbit",
    "Scenario",
    "Sensor",
    "per_vehicle",
]

MAX_VEHICLES = 2000
"""Largest team accepted unless the caller says otherwise."""

SPEED_AGREEMENT = 1e-6
"""Relative difference up to which speed and rate times radius agree."""

T = TypeVar("T")

Rate = Annotated[float, Field(ge=1e-6, le=1e4)]
Speed = Annotated[float, Field(ge=1e-9, le=1e6)]
Sigma = Annotated[float, Field(ge=0, le=1e3)]
Duration = Annotated[float, Field(gt=0, le=1e9)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Orbit(_Model):
    """The circles: radius, common angular rate, senses and phases."""

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
        count = max(len(speeds), len(radii))
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


class Formation(_Model):
    """Where the centres are: listed, named, or a shape; and which pairs to synchronise."""

    centers_m: ListedOrNamed | None = Field(
        default=None,
        description="Centres [x, y]: a list (vehicles are v1, v2, ...) or a mapping of names",
        examples=[[[0.0, 0.0], [70.0, 0.0]]],
    )
    shape: Literal["line", "grid", "hex", "ring"] | None = Field(
        default=None, description="A shape instead of centers_m", examples=["ring"]
    )
    count: Annotated[int, Field(ge=1, le=10_000_000)] | None = Field(
        default=None, description="Number of vehicles of the shape", examples=[6]
    )
    spacing_m: Length | None = Field(
        default=None, description="Distance of neighbouring centres of the shape", examples=[70.0]
    )
    columns: Annotated[int, Field(ge=1, le=10_000_000)] | None = Field(
        default=None,
        description="Width of grid and hex rows; nearly square if not given",
        examples=[3],
    )
    names: list[Name] | None = Field(
        default=None, description="Names of the vehicles, instead of v1, v2, ...", examples=[["a"]]
    )
    links: list[Pair] | None = Field(
        default=None,
        description="Pairs to synchronise; every pair that can come within range if not given",
        examples=[[["v1", "v2"]]],
    )

    @model_validator(mode="after")
    def _centers_or_shape(self, info: ValidationInfo) -> Self:
        shape_keys = {"count": self.count, "spacing_m": self.spacing_m, "columns": self.columns}
        if self.centers_m is None and self.shape is None:
            raise fault(
                "centers_m", "is missing: list the centres, or give shape, count, spacing_m"
            )
        if self.centers_m is not None:
            extra = [key for key, value in {"shape": self.shape, **shape_keys}.items() if value]
            if extra:
                raise fault(extra[0], "does not go with centers_m; give one of the two")
            if not self.centers_m:
                raise fault("centers_m", "is empty; a formation has at least one vehicle")
            if isinstance(self.centers_m, dict) and self.names is not None:
                raise fault("names", "does not go with centers_m that carries names already")
        else:
            for key in ("count", "spacing_m"):
                if shape_keys[key] is None:
                    raise fault(key, f"is missing: shape {self.shape} needs count and spacing_m")
        _check_team_size(self, info)
        return self

    @property
    def size(self) -> int:
        """Number of vehicles."""
        return len(self.centers_m) if self.centers_m is not None else self.count or 0


def _check_team_size(formation: Formation, info: ValidationInfo) -> None:
    limit = (info.context or {}).get("max_vehicles", MAX_VEHICLES)
    if formation.size > limit:
        raise fault(
            "count" if formation.centers_m is None else "centers_m",
            f"{formation.size} vehicles are more than the limit of {limit}; "
            "raise it with --max-vehicles (library: max_vehicles=) if you mean it",
        )


class Sensor(_Model):
    """What a vehicle sees of others and of landmarks: bearings, within range and field of view."""

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
        default=0.1, description="Time between samples, common to all vehicles", examples=[0.1]
    )


class Motion(_Model):
    """Noise of the motion readings, per sample."""

    speed_sigma_mps: Sigma = Field(
        default=0.1, description="Standard deviation of a speed reading", examples=[0.1]
    )
    turn_rate_sigma_rad_s: Sigma = Field(
        default=0.01, description="Standard deviation of a turn-rate reading", examples=[0.01]
    )


class InitialSigma(_Model):
    """How well each vehicle knows its pose at time 0."""

    position_m: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        default=5.0, description="Standard deviation of each coordinate", examples=[5.0]
    )
    heading_rad: Annotated[float, Field(ge=1e-6, le=100)] = Field(
        default=0.1, description="Standard deviation of the heading", examples=[0.1]
    )


class Scenario(_Model):
    """A formation to plan: circles, sensors, landmarks and noise."""

    name: Title = Field(default="", description="Title", examples=["survey"])
    orbit: Orbit
    formation: Formation
    landmarks_m: ListedOrNamed = Field(
        default_factory=list,
        description="Known landmarks [x, y]: a list (L1, L2, ...) or a mapping of names",
        examples=[[[190.0, 0.0], [190.0, 70.0]]],
    )
    sensor: OneOrMany[Sensor] = Field(description="One sensor for all, or one per vehicle")
    motion: Motion = Field(default_factory=Motion)
    initial_sigma: InitialSigma = Field(default_factory=InitialSigma)
    duration_s: Duration = Field(
        default=200.0, description="Length of the run that errors are predicted for", examples=[200]
    )
    window_s: Duration | None = Field(
        default=None,
        description="What observability is judged over; one period if not given",
        examples=[60.0],
    )
    min_separation_m: Annotated[float, Field(ge=0, le=1e7)] = Field(
        default=0.0, description="Least distance two vehicles may come to", examples=[10.0]
    )
    start_time: StartTime | None = Field(
        default=None, description="Moment of time 0, RFC 3339", examples=["2026-05-01T09:00:00Z"]
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        orbit, formation = self.orbit, self.formation
        radii = per_vehicle(orbit.radius_m, self.size)
        check_lengths(
            {
                "orbit.radius_m": orbit.radius_m,
                "orbit.speed_mps": orbit.speed_mps,
                "orbit.direction": orbit.direction,
                "orbit.desync_rad": orbit.desync_rad,
                "sensor": self.sensor,
                "formation.names": formation.names,
            },
            self.size,
        )
        check_names(self.vehicle_names, self.landmark_names)
        check_samples(
            (sensor.sample_time_s for sensor in self.sensors),
            {"duration_s": self.duration_s, "window_s": self.window},
            self.period,
            self.size,
        )
        check_extent("formation.spacing_m", self.centers)
        check_landmarks(self.landmark_names, self.landmarks)
        ranges = [sensor.range_m for sensor in self.sensors]
        check_links(formation.links or [], self.vehicle_names, self.centers, radii, ranges)
        if isinstance(orbit.direction, list):
            check_shared_circles(orbit.direction, self.vehicle_names, self.centers, radii)
        return self

    # --- what follows from the keys -----------------------------------------------------------

    @property
    def size(self) -> int:
        """Number of vehicles."""
        return self.formation.size

    @property
    def vehicle_names(self) -> list[str]:
        """Names of the vehicles in order."""
        formation = self.formation
        if isinstance(formation.centers_m, dict):
            return list(formation.centers_m)
        return formation.names or [f"v{k + 1}" for k in range(formation.size)]

    @property
    def landmark_names(self) -> list[str]:
        """Names of the landmarks in order."""
        if isinstance(self.landmarks_m, dict):
            return list(self.landmarks_m)
        return [f"L{k + 1}" for k in range(len(self.landmarks_m))]

    @property
    def centers(self) -> list[Point]:
        """Centre [x, y] of each circle in m."""
        formation = self.formation
        if formation.centers_m is not None:
            return _points(formation.centers_m)
        shape, count, spacing = formation.shape, formation.count, formation.spacing_m
        if shape not in SHAPES or count is None or spacing is None:
            return []
        return [
            (float(x), float(y)) for x, y in shape_centers(shape, count, spacing, formation.columns)
        ]

    @property
    def landmarks(self) -> list[Point]:
        """Position [x, y] of each landmark in m."""
        return _points(self.landmarks_m)

    @property
    def sensors(self) -> list[Sensor]:
        """The sensor of each vehicle."""
        return per_vehicle(self.sensor, self.size)

    @property
    def sample_time(self) -> float:
        """Time between samples in s."""
        return self.sensors[0].sample_time_s

    @property
    def period(self) -> float:
        """Time of one turn in s."""
        return 2.0 * math.pi / self.orbit.rate

    @property
    def window(self) -> float:
        """What observability is judged over, in s."""
        return self.window_s if self.window_s is not None else self.period

    def resolved(self) -> "Scenario":
        """Return the scenario with defaults written out and its shape turned into centres."""
        formation = self.formation
        if formation.centers_m is None:
            formation = Formation(
                centers_m=self.centers, names=formation.names, links=formation.links
            )
        return self.model_copy(update={"formation": formation, "window_s": self.window})


def per_vehicle(value: T | list[T], count: int) -> list[T]:
    """Return one value for each of `count` vehicles, a single value repeated."""
    return value if isinstance(value, list) else [value] * count


def _spread(values: list[float], count: int) -> list[float]:
    return values * count if len(values) == 1 else values


def _points(value: Sequence[Point] | dict[str, Point]) -> list[Point]:
    return list(value.values()) if isinstance(value, dict) else list(value)
