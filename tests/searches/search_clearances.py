"""Search for a refinement after which a vehicle passes a landmark or a keep-out too near.

    python -m tests.searches.search_clearances [DRAWS [FIRST]]

Scenarios of tests.searches.search_refinements. In two of three a landmark is moved onto a vehicle's
path or beside it, nearer than asked; in one of three a clearance is stated as well, and a vehicle
orbits an obstacle. Afterwards each vehicle is looked at where it is at many instants.
"""

import math
import sys
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from syncplan.arrays import Array
from syncplan.planning.planner import Plan, plan
from syncplan.refinement.refiner import refine
from syncplan.scenario.loading import scenario_from
from tests.searches.search_refinements import (
    NEAR_SHARE,
    ROUNDING,
    draw_scenario,
    faults_of,
    landmark_passes,
)

__all__ = ["ClearanceFinding", "clear_one", "draw_near_plan", "main"]

INSTANTS = 20_000


@dataclass(frozen=True, slots=True)
class ClearanceFinding:
    """What one drawn scenario came to: nearest passes of landmarks in m, and what is asked."""

    number: int
    before: float
    after: float
    asked: float
    orbited: bool
    seconds: float
    faults: list[str]

    @property
    def too_near(self) -> bool:
        """Whether a vehicle passes a landmark nearer than asked after all."""
        return self.after < self.asked * (1.0 - ROUNDING)


def draw_near_plan(number: int) -> Plan:
    """Return the plan of the `number`-th scenario."""
    scenario, given = draw_scenario(number)
    kind = number % 3
    if kind == 0:
        return given
    generator = np.random.default_rng([number, 31])
    document: dict[str, Any] = scenario.model_dump(exclude_none=True)
    asked = NEAR_SHARE * float(given.orbits.radii.mean())
    if kind == 2:
        asked = float(generator.uniform(1.0, 4.0))
        document["landmark_clearance_m"] = asked
    document["landmarks_m"] = _one_on_a_path(generator, given, asked).tolist()
    if kind == 2 and (obstacle := _orbited(generator, given)) is not None:
        document["keep_out_m"] = [obstacle.tolist()]
    return plan(scenario_from(document))


def _one_on_a_path(generator: np.random.Generator, given: Plan, asked: float) -> Array:
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


def clear_one(number: int, **changes: Any) -> ClearanceFinding:
    """Return what the refinement of drawn scenario `number` came to."""
    given = draw_near_plan(number)
    began = time.monotonic()
    after = refine(given, workers=1, **changes)
    seconds = time.monotonic() - began
    stated = given.scenario.landmark_clearance_m
    asked = NEAR_SHARE * float(after.orbits.radii.mean()) if stated is None else stated
    faults = faults_of(given, after)
    for corners in given.scenario.keep_out_m or []:
        if _passes_by(after, np.array(corners)).min() <= 0.0:
            faults.append("a vehicle flies through a keep-out that none flew through")
    return ClearanceFinding(
        number=number,
        before=float(landmark_passes(given).min(initial=math.inf)),
        after=float(landmark_passes(after).min(initial=math.inf)),
        asked=asked,
        orbited=bool(given.scenario.keep_out_m),
        seconds=seconds,
        faults=faults,
    )


def main(draws: int = 50, first: int = 0, starts: int = 2) -> list[ClearanceFinding]:
    """Return and print what the refinements of `draws` scenarios from number `first` on came to."""
    findings = []
    for number in range(first, first + draws):
        found = clear_one(number, starts=starts)
        findings.append(found)
        print(
            f"{number}: a landmark passed at {found.before:.3f} m, refined at {found.after:.6f} m, "
            f"asked {found.asked:.6f} m{', an obstacle orbited' if found.orbited else ''}; "
            f"{found.seconds:.1f} s {'; '.join(found.faults)}",
            flush=True,
        )
    begun = [replace(one, after=one.before) for one in findings]
    print(
        f"{draws} scenarios: nearer to a landmark than asked in "
        f"{sum(one.too_near for one in begun)} before, {sum(one.too_near for one in findings)} "
        f"after; {sum(one.orbited for one in findings)} orbit an obstacle; "
        f"{sum(bool(one.faults) for one in findings)} with faults"
    )
    return findings


if __name__ == "__main__":
    found_all = main(*(int(argument) for argument in sys.argv[1:]))
    sys.exit(any(one.faults or one.too_near for one in found_all))
