"""Search for teams whose bound by lumps is further off than stated.

Teams of 6 to 24 vehicles on circles of equal or mixed radii, with dull and sharp bearings, short
and long samples and now and then limited views, intervals, misses, ranges, wind and constant
errors. A case is the error of the bound by lumps, of the vehicle where it is largest, and the
stated accuracy. Fails where more than one in 60 is further off.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from syncplan.estimation.bounds import posterior_bound
from syncplan.planning.plans import Plan
from tests.searches import Search, most_of
from tests.tools.scenario_draws import (
    certified_plans,
    draw_centers,
    draw_landmarks,
    with_world,
)

ROUNDING = 1e-6
MOST_BEYOND = 1.0 / 60.0


def draw_keys(generator: np.random.Generator) -> dict[str, Any]:
    """Return the values of a scenario; not every draw is observable, or even valid."""
    count = int(generator.integers(6, 25))
    radii = generator.uniform(14.0, 26.0, count) if generator.random() < 0.5 else np.full(count, 20)
    reach, rate = generator.uniform(40.0, 60.0), generator.uniform(0.1, 0.4)
    period = 2.0 * np.pi / rate
    centers = draw_centers(generator, radii, reach, trees=0.5, clear=0.1)
    landmarks = draw_landmarks(generator, centers, radii, reach, most=5)
    sensor = {
        "range_m": reach,
        "bearing_sigma_rad": 10.0 ** generator.uniform(-3.0, -0.7),
        "sample_time_s": period / round(10.0 ** generator.uniform(1.5, 2.8)),
    }
    if generator.random() < 0.3:
        sensor["fov_deg"] = generator.uniform(150.0, 360.0)
    document: dict[str, Any] = {
        "orbit": {
            "radius_m": radii.tolist(),
            "angular_rate_rad_s": rate,
            "direction": str(generator.choice(["ccw", "alternate"])),
        },
        "formation": {"centers_m": centers.tolist()},
        "landmarks_m": landmarks.tolist(),
        "landmark_clearance_m": 0.0,
        "sensor": sensor,
        "motion": {
            "speed_sigma_mps": 10.0 ** generator.uniform(-2.0, -0.3),
            "turn_rate_sigma_rad_s": 10.0 ** generator.uniform(-3.0, -1.5),
        },
        "initial_sigma": {"position_m": 10.0 ** generator.uniform(-0.5, 1.0), "heading_rad": 0.1},
        "duration_s": period * generator.uniform(1.2, 6.0),
    }
    document = with_world(document, generator)
    if generator.random() < 0.5:
        document["sensor"]["bearing_bias_sigma_rad"] = 10.0 ** generator.uniform(-2.0, -1.0)
    # teams with gusts take the exact recursion
    document.get("wind", {}).pop("gust_sigma_mps", None)
    return document


def draw_team(number: int) -> Plan:
    """Return the plan of an observable team, its errors not predicted."""
    generator = np.random.default_rng([0, number, 43])
    return next(certified_plans(lambda: draw_keys(generator), bound="never"))


def error_and_accuracy(made: Plan) -> tuple[float, float]:
    """Return the largest relative error of a vehicle's bound by lumps, and the stated accuracy."""
    given = made.team, made.windows, made.scenario.duration_s
    lumped = posterior_bound(*given, lumped=True)
    ratios = lumped.rms_second_half() / posterior_bound(*given).rms_second_half()
    return float(np.max(np.abs(ratios - 1.0))), lumped.accuracy


def draw(number: int) -> tuple[Sequence[str], tuple[float, float]]:
    """Return the error of a team and the stated accuracy."""
    return [], error_and_accuracy(draw_team(number))


def judge(cases: Mapping[int, tuple[float, float]], chance: float) -> list[str]:
    """Print errors and accuracies of teams; return whether too many are further off than stated."""
    off, stated = np.array(list(cases.values())).T
    lumped = stated > 0.0
    print(f"{lumped.sum()} of {len(off)} teams lumped, stated up to {100.0 * stated.max():.2g} %")
    if lumped.any():
        print(f"error over accuracy up to {np.max(off[lumped] / stated[lumped]):.2f}")
    beyond = [number for number, (error, most) in cases.items() if error > most + ROUNDING]
    if len(beyond) > (most := most_of(len(cases), MOST_BEYOND, chance)):
        return [f"{len(beyond)} further off than stated, at most {most:.3g} may: {beyond[:5]}"]
    return []


SEARCH = Search(draw, judge, draws=16)
