"""A scenario as arrays: radii, sensors and noise, and with its circles the team."""

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits
from syncplan.orbits.noise import Noise
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.team import Team
from syncplan.scenario.specification import Scenario, per_vehicle

__all__ = ["radii_of", "sensors_of", "team_of"]


def radii_of(scenario: Scenario) -> Array:
    """Return (n,) m: the radius of each vehicle's circle."""
    return np.array(per_vehicle(scenario.orbit.radius_m, scenario.size), dtype=float)


def sensors_of(scenario: Scenario) -> Sensors:
    """Return the sensors of a scenario's vehicles."""
    sensors = scenario.sensors
    return Sensors(
        ranges=np.array([sensor.range_m for sensor in sensors]),
        fields_of_view=np.radians([sensor.fov_deg for sensor in sensors]),
        boresights=np.radians([sensor.boresight_deg for sensor in sensors]),
        bearing_sigmas=np.array([sensor.bearing_sigma_rad for sensor in sensors]),
        sample_time=scenario.sample_time,
    )


def team_of(scenario: Scenario, orbits: Orbits) -> Team:
    """Return the team of a scenario's vehicles on the orbits given."""
    return Team(
        orbits=orbits,
        landmarks=np.array(scenario.landmarks, dtype=float).reshape(-1, 2),
        sensors=sensors_of(scenario),
        noise=Noise(
            speed_sigma=scenario.motion.speed_sigma_mps,
            turn_rate_sigma=scenario.motion.turn_rate_sigma_rad_s,
            position_sigma=scenario.initial_sigma.position_m,
            heading_sigma=scenario.initial_sigma.heading_rad,
        ),
    )
