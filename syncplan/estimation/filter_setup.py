"""The set-up of a filter run: motion model, initial variances, gate, sightings and readings.

Monte Carlo and replays both build it here. `kinds` says what each sighting measures; a compass is a
sighting without a target. `augmented_setup` has what further states add (a wind, a sensor's bias).
"""

from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.consistency import gate_threshold
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_statistics import SAMPLE_EVERY
from syncplan.orbits.noise import Noise

__all__ = ["FilterSetup", "MotionModel", "Readings", "build_setup"]


class MotionModel(NamedTuple):
    """How motion readings are integrated, and how far they are trusted.

    Fields
    ------
    time : s, of one sample
    substeps : Euler sub-steps in a sample, 0 for exact arcs
    speed_variance, turn_rate_variance : (m/s)^2, (rad/s)^2, of each reading
    """

    time: float
    substeps: int
    speed_variance: float
    turn_rate_variance: float


class FilterSetup(NamedTuple):
    """What all trials of a run share.

    Fields
    ------
    truth : (steps + 1, n, 3) m, m, rad
    landmarks : (m, 2) m
    first : (steps + 2,) sightings of step k are first[k] to first[k + 1]
    observers, targets : (s,) of each sighting; targets from n on are landmarks
    kinds : (s,) what each sighting measures, as its place in SIGHTING_KINDS
    variances : (s,) of each sighting, in its kind's unit squared
    initial_variances : (n, 3) m^2, m^2, rad^2
    motion : the motion model
    gate : largest innovation^2 / variance that is accepted
    sample_every : steps between samples of NEES and coverage; the last step is one too
    """

    truth: Array
    landmarks: Array
    first: Index
    observers: Index
    targets: Index
    kinds: Index
    variances: Array
    initial_variances: Array
    motion: MotionModel
    gate: float
    sample_every: int


class Readings(NamedTuple):
    """What the filter reads, a lane for each trial.

    Fields
    ------
    initial : (n, 3, lanes) initial estimate in m, m, rad
    speeds, turn_rates : (steps, n, lanes) m/s, rad/s
    sightings : (s, lanes) in the unit of their kind
    """

    initial: Array
    speeds: Array
    turn_rates: Array
    sightings: Array


def build_setup(
    *,
    truth: Array,
    landmarks: Array,
    first: Index,
    observers: Index,
    targets: Index,
    kinds: Index,
    variances: Array,
    noise: Noise,
    sample_time: float,
    options: FilterOptions,
) -> FilterSetup:
    """Return the set-up of a run of the vehicles in `truth`, (steps + 1, n, 3).

    The arguments are as in FilterSetup; `sample_time` is in s.
    """
    deviations = [noise.position_sigma, noise.position_sigma, noise.heading_sigma]
    return FilterSetup(
        truth=truth,
        landmarks=landmarks,
        first=first,
        observers=observers,
        targets=targets,
        kinds=kinds,
        variances=variances,
        initial_variances=np.tile(np.square(deviations), (truth.shape[1], 1)),
        motion=MotionModel(
            time=float(sample_time),
            substeps=options.motion_substeps,
            speed_variance=float(noise.speed_sigma) ** 2,
            turn_rate_variance=float(noise.turn_rate_sigma) ** 2,
        ),
        gate=gate_threshold(options.gate_probability),
        sample_every=SAMPLE_EVERY,
    )
