"""Random scenarios as a user writes them, and with the errors and sensors of the world as it is."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import scenario_from
from tests.tools.draws import draw_tree
from tests.tools.on_paper import plan

__all__ = [
    "certified_plans",
    "draw_centers",
    "draw_document",
    "draw_landmarks",
    "with_strays",
    "with_world",
]

HEADING_RAD_A_METRE = 0.02

LASTING = (
    ("wind", "sigma_mps", 0.5),
    ("wind", "gust_sigma_mps", 0.1),
    ("motion", "speed_scale_sigma", 0.02),
    ("motion", "turn_rate_bias_sigma_rad_s", 0.005),
    ("sensor", "bearing_bias_sigma_rad", 0.02),
)
"""Errors that last: section, key and a sigma that matters."""


def draw_centers(
    generator: np.random.Generator, radii: Array, reach: float, *, trees: float, clear: float
) -> Array:
    """Return centres (n, 2) in m: with probability `trees` on a tree, else on a shaken grid.

    The circles of a tree are more than `clear` times the reach apart.
    """
    count = len(radii)
    centers = draw_tree(generator, radii, reach, clear) if generator.random() < trees else None
    if centers is None:
        columns = 2 if count < 7 else 3
        place = np.array([(k % columns, k // columns) for k in range(count)], dtype=float)
        spacing = 2.0 * radii.max() + reach * generator.uniform(0.3, 0.7)
        centers = spacing * place + generator.uniform(-6.0, 6.0, (count, 2))
    return centers


def draw_landmarks(
    generator: np.random.Generator, centers: Array, radii: Array, reach: float, *, most: int
) -> Array:
    """Return 2 to `most` landmarks (m, 2) in m, each within reach of some circle."""
    number = int(generator.integers(2, most + 1))
    near = generator.choice(len(radii), number)
    turn = generator.uniform(0.0, 2.0 * np.pi, number)
    away = (radii[near] + reach * generator.uniform(0.2, 0.8, number))[:, None]
    return np.asarray(centers[near] + away * np.column_stack([np.cos(turn), np.sin(turn)]))


def draw_document(generator: np.random.Generator, sigma: float) -> dict[str, Any]:
    """Return the values of a scenario of 2 to 8 vehicles that start within `sigma` m.

    Trees and grids, two to five landmarks; not every draw is observable, or even valid.
    """
    count = int(generator.integers(2, 9))
    radii = generator.uniform(14.0, 26.0, count) if generator.random() < 0.6 else np.full(count, 20)
    reach = generator.uniform(30.0, 60.0)
    centers = draw_centers(generator, radii, reach, trees=0.6, clear=0.1)
    landmarks = draw_landmarks(generator, centers, radii, reach, most=5)
    sensor = {
        "range_m": reach,
        "bearing_sigma_rad": float(generator.choice([0.03, 0.1])),
        "sample_time_s": float(generator.choice([0.1, 0.2])),
    }
    if generator.random() < 0.2:
        sensor["fov_deg"] = generator.uniform(160.0, 360.0)
    return {
        "orbit": {
            "radius_m": radii.tolist(),
            "angular_rate_rad_s": float(generator.uniform(0.15, 0.4)),
            "direction": str(generator.choice(["ccw", "alternate"])),
        },
        "formation": {"centers_m": centers.tolist()},
        "landmarks_m": landmarks.tolist(),
        "sensor": sensor,
        "motion": {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01},
        "initial_sigma": {"position_m": sigma, "heading_rad": HEADING_RAD_A_METRE * sigma},
        "duration_s": float(generator.choice([120.0, 200.0])),
    }


def with_world(document: dict[str, Any], generator: np.random.Generator) -> dict[str, Any]:
    """Return a scenario's values with further keys, each now and then.

    The wind stays well below the slowest vehicle's speed.
    """
    sensor, motion = dict(document["sensor"]), dict(document["motion"])
    made: dict[str, Any] = {**document, "sensor": sensor, "motion": motion}
    if generator.random() < 0.5:
        sensor["interval_s"] = sensor["sample_time_s"] * int(generator.integers(2, 6))
    if generator.random() < 0.5:
        sensor["detection_probability"] = float(generator.uniform(0.6, 0.95))
    if generator.random() < 0.5:
        sensor["range_sigma_m"] = float(generator.uniform(0.3, 3.0))
    if generator.random() < 0.3:
        made["heading_sigma_rad"] = float(generator.uniform(0.05, 0.3))
    if generator.random() < 0.5:
        root = float(np.sqrt(sensor["sample_time_s"]))
        motion.clear()
        motion["position_random_walk_m_sqrt_s"] = 0.1 * root
        motion["angle_random_walk_rad_sqrt_s"] = 0.01 * root
    for section, key, sigma in LASTING:
        if generator.random() < 0.4:
            drawn = sigma * float(generator.uniform(0.5, 1.5))
            made[section] = {**made.get(section, {}), key: drawn}
    return made


def with_strays(document: dict[str, Any], generator: np.random.Generator) -> dict[str, Any]:
    """Return a scenario's values with a bearing walk, clock offsets, or both."""
    which = int(generator.integers(1, 4))
    sensor, motion = dict(document["sensor"]), dict(document["motion"])
    if which & 1:
        sensor["bearing_walk"] = {
            "sigma_rad": float(generator.uniform(0.02, 0.08)),
            "time_s": float(10.0 ** generator.uniform(0.0, 2.0)),
        }
    if which & 2:
        motion["clock_offset_sigma_s"] = float(generator.uniform(0.03, 0.2))
    return {**document, "sensor": sensor, "motion": motion}


def certified_plans(draw: Callable[[], dict[str, Any]], **options: Any) -> Iterator[Plan]:
    """Draw scenarios' values for ever; yield the plans whose certificate holds."""
    while True:
        try:
            made = plan(scenario_from(draw()), **options)
        except (InputError, NoSolutionError):
            continue
        if made.certificate.holds:
            yield made
