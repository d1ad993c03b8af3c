"""The machine: cores and threads, child processes, files written whole, solvers loaded late.

blas              one thread for linear algebra
control_groups    what a container may use
cores             how many cores this process may use
memory            how much memory there is, and limits on it
child_processes   processes that end with their parent and inherit no secrets
files             files written whole or not at all
convex_solver     convex problems solved by cvxpy
"""
