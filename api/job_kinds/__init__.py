"""The kinds of jobs: what each takes, computes and results in.

job_kind          what a kind is made of, and what computes its jobs
option_requests   requests whose keys are the library's options
refinement_jobs   refinements
trial_jobs        validations and flights
sweep_jobs        sweeps
replay_jobs       replays
job_table         all kinds by name
"""
