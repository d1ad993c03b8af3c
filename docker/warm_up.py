"""Compile the kernels of filters and flights into NUMBA_CACHE_DIR, for small and large teams.

    python docker/warm_up.py [filters] [flights]

All of them without arguments. The two can be compiled side by side: each cache has one writer.
"""

import sys

import syncplan
from syncplan.estimation.filters import FILTERS

SIZES = (6, 100)
"""Vehicles, side by side in wide lanes and alone in theirs."""


def filters() -> None:
    """Compile what filters are made of."""
    for vehicles in SIZES:
        for one in FILTERS.values():
            one.lane_filter.compile(vehicles)


def flights() -> None:
    """Compile what flies, by flying."""
    for vehicles in SIZES:
        team = {
            "orbit": {"radius_m": 20, "angular_rate_rad_s": 0.2, "direction": "ccw"},
            "formation": {"shape": "line", "count": vehicles, "spacing_m": 70},
            "landmarks_m": [[-50, 0], [50, 50]],
            "sensor": {"range_m": 50, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
            "duration_s": 100,
        }
        plan = syncplan.plan(team, bound="never", pilot=False)
        for guidance in ("track", "mpc"):
            syncplan.fly(plan, trials=1, duration=1.0, guidance=guidance, filter="ekf")


PARTS = {"filters": filters, "flights": flights}

if __name__ == "__main__":
    for name in sys.argv[1:] or PARTS:
        PARTS[name]()
