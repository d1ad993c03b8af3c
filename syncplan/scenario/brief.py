"""The brief: a field, vehicles, sensors and the error that is allowed, checked like a scenario."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from syncplan.scenario import models, rules
from syncplan.scenario.disturbances import Filter, InitialSigma, Motion, Wind
from syncplan.scenario.lat_lon_keys import PlacedSection
from syncplan.scenario.loading import parse_document, read_text
from syncplan.scenario.purposes import Purpose
from syncplan.scenario.quantities import (
    Length,
    ListedOrNamed,
    ListedOrNamedPlaces,
    Many,
    OneOrRange,
    Place,
    Point,
    Polygon,
    Section,
    Title,
    fault,
    instead_of,
    points_of,
)
from syncplan.scenario.truths import CompassSigma

GRAVITY = 9.80665
"""Standard gravity in m/s^2."""

MOST_VEHICLES = 50
MOST_LANDMARKS = 50
"""Largest team that a search designs."""

Effort = Literal["quick", "normal", "thorough"]
Cost = Annotated[float, Field(ge=0, le=1e9)]


class Vehicle(Section):
    """A vehicle: its speed, and how tightly it can turn."""

    speed_mps: OneOrRange[models.Speed] = Field(
        description="Speed along the circle, or the least and the largest", examples=[5.0]
    )
    min_radius_m: Length | None = Field(
        default=None, description="Smallest radius it can fly", examples=[10.0]
    )
    bank_deg: Annotated[float, Field(gt=0, lt=90)] | None = Field(
        default=None, description="Largest bank angle of a coordinated turn", examples=[30.0]
    )
    turn_rate_rad_s: Annotated[float, Field(gt=0, le=1e4)] | None = Field(
        default=None, description="Largest turn rate", examples=[0.5]
    )

    @model_validator(mode="after")
    def _limited(self) -> Self:
        if self.speeds[0] > self.speeds[1]:
            raise fault("speed_mps", "the least is larger than the largest", list(self.speeds))
        if self.min_radius_m is None and self.bank_deg is None and self.turn_rate_rad_s is None:
            raise fault("min_radius_m", "is missing: give it, bank_deg or turn_rate_rad_s")
        return self

    @property
    def speeds(self) -> tuple[float, float]:
        """Least and largest speed in m/s."""
        given = self.speed_mps
        return given if isinstance(given, tuple) else (given, given)

    def least_radius(self, speed: float) -> float:
        """Return the radius in m of the smallest circle at a speed in m/s.

        In a coordinated turn at bank angle b, the radius is v^2 / (g tan b).
        """
        radius = self.min_radius_m or 0.0
        if self.bank_deg is not None:
            radius = max(radius, speed**2 / (GRAVITY * math.tan(math.radians(self.bank_deg))))
        if self.turn_rate_rad_s is not None:
            radius = max(radius, speed / self.turn_rate_rad_s)
        return radius


class TeamSize(Section):
    """How many vehicles there may be."""

    max: Annotated[int, Field(ge=1, le=MOST_VEHICLES)] = Field(
        description="Largest number of vehicles", examples=[6]
    )
    min: Annotated[int, Field(ge=1, le=MOST_VEHICLES)] = Field(
        default=1, description="Least number of vehicles", examples=[2]
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min > self.max:
            raise fault("min", f"is larger than max, {self.max}", self.min)
        return self


class Sites(Section):
    """How many landmarks there may be, and where: anywhere in the area unless it is said."""

    max: Annotated[int, Field(ge=0, le=MOST_LANDMARKS)] | None = Field(
        default=None,
        description="Largest number of landmarks; without it, all of the sites listed",
        examples=[3],
    )
    candidates_m: ListedOrNamed | None = Field(
        default=None,
        description="Sites to choose from",
        examples=[[[0.0, 0.0], [100.0, 0.0]]],
        json_schema_extra={"minItems": 1, "minProperties": 1},
    )
    candidates_lat_lon_deg: ListedOrNamedPlaces | None = instead_of("candidates_m")
    on_edge: bool = Field(default=False, description="Whether they stand on the area's edge")
    given: ListedOrNamed | None = Field(
        default=None,
        description="Landmarks that are there already",
        examples=[[[0.0, 0.0]]],
        json_schema_extra={"minItems": 1, "minProperties": 1},
    )
    given_lat_lon_deg: ListedOrNamedPlaces | None = instead_of("given")

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        listed = {"candidates_m": self.candidates_m, "given": self.given}
        for key, sites in listed.items():
            if sites is not None and not sites:
                raise fault(key, "is empty: list a site, or leave it out")
        kinds = {**listed, "on_edge": self.on_edge}
        named = [key for key, value in kinds.items() if value]
        if len(named) > 1:
            raise fault(named[1], f"can't be combined with {named[0]}; give one of the two")
        sites = self.candidates_m or self.given
        if self.max is None and sites is None:
            raise fault("max", "is missing: give it, candidates_m or given")
        if self.candidates_m and self.most > MOST_LANDMARKS:
            raise fault("max", f"is missing: give it, up to {MOST_LANDMARKS}")
        if self.max is not None and sites is not None and self.max > len(sites):
            raise fault("max", f"is more than the {len(sites)} sites listed", self.max)
        if self.given is not None and self.max not in (None, len(self.given)):
            raise fault("max", f"must be {len(self.given)}, the landmarks given", self.max)
        return self

    @property
    def most(self) -> int:
        """Largest number of landmarks."""
        return len(self.listed) if self.max is None else self.max

    @property
    def listed(self) -> list[Point]:
        """Sites that the brief lists, to choose from or given."""
        return points_of(self.candidates_m or self.given or [])

    @property
    def least(self) -> int:
        """Least number of landmarks: given ones are all used."""
        return len(self.given) if self.given else 0


class Need(Section):
    """The error that the team may have."""

    worst_rms_m: Length = Field(
        description="Largest RMS position error of any vehicle over the second half of a run",
        examples=[0.5],
    )
    margin: Annotated[float, Field(ge=0, lt=1)] = Field(
        default=0.05, description="Share by which the predicted error stays below it"
    )
    losses: Literal[0, 1] = Field(
        default=0, description="1 if the need must hold after the loss of any one part too"
    )


class Prefer(Section):
    """Costs, in any unit: the cheapest team that meets the need is chosen."""

    vehicle: Cost = Field(default=1.0, description="Cost of a vehicle", examples=[1.0])
    landmark: Cost = Field(default=0.3, description="Cost of a landmark", examples=[0.3])
    range_per_m: Cost = Field(
        default=0.01, description="Cost of a metre of every sensor's range", examples=[0.01]
    )


class Brief(PlacedSection):
    """What a team must do, what it may consist of, and the error that is allowed."""

    name: Title = Field(default="", description="Title", examples=["field survey"])
    area_m: Polygon = Field(
        description="Corners [x, y], in order, of the polygon that all circles lie within",
        examples=[[[0.0, 0.0], [300.0, 0.0], [300.0, 200.0], [0.0, 200.0]]],
    )
    area_lat_lon_deg: Many[Place] | None = instead_of("area_m")
    keep_out_m: rules.Polygons | None = Field(
        default=None, description="Polygons that no path may pass through"
    )
    keep_out_lat_lon_deg: rules.PolygonsOfPlaces | None = instead_of("keep_out_m")
    obstacles_m: rules.Polygons | None = Field(
        default=None, description="Polygons that block sight"
    )
    obstacles_lat_lon_deg: rules.PolygonsOfPlaces | None = instead_of("obstacles_m")
    vehicle: Vehicle
    sensor: models.Sensor
    heading_sigma_rad: CompassSigma | None = Field(
        default=None, description="Standard deviation of a compass reading; no compass if not given"
    )
    motion: Motion = Field(default_factory=Motion)
    wind: Wind | None = Field(default=None, description="Wind or current; none if not given")
    filter: Filter | None = Field(default=None, description="Errors that the filter estimates")
    initial_sigma: InitialSigma = Field(default_factory=InitialSigma)
    team: TeamSize
    landmarks: Sites
    purpose: Purpose
    need: Need
    prefer: Prefer = Field(default_factory=Prefer)
    min_separation_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None, description="Least distance two vehicles may come to"
    )
    landmark_clearance_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None, description="Least distance a vehicle may come to a landmark"
    )
    geo_origin: models.GeoOrigin | None = Field(
        default=None,
        description="Where on Earth [0, 0] lies; the middle of the places in degrees if not given",
    )
    effort: Effort = Field(default="normal", description="Length of the search")
    time_limit_s: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        default=None,
        description="Longest time of the searches; the best formations found are judged after it",
        examples=[600.0],
    )
    purchases: bool = Field(
        default=False,
        description="Whether to search what changes of the brief would bring also where it is met",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=0, description="Seed of the search"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        polygons = {"area_m": self.area_m}
        for key, many in (("keep_out_m", self.keep_out_m), ("obstacles_m", self.obstacles_m)):
            polygons.update({f"{key}[{k}]": one for k, one in enumerate(many or [])})
        rules.check_corners("obstacles_m", self.obstacles_m or [])
        rules.check_corners("keep_out_m", self.keep_out_m or [])
        rules.check_polygons(polygons)
        self.purpose.check_against(self.area_m, self.team.max, "team.max")
        return self

    def __repr__(self) -> str:
        """Return one line: name, need and limits."""
        name = f" {self.name!r}" if self.name else ""
        return (
            f"<{type(self).__name__}{name}: worst RMS {self.need.worst_rms_m:g} m, up to "
            f"{self.team.max} vehicles and {self.landmarks.most} landmarks>"
        )

    def shared_keys(self) -> dict[str, Any]:
        """Return the keys that every scenario of the brief has in common."""
        names = (
            "area_m",
            "keep_out_m",
            "obstacles_m",
            "purpose",
            "sensor",
            "heading_sigma_rad",
            "motion",
            "wind",
            "filter",
            "initial_sigma",
            "min_separation_m",
            "landmark_clearance_m",
            "geo_origin",
        )
        values = self.model_dump(include=set(names), exclude_none=True)
        return values


def brief_of(given: Brief | str | Path | Mapping[str, Any]) -> Brief:
    """Return a brief unchanged, or that of a file's path or of a mapping of keys.

    Raises InputError naming the file, the key, its value and what is allowed.
    """
    if isinstance(given, Brief):
        return given
    if isinstance(given, str | Path):
        name, text = read_text(given)
        return Brief.from_mapping(parse_document(text, name), source=name)
    return Brief.from_mapping(given)
