"""Flights of a plan: vehicles that steer by their own estimates, in wind and with losses.

flying               flights of a plan
onboard_data         inputs and outputs of a navigator, kept for late sightings
navigator            filter and guidance one step at a time
"""
