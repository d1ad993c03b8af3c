"""From a plan to the best plan near it: a smooth problem for IPOPT, results measured exactly.

problem             what may move and what must hold, as arrays
measures            exact figures of merit and constraint margins
exact_search        a last search by the exact measure
constraint_blocks   constraints with their sparse Jacobian
sample_times        samples at which the smooth problem looks
smooth_sightings    information of sightings, smooth
smooth_contacts     contact, smooth
smooth_team         information and contacts of the whole team
smooth_bound        the posterior bound, smooth
smooth_determinants determinants and bounds of the information
stages              ever sharper looks at the problem
objective_forms     each objective, exact and smooth
clearances          separation and areas
nlp                 the nonlinear program of one stage
ipopt               the stages, solved
starting_points     where the starts begin
parallel_starts     all starts, here or in child processes
problem_setup       the problem of a plan and options
refiner             the refinement of a plan
"""
