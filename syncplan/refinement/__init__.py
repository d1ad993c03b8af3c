"""Refinement of a plan: a smooth problem for IPOPT, with results measured exactly.

problem              variables, objective and constraints as arrays; samples and stages
measures             exact figures of merit, and the margin of each constraint
problem_setup        the problem that a plan and options pose
smooth_sightings     information of sightings past obstacles, smooth
constraints          contacts, separation, landmarks and areas, smooth, with their sparse Jacobian
smooth_team          information of the whole team, and its determinants
smooth_bound         posterior bound with bias states, smooth, and its slopes
nlp                  each objective, and the nonlinear program of one stage
ipopt                solution of the stages in turn, from starting points
exact_search         final search by the exact measure
parallel_starts      all starts, in this or child processes, and finished ones as bytes
refiner              the refinement of a plan
"""
