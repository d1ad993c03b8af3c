"""Cross-checks: somebody else's vehicles flown by our commands from our filter.

The packages that simulate them are no dependencies of syncplan: tests/crosschecks/requirements.txt.

plants            what every plant offers
multirotor_lanes  RotorPy's multirotor for many vehicles at once
velocity_loop     from air speed and turn rate to thrust and attitude
rotorpy_team      multirotors of RotorPy
jsbsim_planes     aeroplanes of JSBSim
responses         systematic errors and lags of a plant
known_plants      the plants that can be flown
courses           what is flown
closed_loop       vehicles that steer by what a filter estimates
comparisons       two flights under the same noise, side by side
check_plants      the script
"""
