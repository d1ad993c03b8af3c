"""The machine: cores and threads, child processes, files written whole, solvers loaded late.

blas              one thread for linear algebra
cores             how many cores there are
child_processes   processes that end with their parent
files             files written whole or not at all
convex_solver     convex problems solved by cvxpy
"""
