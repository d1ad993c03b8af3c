"""Senses and phases that bring linked vehicles together once a period.

phase_rules         the phase difference each link asks for
phase_constraints   phases of largest smallest margin, by difference constraints
phase_relaxation    the semidefinite bound on that margin
senses              which vehicles turn which way
phases              phases for a team
phase_tolerance     how far a phase may shift before contact or separation is lost
"""
