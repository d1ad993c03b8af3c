"""The plans and runs that the figures of the documentation show, each made once a build."""

from functools import cache
from pathlib import Path
from typing import Any

import syncplan
from syncplan.reports.validation_report import ValidationDocument, validation_document
from syncplan.scenario.loading import scenario_from

__all__ = [
    "DESYNC_RAD",
    "LONG_RUN_S",
    "TRIALS",
    "alternating",
    "flown",
    "pair",
    "proven",
    "refined",
    "same",
]

SCENARIOS = Path(__file__).parents[2] / "examples" / "scenarios"

DESYNC_RAD = 0.2
TRIALS = 200
LONG_RUN_S = 1200.0


@cache
def same() -> syncplan.Plan:
    """Return the plan of the grid whose vehicles all turn one way."""
    return syncplan.plan(syncplan.load_scenario(SCENARIOS / "paper-grid-same.yaml"))


@cache
def alternating(desync_rad: float = 0.0) -> syncplan.Plan:
    """Return the plan of the alternating grid, its phases off the rule by `desync_rad`."""
    return syncplan.plan(_varied("paper-grid-alternate", desync_rad=desync_rad))


@cache
def refined() -> syncplan.Plan:
    """Return the alternating grid after refinement, one start."""
    return syncplan.refine(alternating(), starts=1, workers=1)


@cache
def flown(desync_rad: float = 0.0, duration_s: float = LONG_RUN_S) -> ValidationDocument:
    """Return the Monte Carlo of the alternating grid, with errors over time."""
    return validation_document(
        syncplan.validate(
            alternating(desync_rad), trials=TRIALS, seed=1, duration=duration_s, with_series=True
        )
    )


@cache
def proven() -> ValidationDocument:
    """Return the Monte Carlo of the grid whose vehicles all turn one way."""
    return validation_document(syncplan.validate(same(), trials=TRIALS, seed=1))


@cache
def pair(direction: str, radius_m: float, desync_rad: float) -> syncplan.Plan:
    """Return two vehicles 70 m apart, the second of `radius_m`, phased by the rule of a sense."""
    return syncplan.plan(
        scenario_from(
            {
                "orbit": {
                    "radius_m": [20.0, radius_m],
                    "angular_rate_rad_s": 0.2,
                    "direction": direction,
                    "first_phase_rad": 0.3,
                    "desync_rad": [0.0, desync_rad],
                },
                "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
                "sensor": {"range_m": 50.0},
            }
        )
    )


def _varied(name: str, **orbit: Any) -> syncplan.Scenario:
    document = syncplan.load_scenario(SCENARIOS / f"{name}.yaml").model_dump(exclude_none=True)
    document["orbit"].update(orbit)
    return scenario_from(document)
