"""Search for a refinement with one of the further keys that breaks something or does worse.

Scenarios are those of `refinements`, of 3 to 5 vehicles, each with one key drawn, or with several:
the keys take turns, one number each. The error of the whole state is what is minimised. Fails
where `refinements` does.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from syncplan.arrays import Array
from tests.searches import Search, refinements
from tests.searches.refinements import Equip, Refined

__all__ = ["KEYS", "SEARCH"]

SIZES = 3, 5
DURATION_S = 60.0


def _on_sensors(document: dict[str, Any], name: str, values: Array) -> None:
    """Give each sensor its value of a key; none where it is NaN."""
    given = document["sensor"]
    sensors = given if isinstance(given, list) else [dict(given) for _ in values]
    for sensor, value in zip(sensors, values.tolist(), strict=True):
        if not np.isnan(value):
            sensor[name] = value
    document["sensor"] = sensors


def _count(document: dict[str, Any]) -> int:
    return len(document["formation"]["centers_m"])


def _of_sensors(name: str, low: float, high: float, share: float = 1.0) -> Equip:
    """A key of sensors, on a share of them, between two values."""

    def equip(document: dict[str, Any], generator: np.random.Generator) -> None:
        values = generator.uniform(low, high, _count(document))
        values[generator.random(len(values)) > share] = np.nan
        _on_sensors(document, name, values)

    return equip


def _in_section(section: str, **limits: tuple[float, float]) -> Equip:
    """Keys of a section, each between two values."""

    def equip(document: dict[str, Any], generator: np.random.Generator) -> None:
        drawn = {name: float(generator.uniform(*ends)) for name, ends in limits.items()}
        document.setdefault(section, {}).update(drawn)

    return equip


def _compasses(document: dict[str, Any], generator: np.random.Generator) -> None:
    sigmas = generator.uniform(0.02, 0.3, _count(document)).tolist()
    document["heading_sigma_rad"] = sigmas if generator.random() < 0.5 else sigmas[0]


def _intervals(document: dict[str, Any], generator: np.random.Generator) -> None:
    samples = generator.integers(2, 6, _count(document)).astype(np.float64)
    _on_sensors(document, "interval_s", 0.2 * samples)


def _obstacles(document: dict[str, Any], generator: np.random.Generator) -> None:
    """One to three shelves, each about halfway between two vehicles."""
    centers = np.array(document["formation"]["centers_m"])
    shelves = []
    for _ in range(int(generator.integers(1, 4))):
        a, b = generator.choice(len(centers), 2, replace=False)
        middle = 0.5 * (centers[a] + centers[b]) + generator.uniform(-5.0, 5.0, 2)
        turn, half = generator.uniform(0.0, np.pi), generator.uniform([2.0, 0.5], [8.0, 2.0])
        along = np.array([np.cos(turn), np.sin(turn)])
        across = np.array([-along[1], along[0]])
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        corners = [middle + s * half[0] * along + t * half[1] * across for s, t in signs]
        shelves.append([corner.tolist() for corner in corners])
    document["obstacles_m"] = shelves


def _clearances(document: dict[str, Any], generator: np.random.Generator) -> None:
    document["landmark_clearance_m"] = float(generator.uniform(2.0, 10.0))


ALONE: dict[str, Equip] = {
    "range_sigma_m": _of_sensors("range_sigma_m", 0.1, 2.0, share=0.7),
    "heading_sigma_rad": _compasses,
    "interval_s": _intervals,
    "detection_probability": _of_sensors("detection_probability", 0.2, 1.0),
    "wind": _in_section("wind", sigma_mps=(0.2, 2.0)),
    "gusts": _in_section("wind", gust_sigma_mps=(0.05, 0.4), gust_time_s=(2.0, 20.0)),
    "speed_scale": _in_section("motion", speed_scale_sigma=(0.01, 0.1)),
    "turn_rate_bias": _in_section("motion", turn_rate_bias_sigma_rad_s=(0.002, 0.02)),
    "bearing_bias": _of_sensors("bearing_bias_sigma_rad", 0.01, 0.1),
    "obstacles_m": _obstacles,
    "landmark_clearance_m": _clearances,
}
"""What each key adds to a document."""


def _several(document: dict[str, Any], generator: np.random.Generator) -> None:
    """Each key with a probability of a half."""
    for equip in ALONE.values():
        if generator.random() < 0.5:
            equip(document, generator)


KEYS: dict[str, Equip] = {**ALONE, "several": _several}
"""What is searched: each key alone, and several together."""


def _equip(key: str, document: dict[str, Any], generator: np.random.Generator) -> None:
    KEYS[key](document, generator)
    document["duration_s"] = DURATION_S
    document["refine"].pop("objective", None)


def _key(number: int) -> str:
    return list(KEYS)[number % len(KEYS)]


def draw(number: int) -> tuple[list[str], Refined]:
    """Return what is wrong with the refinement of a scenario with a key, and what it gained."""
    return refinements.draw(number // len(KEYS), SIZES, partial(_equip, _key(number)))


def judge(cases: Mapping[int, Refined], chance: float) -> list[str]:
    """Print for each key how many improved, and ratios of predicted errors after to before."""
    for key in KEYS:
        drawn = [case for number, case in cases.items() if _key(number) == key]
        if drawn:
            ratios = [1.0 - case.gain for case in drawn]
            print(
                f"{key:<22}{sum(case.improved for case in drawn):>4} of {len(drawn)} improved, "
                f"largest ratio {max(ratios):.6f}, median {np.median(ratios):.3f}"
            )
    return []


SEARCH = Search(draw, judge, draws=len(KEYS))
