"""Plans and runs as JSON documents, with what their figures mean in words.

document_base       what all documents share
start_up_schemas    the start of a plan and its JSON contract
verdict_schemas     verdicts and their JSON contract
refinement_schemas  the JSON contract of refinements
flown_plan_schemas  of what flying has found of a plan
plan_schemas        of plans
site_schemas        of choices of landmark sites
flight_series_schemas  of flights over time
flight_schemas      the contract of flights
flight_notes        what their figures mean
flight_series_report  flights over time as documents
flight_report       flights as documents
loss_schemas        of what losses do to a plan
state_error_schemas  of errors of states that are no poses
truth_schemas       of worlds that differ from the scenario
run_schemas         of validations and sweeps
replay_schemas      of replays
consistency_words   ANEES and NIS in words
job_contract        kinds and states of the service's jobs
refinement_report   refinements
error_report        what is determined of errors that last
plan_report         plans
loss_report         what losses do to a plan
sites_report        choices of landmark sites
state_errors_report  errors of states that are no poses
truth_report        how a simulated world differs, and what that was expected to cost
validation_notes    what the figures of a validation mean
validation_report   validations and sweeps
replay_notes        what the figures of a replay mean
replay_report       replays
presentations       results as documents, data frames and HTML
"""
