"""Kinds of jobs: a study each, with the request for one.

job_kind        kinds, jobs, and what their tasks take and return
requests        requests, with keys for the options of studies, and their limits
sweep_request   requests for sweeps
job_table       all kinds by name
"""
