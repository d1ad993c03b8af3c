"""Geofences of a plan: its area, which vehicles stay within, and keep-outs, which they avoid."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.phrases import metres
from syncplan.scenario.areas import Area
from syncplan.scenario.ground import lat_lon_of
from syncplan.scenario.quantities import Polygon

FenceKind = Literal["area", "keep_out", "obstacle"]


@dataclass(frozen=True, slots=True)
class Fence:
    """A polygon of a plan on the ground.

    Attributes
    ----------
    kind : area, keep_out or obstacle; an obstacle blocks sight alone, and is no fence of vehicles
    corners, places : (k, 2) in m and in degrees, in order, not closed
    """

    kind: FenceKind
    corners: Array
    places: Array


def polygons_of(flown: ScheduledPlan) -> list[Fence]:
    """Return all polygons of a plan. Raises InputError without a geo_origin."""
    scenario = flown.plan.scenario
    given: dict[FenceKind, list[Polygon]] = {
        "area": [scenario.area_m] if scenario.area_m else [],
        "keep_out": scenario.keep_out_m or [],
        "obstacle": scenario.obstacles_m or [],
    }
    return [
        Fence(kind, corners, lat_lon_of(flown.origin, corners))
        for kind, polygons in given.items()
        for corners in map(np.array, polygons)
    ]


def fences_of(flown: ScheduledPlan) -> list[Fence]:
    """Return the polygons that vehicles stay within or avoid."""
    return [polygon for polygon in polygons_of(flown) if polygon.kind != "obstacle"]


def fence_notes(flown: ScheduledPlan) -> list[str]:
    """Return what to know about the fences of a plan: their distances from circles and home."""
    scenario, orbits = flown.plan.scenario, flown.plan.orbits
    area = Area.of(scenario.area_m, scenario.keep_out_m)
    if not area.limited:
        return []
    least = float(area.path_clearances(orbits.centers, orbits.radii).min())
    notes = [
        f"circles keep {metres(least)} m from the fences: an autopilot that enforces them acts on "
        "a vehicle further off its circle, and on one that takes off or returns across a fence"
    ]
    if float(area.path_clearances(np.zeros((1, 2)), np.zeros(1)).min()) <= 0.0:
        notes.append("home, at geo_origin, breaks a fence: choose another place for it")
    return notes
