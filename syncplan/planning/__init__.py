"""The chain from a scenario to a judged plan, and what is done with plans.

figures_of_merit    by what plans are compared
refinement_record   how a plan was refined
judged_plan         the plan: orbits with every verdict
judgement           orbits to plan
planner             scenario to plan
validation          Monte Carlo of a plan beside its bound
swept_keys          the table of keys that a sweep may vary
sweeps              one key varied
plan_files          plans read back and judged afresh
"""
