"""The chain from a scenario to a judged plan, and what is done with plans.

start_up            whether the filter reaches the bound: index and pilot
plan_records        how a plan was refined, and what flying found of it
judged_team         a team with all that was found of it; findings and the verdict
lost_parts          what can be lost, by name, and the scenario of what is left
observability_checks  findings on rank, certificate, links, single points of failure
path_checks         findings on distances, areas and speeds
flight_checks       findings on errors that leave no room, and of a flight
filter_checks       findings on the start and on neglected errors
verdict_checks      the table of checks
planner             the plan: of a scenario, or of orbits given
expected_work       how much work a scenario will be
written_records     how the orbits of a plan file were found
plan_files          plans read back and judged afresh; what a function takes as a plan
validation          Monte Carlo of a plan beside its bound, and the filter that runs
variations          one key varied, and worlds worse than the scenario states
loss_study          every loss judged afresh
"""
