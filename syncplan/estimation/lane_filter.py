"""Filters of many trials at a time: the extended Kalman filter and the ideal filter.

The state stacks the poses (x, y, heading) of n vehicles and the bias states of a layout. Each step:

    predict   by the motion readings                      `motion_kernels`
    correct   by the sightings, one after another         `correction_kernels`

`tests.tools.reference_filter` does this in NumPy for one trial, to be read; these kernels filter
many trials at a time, a lane each. With second-order noise in its set-up the extended filter is the
second-order filter.

The ideal filter is linearised at the truth instead of at its estimate. No real filter can do this,
since the truth is unknown. It shows what is attainable: its errors are those of the posterior
Cramer-Rao bound, and its covariance holds, however uncertain the start. With d the deviation of the
state from the truth, and F, G and rows h taken at the truth:

    predict   d = F d + G (readings - true readings) + (truth moved by true readings - truth)
    update    nu = z - h(truth) - h' d,   d += gain nu
    P         as of the extended filter, at the truth

True readings are those that lead from each true pose to the next through the true air. The last
term of the prediction is the tiny difference between a sample's arc and the true path, the effect
of errors that are not states, and the noise of states that change. d is not wrapped: as in the
normal distribution, a heading may be off by more than half a turn. Each step must be a sample, at
which the truth is known.

Sources
-------
extended filter, NEES and NIS : Bar-Shalom, Li, Kirubarajan (2001), 10.3
ideal filter : Taylor (1979), The Cramer-Rao estimation error lower bound computation for
    deterministic nonlinear systems, IEEE Transactions on Automatic Control 24
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.air_kernels import compile_motion
from syncplan.estimation.correction_kernels import OFF, WHOLE, Correction, correct, correction_of
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import (
    DRIFT,
    SPEED,
    TURN,
    FilterRun,
    FilterSetup,
    FilterStatistics,
    Readings,
    State,
    States,
    build_setup,
    run_without_truth,
    start_of,
)
from syncplan.estimation.kernels import (
    Lanes,
    compile_for,
    compiled_beside,
    has_compiled,
    inner,
    lanes_of,
    lean,
    part,
)
from syncplan.estimation.motion_kernels import (
    Frame,
    add_reading_noise,
    bring_to_now,
    copy,
    frame_of,
    kept,
    motion_in,
    move,
    pass_step,
    predict,
    shortening,
)
from syncplan.estimation.statistics_kernels import (
    Comparison,
    comparison_of,
    fill_errors,
    fill_truth,
    is_sampled,
    record,
)
from syncplan.orbits.error_states import StateLayout
from syncplan.orbits.noise import Noise

Scratch = tuple[Frame, Correction, Comparison]
"""Scratch arrays of a filter kernel."""


def scratch_of(setup: FilterSetup, width: int) -> Scratch:
    """Return scratch for a filter of `width` lanes, at its first step."""
    states, size = setup.states, len(setup.initial_variances)
    work = correction_of(states, size, width)
    return frame_of(states, width), work, comparison_of(len(setup.lost_variances), size, width)


@part
def step_filter(
    x: Array, P: Array, step: int, run: FilterRun, frame: Frame, work: Correction, lanes: Lanes
) -> None:
    """Advance x (3n + e, lanes) and P, which stays in its frame, by a step."""
    speeds, turn_rates = run.readings.speeds[step - 1], run.readings.turn_rates[step - 1]
    predict(x, P, speeds, turn_rates, run.setup, step, frame, work.slopes, lanes)
    correct(x, P, step, run, x, WHOLE, frame, work, lanes)


@lean
def _filter(
    run: FilterRun, scratch: Scratch, lanes: Lanes, x: Array, P: Array, begin: int, end: int
) -> None:
    """Advance x and P, lower triangle, from step `begin` to step `end`."""
    setup, statistics = run.setup, run.statistics
    frame, work, compared = scratch
    for step in range(begin, end + 1):
        if step > begin:
            step_filter(x, P, step, run, frame, work, lanes)
        elif begin > 0:
            continue
        at = setup.compared[step]
        if step == end or (at >= 0 and is_sampled(setup, at)):
            bring_to_now(P, setup.states, frame, lanes)
        if at >= 0:
            fill_truth(compared.true, run.truth, at, lanes)
            fill_errors(x, compared.true, len(setup.lost_variances), compared.errors, lanes)
            record(P, setup, at, frame, work, compared, statistics, lanes)


# --- the ideal filter ---------------------------------------------------------------------------


@inner
def _read_truly(
    i: int,
    time: float,
    true: Array,
    after: Array,
    states: States,
    speeds: Array,
    turn_rates: Array,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Fill in the true readings (n, lanes), m/s and rad/s, of vehicle i between two states."""
    r = 3 * i
    for lane in range(len(lanes)):
        slopes[0, lane] = after[r, lane] - true[r, lane]
        slopes[1, lane] = after[r + 1, lane] - true[r + 1, lane]
        slopes[2, lane], slopes[3, lane] = 1.0, 0.0
    for m in range(states.first[i] + 1, states.first[i + 1]):
        act, column = states.acts[m], states.columns[m]
        for lane in range(len(lanes)):
            if act == DRIFT:
                slopes[states.axes[m, 0], lane] -= time * true[column, lane]
            elif act == SPEED:
                slopes[2, lane] += true[column, lane]
            elif act == TURN:
                slopes[3, lane] += true[column, lane]
    for lane in range(len(lanes)):
        turn = after[r + 2, lane] - true[r + 2, lane]
        turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
        ahead = true[r + 2, lane] + 0.5 * turn
        along = slopes[0, lane] * math.cos(ahead) + slopes[1, lane] * math.sin(ahead)
        path = along / shortening(0.5 * turn, 0)[0]
        speeds[i, lane] = path / (time * slopes[2, lane])
        turn_rates[i, lane] = turn / time - slopes[3, lane]


@inner
def _carry_off(
    i: int,
    time: float,
    off: Array,
    speeds: Array,
    turn_rates: Array,
    states: States,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Carry the error of vehicle i through a step, with the errors of its readings (n, lanes)."""
    r = 3 * i
    for m in range(states.first[i] + 1, states.first[i + 1]):
        act, column = states.acts[m], states.columns[m]
        for lane in range(len(lanes)):
            if act == DRIFT:
                off[r + states.axes[m, 0], lane] += time * off[column, lane]
            elif act == SPEED:
                off[r, lane] += slopes[6, lane] * off[column, lane]
                off[r + 1, lane] += slopes[7, lane] * off[column, lane]
            elif act == TURN:
                turn_rates[i, lane] += off[column, lane]
    for lane in range(len(lanes)):
        v, w, psi = speeds[i, lane], turn_rates[i, lane], off[r + 2, lane]
        off[r, lane] += slopes[2, lane] * v + slopes[4, lane] * w - slopes[1, lane] * psi
        off[r + 1, lane] += slopes[3, lane] * v + slopes[5, lane] * w + slopes[0, lane] * psi
        off[r + 2, lane] += time * w


@inner
def _add(x: Array, other: Array, share: float, lanes: Lanes) -> None:
    for k in range(len(x)):
        for lane in range(len(lanes)):
            x[k, lane] += share * other[k, lane]


@inner
def _predict_ideal(
    off: Array, P: Array, step: int, run: FilterRun, scratch: Scratch, lanes: Lanes
) -> None:
    """Advance the deviation from the truth, P and the true state by a step."""
    setup, readings, (frame, work, compared) = run.setup, run.readings, scratch
    motion, slopes, states = motion_in(setup, step), work.slopes, setup.states
    # scratch of the comparison is free during a prediction
    true, after, n = compared.true, compared.errors, readings.speeds.shape[1]
    speeds, turn_rates = compared.column[:n], compared.factor[:n]
    fill_truth(after, run.truth, step, lanes)
    for i in range(len(speeds)):
        _read_truly(i, motion.time, true, after, states, speeds, turn_rates, slopes, lanes)
        move(true, i, speeds, turn_rates, motion, states, slopes, lanes)
        for lane in range(len(lanes)):
            speeds[i, lane] = readings.speeds[step - 1, i, lane] - speeds[i, lane]
            turn_rates[i, lane] = readings.turn_rates[step - 1, i, lane] - turn_rates[i, lane]
        _carry_off(i, motion.time, off, speeds, turn_rates, states, slopes, lanes)
        for c in range(2):
            for lane in range(len(lanes)):
                off[3 * i + c, lane] += true[3 * i + c, lane] - after[3 * i + c, lane]
        add_reading_noise(P, i, motion, states, frame, slopes, lanes)
    pass_step(off, P, setup, motion.time, frame, lanes)
    first = len(P) - len(frame.left)
    for c in range(states.first_changing, len(P)):
        decay = kept(setup, c - first, motion.time)
        for lane in range(len(lanes)):
            off[c, lane] -= after[c, lane] - decay * true[c, lane]
    copy(after, true, lanes)


@lean
def _filter_ideally(
    run: FilterRun, scratch: Scratch, lanes: Lanes, x: Array, P: Array, begin: int, end: int
) -> None:
    """Advance x and P, lower triangle, from step `begin` to step `end`."""
    setup, statistics, (frame, work, compared) = run.setup, run.statistics, scratch
    # the kernel takes and leaves a whole state; meanwhile x is its deviation from the truth
    true = compared.true
    fill_truth(true, run.truth, begin, lanes)
    _add(x, true, -1.0, lanes)
    for step in range(begin, end + 1):
        if step > begin:
            _predict_ideal(x, P, step, run, scratch, lanes)
            correct(x, P, step, run, true, OFF, frame, work, lanes)
        elif begin > 0:
            continue
        if step == end or is_sampled(setup, step):
            bring_to_now(P, setup.states, frame, lanes)
        copy(x, compared.errors, lanes)
        record(P, setup, step, frame, work, compared, statistics, lanes)
    _add(x, true, 1.0, lanes)


# --- runs of filters ----------------------------------------------------------------------------


class Stepped(Protocol):
    """A filter that advances step by step: a LaneFilter, or a flight with one in it."""

    def advance(self, run: FilterRun, state: State, begin: int, end: int) -> None:
        """Advance a state from step `begin` to step `end`, in place."""


@dataclass(slots=True)
class LaneRun:
    """A filter run in progress; its lanes may be inspected, and moved, between steps.

    Attributes
    ----------
    base : filter that makes the steps
    given : its input; may be replaced by one with room for more
    state : at present
    at : number of steps made
    """

    base: Stepped
    given: FilterRun
    state: State
    at: int = field(default=0, kw_only=True)

    @classmethod
    def begun(
        cls, base: Stepped, given: FilterRun, streams: Sequence[np.random.SeedSequence] = ()
    ) -> Self:
        """Return a filter at step 0; `streams` are for filters that draw numbers."""
        return cls(base, given, start_of(given.setup, given.readings))

    def advance(self, end: int) -> None:
        """Make all steps up to `end`."""
        self.base.advance(self.given, self.state, self.at, end)
        self.at = end

    @property
    def setup(self) -> FilterSetup:
        """The filter's set-up."""
        return self.given.setup

    @property
    def readings(self) -> Readings:
        """Readings of the filter."""
        return self.given.readings

    @property
    def statistics(self) -> FilterStatistics:
        """Statistics of the filter."""
        return self.given.statistics


@dataclass(frozen=True, slots=True)
class LaneFilter:
    """A compiled filter whose trials are lanes.

    Attributes
    ----------
    kernel : compiled function of (FilterRun, Scratch, Lanes), state (3n + e, lanes), covariance
        (3n + e, 3n + e, lanes), and the two steps between which it advances both in place
    """

    kernel: Any

    def run(self, run: FilterRun, streams: Sequence[np.random.SeedSequence] = ()) -> State:
        """Return the state at the end, and add to the statistics on the way.

        Any number of lanes is possible. `streams` are for filters that draw numbers, which these do
        not.
        """
        state = start_of(run.setup, run.readings)
        self.advance(run, state, 0, len(run.readings.speeds))
        return state

    def advance(self, run: FilterRun, state: State, begin: int, end: int) -> None:
        """Advance a state, as `run` returns it, from step `begin` to step `end`, in place."""
        n, _, width = run.readings.initial.shape
        self.kernel(run, scratch_of(run.setup, width), lanes_of(n, width), *state, begin, end)

    def is_compiled(self, n: int) -> bool:
        """Return whether the kernel for n vehicles is in memory or in the disk cache.

        If not, the first run compiles it, which takes some seconds; callers announce this.
        """
        return has_compiled(self.kernel, specimen(n))

    def compile(self, n: int) -> None:
        """Compile the kernel for n vehicles, or load it from the disk cache."""
        if not self.is_compiled(n):
            compile_steps(n)
        self.kernel(*specimen(n))


def compile_steps(n: int) -> None:
    """Compile kernels shared by filters and flights of n vehicles, if missing, in two processes."""
    run, (frame, work, _), lanes, x, P, step, _ = specimen(n)
    given = (x, P, step, run, x, WHOLE, frame, work, lanes)
    if not has_compiled(correct, given):
        with compiled_beside(f"{__name__}:compile_prediction", n):
            compile_for(correct, *given)


def compile_prediction(n: int) -> None:
    """Compile the prediction of n vehicles, their motion, and the comparison with the truth."""
    run, (frame, work, compared), lanes, x, P, step, _ = specimen(n)
    # readings have the type of a state
    compile_for(predict, x, P, x, x, run.setup, step, frame, work.slopes, lanes)
    compile_for(record, P, run.setup, step, frame, work, compared, run.statistics, lanes)
    compile_motion()


def specimen(n: int) -> tuple[Any, ...]:
    """Return arguments of a kernel for n vehicles without bias states, and for no step."""
    none = np.zeros(0, dtype=np.int64)
    setup = build_setup(
        layout=StateLayout((), {}, np.zeros(0), np.zeros(0), n),
        landmarks=np.zeros((0, 2)),
        first=np.zeros(2, dtype=np.int64),
        observers=none,
        targets=none,
        kinds=none,
        variances=np.zeros(0),
        noise=Noise(speed_sigma=0.0, turn_rate_sigma=0.0, position_sigma=1.0, heading_sigma=1.0),
        sample_time=1.0,
        period=1.0,
        reach=1.0,
        options=FilterOptions(),
        samples=0,
    )
    still = np.zeros((0, n, 1))
    readings = Readings(np.zeros((n, 3, 1)), still, still, np.zeros((0, 1)))
    run = run_without_truth(setup, readings)
    return run, scratch_of(setup, 1), lanes_of(n, 1), *start_of(setup, readings), 0, 0


EXTENDED, IDEAL = LaneFilter(_filter), LaneFilter(_filter_ideally)
"""The extended Kalman filter, and the ideal filter, linearised at the truth."""
