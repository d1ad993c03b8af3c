"""Circles, and what follows from them exactly: contact windows, least distances, sightings.

circles                     positions, headings, transition of errors
paths                       circles as trigonometric polynomials in time
noise                       sigmas of motion and of the start
sensors                     what each vehicle can see
error_states                errors that last, and where the states of a team are
team                        orbits, landmarks, sensors and noise together
scenario_arrays             a scenario as arrays, and its team
trigonometric_polynomials   their real roots, many at once
sight_lines                 when obstacles stand between
contacts                    when who sees whom
separation                  how near circles and vehicles come
sightings                   contact sampled at k Ts
sighting_kind               what one kind of sighting measures, and its slopes
bearings                    the kind that every camera measures
distances                   how far the target is
compasses                   a vehicle's own heading
losses                      what is left when vehicles, sensors or landmarks are lost
sighting_kinds              the table of them
graphs                      components, trees and cycles of a team
"""
