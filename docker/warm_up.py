"""Compile kernels of plans, filters and flights into NUMBA_CACHE_DIR, for small and large teams.

    python docker/warm_up.py [small] [large] [filters] [flights]

Both sizes if neither is named; filters and flights likewise. Kernels of large teams run one trial
at a time, those of small ones many.
"""

import sys
from itertools import product

import syncplan
from syncplan.estimation.filter_options import lane_filter_of
from syncplan.scenario.filters import FILTERS

VEHICLES = {"small": 6, "large": 100}


def compile_filters(vehicles: int) -> None:
    """Compile what filters are made of."""
    for one in FILTERS.values():
        lane_filter_of(one).compile(vehicles)


def compile_flights(vehicles: int) -> None:
    """Compile what flies, by flying."""
    team = {
        "orbit": {"radius_m": 20, "angular_rate_rad_s": 0.2, "direction": "ccw"},
        "formation": {"shape": "line", "count": vehicles, "spacing_m": 70},
        "landmarks_m": [[-50, 0], [50, 50]],
        "sensor": {"range_m": 50, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "duration_s": 100,
    }
    plan = syncplan.plan(team, bound="always", pilot=False)
    for guidance in ("track", "mpc"):
        syncplan.fly(plan, trials=1, duration=1.0, guidance=guidance, filter="ekf")


PARTS = {"filters": compile_filters, "flights": compile_flights}

if __name__ == "__main__":
    if unknown := {*sys.argv[1:]} - {*VEHICLES, *PARTS}:
        sys.exit(f"no kernels have the names {sorted(unknown)}; see {__file__}")
    sizes = [name for name in VEHICLES if name in sys.argv] or VEHICLES
    parts = [name for name in PARTS if name in sys.argv] or PARTS
    for size, part in product(sizes, parts):
        PARTS[part](VEHICLES[size])
