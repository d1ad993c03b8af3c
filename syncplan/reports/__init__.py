"""Plans and runs as JSON documents, with notes on the meaning of their figures.

Each module holds a document's parts with their descriptions, the functions that make them from a
result, and its notes.

refinement_report     refinements
plan_report           plans
sites_report          choices of landmark sites
covariance_report     covariances of positions over a period of a plan
run_figures           figures that runs of the filter share
validation_report     validations and sweeps
flight_series         flights over time
flight_report         flights
replay_notes          notes on the figures of a replay
replay_report         replays
presentations         results as documents, data frames and HTML
"""
