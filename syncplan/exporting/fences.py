"""Geofences of a plan: its area, which vehicles stay within, and keep-outs, which they avoid."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.scenario.areas import Area
from syncplan.scenario.ground import lat_lon_of

FenceKind = Literal["area", "keep_out", "obstacle"]


@dataclass(frozen=True, slots=True)
class Fence:
    """A polygon of a plan on the ground.

    Attributes
    ----------
    kind : area, keep_out or obstacle; an obstacle blocks sight alone, and is no fence of vehicles
    places : (k, 2) corners in degrees, in order, not closed
    """

    kind: FenceKind
    places: Array


def polygons_of(flown: ScheduledPlan) -> list[Fence]:
    """Return all polygons of a plan. Raises InputError without a geo_origin."""
    scenario = flown.plan.scenario
    given: dict[FenceKind, list[list[tuple[float, float]]]] = {
        "area": [] if scenario.area_m is None else [scenario.area_m],
        "keep_out": scenario.keep_out_m or [],
        "obstacle": scenario.obstacles_m or [],
    }
    return [
        Fence(kind, lat_lon_of(flown.origin, np.array(corners)))
        for kind, polygons in given.items()
        for corners in polygons
    ]


def fences_of(flown: ScheduledPlan) -> list[Fence]:
    """Return the polygons that vehicles stay within or avoid."""
    return [polygon for polygon in polygons_of(flown) if polygon.kind != "obstacle"]


def fence_notes(flown: ScheduledPlan) -> list[str]:
    """Return what to know about the fences of a plan: their distances from circles and home."""
    scenario, orbits = flown.plan.scenario, flown.plan.orbits
    if not fences_of(flown):
        return []
    area = Area.of(scenario.area_m, scenario.keep_out_m)
    least = float(area.path_clearances(orbits.centers, orbits.radii).min())
    notes = [
        f"circles keep {least:.3g} m from the fences: an autopilot acts on a vehicle that strays "
        "further, or that takes off or returns across one"
    ]
    if float(area.path_clearances(np.zeros((1, 2)), np.zeros(1)).min()) < 0.0:
        notes.append("home, at geo_origin, lies outside the fences: choose another place for it")
    return notes
