"""Numerical libraries: BLAS held to one thread, and cvxpy, which loads when it is first used.

One thread for linear algebra gives the same bytes on every machine load, and no fight over cores: a
threaded BLAS splits sums by the number of threads it finds, so its last bits depend on the machine;
and two processes whose BLAS threads wait for each other run many times slower than one thread each.
The matrices here are small: one thread costs nothing until a thousand vehicles.
"""

import sys
import warnings
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

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


# --- convex problems ----------------------------------------------------------------------------


def load_cvxpy() -> Any:
    """Return the module cvxpy; importing it takes most of a second."""
    import cvxpy

    return cvxpy


def has_solution(problem: Any, **settings: Any) -> bool:
    """Solve a cvxpy problem in place and return whether its variables have values.

    `settings` are those of cvxpy.Problem.solve. A solution of low accuracy counts; the problem's
    status distinguishes it.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Solution may be inaccurate")
            problem.solve(**settings)
    except load_cvxpy().SolverError:
        return False
    return all(variable.value is not None for variable in problem.variables())
