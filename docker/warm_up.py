"""Compile the filter's kernels into NUMBA_CACHE_DIR, for small teams and for large ones."""

from syncplan.estimation.batched_filter import compile_kernels

for vehicles in (6, 100):
    compile_kernels(vehicles)
