"""Figures of trials that have been flown: errors of estimates, and how the plan was kept.

The posterior Cramer-Rao bound is along the paths that vehicles truly took, by what they truly saw.
It is the covariance of the filter's state, with F, G and rows of sightings at the truth: that of
the ideal filter of `lane_filter`. Each trial has its own, as paths and sightings differ. A false
sighting counts here as a true one.

The variance of a place now, while P is in an earlier frame, is h' P h with h the row in that frame
of the place itself: `correction_kernels.refer_place`.

Source: Tichavsky, Muravchik, Nehorai (1998), Posterior Cramer-Rao bounds for discrete-time
nonlinear filtering; Taylor (1979).

A meeting of two bodies is planned once a period, where their contact windows of either direction
are; it is kept where a sighting of one by the other is made within half a period of the middle of
the longest of these.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.correction_kernels import OFF, correct, refer_place, spread
from syncplan.estimation.filter_setup import (
    SAMPLE_EVERY,
    FilterRun,
    FilterSetup,
    FilterStatistics,
    empty_statistics,
    start_of,
)
from syncplan.estimation.kernels import Lanes, kernel, lanes_of, lean
from syncplan.estimation.lane_filter import Scratch, scratch_of, specimen
from syncplan.estimation.motion_kernels import predict
from syncplan.estimation.statistics_kernels import fill_truth
from syncplan.flight.flight_results import FlightFigures
from syncplan.flight.flown_lanes import FlownLanes
from syncplan.flight.flown_team import FlownTeam
from syncplan.orbits.circles import Orbits, phase, position, wrap
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sightings import samples_before

# --- what is measured -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Meetings:
    """Meetings that a plan has in a run.

    Attributes
    ----------
    pairs : (p, 2) bodies, the first a vehicle; those from n on are landmarks
    first_end : (p,) step at which the first meeting is over
    times : (p,) how many there are, all with a whole period about them in the run
    period : steps, of a period; no whole number
    """

    pairs: Index
    first_end: Array
    times: Index
    period: float


@dataclass(frozen=True, slots=True)
class Nearest:
    """The closest that any two vehicles come in each trial.

    Attributes
    ----------
    distance : (lanes,) m; infinite for one vehicle
    pair : (lanes, 2)
    step : (lanes,)
    """

    distance: Array
    pair: Index
    step: Index


def meetings_of(windows: Windows, sample_time: float, period: float, steps: int) -> Meetings:
    """Return the meetings of a plan in so many steps."""
    longest: dict[tuple[int, int], tuple[float, float]] = {}
    for k, (observer, target) in enumerate(
        zip(windows.observers.tolist(), windows.targets.tolist(), strict=True)
    ):
        pair = (min(observer, target), max(observer, target))
        for start, end in windows.of(k).tolist():
            if end - start > longest.get(pair, (-1.0, 0.0))[0]:
                longest[pair] = (end - start, 0.5 * (start + end))
    pairs = sorted(longest)
    middle = np.array([longest[pair][1] for pair in pairs]) % period
    # from half a period before the middle; the first that is wholly in the run
    end = np.where(middle >= 0.5 * period, middle + 0.5 * period, middle + 1.5 * period)
    length = period / sample_time
    first_end = end / sample_time
    times = np.maximum(np.floor((steps - first_end) / length + 1e-9) + 1.0, 0.0)
    return Meetings(
        np.array(pairs, dtype=np.int64).reshape(-1, 2), first_end, times.astype(np.int64), length
    )


def kept_meetings(
    meetings: Meetings, setup: FilterSetup, sightings: Array, gone: Index
) -> tuple[Array, Index]:
    """Return (p, lanes) how many of each pair's meetings were kept, and (p,) how many there were.

    A meeting that is not over when one of the two is gone, (n + m,) steps, is none.
    """
    count = int(setup.first[-1])
    step = np.repeat(np.arange(len(setup.first) - 1), np.diff(setup.first))
    a = np.minimum(setup.observers[:count], setup.targets[:count])
    b = np.maximum(setup.observers[:count], setup.targets[:count])
    made = np.isfinite(sightings[:count])
    kept = np.zeros((len(meetings.pairs), sightings.shape[1]))
    until = np.minimum(gone[meetings.pairs[:, 0]], gone[meetings.pairs[:, 1]])
    last = np.floor((until - meetings.first_end) / meetings.period) + 1.0
    times = np.minimum(meetings.times, np.maximum(last, 0.0)).astype(np.int64)
    for p, (first, second) in enumerate(meetings.pairs.tolist()):
        rows = np.flatnonzero((a == first) & (b == second))
        begin = meetings.first_end[p] - meetings.period
        number = np.floor((step[rows] - begin) / meetings.period).astype(np.int64)
        for k in range(times[p]):
            kept[p] += made[rows[number == k]].any(axis=0)
    return kept, times


def off_plan(orbits: Orbits, path: Array, time: float) -> tuple[Array, Array]:
    """Return (steps + 1, n, lanes) how far vehicles are from their places, m, and ahead of them, s.

    `path` is (steps + 1, n, 3, lanes), at steps of `time` s. Ahead is by the angle about the
    centre, within half a period.
    """
    times = time * np.arange(len(path))
    off = path[:, :, :2] - position(orbits, times)[..., None]
    arm = path[:, :, :2] - orbits.centers[:, :, None]
    turned = np.arctan2(arm[:, :, 1], arm[:, :, 0]) - phase(orbits, times)[..., None]
    ahead = wrap(turned) * (orbits.senses / orbits.rate)[:, None]
    return np.hypot(off[:, :, 0], off[:, :, 1]), ahead


def nearest(path: Array, there: Flags) -> Nearest:
    """Return the closest that two vehicles come on paths (steps + 1, n, 3, lanes).

    `there` is (steps + 1, n): vehicles that are gone do not count.
    """
    lanes = path.shape[-1]
    squares, pair = np.full(lanes, np.inf), np.zeros((lanes, 2), dtype=np.int64)
    step = np.zeros(lanes, dtype=np.int64)
    _find_nearest(np.ascontiguousarray(path), there, squares, pair, step)
    return Nearest(np.sqrt(squares), pair, step)


@kernel
def _find_nearest(path: Array, there: Flags, squares: Array, pair: Index, step: Index) -> None:
    for k in range(len(path)):
        for i in range(path.shape[1]):
            for j in range(i):
                if not (there[k, i] and there[k, j]):
                    continue
                for lane in range(path.shape[3]):
                    dx = path[k, i, 0, lane] - path[k, j, 0, lane]
                    dy = path[k, i, 1, lane] - path[k, j, 1, lane]
                    square = dx * dx + dy * dy
                    if square < squares[lane]:
                        squares[lane], step[lane] = square, k
                        pair[lane, 0], pair[lane, 1] = j, i


IN_PHASE_S = 1.0
"""A vehicle that was held has its phase again where it is off by no more, for a period."""


def figures_of(team: FlownTeam, lanes: FlownLanes) -> FlightFigures:
    """Return the figures of trials that have been flown to their end."""
    flown, time, steps = lanes.flown, team.setup.time, team.steps
    orbits = team.team.orbits
    away, ahead = off_plan(orbits, flown.path, time)
    there, late = team.present, 2 * np.arange(steps + 1) > steps
    counted = late[:, None] & there
    bounds = _bounds(team, lanes, counted)
    close = nearest(flown.path, there)
    meetings = meetings_of(team.windows, time, orbits.period, steps)
    sightings = lanes.readings.sightings[: flown.places[1]]
    gone = team.setup.mishaps.gone_from
    kept, planned = kept_meetings(meetings, lanes.setup, sightings, gone)
    # for a vehicle that is gone the time until then counts
    steered = np.maximum(np.minimum(gone[: len(there[0])], steps), 1)[:, None]
    return FlightFigures(
        planned_meetings=planned,
        tracking_squares=_mean(away**2, counted),
        phase_squares=_mean(ahead**2, counted),
        worst_phases=_worst(np.abs(ahead), counted),
        bound_squares=bounds[0],
        state_bound_squares=bounds[1],
        separations=close.distance,
        nearest=close.pair,
        nearest_times=np.asarray(close.step * time),
        kept_meetings=kept.T,
        longest_unseen=np.asarray(flown.longest.T * time),
        # that of its circle for a vehicle that is held all the while
        slowest=np.where(np.isinf(flown.slowest), orbits.speeds[:, None], flown.slowest).T,
        fastest=np.where(np.isinf(flown.slowest), orbits.speeds[:, None], flown.fastest).T,
        saturated=(flown.saturated / steered).T,
        sought=(flown.sought / steered).T,
        refused=_refused(lanes),
        sightings=np.isfinite(sightings).sum(axis=0),
        settled=_settled(team, ahead),
    )


def without_gone(team: FlownTeam, lanes: FlownLanes) -> FilterStatistics:
    """Return the statistics, those of vehicles that leave being of the time that they are there.

    A vehicle that is gone counts with errors of zero; means are over all samples.
    """
    counted, there, steps = lanes.statistics, team.present, team.steps
    if there.all():
        return counted
    late = 2 * np.arange(steps + 1) > steps
    sampled = np.arange(steps + 1) % SAMPLE_EVERY == 0
    sampled[-1], sampled[0] = True, False
    sampled &= np.arange(steps + 1) > lanes.setup.judged_from
    seldom = there[sampled].mean()
    # of each state; bias states stay
    stays = np.ones((steps + 1, len(counted.squares)), dtype=bool)
    stays[:, : 3 * there.shape[1]] = np.repeat(there, 3, axis=1)
    of_run, of_late, of_sampled = (
        stays[chosen].mean(axis=0)[:, None] for chosen in (np.arange(steps + 1) > 0, late, sampled)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return counted._replace(
            squares=counted.squares / of_run,
            late_squares=counted.late_squares / of_late,
            final=np.where(stays[-1][:, None], counted.final, np.nan),
            covered=(counted.covered - (1.0 - of_sampled) * sampled.sum()) / of_sampled,
            nees=counted.nees / seldom,
        )


def _refused(lanes: FlownLanes) -> Array:
    """(lanes, n) share of decisions that were refused; zero where none are made."""
    guidance = lanes.guidance
    if guidance is None:
        n, _, width = lanes.readings.initial.shape
        return np.zeros((width, n))
    return np.asarray(guidance.refused.T / max(guidance.decisions, 1))


def _mean(values: Array, counted: Flags) -> Array:
    """(lanes, n) mean over the samples that count of (steps + 1, n, lanes); NaN without any."""
    with np.errstate(invalid="ignore"):
        sums = np.where(counted[..., None], values, 0.0).sum(axis=0)
        return np.asarray((sums / counted.sum(axis=0)[:, None]).T)


def _worst(values: Array, counted: Flags) -> Array:
    """(lanes, n) largest over the samples that count; NaN without any."""
    most = np.where(counted[..., None], values, -1.0).max(axis=0)
    return np.where(most < 0.0, np.nan, most).T


def _bounds(team: FlownTeam, lanes: FlownLanes, counted: Flags) -> tuple[Array, Array]:
    """Mean of the bound's variance over the second half: of places (lanes, n) m^2, and of errors.

    Those of the bias states are (lanes, e). Fills in the records' bounds over time.
    """
    n = team.team.count
    width, e = lanes.readings.initial.shape[-1], len(team.layout.sigmas)
    setup = lanes.setup._replace(gate=np.inf, second_order=False)
    scratch = empty_statistics(width, team.size)
    squares, of_states = np.zeros((n, width)), np.zeros((e, width))
    side_by_side, records = lanes_of(n, width), lanes.records
    along = np.zeros((0, n, width)) if records is None else records.bounds
    bound_lanes(
        lanes.run.given._replace(setup=setup, statistics=scratch),
        squares,
        of_states,
        counted,
        along,
        1 if records is None else records.steps.every,
        scratch_of(setup, width),
        side_by_side,
        *start_of(setup, lanes.readings),
    )
    late = team.steps - team.steps // 2
    with np.errstate(invalid="ignore"):
        return (squares / counted.sum(axis=0)[:, None]).T, of_states.T / late


def compile_bound(n: int) -> None:
    """Compile the bound along paths of n vehicles, by that of no step."""
    run, scratch, lanes, *state, _, _ = specimen(n)
    squares, of_states, along = np.zeros((n, 1)), np.zeros((0, 1)), np.zeros((0, n, 1))
    counted = np.zeros((1, n), dtype=bool)
    bound_lanes(run, squares, of_states, counted, along, 1, scratch, lanes, *state)


def _settled(team: FlownTeam, ahead: Array) -> Array:
    """(lanes, h) s from the end of each hold until the vehicle keeps its phase for a period.

    NaN where it never does, or less than a period is left in which it could.
    """
    time, found = team.setup.time, []
    period = samples_before(team.team.orbits.period, time)
    for hold in team.events.holds:
        after = team.steps_after(hold)
        off = np.abs(ahead[after.start : after.stop, hold.vehicle]) > IN_PHASE_S
        # off at some sample of the period that begins here
        total = np.cumsum(np.concatenate([np.zeros((1, off.shape[1])), off]), axis=0)
        if not team.shows_phase_after(hold):
            found.append(np.full(off.shape[1], np.nan))
            continue
        calm = total[period:] == total[:-period]
        found.append(np.where(calm.any(axis=0), calm.argmax(axis=0) * time, np.nan))
    return np.array(found).reshape(len(found), ahead.shape[-1]).T


# --- the bound along the paths flown --------------------------------------------------------------


@lean
def bound_lanes(
    run: FilterRun,
    squares: Array,
    state_squares: Array,
    counted: Flags,
    along: Array,
    every: int,
    scratch: Scratch,
    lanes: Lanes,
    x: Array,
    P: Array,
) -> None:
    """Add each place's variance, m^2, to `squares` (n, lanes), at steps `counted` (steps + 1, n).

    Those of bias states go to `state_squares` (e, lanes), over the second half of the run. Every
    few steps, from step 0 on, each place's variance goes to `along` (k, n, lanes), if k > 0.

    x and P are the state at the start, and scratch; so are the run's statistics.
    """
    setup, readings, truth = run.setup, run.readings, run.truth
    n, size, width, steps = len(squares), len(P), len(lanes), len(readings.speeds)
    frame, work, compared = scratch
    states, true, sums = setup.states, compared.true, work.sums
    for i in range(n if len(along) else 0):
        for lane in range(width):
            along[0, i, lane] = P[3 * i, 3 * i, lane] + P[3 * i + 1, 3 * i + 1, lane]
    for step in range(1, steps + 1):
        fill_truth(true, truth, step - 1, lanes)
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict(true, P, speeds, turn_rates, setup, step, frame, work.slopes, lanes)
        fill_truth(true, truth, step, lanes)
        x[:] = 0.0
        correct(x, P, step, run, true, OFF, frame, work, lanes)
        kept = len(along) > 0 and step % every == 0
        for i in range(n):
            if counted[step, i] or kept:
                for axis in range(2):
                    work.counts[axis] = 0
                    refer_place(i, axis, 1.0, True, states, frame, work, lanes)
                    spread(P, axis, axis, work, axis, lanes)
                for lane in range(width):
                    here = sums[0, lane] + sums[1, lane]
                    if counted[step, i]:
                        squares[i, lane] += here
                    if kept:
                        along[step // every, i, lane] = here
        if 2 * step > steps:
            for k in range(3 * n, size):
                # a constant is the same in any frame, what changes has decayed since
                left = frame.left[k - 3 * n]
                for lane in range(len(lanes)):
                    state_squares[k - 3 * n, lane] += left * left * P[k, k, lane]
