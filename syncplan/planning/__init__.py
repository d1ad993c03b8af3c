"""Planning: the chain from a scenario to a judged plan, and studies of plans.

share_test          sequential test of the share of flights that fail
plan_records        records of a plan's refinement and flights
judged_team         a team with the results of its judgement; findings and the verdict
filter_choice       the filter to run: asked for, flown, or by the start-up index
scenario_checks     findings on values that the scenario states
observability_checks  findings on rank, certificate, links, single points of failure
path_checks         findings on distances, areas and speeds
flight_checks       findings on flights
error_checks        errors above their predictions, in flights and validations
filter_checks       findings on errors that the filter leaves out
verdict_checks      the table of checks
plans               a judged team with its verdict
observability_records  rank, certificate and predicted errors as parts of documents
pilot_options       options of a pilot flight
planner             the plan of a scenario, or of given orbits
expected_work       estimate of a scenario's computing work
plan_flights        flights of a plan, and the record that its verdict takes into account
pilot_flight        a plan flown until a test shows whether it flies well
written_records     a plan file's record of how its orbits were found
plan_files          plan files read and judged afresh; subjects that functions take as a plan
validation          Monte Carlo of a plan against its bound, and the choice of the filter
variations          sweeps of one key, and stress tests in worse worlds
loss_study          every loss judged afresh
"""
