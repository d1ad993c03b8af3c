"""Guidance: the closed loop of filter, commands and true motion, and trials of it.

flight_events        losses and holds at stated times
flight_options       options of a flight: filter, guidance, faults
flight_setup         limits of vehicles; inputs and state of the closed loop
keyed_noise          random numbers of each sighting, by key
anchors              the body that keeps each vehicle in contact
truth                true motion and sightings of vehicles
tracking_law         commands towards the plan; circles that move to their anchors
reference_tracking   guidance `track` in plain NumPy: a pose-tracking law with saturation
predictive_model     predicted flights over a horizon, and laws for first guesses
predictive_program   the quadratic program of one vehicle about a guess
predictive_team      guesses and programs of a team, and the resulting flights
predictive_guidance  guidance `mpc`: decisions of a team from estimates, by OSQP
closed_loop          filter and flight in one loop
flown_team           set-ups of a team, and random draws of its trials
flown_lanes          trials in progress, and guidance `mpc` for them
flight_records       records kept during a flight
flight_results       figures of each trial; an archive of flights
flown_figures        adherence to the plan; bound along the paths flown
flights              many trials over threads, and figures over time
"""
