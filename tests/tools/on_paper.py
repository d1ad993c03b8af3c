"""Plans, refinements and choices of landmarks on paper, for tests that have no use for flights."""

from functools import partial

from syncplan.landmarks import site_choice
from syncplan.planning import planner
from syncplan.refinement import refiner

plan = partial(planner.plan, pilot=False)
refine = partial(refiner.refine, pilot=False)
choose_landmarks = partial(site_choice.choose_landmarks, pilot=False)
