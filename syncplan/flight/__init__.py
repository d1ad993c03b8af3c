"""Flying: vehicles that steer by their own estimates, in wind, with losses.

flight_limits  what vehicles can do in flight
"""
