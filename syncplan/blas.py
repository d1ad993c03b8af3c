"""One thread for linear algebra: the same bytes on every machine load, and no fight over cores.

A threaded BLAS splits sums by the number of threads it finds, so its last bits depend on the
machine; and two processes whose BLAS threads wait for each other run many times slower than one
thread each. The matrices here are small: one thread costs nothing until a thousand vehicles.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

__all__ = ["single_threaded_blas"]

P = ParamSpec("P")
R = TypeVar("R")


def single_threaded_blas(function: Callable[P, R]) -> Callable[P, R]:
    """Return `function` run with a single BLAS thread, the caller's setting restored after."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
