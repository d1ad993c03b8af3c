"""Circles, and what follows from them exactly: contact windows, least distances, sightings.

circles          positions, headings; paths as polynomials in time
noise            of motion readings and of the start; errors that last
sighting_kinds   the table of what sightings measure
team             orbits, landmarks, sensors and noise together, as a scenario has them
error_states     errors that last, and where the states of a team are
sight_lines      when obstacles stand between
contacts         when who sees whom, and how near circles and vehicles come
sightings        contact sampled at k Ts, and what losses leave of it
graphs           components, trees and cycles of a team
"""
