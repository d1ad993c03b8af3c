"""Convex problems, stated and solved with cvxpy, which loads when it is first used."""

import warnings
from typing import Any


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
