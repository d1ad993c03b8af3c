"""Senses and phases that bring linked vehicles together once a period.

phase_rules              the phase difference each link asks for
difference_constraints   angles whose differences lie within intervals
difference_tables        what pairs are worth at every difference
cell_search              the best phases of a few vehicles, globally
coordinate_descent       starts for many vehicles
contact_tables           contact time of links over the phase difference
contact_search           phases of largest smallest share of contact
sighted_phases           the same with limited fields of view, or among obstacles
phase_constraints        phases of largest smallest margin, by difference constraints
phase_relaxation         the semidefinite bound on that margin
margin_search            phases of largest smallest margin
senses                   which vehicles turn which way
phases                   phases for a team
phase_tolerance          how far a phase may shift before contact or separation is lost
"""
