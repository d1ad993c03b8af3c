"""Compile the filters' kernels into NUMBA_CACHE_DIR, for small teams and for large ones."""

from syncplan.estimation.filters import FILTERS

for vehicles in (6, 100):
    for one in FILTERS.values():
        one.lane_filter.compile(vehicles)
        one.augmented_lane_filter.compile(vehicles)
