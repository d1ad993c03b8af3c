"""One thread for linear algebra: the same bytes on every machine load, and no fight over cores.

A threaded BLAS splits sums by the number of threads it finds, so its last bits depend on the
machine; and two processes whose BLAS threads wait for each other run many times slower than one
thread each. The matrices here are small: one thread costs nothing until a thousand vehicles.
"""

import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


def single_threaded_blas(function: Callable[P, R]) -> Callable[P, R]:
    """Return `function` run with a single BLAS thread, the caller's setting restored after."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with _libraries(len(sys.modules)).limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


@lru_cache(maxsize=1)
def _libraries(modules: int) -> "ThreadpoolController":
    """The linear algebra libraries of a process that has imported so many modules.

    Finding them takes two milliseconds, and only an import brings another.
    """
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
