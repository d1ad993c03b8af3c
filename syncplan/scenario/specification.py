"""The scenario: a user's formation, checked; one model for files and service."""

import math
from typing import Annotated, Self, TypeVar

from pydantic import Field, model_validator

from syncplan.results.result import Result
from syncplan.scenario import models, rules
from syncplan.scenario.disturbances import (
    ESTIMABLE,
    EstimableName,
    Filter,
    InitialSigma,
    Motion,
    Wind,
    check_estimated,
    error_sigma,
)
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.lat_lon_keys import PlacedSection
from syncplan.scenario.purposes import Purpose
from syncplan.scenario.quantities import (
    ListedOrNamed,
    ListedOrNamedPlaces,
    Many,
    OneOrMany,
    Place,
    Point,
    Polygon,
    StartTime,
    Title,
    fault,
    instead_of,
    points_of,
)
from syncplan.scenario.truths import CompassSigma, Truth, true_world

T = TypeVar("T")

Duration = Annotated[float, Field(gt=0, le=1e9)]


class Scenario(Result, PlacedSection):
    """A formation to plan: circles, sensors, landmarks and noise."""

    name: Title = Field(default="", description="Title", examples=["survey"])
    orbit: models.Orbit
    formation: models.Formation
    landmarks_m: ListedOrNamed = Field(
        default_factory=list,
        description="Known landmarks [x, y]: a list (L1, L2, ...) or a mapping of names",
        examples=[[[190.0, 0.0], [190.0, 70.0]]],
    )
    landmarks_lat_lon_deg: ListedOrNamedPlaces | None = instead_of("landmarks_m")
    sensor: OneOrMany[models.Sensor] = Field(description="One sensor for all, or one per vehicle")
    heading_sigma_rad: OneOrMany[CompassSigma | None] = Field(
        default=None,
        description="Standard deviation of a reading of a compass, one value or one per vehicle, "
        "null for one that has none; no compass if not given",
        examples=[0.05],
    )
    heading_interval_s: models.Interval | None = Field(
        default=None,
        description="Time between readings of a compass, a multiple of sample_time_s; "
        "sample_time_s if not given",
        examples=[0.5],
    )
    motion: Motion = Field(default_factory=Motion)
    wind: Wind | None = Field(default=None, description="Wind or current; none if not given")
    filter: Filter | None = Field(
        default=None, description="Errors that the filter estimates beside the poses"
    )
    initial_sigma: InitialSigma = Field(default_factory=InitialSigma)
    truth: Truth | None = Field(
        default=None,
        description="Noise, errors, sensors and limits of the simulated world where they differ "
        "from the scenario's own, which plan, prediction and filter keep; nothing if not given",
        examples=[{"wind": {"gust_sigma_mps": 0.6}}],
    )
    duration_s: Duration = Field(
        default=200.0, description="Length of the run that errors are predicted for", examples=[200]
    )
    window_s: Duration | None = Field(
        default=None,
        description="Time over which observability is judged, but no more than the run; one "
        "period if not given",
        examples=[60.0],
    )
    min_separation_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None,
        description="Least distance two vehicles may come to; a tenth of the mean radius counts as "
        "too near if not given, nothing if 0",
        examples=[10.0],
    )
    landmark_clearance_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None,
        description="Least distance a vehicle may come to a landmark; a tenth of the mean radius "
        "counts as too near if not given, nothing if 0",
        examples=[2.0],
    )
    area_m: Polygon | None = Field(
        default=None,
        description="Corners [x, y], in order, of the polygon that all circles must lie within",
        examples=[[[-50.0, -50.0], [250.0, -50.0], [250.0, 150.0], [-50.0, 150.0]]],
    )
    area_lat_lon_deg: Many[Place] | None = instead_of("area_m")
    keep_out_m: rules.Polygons | None = Field(
        default=None,
        description="Polygons that no path may pass through; a circle may go round one",
        examples=[[[[100.0, 20.0], [110.0, 20.0], [105.0, 30.0]]]],
    )
    keep_out_lat_lon_deg: rules.PolygonsOfPlaces | None = instead_of("keep_out_m")
    obstacles_m: rules.Polygons | None = Field(
        default=None,
        description="Polygons that block sight; what blocks paths is keep_out_m, and one polygon "
        "may stand in both",
        examples=[[[[100.0, 30.0], [110.0, 30.0], [105.0, 40.0]]]],
    )
    obstacles_lat_lon_deg: rules.PolygonsOfPlaces | None = instead_of("obstacles_m")
    purpose: Purpose | None = Field(
        default=None,
        description="What the circles are flown for; a plan that misses it is NO-GO",
        examples=[{"cover": {"share": 0.9, "swath_m": 60.0}}],
    )
    limits: models.Limits | None = Field(
        default=None, description="Speeds and turn rates that vehicles can reach"
    )
    refine: models.RefineOptions | None = Field(
        default=None, description="Options of a refinement; defaults where not given"
    )
    altitude_m: OneOrMany[models.Altitude] | None = Field(
        default=None,
        description="Altitude of flight above the ground at [0, 0], one value or one per vehicle; "
        "moves nothing in the plane, but exports take it; the format's own if not given",
        examples=[60.0],
    )
    start_time: StartTime | None = Field(
        default=None, description="Moment of time 0, RFC 3339", examples=["2026-05-01T09:00:00Z"]
    )
    geo_origin: models.GeoOrigin | None = Field(
        default=None,
        description="Where on Earth [0, 0] lies; exports to maps and autopilots need it; the "
        "middle of places in degrees if not given",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        orbit, formation = self.orbit, self.formation
        radii = per_vehicle(orbit.radius_m, self.size)
        rules.check_lengths(
            {
                "orbit.radius_m": orbit.radius_m,
                "orbit.speed_mps": orbit.speed_mps,
                "orbit.direction": orbit.direction,
                "orbit.desync_rad": orbit.desync_rad,
                "sensor": self.sensor,
                "heading_sigma_rad": self.heading_sigma_rad,
                "altitude_m": self.altitude_m,
                "formation.names": formation.names,
            },
            self.size,
        )
        rules.check_names(self.vehicle_names, self.landmark_names)
        rules.check_samples(
            (sensor.sample_time_s for sensor in self.sensors),
            {"duration_s": self.duration_s, "window_s": self.stated_window},
            self.period,
            self.size,
        )
        if self.heading_interval_s is not None:
            if self.heading_sigma_rad is None:
                raise fault("heading_interval_s", "does nothing unless heading_sigma_rad is given")
            models.check_interval("heading_interval_s", self.heading_interval_s, self.sample_time)
        rules.check_landmarks(self.landmark_names, self.landmarks)
        rules.check_corners("obstacles_m", self.obstacles_m or [])
        rules.check_polygons(self._polygons)
        check_estimated(self.filter.estimate if self.filter else "auto", self.error_sigmas)
        if self.limits is not None:
            rules.check_limits(self.limits, self.refine, orbit.rate, radii, self.vehicle_names)
        rules.check_link_names(formation.links or [], self.vehicle_names)
        if formation.placed:
            rules.check_extent("formation.spacing_m", self.centers)
            ranges = [sensor.range_m for sensor in self.sensors]
            rules.check_links(
                formation.links or [], self.vehicle_names, self.centers, radii, ranges
            )
        if formation.placed and isinstance(orbit.direction, list):
            rules.check_shared_circles(orbit.direction, self.vehicle_names, self.centers, radii)
        if self.purpose is not None:
            self.purpose.check_against(self.area_m, self.size, "the number of vehicles")
        if self.truth is not None:
            true_world(self, self.truth, self.size)
        return self

    # --- derived from the keys ----------------------------------------------------------------

    def __repr__(self) -> str:
        """Return one line: name, vehicles, landmarks."""
        name = f" {self.name!r}" if self.name else ""
        many = "s" if len(self.landmarks_m) != 1 else ""
        return (
            f"<{type(self).__name__}{name}: {self.size} vehicle{'s' if self.size > 1 else ''}, "
            f"{len(self.landmarks_m)} landmark{many}>"
        )

    @property
    def size(self) -> int:
        """Number of vehicles."""
        return self.formation.size

    @property
    def vehicle_names(self) -> list[str]:
        """Names of the vehicles in order."""
        return self.formation.vehicle_names

    @property
    def landmark_names(self) -> list[str]:
        """Names of the landmarks in order."""
        if isinstance(self.landmarks_m, dict):
            return list(self.landmarks_m)
        return [f"L{k + 1}" for k in range(len(self.landmarks_m))]

    @property
    def centers(self) -> list[Point]:
        """Centre [x, y] of each circle in m; empty where none are given."""
        formation = self.formation
        if formation.centers_m is not None:
            return points_of(formation.centers_m)
        shape, count, spacing = formation.shape, formation.count, formation.spacing_m
        if shape is None or count is None or spacing is None:
            return []
        centers = SHAPES[shape].centers(count, spacing, formation.columns)
        return [(float(x), float(y)) for x, y in centers]

    @property
    def landmarks(self) -> list[Point]:
        """Position [x, y] of each landmark in m."""
        return points_of(self.landmarks_m)

    @property
    def sensors(self) -> list[models.Sensor]:
        """Sensor of each vehicle."""
        return per_vehicle(self.sensor, self.size)

    @property
    def altitudes(self) -> list[float]:
        """Altitude of each vehicle in m above the ground at [0, 0]; empty where none is given."""
        return [] if self.altitude_m is None else per_vehicle(self.altitude_m, self.size)

    @property
    def sample_time(self) -> float:
        """Time between samples in s."""
        return self.sensors[0].sample_time_s

    @property
    def period(self) -> float:
        """Time of one turn in s."""
        return 2.0 * math.pi / self.orbit.rate

    @property
    def stated_window(self) -> float:
        """Window in s as stated; one period if not given."""
        return self.window_s if self.window_s is not None else self.period

    @property
    def window(self) -> float:
        """Window over which observability is judged, in s: as stated, but no more than the run."""
        return min(self.stated_window, self.duration_s)

    @property
    def run_cuts_window(self) -> bool:
        """Whether the run is shorter than the stated window."""
        return self.duration_s < self.stated_window

    def samples_in(self, interval: float | None) -> int:
        """Return the number of samples in an interval in s; 1 if not given."""
        return 1 if interval is None else round(interval / self.sample_time)

    @property
    def separation(self) -> float:
        """Required least distance of two vehicles in m; 0 if there is none."""
        return self.min_separation_m or 0.0

    @property
    def linked(self) -> list[tuple[int, int]]:
        """Listed links as indices of vehicles a < b; empty if none are listed."""
        index = {name: k for k, name in enumerate(self.vehicle_names)}
        return [
            (min(index[a], index[b]), max(index[a], index[b]))
            for a, b in self.formation.links or []
        ]

    @property
    def error_sigmas(self) -> dict[EstimableName, float]:
        """Largest sigma of each error beside noise, by name; errors without one are left out."""
        sigmas = {name: error_sigma(self, key.split(".")) for name, key in ESTIMABLE.items()}
        return {name: sigma for name, sigma in sigmas.items() if sigma > 0.0}

    @property
    def estimated(self) -> list[EstimableName]:
        """Errors that are states of the filter."""
        wanted = self.filter.estimate if self.filter else "auto"
        if isinstance(wanted, list):
            return [name for name in self.error_sigmas if name in wanted]
        return [] if wanted == "none" else list(self.error_sigmas)

    @property
    def in_truth(self) -> "Scenario":
        """Scenario of the simulated world, with the truth's keys in place of its own."""
        return self if self.truth is None else true_world(self, self.truth, self.size)

    @property
    def _polygons(self) -> dict[str, Polygon]:
        """Every polygon by its key."""
        area = {} if self.area_m is None else {"area_m": self.area_m}
        many = {"keep_out_m": self.keep_out_m, "obstacles_m": self.obstacles_m}
        each = {
            f"{key}[{k}]": polygon
            for key, polygons in many.items()
            for k, polygon in enumerate(polygons or [])
        }
        return {**area, **each}

    def resolved(self) -> "Scenario":
        """Return the scenario with defaults written out and its shape turned into centres.

        Centres that are not given stay unset; syncplan.placement.centers finds them.
        """
        formation = self.formation
        if formation.centers_m is None and formation.placed:
            keys = {"centers_m": self.centers, "names": formation.names, "links": formation.links}
            # loading the scenario has accepted any team beyond the usual limit
            formation = models.Formation.model_validate(keys, context={"max_vehicles": self.size})
        return self.following(formation=formation, window_s=self.stated_window)


def per_vehicle(value: T | list[T], count: int) -> list[T]:
    """Return one value for each of `count` vehicles, a single value repeated."""
    return value if isinstance(value, list) else [value] * count
