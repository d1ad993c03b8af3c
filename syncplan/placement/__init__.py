"""Centres for a formation given by its links, or by a shape and a gap.

drawing         a drawing's demands, figures and shortfalls
improvement     steps towards a drawing that meets its demands, each a quadratic program
infeasibility   proofs that no drawing exists
centers         demands, drawing, certificate: centres for a scenario
"""
