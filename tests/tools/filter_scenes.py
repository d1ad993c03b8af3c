"""Runs of the filter that have every kind of sensor and any bias states."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import FilterSetup, Readings, Truth
from syncplan.estimation.montecarlo import poses_over, setup_along
from syncplan.estimation.trial_readings import TrialReadings, possible_sightings
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.team import Sensors, Team

ALL = tuple(ERROR_STATES)

BUT_CLOCKS = tuple(name for name in ALL if name != "clock_offset")
"""States whose rows are exact wherever they are; those of a clock offset are so about 0."""

CHOICES = [
    (),
    ("wind",),
    ("gusts",),
    ("bearing_bias",),
    ("bearing_walk",),
    ("clock_offset",),
    ("speed_scale", "turn_rate_bias"),
    ALL,
]
"""Bias states of a filter."""


class Scene(NamedTuple):
    """A run, what some lanes read in it, and what is true."""

    setup: FilterSetup
    readings: Readings
    truth: Truth


def a_team(estimated: tuple[str, ...], fov: float = 2.0 * np.pi, detection: float = 0.7) -> Team:
    """Return three vehicles with all errors, of which the filter estimates some.

    They have every kind of sensor, but the second has neither bearing bias nor distances, and the
    first has no bearing walk.
    """
    return Team(
        Orbits(
            centers=np.array([[0.0, 0.0], [60.0, 5.0], [10.0, 55.0]]),
            radii=np.array([20.0, 15.0, 18.0]),
            senses=np.array([1.0, -1.0, 1.0]),
            phases=np.array([0.3, 2.0, -1.0]),
            rate=0.4,
        ),
        np.array([[60.0, -5.0], [-30.0, 70.0]]),
        Sensors(
            ranges=np.full(3, 60.0),
            fields_of_view=np.full(3, fov),
            boresights=np.array([0.0, 1.0, -1.0]),
            bearing_sigmas=np.array([0.02, 0.03, 0.05]),
            sample_time=0.1,
            range_sigmas=np.array([0.5, np.inf, 0.3]),
            compass_sigmas=np.array([np.inf, 0.05, 0.1]),
            every=np.array([1, 3, 2]),
            detection=np.array([1.0, detection, detection]),
            bearing_bias_sigmas=np.array([0.03, 0.0, 0.02]),
            bearing_walk_sigmas=np.array([0.0, 0.04, 0.03]),
            bearing_walk_times=np.array([np.inf, 2.0, 0.5]),
        ),
        Noise(speed_sigma=0.3, turn_rate_sigma=0.05, position_sigma=1.0, heading_sigma=0.1),
        ErrorSigmas(
            {
                "wind": 0.8,
                "gusts": 0.3,
                "speed_scale": 0.05,
                "turn_rate_bias": 0.02,
                "clock_offset": 0.05,
            },
            gust_time=4.0,
            estimated=estimated,
        ),
    )


def quiet(team: Team, errors: ErrorSigmas | None = None) -> Team:
    """Return the team with other errors, none by default, and bearings without bias or walk."""
    none = np.zeros(team.count)
    sensors = replace(team.sensors, bearing_bias_sigmas=none, bearing_walk_sigmas=none)
    return replace(team, sensors=sensors, errors=errors or ErrorSigmas())


def scene_of(team: Team, steps: int, lanes: int, *, seed: int = 3, **changes: object) -> Scene:
    """Return the first trials of a team; changes are of FilterOptions."""
    options = FilterOptions(**changes)  # type: ignore[arg-type]
    seen, layout = possible_sightings(team, find_windows(team), steps), layout_of(team)
    setup = setup_along(team, layout, seen, steps, options)
    trials = TrialReadings.of(team, poses_over(team, steps), setup, layout, seed)
    return Scene(setup, *trials.drawn(range(lanes)))


def true_state(truth: Truth, sample: int, lane: int) -> Array:
    """Return the true state (3n + e,) of a lane."""
    poses = truth.poses[sample, ..., min(lane, truth.poses.shape[-1] - 1)]
    errors = [truth.constants[:, lane], truth.changing[sample, :, lane]]
    return np.concatenate([poses.ravel(), *errors])


def derivative(function: Callable[[Array], ArrayLike], x: Array, step: float = 1e-6) -> Array:
    """Return the central differences of a vector function, (outputs, inputs)."""
    columns = [
        np.atleast_1d(np.subtract(function(x + step * one), function(x - step * one)))
        for one in np.eye(len(x))
    ]
    return np.array(columns).T / (2.0 * step)
