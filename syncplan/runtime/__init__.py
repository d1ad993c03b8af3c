"""The machine: cores, memory, child processes, files written whole, numerical libraries.

machine           cores and memory that this process may use
child_processes   processes that end with their parent and inherit no secrets
template_process  a process that has loaded what others need, which are forked from it
task_crew         orders carried out in child processes, with progress and Ctrl-C
files             files written whole or not at all
"""
