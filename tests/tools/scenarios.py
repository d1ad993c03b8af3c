"""Scenarios for tests: the files of examples/scenarios, and small ones made on the spot."""

from pathlib import Path
from typing import Any

from syncplan.scenario.loading import load_scenario, scenario_from
from syncplan.scenario.specification import Scenario

FILES = Path(__file__).parents[2] / "examples" / "scenarios"
BAD_FILES = FILES / "bad"


def example(name: str) -> Scenario:
    """Return the scenario of examples/scenarios/<name>.yaml."""
    return load_scenario(FILES / f"{name}.yaml")


def document(**changes: Any) -> dict[str, Any]:
    """Return a small valid scenario with some of its top keys replaced; None removes a key."""
    base: dict[str, Any] = {
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
        "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    }
    base.update(changes)
    return {key: value for key, value in base.items() if value is not None}


def small(**changes: Any) -> Scenario:
    """Return the scenario of `document(**changes)`."""
    return scenario_from(document(**changes))


def shared_circles(per_circle: int) -> dict[str, Any]:
    """Return six circles of several vehicles each: few vehicles, and sightings at every sample.

    Four on each circle take about 3 s to plan, eight 40 s.
    """
    centres = [[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]]
    return document(
        formation={"centers_m": [centre for centre in centres for _ in range(per_circle)]},
        landmarks_m=[[190.0, 0.0], [190.0, 70.0]],
        duration_s=200.0,
    )
