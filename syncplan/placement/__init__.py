"""Centres for a formation given by its links, or by a shape and a gap.

drawing         what a drawing must meet, what it attains and misses
improvement     steps towards a drawing that meets its demands, each a quadratic program
infeasibility   why there is no drawing
centers         demands, drawing, certificate: centres for a scenario
"""
