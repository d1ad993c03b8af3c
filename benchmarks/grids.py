"""The paper's grid, of any of a few sizes."""

from typing import Any

__all__ = ["GRIDS", "grid_scenario"]

GRIDS = {6: 3, 12: 4, 24: 6, 50: 10}
"""Vehicles of each grid, and its columns."""


def grid_scenario(count: int) -> dict[str, Any]:
    """Return the scenario of a grid: circles, landmarks, cameras and 200 s of flight."""
    return {
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "first_phase_rad": 0.3},
        "formation": {
            "shape": "grid",
            "count": count,
            "columns": GRIDS[count],
            "spacing_m": 70.0,
        },
        "landmarks_m": [[-40.0, 0.0], [-40.0, 70.0]],
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "duration_s": 200.0,
    }
