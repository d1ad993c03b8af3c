"""From a plan to the best plan near it: a smooth problem for IPOPT, results measured exactly.

problem              variables, objective and constraints as arrays; samples and stages
measures             exact figures of merit, and the margin of each constraint
problem_setup        the problem that a plan and options pose
smooth_sightings     the information of sightings past obstacles, smooth
constraints          contacts, separation, landmarks and areas, smooth, with their sparse Jacobian
smooth_team          information of the whole team, its determinants
smooth_bound         the posterior bound with bias states, smooth, and its slopes
nlp                  each objective, and the nonlinear program of one stage
ipopt                the stages solved one after the other, from starting points
exact_search         a last search by the exact measure
parallel_starts      all starts, here or in child processes, and finished ones as bytes
refiner              the refinement of a plan
"""
