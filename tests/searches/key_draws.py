"""Random scenarios of all kinds: every key is drawn independently of the others.

Lengths are those of circles of about 20 m. Not every draw is observable, or even valid.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.scenario.disturbances import ESTIMABLE
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.loading import scenario_from
from tests.searches.equipment import KEYS
from tests.tools.draws import draw_tree
from tests.tools.scenario_draws import draw_centers, draw_landmarks

__all__ = ["draw_scenario"]

NUMBERS = (
    ("sensor", "bearing_sigma_rad", 0.9, 0.003, 0.15),
    ("sensor", "bearing_bias_sigma_rad", 0.2, 0.002, 0.05),
    ("motion", "speed_scale_sigma", 0.2, 0.002, 0.05),
    ("motion", "turn_rate_bias_sigma_rad_s", 0.2, 0.0005, 0.01),
    ("motion", "clock_offset_sigma_s", 0.1, 0.005, 0.2),
    ("motion", "lag_s", 0.3, 0.05, 2.0),
    ("wind", "sigma_mps", 0.3, 0.05, 2.0),
    ("wind", "gust_sigma_mps", 0.3, 0.02, 0.5),
    ("wind", "gust_time_s", 0.3, 2.0, 40.0),
    ("initial_sigma", "position_m", 0.9, 0.5, 15.0),
    ("initial_sigma", "heading_rad", 0.9, 0.05, 0.4),
)
"""Section, key, share of scenarios that give it, and the limits of its log-uniform values."""

NOISES = (
    ("speed_sigma_mps", "position_random_walk_m_sqrt_s", 0.01, 0.4),
    ("turn_rate_sigma_rad_s", "angle_random_walk_rad_sqrt_s", 0.001, 0.04),
)
"""Noise of a reading, its random walk, and the limits of the former."""

EQUIPMENT = {
    "range_sigma_m": 0.2,
    "detection_probability": 0.2,
    "heading_sigma_rad": 0.2,
    "obstacles_m": 0.1,
    "landmark_clearance_m": 0.1,
}
"""Keys of `equipment`, each with the share of scenarios that give it."""

FEW, MANY, MANY_SHARE = (2, 8), (9, 12), 0.05
"""Vehicles, and how often there are many."""

RADII_M = 14.0, 26.0


class _Draw:
    """A scenario being drawn."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.generator = generator
        least, most = MANY if self.sometimes(MANY_SHARE) else FEW
        self.count = int(generator.integers(least, most + 1))
        equal = self.sometimes(0.5)
        self.radii = np.full(self.count, generator.uniform(*RADII_M))
        if not equal:
            self.radii = generator.uniform(*RADII_M, self.count)
        self.rate = self.log(0.1, 0.5)
        self.reach = float(generator.uniform(30.0, 70.0))
        self.gap = float(self.reach * generator.uniform(0.1, 0.9))

    def sometimes(self, share: float) -> bool:
        return bool(self.generator.random() < share)

    def log(self, low: float, high: float) -> float:
        return float(np.exp(self.generator.uniform(np.log(low), np.log(high))))

    # --- formations ---------------------------------------------------------------------------

    def tree(self) -> tuple[dict[str, Any], Array]:
        clear = float(self.generator.uniform(0.0, 0.3))
        centers = draw_tree(self.generator, self.radii, self.reach, clear)
        return self.shaken_grid() if centers is None else ({"centers_m": centers.tolist()}, centers)

    def shaken_grid(self) -> tuple[dict[str, Any], Array]:
        centers = draw_centers(self.generator, self.radii, self.reach, trees=0.0, clear=0.0)
        return {"centers_m": centers.tolist()}, centers

    def shape(self) -> tuple[dict[str, Any], Array]:
        name = str(self.generator.choice(list(SHAPES)))
        spacing = 2.0 * float(self.radii.max()) + self.gap
        centers = SHAPES[name].centers(self.count, spacing)
        given = {"spacing_m": spacing} if self.sometimes(0.7) else {"gap_m": self.gap}
        return {"shape": name, "count": self.count, **given}, centers

    def linked(self) -> tuple[dict[str, Any], Array]:
        """Links of a tree, in half of the scenarios with the centres left to placement."""
        formation, centers = self.tree()
        apart = np.hypot(*np.moveaxis(centers[:, None] - centers, -1, 0))
        parents = [int(np.argmin(apart[k, :k])) for k in range(1, self.count)]
        links = [[f"v{parent + 1}", f"v{k + 2}"] for k, parent in enumerate(parents)]
        return {**(formation if self.sometimes(0.5) else {}), "links": links}, centers

    # --- sections -----------------------------------------------------------------------------

    def document(self) -> dict[str, Any]:
        generator = self.generator
        formations = list(FORMATIONS)
        chosen = int(generator.choice(len(formations), p=list(FORMATIONS.values())))
        formation, centers = formations[chosen](self)
        landmarks = draw_landmarks(generator, centers, self.radii, self.reach, most=4).tolist()
        if self.sometimes(0.2):
            landmarks = landmarks[: int(generator.integers(0, 2))]
        document: dict[str, Any] = {
            "orbit": self.orbit(),
            "formation": formation,
            "landmarks_m": landmarks,
            "sensor": self.sensor(),
            "duration_s": float(2.0 * np.pi / self.rate * generator.uniform(3.0, 12.0)),
        }
        for section, key, share, low, high in NUMBERS:
            value = self.log(low, high)
            if self.sometimes(share):
                document.setdefault(section, {})[key] = value
        self.motion(document)
        if self.sometimes(0.4):
            document["limits"] = self.limits()
        if self.sometimes(0.5):
            document["min_separation_m"] = self.separation(document["orbit"]["direction"], centers)
        if self.sometimes(0.2):
            sample = document["sensor"]["sample_time_s"]
            document["sensor"]["interval_s"] = sample * int(generator.integers(2, 6))
        if self.sometimes(0.2):
            document["sensor"] = self.sensors(document["sensor"])
        # what `equipment` adds is added to listed centres
        document["formation"] = {"centers_m": centers.tolist()}
        for key, share in EQUIPMENT.items():
            if self.sometimes(share):
                KEYS[key](document, generator)
        document["formation"] = formation
        self.filter(document)
        if self.sometimes(0.1):
            document["truth"] = self.truth(document)
        return document

    def orbit(self) -> dict[str, Any]:
        equal = np.ptp(self.radii) == 0.0
        orbit: dict[str, Any] = {
            "radius_m": float(self.radii[0]) if equal else self.radii.tolist(),
            "direction": self.direction(),
            "first_phase_rad": float(self.generator.uniform(0.0, 6.0)),
        }
        if self.sometimes(0.3):
            speeds = self.rate * self.radii
            orbit["speed_mps"] = float(speeds[0]) if equal else speeds.tolist()
        else:
            orbit["angular_rate_rad_s"] = self.rate
        if self.sometimes(0.5):
            size = self.log(1e-3, 0.5)
            orbit["desync_rad"] = self.generator.uniform(-size, size, self.count).tolist()
        return orbit

    def direction(self) -> str | list[str]:
        listed: list[str] = self.generator.choice(["ccw", "cw"], self.count).tolist()
        return ("ccw", "cw", "alternate", "alternate", listed)[int(self.generator.integers(5))]

    def sensor(self) -> dict[str, Any]:
        sensor: dict[str, Any] = {
            "range_m": self.reach,
            "sample_time_s": float(self.generator.choice([0.1, 0.2, 0.25, 0.5])),
        }
        if self.sometimes(0.25):
            sensor["fov_deg"] = float(self.generator.uniform(100.0, 350.0))
            sensor["boresight_deg"] = float(self.generator.choice([0.0, 90.0, -90.0, 180.0]))
        if self.sometimes(0.1):
            sensor["bearing_walk"] = {
                "sigma_rad": self.log(0.005, 0.06),
                "time_s": self.log(1.0, 100.0),
            }
        return sensor

    def sensors(self, sensor: dict[str, Any]) -> list[dict[str, Any]]:
        """A sensor for each vehicle, of differing ranges and views."""
        factors = self.generator.uniform(0.8, 1.2, (self.count, 2)).tolist()
        fov = sensor.get("fov_deg", 360.0)
        return [
            {**sensor, "range_m": reach * sensor["range_m"], "fov_deg": min(view * fov, 360.0)}
            for reach, view in factors
        ]

    def motion(self, document: dict[str, Any]) -> None:
        motion = document.setdefault("motion", {})
        sample = document["sensor"]["sample_time_s"]
        for sigma, walk, low, high in NOISES:
            value = self.log(low, high)
            if self.sometimes(0.3):
                motion[walk] = value * float(np.sqrt(sample))
            elif self.sometimes(0.9):
                motion[sigma] = value
        if self.sometimes(0.4):
            motion["readings"] = str(self.generator.choice(["measured", "commanded"]))

    def limits(self) -> dict[str, Any]:
        """Speeds, turn rate or both, with margins from one to two hundred per cent."""
        speeds = self.rate * self.radii
        limits: dict[str, Any] = {
            "speed_mps": [
                float(speeds.min() * self.generator.uniform(0.1, 0.99)),
                float(speeds.max() * (1.0 + self.log(0.01, 2.0))),
            ],
            "turn_rate_rad_s": self.rate * (1.0 + self.log(0.01, 4.0)),
        }
        left = int(self.generator.integers(4))
        if left < 2:
            del limits[list(limits)[left]]
        return limits

    def separation(self, direction: str | list[str], centers: Array) -> float:
        """A share of the least distance of circles that turn in mirror motion, or in step."""
        a, b = np.triu_indices(self.count, 1)
        apart = np.hypot(*(centers[a] - centers[b]).T)
        nearest = apart - self.radii[a] - self.radii[b]
        if direction in ("ccw", "cw"):
            nearest = apart - np.abs(self.radii[a] - self.radii[b])
        return float(max(nearest.min(), 1.0) * self.generator.uniform(0.1, 1.0))

    def filter(self, document: dict[str, Any]) -> None:
        given: dict[str, Any] = {}
        if self.sometimes(0.4):
            given["kind"] = str(self.generator.choice(["auto", "ekf", "second-order", "robust"]))
        sigmas = scenario_from(document).error_sigmas
        named = [name for name in ESTIMABLE if self.sometimes(0.7) and name in sigmas]
        chosen = self.generator.random()
        if chosen < 0.4:
            given["estimate"] = "auto" if chosen < 0.2 else "none" if chosen < 0.25 else named
        if given:
            document["filter"] = given

    def truth(self, document: dict[str, Any]) -> dict[str, Any]:
        """One of the numbers, half to twice the scenario's, or false bearings."""
        if self.sometimes(0.3):
            return {"false_bearings": self.log(0.001, 0.05)}
        sections = [name for name in ("motion", "wind", "initial_sigma") if document.get(name)]
        if not sections:
            return {}
        section = str(self.generator.choice(sections))
        numbers = {
            key: value for key, value in document[section].items() if not isinstance(value, str)
        }
        factor = self.log(0.5, 2.0)
        return {section: {key: factor * value for key, value in numbers.items()}}


FORMATIONS: dict[Callable[[_Draw], tuple[dict[str, Any], Array]], float] = {
    _Draw.tree: 0.35,
    _Draw.shaken_grid: 0.25,
    _Draw.shape: 0.3,
    _Draw.linked: 0.1,
}
"""Ways to place circles, each with its share of scenarios."""


def draw_scenario(generator: np.random.Generator) -> dict[str, Any]:
    """Return the first valid document of a scenario that the generator draws."""
    while True:
        try:
            document = _Draw(generator).document()
            scenario_from(document)
        except InputError:
            continue
        return document
