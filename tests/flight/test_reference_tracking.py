"""Guidance `track` in plain NumPy."""

import numpy as np

from syncplan.arrays import Array
from syncplan.flight.flight_limits import FlightLimits
from syncplan.flight.reference_tracking import tracking_commands, tracking_gains
from syncplan.orbits.circles import Orbits, heading, position, unit
from tests.tools.exact_flights import paper_grid

TIME = 12.3


def _commands(poses: Array, orbits: Orbits, limits: FlightLimits) -> Array:
    gains = tracking_gains(orbits, limits)
    return tracking_commands(orbits, limits, gains, TIME, poses, np.zeros((orbits.count, 2)))


def test_near_the_plan_it_is_the_law_of_kanayama() -> None:
    """Its gains: K_x along, K_y v across, K_theta v on the heading."""
    orbits, limits = paper_grid()
    gains, small = tracking_gains(orbits, limits), 1e-5
    ahead = unit(heading(orbits, TIME))
    left = unit(heading(orbits, TIME) + np.pi / 2.0)
    poses = np.column_stack([position(orbits, TIME), heading(orbits, TIME)])
    for way, slopes in (
        (np.column_stack([ahead, np.zeros(6)]), (-gains.place, 0.0)),
        (np.column_stack([left, np.zeros(6)]), (0.0, -gains.heading * gains.place / 4.0)),
        (np.tile([0.0, 0.0, 1.0], (6, 1)), (0.0, -gains.heading)),
    ):
        further = _commands(poses + small * way, orbits, limits)
        nearer = _commands(poses - small * way, orbits, limits)
        slope = (further - nearer) / (2.0 * small)
        np.testing.assert_allclose(slope, np.tile(slopes, (6, 1)), atol=1e-6)


def test_far_off_it_closes_in_as_fast_as_limits_leave_and_no_faster() -> None:
    """A vehicle far behind, heading for its place, adds the closing speed to the plan's own."""
    orbits, limits = paper_grid()
    gains = tracking_gains(orbits, limits)
    behind = position(orbits, TIME) - 100.0 * unit(heading(orbits, TIME))
    poses = np.column_stack([behind, heading(orbits, TIME)])
    speeds = _commands(poses, orbits, limits)[:, 0]
    np.testing.assert_allclose(speeds, orbits.speeds + gains.closing_speeds)


def test_commands_stay_within_limits_wherever_a_vehicle_is() -> None:
    orbits, limits = paper_grid()
    generator = np.random.default_rng(1)
    for _ in range(50):
        poses = generator.normal(size=(6, 3)) * [100.0, 100.0, 3.0]
        speeds, turn_rates = _commands(poses, orbits, limits).T
        assert np.all((limits.least_speeds <= speeds) & (speeds <= limits.most_speeds))
        assert np.all(np.abs(turn_rates) <= limits.most_turn_rates)
