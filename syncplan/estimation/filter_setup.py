"""The set-up of a filter run: motion model, initial variances, gate, sightings and readings.

Monte Carlo and replays both build it here. `kinds` says what each sighting measures; a compass is a
sighting without a target. `augmented_setup` has what further states add (a wind, a sensor's bias).

A run is a row of steps, each a prediction and the sightings at its end. Trials have one step for
each sample, all of one length; a recording has one for each time at which something was read, and
its errors are compared with the truth after some of them alone.
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.consistency import gate_threshold
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_statistics import SAMPLE_EVERY
from syncplan.orbits.noise import Noise

BEARING_KIND, DISTANCE_KIND, COMPASS_KIND = 0, 1, 2
"""Places in SIGHTING_KINDS, as kernels have them."""


LOST_HEADING_SIGMA = 0.6
"""rad, of the heading of a vehicle that is lost."""


class MotionModel(NamedTuple):
    """How motion readings are integrated, and how far they are trusted.

    Fields
    ------
    time : s, of one sample
    substeps : Euler sub-steps in a sample, 0 for exact arcs
    speed_variance, turn_rate_variance : (m/s)^2, (rad/s)^2, of a reading that holds for a sample;
        over a step k times as long it is 1 / k of that, so that errors are random walks
    """

    time: float
    substeps: int
    speed_variance: float
    turn_rate_variance: float


class FilterSetup(NamedTuple):
    """What all trials of a run share.

    Fields
    ------
    truth : (samples + 1, n, 3) m, m, rad
    spans : (steps,) s, the length of each step, more than 0
    compared : (steps + 1,) entry of `truth` that the state after each step is compared with, or -1;
        that of step 0 is 0, and that of the last step the last one
    landmarks : (m, 2) m
    first : (steps + 2,) sightings of step k are first[k] to first[k + 1]
    observers, targets : (s,) of each sighting; targets from n on are landmarks
    kinds : (s,) what each sighting measures, as its place in SIGHTING_KINDS
    variances : (s,) of each sighting, in its kind's unit squared
    initial_variances : (n, 3) m^2, m^2, rad^2
    motion : the motion model
    gate : largest innovation^2 / variance that is accepted
    second_order : whether sightings have second-order noise beside their own
    period : s, that a batch solution covers
    judged_from : entry of `truth` from which on NEES and coverage are taken
    lost_variances : (n, 3) m^2, m^2, rad^2, about where a lost vehicle is taken for
    sample_every : entries of `truth` between those at which NEES and coverage are taken; the last
        one is one too
    noise_known : whether sightings scatter as `variances` say; those of a recording are assumed
    """

    truth: Array
    spans: Array
    compared: Index
    landmarks: Array
    first: Index
    observers: Index
    targets: Index
    kinds: Index
    variances: Array
    initial_variances: Array
    motion: MotionModel
    gate: float
    second_order: bool
    period: float
    judged_from: int
    lost_variances: Array
    sample_every: int
    noise_known: bool


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
    period: float,
    reach: float,
    options: FilterOptions,
    spans: Array | None = None,
    compared: Index | None = None,
    noise_known: bool = True,
) -> FilterSetup:
    """Return the set-up of a run of the vehicles in `truth`, (samples + 1, n, 3).

    The arguments are as in FilterSetup; `sample_time` and `period` are in s. `reach` in m is about
    how far a vehicle is from where a filter that has lost it takes it to be. Where `spans` and
    `compared` are None, each sample is a step.
    """
    samples = len(truth) - 1
    deviations = [noise.position_sigma, noise.position_sigma, noise.heading_sigma]
    return FilterSetup(
        truth=truth,
        spans=np.full(samples, float(sample_time)) if spans is None else spans,
        compared=np.arange(samples + 1) if compared is None else compared,
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
        second_order=options.filter_model.second_order,
        period=float(period),
        judged_from=judged_from(samples, sample_time, period, options),
        lost_variances=np.tile(np.square([reach, reach, LOST_HEADING_SIGMA]), (truth.shape[1], 1)),
        sample_every=SAMPLE_EVERY,
        noise_known=noise_known,
    )


def judged_from(samples: int, sample_time: float, period: float, options: FilterOptions) -> int:
    """Return the sample from which on a filter's covariance is meant to hold.

    A filter that looks for its start takes a period of as many samples, each of `sample_time` s; a
    run of no more `samples` than that ends before.
    """
    if not options.filter_model.finds_start:
        return 0
    found = math.ceil(period / sample_time - 1e-9)
    return found if found < samples else 0
