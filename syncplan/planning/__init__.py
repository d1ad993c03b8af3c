"""The chain from a scenario to a judged plan, and what is done with plans.

figures_of_merit    by what plans are compared
start_up            whether the filter reaches the bound: index and pilot
refinement_record   how a plan was refined
predicted_errors    what bounds predict of positions and further states, what neglect costs
flight_record       what flying a plan has found
judged_team         a team with all that was found of it
distance_limits     how near vehicles may come to each other and to landmarks
findings            what speaks against flying a plan, and the verdict
observability_checks  findings on rank and certificate
path_checks         findings on distances and areas
link_checks         findings on links lost or easily lost, hidden landmarks
lost_parts          what can be lost, by name, and the scenario of what is left
needed_links        whether a team needs links, and what it costs to be without
speed_checks        findings on speeds, in the wind
room_checks         findings on errors that leave no room
loss_checks         findings on single points of failure
search_checks       findings on how the plan was found
neglect_checks      findings on errors that the filter does not estimate
start_up_checks     findings on the start
flight_checks       findings of a flight
verdict_checks      the table of checks
judged_plan         the plan: a judged team and the verdict
judgement           orbits to plan
expected_work       how much work a scenario will be
planner             scenario to plan
derived_keys        keys of plan files that follow from others
written_records     how the orbits of a plan file were found
plan_files          plans read back and judged afresh
filter_choice       which filter runs on a plan, and why
subjects            what a function takes as a plan
validation          Monte Carlo of a plan beside its bound
stress_tests        the same in worlds that are worse than the scenario states
swept_keys          the keys that a sweep may vary
sweeps              one key varied
loss_study          every loss judged afresh
"""
