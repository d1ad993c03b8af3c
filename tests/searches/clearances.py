"""Search for a refinement after which a vehicle passes a landmark or a keep-out too near.

Scenarios are those of `refinements`. In two of three a landmark is moved onto a vehicle's path or
beside it, nearer than asked; in one of three a clearance is stated as well, and a vehicle orbits an
obstacle. Fails where `refinements` does, where a vehicle passes a landmark nearer than asked after
all, or flies through a keep-out: each is looked at where it is at many instants.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import shapely

from syncplan.arrays import Array
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import scenario_from
from tests.searches import Search
from tests.searches.refinements import (
    NEAR_SHARE,
    ROUNDING,
    STARTS,
    draw_plan,
    faults_of,
    landmark_passes,
)
from tests.tools.on_paper import plan, refine

__all__ = ["SEARCH", "Passes", "draw_near_plan"]

INSTANTS = 20_000
SHOWN = 10


class Passes(NamedTuple):
    """Nearest passes of landmarks before and after a refinement in m, and what is asked."""

    before: float
    after: float
    asked: float
    orbited: bool


def draw_near_plan(number: int) -> Plan:
    """Return the plan of a scenario, of the third kind with a stated clearance."""
    given = draw_plan(number)
    kind = number % 3
    if kind == 0:
        return given
    generator = np.random.default_rng([number, 31])
    document: dict[str, Any] = given.scenario.model_dump(exclude_none=True)
    asked = NEAR_SHARE * float(given.orbits.radii.mean())
    if kind == 2:
        asked = float(generator.uniform(1.0, 4.0))
        document["landmark_clearance_m"] = asked
    document["landmarks_m"] = _first_on_a_path(generator, given, asked).tolist()
    if kind == 2 and (obstacle := _orbited(generator, given)) is not None:
        document["keep_out_m"] = [obstacle.tolist()]
    return plan(scenario_from(document))


def _first_on_a_path(generator: np.random.Generator, given: Plan, asked: float) -> Array:
    """The landmarks, the first one beside the path of some vehicle, on either side."""
    orbits, landmarks = given.orbits, given.landmarks.copy()
    k, turn = int(generator.integers(orbits.count)), generator.uniform(0.0, 2.0 * np.pi)
    away = orbits.radii[k] + 0.9 * asked * generator.uniform(-1.0, 1.0)
    landmarks[0] = orbits.centers[k] + away * np.array([np.cos(turn), np.sin(turn)])
    return landmarks


def _orbited(generator: np.random.Generator, given: Plan) -> Array | None:
    """Corners of an obstacle within one circle that no other path crosses; None if one would."""
    orbits = given.orbits
    k = int(generator.integers(orbits.count))
    turns = np.linspace(0.0, 2.0 * np.pi, 5, endpoint=False) + generator.uniform(0.0, 1.0, 5)
    away = orbits.radii[k] * generator.uniform(0.2, 0.8, 5)
    corners = orbits.centers[k] + away[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    return corners if _passes_by(given, corners).min() > 0.0 else None


def _passes_by(given: Plan, corners: Array) -> Array:
    """(n,) m: how near each vehicle comes to a polygon."""
    orbits = given.orbits
    angle = np.linspace(0.0, 2.0 * np.pi, INSTANTS // 10)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    polygon = shapely.Polygon(corners)
    return np.array(
        [
            float(shapely.distance(shapely.points(center + radius * circle), polygon).min())
            for center, radius in zip(orbits.centers, orbits.radii, strict=True)
        ]
    )


def _too_near(away: float, asked: float) -> bool:
    return away < asked * (1.0 - ROUNDING)


def draw(number: int) -> tuple[list[str], Passes]:
    """Return what is wrong with the refinement of a scenario, and its passes of landmarks."""
    given = draw_near_plan(number)
    after = refine(given, workers=1, starts=STARTS, time_limit_s=3600.0)
    stated = given.scenario.landmark_clearance_m
    asked = NEAR_SHARE * float(after.orbits.radii.mean()) if stated is None else stated
    passes = Passes(
        float(landmark_passes(given).min(initial=math.inf)),
        float(landmark_passes(after).min(initial=math.inf)),
        asked,
        bool(given.scenario.keep_out_m),
    )
    faults = faults_of(given, after)
    if _too_near(passes.after, asked):
        faults.append(f"a landmark passed at {passes.after:.6f} m after all, asked {asked:.6f} m")
    for corners in given.scenario.keep_out_m or []:
        if _passes_by(after, np.array(corners)).min() <= 0.0:
            faults.append("a vehicle flies through a keep-out that none flew through")
    return faults, passes


def judge(cases: Mapping[int, Passes], chance: float) -> list[str]:
    """Print the nearest passes, over what is asked."""
    before, after = (
        sum(_too_near(getattr(case, moment), case.asked) for case in cases.values())
        for moment in ("before", "after")
    )
    print(
        f"nearer to a landmark than asked: {before} before, {after} after; "
        f"{sum(case.orbited for case in cases.values())} orbit an obstacle"
    )
    nearest = sorted(cases.items(), key=lambda item: item[1].after / item[1].asked)
    for number, case in nearest[:SHOWN]:
        print(
            f"  {number:>4}: {case.before:.3f} m, refined {case.after:.6f} m, "
            f"asked {case.asked:.6f} m{', an obstacle orbited' if case.orbited else ''}"
        )
    return []


SEARCH = Search(draw, judge, draws=4)
