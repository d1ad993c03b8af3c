"""Centres for a formation given by its links, or by a shape and a gap.

demands         what a drawing must meet
layout_qp       the convex problem of one step
drawing         steps towards a drawing that meets its demands
layouts         first drawings
infeasibility   why there is no drawing
centers         centres for a scenario
"""
