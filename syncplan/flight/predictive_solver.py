"""OSQP for the programs of one team: which entries there are, settings, a solution and its state.

All programs of a team have one pattern, so one workspace serves all. It keeps nothing from one
program to the next: data come scaled, the penalty rho is fixed, and each program starts at its
guess (no change) with the multipliers that it brings. There is no limit of time. So a solution
depends on its program alone, to the byte, whatever the load. OSQP lets other threads run while it
solves; a solver serves one thread at a time.
"""

from typing import Any, NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.flight.predictive_program import Program

SETTINGS = {
    "adaptive_rho": 0,
    "alpha": 1.6,
    "check_termination": 10,
    "eps_abs": 1e-3,
    "eps_rel": 1e-3,
    "max_iter": 1000,
    "polishing": False,
    "scaling": 0,
    "verbose": False,
}
"""Of OSQP. A thousandth is one of the plan's speed and rate; what is flown is exact in any case."""

RHO, RHO_APART = 0.3, 1.0
"""OSQP's penalty for programs without and with separation, in which P's diagonal is 1 on average.

In returns from holds under five sets of limits, these take the fewest iterations of 0.1 to 10.
"""

SOLVED = 1
"""OSQP's status of a program that is solved to the tolerances."""


class Solution(NamedTuple):
    """What came out of a program.

    Fields
    ------
    change : (2N,) of commands in units of the plan's speed and rate; zero where not solved
    multipliers : (4N,) of limits and changes; zero where not solved
    solved : whether OSQP says so
    iterations : of OSQP
    """

    change: Array
    multipliers: Array
    solved: bool
    iterations: int


class ProgramSolver:
    """Solves programs of N steps, with separation from so many neighbours at each; 0: without."""

    def __init__(self, steps: int, neighbours: int = 0, shortfall: float = 1.0) -> None:
        from osqp import OSQP
        from scipy.sparse import block_diag, csc_array, csc_matrix, eye_array

        own, shortfalls = 2 * steps, steps if neighbours else 0
        hessian = csc_array(np.triu(np.ones((own, own))))
        if shortfalls:
            hessian = block_diag([hessian, eye_array(shortfalls)])
        rows = csc_matrix(_rows(steps, neighbours, shortfall))
        rows.sort_indices()
        self.pattern: Any = rows
        self._own, self._size, self._count = own, own + shortfalls, rows.shape[0]
        separating = rows.indices >= self._count - steps * neighbours
        column = np.repeat(np.arange(self._size), np.diff(rows.indptr))
        self._constant = np.flatnonzero(~separating | (column >= own))
        self._entries = rows.data[self._constant].copy()
        counts = np.bincount(column[separating], minlength=self._size)
        self.starts: Index = rows.indptr[1:].astype(np.int64) - counts
        nothing, settings = np.zeros(self._count), {**SETTINGS, "rho": RHO}
        if neighbours:
            settings["rho"] = RHO_APART
        self._solver: Any = OSQP()
        self._solver.setup(
            csc_matrix(hessian),
            np.zeros(self._size),
            rows,
            nothing - 1.0,
            nothing + 1.0,
            **settings,
        )

    def solve(self, program: Program, multipliers: Array) -> Solution:
        """Return the solution of a program, from no change and `multipliers` (4N,)."""
        own, size, y = self._own, self._size, np.zeros(self._count)
        y[: 2 * own] = multipliers
        data = {"Px": program.hessian[: own * (own + 1) // 2 + size - own]}
        if size > own:  # no shortfall is wanted, and its multiplier is what it costs
            y[2 * own : 2 * own + size - own] = -program.gradient[own:size]
            program.rows[self._constant] = self._entries
            data["Ax"] = program.rows
        self._solver.update(
            q=program.gradient[:size],
            l=program.lower[: self._count],
            u=program.upper[: self._count],
            **data,
        )
        self._solver.warm_start(np.zeros(size), y)
        found = self._solver.solve(raise_error=False)
        if found.info.status_val != SOLVED:
            return Solution(np.zeros(own), np.zeros(2 * own), False, found.info.iter)
        return Solution(found.x[:own], found.y[: 2 * own], True, found.info.iter)


def _rows(steps: int, neighbours: int, shortfall: float) -> Any:
    """A (rows, variables): limits, changes, and with separation shortfalls and distances."""
    from scipy.sparse import block_diag, eye_array, hstack, kron, vstack

    own = 2 * steps
    changes = eye_array(steps) - eye_array(steps, k=-1)
    limits = vstack([eye_array(own), block_diag([changes, changes])])
    if not neighbours:
        return limits
    each = np.ones((neighbours, 1))
    before = kron(np.tril(np.ones((steps, steps))), each)
    lacks = kron(eye_array(steps), each) / np.sqrt(shortfall)
    return vstack([block_diag([limits, eye_array(steps)]), hstack([before, before, lacks])])
