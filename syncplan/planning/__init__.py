"""The chain from a scenario to a judged plan, and what is done with plans.

refinement_record   how a plan was refined
planner             scenario to plan, orbits to verdict
validation          Monte Carlo of a plan beside its bound
sweeps              one key varied
plan_files          plans read back and judged afresh
"""
