"""From a plan to the best plan near it: a smooth problem for IPOPT, results measured exactly.

problem              variables, objective and constraints as arrays
constraint_margins   how far each constraint is from being violated
measures             exact figures of merit with these margins
problem_setup        the problem that a plan and options pose
sample_times         the samples at which the smooth problem looks
stages               ever sharper steps between seen and unseen
sides                on which side of landmarks and keep-outs circles pass
constraint_blocks    constraints with their sparse Jacobian
smooth_sight_lines   how far sight lines clear obstacles, smooth
smooth_sightings     the information of sightings, smooth
smooth_contacts      contacts, smooth
smooth_team          information and contacts of the whole team
smooth_bound         the posterior bound, smooth
smooth_passages      how poses and errors as states go on from step to step
smooth_wide_bound    the posterior bound with errors as states, and its slopes
smooth_determinants  log determinant and window bound of the information
objective_forms      each objective, exact and smooth
clearances           separation, landmarks and areas, smooth
nlp                  the nonlinear program of one stage
starting_points      where the starts begin
ipopt                the stages solved one after the other
exact_search         a last search by the exact measure
parallel_starts      all starts, here or in child processes
kept_starts          finished starts as bytes, to go on from
refiner              the refinement of a plan
"""
