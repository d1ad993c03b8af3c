"""Planning: the chain from a scenario to a judged plan, and studies of plans.

start_up            whether the filter reaches the bound: index and pilot
plan_records        records of a plan's refinement and flights
judged_team         a team with the results of its judgement; findings and the verdict
observability_checks  findings on rank, certificate, links, single points of failure
path_checks         findings on distances, areas and speeds
flight_checks       findings on errors that leave no room, and on flights
filter_checks       findings on the start and on neglected errors
verdict_checks      the table of checks
planner             the plan of a scenario, or of given orbits
expected_work       estimate of a scenario's computing work
written_records     a plan file's record of how its orbits were found
plan_files          plan files read and judged afresh; subjects that functions take as a plan
validation          Monte Carlo of a plan against its bound, and the choice of the filter
variations          sweeps of one key, and stress tests in worse worlds
loss_study          every loss judged afresh
"""
