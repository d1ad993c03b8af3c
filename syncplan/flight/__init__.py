"""Flying: vehicles that steer by their own estimates, in wind, with losses.

flight_events        losses and holds at their times
flight_options       how a flight is flown, and what goes wrong
flight_setup         what vehicles can do; what the closed loop is given, and keeps
keyed_noise          random numbers of a sighting
anchors              by whom each vehicle keeps in contact
truth                how vehicles move, who sees whom
tracking_law         commands towards the plan; circles that move to their anchors
reference_tracking   guidance `track` in plain NumPy: a pose-tracking law with saturation
predictive_model     predicted flights over a horizon, and laws for a first guess of them
predictive_program   the quadratic program of one vehicle about a guess
predictive_team      guesses and programs of a team; flights that come out of them
predictive_guidance  guidance `mpc`: decisions of a team from estimates, by OSQP
closed_loop          the filter with the flight in it
flown_team           a team's set-ups, and what its trials are drawn
flown_lanes          some trials on their way, and guidance mpc for them
flight_records       what is recorded on the way
flight_results       figures of each trial; an archive of flights
flown_figures        what was kept of the plan; the bound along the paths flown
flights              many trials over threads, and figures over time
flying               flights of a plan
onboard_data         what a navigator is given and gives, kept for late sightings
navigator            filter and guidance one step at a time
"""
