"""A recording through the filter one step at a time, as it would have run on the robots.

What comes out is what `replays` finds, to rounding: the same steps, by the same kernels.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.online_filter import Arrived, OnlineFilter
from syncplan.estimation.recorded_run import RecordedRun


class RecordedStep(NamedTuple):
    """What a team has read in a step of a recording.

    Fields
    ------
    speeds, turn_rates : (n,) m/s, rad/s
    arrived : sightings at its end
    span : s
    sample : number of the clock's sample that it ends at; -1 for none
    """

    speeds: Array
    turn_rates: Array
    arrived: Arrived
    span: float
    sample: int


def online_filter_of(run: RecordedRun, options: FilterOptions) -> OnlineFilter:
    """Return the filter of a replay's run at its start."""
    stream = np.random.SeedSequence(options.seed)
    return OnlineFilter(run.setup, run.readings.initial[..., 0], options.filter_model, stream)


def steps_of(run: RecordedRun) -> Iterator[RecordedStep]:
    """Yield the steps of a replay's run, in order of time."""
    setup, readings = run.setup, run.readings
    for k in range(len(setup.spans)):
        rows = slice(setup.first[k + 1], setup.first[k + 2])
        yield RecordedStep(
            readings.speeds[k, :, 0],
            readings.turn_rates[k, :, 0],
            Arrived(
                setup.observers[rows],
                setup.targets[rows],
                setup.kinds[rows],
                setup.variances[rows],
                readings.sightings[rows, 0],
            ),
            float(setup.spans[k]),
            int(setup.compared[k + 1]),
        )
