"""Computation in child processes: tasks over syncplan, a child, a pool of them, owners' turns."""
