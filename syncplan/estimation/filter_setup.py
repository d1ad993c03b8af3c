"""The set-up of a filter run: states, motion model, initial variances, gate, sightings, readings.

The state stacks the x, y and heading of n vehicles, 3 n in all, and the bias states of a layout,
which may be none. All that a kernel knows of a bias state is its row in `States`: its vehicle, its
place in the state, and its effect.

A run is a sequence of steps, each a prediction and the sightings at its end. Trials have one step
for each sample, all of one length. A recording has one for each time of a reading, and its errors
are compared with the truth after some of them only.
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.consistency import gate_threshold
from syncplan.estimation.filter_options import FilterOptions
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.orbits.noise import Noise
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS

BEARING_KIND, DISTANCE_KIND, COMPASS_KIND = range(len(SIGHTING_KINDS))
"""Places in SIGHTING_KINDS, for kernels."""

HEADING, SPEED, TURN, DRIFT, SHIFT, DELAY = range(6)
"""Effects of a state on its vehicle: its own heading; a share added to its speed, a turn rate, a
velocity of the air; a shift of its readings of a kind, a delay of its stamps."""

_ACTS = {"speed": SPEED, "turn": TURN, "drift": DRIFT, "shift": SHIFT, "delay": DELAY}

_MOVED = {HEADING: (0, 2), SPEED: (0, 2), TURN: (0, 3), SHIFT: (0, 0), DELAY: (0, 0)}
"""First and end of the axes (x, y, heading) of a pose that a state moves."""

LOST_HEADING_SIGMA = 0.6
"""Standard deviation in rad of the heading of a lost vehicle."""

SAMPLE_EVERY = 10
"""NEES and coverage are taken at every tenth step, and at the last."""


class MotionModel(NamedTuple):
    """Integration of motion readings, and their variances.

    Fields
    ------
    time : s, length of one sample
    substeps : Euler sub-steps in a sample, 0 for exact arcs
    speed_variance, turn_rate_variance : (m/s)^2, (rad/s)^2, of a reading that holds for a sample;
        over a step k times as long it is 1 / k of that, so that errors are random walks
    """

    time: float
    substeps: int
    speed_variance: float
    turn_rate_variance: float


class States(NamedTuple):
    """Effects of states: one row for each vehicle and state that acts on it.

    A vehicle's first row is its heading, whose error moves the position as that of a bias state
    does. Rows of bias states follow.

    Fields
    ------
    first : (n + 1,) rows of vehicle i are first[i] to first[i + 1]
    acts : (m,) HEADING, SPEED, TURN, DRIFT, SHIFT or DELAY
    columns : (m,) place in the state vector
    clocks : (n,) place of the delay of each vehicle's stamps, -1 for none
    axes : (m, 2) first and end of the axes of the pose that it moves
    kinds : (m,) kind of sighting that it shifts, -1 for none
    common : (m,) whether all vehicles share it
    variances : (e,) of the bias states at the start
    first_changing : place of the first of them that is not constant; all after it change too. Such
        a state drifts or shifts
    decays : (e,) share of each left after a sample, 1 for constants; the noise it gains keeps its
        variance constant
    """

    first: Index
    acts: Index
    columns: Index
    clocks: Index
    axes: Index
    kinds: Index
    common: Flags
    variances: Array
    first_changing: int
    decays: Array


State = tuple[Array, Array]
"""State (3n + e, lanes) and covariance (3n + e, 3n + e, lanes), valid in its lower triangle."""


class FilterSetup(NamedTuple):
    """Set-up that all trials of a run share.

    Fields
    ------
    states : the bias states and their effects
    spans : (steps,) s, the length of each step, more than 0
    compared : (steps + 1,) sample of the truth that the state after each step is compared with, or
        -1; that of step 0 is 0, and that of the last step the last one, where they are known
    samples : number of samples of the truth after the start
    landmarks : (m, 2) m
    first : (steps + 2,) sightings of step k are first[k] to first[k + 1]
    observers, targets : (s,) of each sighting; targets from n on are landmarks
    kinds : (s,) what each sighting measures, as its place in SIGHTING_KINDS
    variances : (s,) of each sighting, in its kind's unit squared
    initial_variances : (3n + e,) of the state at the start
    motion : the motion model
    gate : largest innovation^2 / variance that is accepted
    second_order : whether sightings have second-order noise beside their own
    period : s, covered by a batch solution
    judged_from : sample from which on NEES and coverage are taken
    lost_variances : (n, 3) m^2, m^2, rad^2, of the prior about a lost vehicle's estimate
    sample_every : NEES and coverage are taken once in so many samples, and at the last
    noise_known : whether `variances` are true; those of a recording are assumed
    """

    states: States
    spans: Array
    compared: Index
    samples: int
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

    @property
    def vehicles(self) -> int:
        """Number of vehicles."""
        return len(self.lost_variances)

    @property
    def sighted_at(self) -> Index:
        """(s,) step of each sighting."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))


class Readings(NamedTuple):
    """Readings of the filter, a lane for each trial.

    Fields
    ------
    initial : (n, 3, lanes) initial estimate in m, m, rad; that of bias states is zero
    speeds, turn_rates : (steps, n, lanes) m/s, rad/s
    sightings : (s, lanes) in the unit of their kind; NaN where a sighting is missed
    """

    initial: Array
    speeds: Array
    turn_rates: Array
    sightings: Array


class Truth(NamedTuple):
    """The true states that estimates are compared with, a lane for each trial.

    Fields
    ------
    poses : (samples + 1, n, 3, lanes) m, m, rad; a single lane where all trials are alike
    constants : (c, lanes) the bias states that are constant
    changing : (samples + 1, e - c, lanes) the other bias states
    """

    poses: Array
    constants: Array
    changing: Array


def states_of(layout: StateLayout, sample_time: float) -> States:
    """Return the effects of the states of a layout, for samples of `sample_time` s."""
    rows: list[tuple[int, ...]] = []
    first, clocks = [0], np.full(layout.count, -1)
    for i in range(layout.count):
        rows.append((HEADING, 3 * i + 2, *_MOVED[HEADING], -1, 0))
        for name, columns in layout.columns.items():
            state = ERROR_STATES[name]
            act = _ACTS[state.act]
            kind = list(SIGHTING_KINDS).index(state.shifts) if act == SHIFT else -1
            for axis, column in enumerate(columns[i].tolist()):
                axes = (axis, axis + 1) if act == DRIFT else _MOVED[act]
                if column >= 0:
                    rows.append((act, column, *axes, kind, int(state.common)))
                    clocks[i] = column if act == DELAY else clocks[i]
        first.append(len(rows))
    table = np.array(rows, dtype=np.int64)
    return States(
        first=np.array(first, dtype=np.int64),
        acts=table[:, 0].copy(),
        columns=table[:, 1].copy(),
        clocks=clocks,
        axes=table[:, 2:4].copy(),
        kinds=table[:, 4].copy(),
        common=table[:, 5] > 0,
        variances=np.square(layout.sigmas),
        first_changing=layout.first_changing,
        decays=np.exp(-sample_time / layout.times),
    )


def build_setup(
    *,
    layout: StateLayout,
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
    samples: int,
    spans: Array | None = None,
    compared: Index | None = None,
    noise_known: bool = True,
) -> FilterSetup:
    """Return the set-up of a run of the vehicles and bias states of a layout.

    The other arguments are as in FilterSetup; `sample_time` and `period` are in s. `reach` in m is
    the typical distance of a lost vehicle from its estimate. Where `spans` and `compared` are None,
    each sample is a step.
    """
    deviations = [noise.position_sigma, noise.position_sigma, noise.heading_sigma]
    start = np.tile(np.square(deviations), layout.count)
    return FilterSetup(
        states=states_of(layout, float(sample_time)),
        spans=np.full(samples, float(sample_time)) if spans is None else spans,
        compared=np.arange(samples + 1) if compared is None else compared,
        samples=samples,
        landmarks=landmarks,
        first=first,
        observers=observers,
        targets=targets,
        kinds=kinds,
        variances=variances,
        initial_variances=np.concatenate([start, np.square(layout.sigmas)]),
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
        lost_variances=np.tile(np.square([reach, reach, LOST_HEADING_SIGMA]), (layout.count, 1)),
        sample_every=SAMPLE_EVERY,
        noise_known=noise_known,
    )


def judged_from(samples: int, sample_time: float, period: float, options: FilterOptions) -> int:
    """Return the first sample at which a filter's covariance is meant to hold.

    A filter that searches for its start takes a period to find it, in samples of `sample_time` s.
    For a run of no more `samples` than that, it is sample 0.
    """
    if not options.filter_model.finds_start:
        return 0
    found = math.ceil(period / sample_time - 1e-9)
    return found if found < samples else 0


def start_of(setup: FilterSetup, readings: Readings) -> State:
    """Return the state of each lane at step 0, in arrays of its own."""
    size, width = len(setup.initial_variances), readings.initial.shape[-1]
    x, P = np.zeros((size, width)), np.zeros((size, size, width))
    x[: 3 * setup.vehicles] = readings.initial.reshape(-1, width)
    P[np.arange(size), np.arange(size)] = setup.initial_variances[:, None]
    return x, P


def poses_of(x: Array, n: int) -> Array:
    """Return the poses (n, 3, lanes) of a state (3n + e, lanes); a view."""
    return x[: 3 * n].reshape(n, 3, *x.shape[1:])


# --- results of a run -----------------------------------------------------------------------------


ERROR, SQUARE, VARIANCE = range(3)
"""Quantities that a series sums over trials, for each state."""


class FilterStatistics(NamedTuple):
    """Statistics of the 3n + e states of each lane; only the series is summed over lanes.

    Fields
    ------
    squares, late_squares : (3n + e, lanes) sums of squared error over all k >= 1, and over
        2k > samples
    final : (3n + e, lanes) error at the last sample
    covered : (3n + e, lanes) sampled steps at which an error is within three sigma
    nees, nees_samples : (lanes,) of the poses, sum and number of samples with a positive definite
        covariance
    nis, accepted, gated : (lanes,) sum and number of accepted innovations, number of rejected ones
    innovations : (s, 2, lanes) each sighting's innovation, in the unit of its kind, and 1 over its
        variance, 0 where it is rejected or missed; (0, 2, lanes) if not wanted
    series : (samples + 1, 3n + e, 3) sums over lanes of errors, their squares and variances;
        (0, 3n + e, 3) if not wanted
    """

    squares: Array
    late_squares: Array
    final: Array
    covered: Array
    nees: Array
    nees_samples: Array
    nis: Array
    accepted: Array
    gated: Array
    innovations: Array
    series: Array


class FilterRun(NamedTuple):
    """Input of a filter of lanes, and the statistics that it adds to.

    Fields
    ------
    setup : shared by all lanes
    readings : of each lane
    truth : compared with the estimates
    statistics : of the comparison
    """

    setup: FilterSetup
    readings: Readings
    truth: Truth
    statistics: FilterStatistics


def empty_statistics(
    lanes: int, states: int, samples: int | None = None, sightings: int = 0
) -> FilterStatistics:
    """Return statistics of zeros, with a series over `samples` unless that is None.

    Innovations are kept for the first `sightings`: all or none.
    """
    return FilterStatistics(
        squares=np.zeros((states, lanes)),
        late_squares=np.zeros((states, lanes)),
        final=np.zeros((states, lanes)),
        covered=np.zeros((states, lanes)),
        nees=np.zeros(lanes),
        nees_samples=np.zeros(lanes),
        nis=np.zeros(lanes),
        accepted=np.zeros(lanes),
        gated=np.zeros(lanes),
        innovations=np.zeros((sightings, 2, lanes)),
        series=np.zeros((0 if samples is None else samples + 1, states, 3)),
    )


def run_without_truth(
    setup: FilterSetup, readings: Readings, innovations: bool = False
) -> FilterRun:
    """Return a run without a truth to compare with; `innovations` says whether these are kept."""
    lanes, states = readings.initial.shape[-1], len(setup.initial_variances)
    kept = len(setup.kinds) if innovations else 0
    nothing = np.zeros((1, setup.vehicles, 3, lanes))
    truth = Truth(nothing, np.zeros((0, lanes)), np.zeros((1, 0, lanes)))
    return FilterRun(setup, readings, truth, empty_statistics(lanes, states, sightings=kept))
