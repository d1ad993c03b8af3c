"""The machine: cores, memory, child processes, files written whole, numerical libraries.

machine           how many cores and how much memory this process may use
child_processes   processes that end with their parent and inherit no secrets
files             files written whole or not at all
"""
