"""What a map shows of a plan: circles, centres, entry points, landmarks, as places on Earth."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.geodesy import geodetic
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.orbits.circles import position, unit

POINTS_PER_TURN = 180


@dataclass(frozen=True, slots=True)
class VehicleTrack:
    """One vehicle on a map; places are latitude and longitude in degrees.

    Attributes
    ----------
    circle : (181, 2) from the entry point in the direction of flown, the last is the first
    center, entry : (2,)
    """

    name: str
    circle: Array
    center: Array
    entry: Array


def tracks_of(flown: ScheduledPlan) -> list[VehicleTrack]:
    """Return the track of each vehicle. Raises InputError without a geo_origin."""
    orbits, origin = flown.plan.orbits, flown.origin
    turn = 2.0 * np.pi / POINTS_PER_TURN * np.arange(POINTS_PER_TURN)
    phases = orbits.phases[:, None] + orbits.senses[:, None] * turn
    points = orbits.centers[:, None] + orbits.radii[:, None, None] * unit(phases)
    circles = geodetic(origin, np.concatenate([points, points[:, :1]], axis=1))
    centers, entries = geodetic(origin, orbits.centers), geodetic(origin, position(orbits, 0.0))
    return [
        VehicleTrack(name, circles[k], centers[k], entries[k]) for k, name in enumerate(flown.names)
    ]


def landmark_places(flown: ScheduledPlan) -> dict[str, Array]:
    """Return latitude and longitude of each landmark by its name."""
    places = geodetic(flown.origin, flown.plan.landmarks)
    return dict(zip(flown.plan.scenario.landmark_names, places, strict=True))


def parted(places: Array) -> list[Array]:
    """Return a line of (k, 2) latitudes and longitudes cut where it crosses the antimeridian.

    Each part ends on one side of it and the next goes on from the other (RFC 7946, section 3.1.9).
    """
    parts: list[list[tuple[float, float]]] = [[]]
    before: tuple[float, float] | None = None
    for latitude, longitude in places.tolist():
        if before is not None and abs(longitude - before[1]) > 180.0:
            side = 180.0 if before[1] > 0.0 else -180.0
            onward = longitude + 2.0 * side
            share = (side - before[1]) / (onward - before[1])
            crossing = before[0] + share * (latitude - before[0])
            parts[-1].append((crossing, side))
            parts.append([(crossing, -side)])
        parts[-1].append((latitude, longitude))
        before = (latitude, longitude)
    return [np.array(part) for part in parts]
