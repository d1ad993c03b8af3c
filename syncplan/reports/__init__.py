"""Plans and runs as JSON documents, with what their figures mean in words.

A module holds a document's parts with their descriptions, what makes them of a result, and the
notes on them.

observability_report  what is determined of a team, and how well
refinement_report     refinements
plan_report           plans
sites_report          choices of landmark sites
loss_report           what losses do to a plan
run_figures           figures that runs of the filter share
validation_report     validations and sweeps
flight_series         flights over time
flight_report         flights
replay_notes          what the figures of a replay mean
replay_report         replays
job_contract          kinds and states of the service's jobs
presentations         results as documents, data frames and HTML
"""
