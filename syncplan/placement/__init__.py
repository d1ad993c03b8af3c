"""Centres for a formation given by its links, or by a shape and a gap.

demands         what a drawing must meet, read from a scenario
drawing         a drawing, measured: what it attains and misses
layouts         first drawings of links
layout_qp       the quadratic program of one step
improvement     steps towards a drawing that meets its demands
hidden_sight    what obstacles hide in a drawing
infeasibility   why there is no drawing
centers         demands, drawing, certificate: centres for a scenario
"""
