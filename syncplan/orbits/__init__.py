"""Circular orbits, with exact contact windows, least distances and sightings.

circles          positions, headings; paths as polynomials in time
noise            noise of motion readings and of the start; lasting errors
sighting_kinds   table of the kinds of sighting
team             orbits, landmarks, sensors and noise of a scenario
error_states     lasting errors, and the layout of a team's states
sight_lines      sight lines and the obstacles that block them
contacts         contact windows; least distances of circles and vehicles
sightings        contact sampled at k Ts, and its remainder after losses
lost_parts       names of parts that can be lost, and the scenario after a loss
graphs           components, trees and cycles of a team
"""
