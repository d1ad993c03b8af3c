"""Senses and phases that bring linked vehicles together once a period.

phase_rules         the phase difference each link asks for
difference_tables   what pairs are worth at every difference, and searches for the best
contact_tables      contact time of links over the phase difference, and phase tolerances
sighted_phases      phases of most contact: limited fields of view, or obstacles
phase_constraints   phases of largest smallest margin, by difference constraints
margin_search       the same from many starts, and the semidefinite bound on that margin
phases              senses and phases for a team
"""
