"""Kinds of jobs: their requests, tasks and results.

job_kind          parts of a kind, and the tasks that compute its jobs
option_requests   requests whose keys are the library's options
refinement_jobs   refinements
trial_jobs        validations and flights
sweep_jobs        sweeps
replay_jobs       replays
design_jobs       designs
job_table         all kinds by name
"""
