"""Vehicles of any plant that steer by what the filter of `tests.tools.plain_flights` estimates.

What a trial is drawn is that of syncplan.flight, so that `fly` and this loop with somebody
else's vehicles fly under the same noise. That of a bearing is a function of trial, step, observer
and target: two plants that see different things still read the same noise where both see the same.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.planning.plan_flights import FlightRun
from tests.crosschecks.plants import MakePlant
from tests.tools.plain_flights import PlainLoop
from tests.tools.plain_truth import PlainTruth


@dataclass(frozen=True, slots=True)
class Flight:
    """What came of some trials.

    Attributes
    ----------
    path : (steps + 1, trials, n, 3) m, m, rad, as flown
    estimates : (steps + 1, trials, n, 3) m, m, rad
    sightings : (trials,) number
    """

    path: Array
    estimates: Array
    sightings: Array


def fly(run: FlightRun, trials: int, make: MakePlant) -> Flight:
    """Return the first trials of a flight as a plant flies them."""
    truths = [PlainTruth(run, trial) for trial in range(trials)]
    loops = [PlainLoop(run) for _ in truths]
    estimates = [_estimated(loops)]
    begun = np.concatenate([one.path[0] for one in truths])
    plan = np.concatenate([one.response for one in truths])
    plant = make(begun, plan, _air(truths), run.plan.sensors.sample_time)
    for k in range(run.team.steps):
        for truth, loop in zip(truths, loops, strict=True):
            truth.obey(loop.commands(truth))
        commands = np.concatenate([one.commands[k] for one in truths])
        short = np.concatenate([one.disturbance for one in truths])
        done = plant.fly(commands, _air(truths), short)
        parts = (np.split(one, trials) for one in (done.poses, done.means))
        for truth, loop, poses, means in zip(truths, loops, *parts, strict=True):
            truth.arrive(poses, means)
            loop.follow(truth)
        estimates.append(_estimated(loops))
    return Flight(
        np.stack([one.path for one in truths], axis=1),
        np.array(estimates),
        np.array([sum(map(len, one.sightings)) for one in truths], dtype=float),
    )


def _estimated(loops: list[PlainLoop]) -> Array:
    """(trials, n, 3)."""
    return np.array([one.state[: 3 * one.team.count].reshape(-1, 3) for one in loops])


def _air(truths: list[PlainTruth]) -> Array:
    """(trials n, 2) m/s, wind and gusts in the sample that begins."""
    return np.concatenate([one.air for one in truths])
