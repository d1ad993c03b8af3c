"""The pilot: a few trials of a filter along a plan, side by side in plain NumPy.

A plan must not wait for kernels to be compiled, or for numba to be loaded. So a pilot thins samples
out (`pilot_readings`) and takes in all sightings of an instant at once. A filter that finds its
start is second-order until a period has passed, then goes on from the batch solution over it; its
looking for the start again over more periods, and its alarm, are left out. Errors that last are
left out, of truth and filter alike: the pilot shows what the start does.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filters import FilterModel
from syncplan.estimation.pilot_batch import batch_start
from syncplan.estimation.pilot_model import PilotFilter
from syncplan.estimation.pilot_readings import PilotReadings, thinned
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sightings import sample_sightings, steps_within
from syncplan.orbits.team import Team

PILOT_TRIALS = 16
PILOT_SEED = 0

BATCH_WORK = 15.0
"""Times what the filter takes of a period that a batch solution over it does."""


def pilot_work(team: Team, windows: Windows, duration: float, model: FilterModel) -> float:
    """Return about how many multiplications a pilot of `duration` s takes."""
    thin = thinned(team)
    steps = steps_within(duration, thin.sensors.sample_time)
    turn = _samples_of_start(thin, model)
    seen = sample_sightings(windows, team.orbits.period, thin.sensors, 1, steps).steps
    sightings = len(seen) + (BATCH_WORK * np.sum(seen <= turn) if turn <= steps else 0.0)
    return 2.0 * PILOT_TRIALS * float(sightings) * (3.0 * team.count) ** 2


def pilot_squares(
    team: Team,
    windows: Windows,
    duration: float,
    model: FilterModel,
    *,
    trials: int = PILOT_TRIALS,
    seed: int = PILOT_SEED,
) -> Array:
    """Return (trials, n) m^2: squared position errors, mean over the second half of `duration` s.

    `team` is as `thinned` returns it. Infinite for all vehicles of a trial whose filter broke down.
    """
    run = PilotReadings.drawn(team, windows, duration, trials, seed)
    lanes = PilotFilter.at_start(run, second_order=model.second_order)
    found, turn = np.zeros((trials, team.count)), _samples_of_start(team, model)
    with np.errstate(all="ignore"):
        for k in range(1, run.steps + 1):
            if k == turn:
                lanes = batch_start(run, turn, seed)
            elif k > turn or 2 * turn > run.steps:
                # before the batch solution only what is compared counts
                lanes.predict(run, k)
                lanes.correct(run, k)
            if 2 * k > run.steps:
                errors = lanes.x[..., :2] - run.places[k, : team.count]
                found += np.sum(errors**2, axis=-1)
    found /= run.steps - run.steps // 2
    found[~np.isfinite(found).all(axis=1)] = np.inf
    return found


def _samples_of_start(team: Team, model: FilterModel) -> int:
    """Samples that the batch solution covers: a period; 0 of a filter without one."""
    if not model.finds_start:
        return 0
    return math.ceil(team.orbits.period / team.sensors.sample_time - 1e-9)
