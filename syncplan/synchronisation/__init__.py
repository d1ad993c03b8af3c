"""Senses and phases that bring linked vehicles together once a period.

phase_rules         phase difference that each link requires
difference_tables   worth of pairs at every phase difference, and searches for the best
contact_tables      contact time of links over the phase difference, and phase tolerances
sighted_phases      phases of most contact with limited fields of view or obstacles
phase_constraints   phases of largest smallest margin, by difference constraints
margin_search       search from many starts, and the semidefinite bound on that margin
phases              senses and phases for a team
"""
