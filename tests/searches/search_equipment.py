"""Search for a refinement with one of the further keys that breaks something or does worse.

    python -m tests.searches.search_equipment [DRAWS [FIRST [KEY ...]]]

Part of `make check-all`. Scenarios are those of tests.searches.search_refinements, of 3 to 5
vehicles, each with one key drawn, then with several; the error of the whole state is what is
minimised, and the result is looked at by the same judge, in plain NumPy and Shapely. Prints for
each key how many improved, the largest ratio of predicted errors after to before, and what is
violated; ends with status 1 where anything is.
"""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from tests.searches.search_refinements import Equip, Finding, search_one

__all__ = ["KEYS", "main", "search_key"]

SIZES = 3, 5
DURATION_S = 60.0


def _on_sensors(document: dict[str, Any], **keys: Any) -> None:
    """Give each sensor its keys, one value for all or a list."""
    count = len(document["formation"]["centers_m"])
    given = document["sensor"]
    sensors = given if isinstance(given, list) else [dict(given) for _ in range(count)]
    for name, values in keys.items():
        for sensor, value in zip(sensors, values, strict=True):
            if value is not None:
                sensor[name] = float(value)
    document["sensor"] = sensors


def _count(document: dict[str, Any]) -> int:
    return len(document["formation"]["centers_m"])


def _distances(document: dict[str, Any], generator: np.random.Generator) -> None:
    sigmas = generator.uniform(0.1, 2.0, _count(document))
    has = generator.random(len(sigmas)) < 0.7
    _on_sensors(
        document, range_sigma_m=[s if h else None for s, h in zip(sigmas, has, strict=True)]
    )


def _compasses(document: dict[str, Any], generator: np.random.Generator) -> None:
    sigmas = generator.uniform(0.02, 0.3, _count(document)).tolist()
    document["heading_sigma_rad"] = sigmas if generator.random() < 0.5 else sigmas[0]


def _intervals(document: dict[str, Any], generator: np.random.Generator) -> None:
    _on_sensors(document, interval_s=0.2 * generator.integers(2, 6, _count(document)))


def _detection(document: dict[str, Any], generator: np.random.Generator) -> None:
    _on_sensors(document, detection_probability=generator.uniform(0.2, 1.0, _count(document)))


def _wind(document: dict[str, Any], generator: np.random.Generator) -> None:
    document.setdefault("wind", {}).update({"sigma_mps": float(generator.uniform(0.2, 2.0))})


def _gusts(document: dict[str, Any], generator: np.random.Generator) -> None:
    sigma, time = generator.uniform(0.05, 0.4), generator.uniform(2.0, 20.0)
    document.setdefault("wind", {}).update(
        {"gust_sigma_mps": float(sigma), "gust_time_s": float(time)}
    )


def _speed_scales(document: dict[str, Any], generator: np.random.Generator) -> None:
    document.setdefault("motion", {}).update(
        {"speed_scale_sigma": float(generator.uniform(0.01, 0.1))}
    )


def _turn_rate_biases(document: dict[str, Any], generator: np.random.Generator) -> None:
    document.setdefault("motion", {}).update(
        {"turn_rate_bias_sigma_rad_s": float(generator.uniform(0.002, 0.02))}
    )


def _bearing_biases(document: dict[str, Any], generator: np.random.Generator) -> None:
    _on_sensors(document, bearing_bias_sigma_rad=generator.uniform(0.01, 0.1, _count(document)))


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
    "range_sigma_m": _distances,
    "heading_sigma_rad": _compasses,
    "interval_s": _intervals,
    "detection_probability": _detection,
    "wind": _wind,
    "gusts": _gusts,
    "speed_scale": _speed_scales,
    "turn_rate_bias": _turn_rate_biases,
    "bearing_bias": _bearing_biases,
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


def _with(key: str) -> Equip:
    def equip(document: dict[str, Any], generator: np.random.Generator) -> None:
        KEYS[key](document, generator)
        document["duration_s"] = DURATION_S
        document["refine"].pop("objective", None)

    return equip


def search_key(key: str, draws: int, first: int = 0, **changes: Any) -> list[Finding]:
    """Return what the refinements of `draws` scenarios with a key came to."""
    equip = _with(key)
    return [search_one(k, SIZES, equip, **changes) for k in range(first, first + draws)]


def main(draws: int = 30, first: int = 0, keys: Sequence[str] = tuple(KEYS)) -> list[Finding]:
    """Return and print what the refinements of `draws` scenarios with each key came to."""
    everything = []
    for key in keys:
        findings = search_key(key, draws, first, starts=2)
        everything += findings
        improved, worst = sum(one.improved for one in findings), min(one.gain for one in findings)
        faults = [f"{one.number}: {text}" for one in findings for text in one.faults]
        print(
            f"{key}: {draws} scenarios, {improved} improved, largest ratio {1.0 - worst:.6f}, "
            f"median {1.0 - float(np.median([one.gain for one in findings])):.3f}, "
            f"{sum(one.seconds for one in findings) / draws:.1f} s each, "
            f"{len(faults)} violations {faults}",
            flush=True,
        )
    return everything


if __name__ == "__main__":
    draws, first, *keys = [*sys.argv[1:], *("30", "0")[len(sys.argv) - 1 :]]
    found = main(int(draws), int(first), keys or tuple(KEYS))
    sys.exit(any(one.faults for one in found))
