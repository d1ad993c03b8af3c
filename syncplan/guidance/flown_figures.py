"""Figures of flown trials: errors of estimates, and adherence to the plan.

The posterior Cramer-Rao bound is along the true paths of vehicles, with their true sightings. It is
the covariance of the filter's state, with F, G and rows of sightings at the truth: that of the
ideal filter of `lane_filter`. Each trial has its own, as paths and sightings differ. A false
sighting counts here as a true one.

While P is in an earlier frame, the variance of a present place is h' P h, with h the row of that
place in the earlier frame: `correction_kernels.refer_place`.

Source: Tichavsky, Muravchik, Nehorai (1998), Posterior Cramer-Rao bounds for discrete-time
nonlinear filtering; Taylor (1979).

Two bodies with contact windows in either direction have one planned meeting a period. It is kept if
one sights the other within half a period of the middle of the longest window.
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
from syncplan.guidance.flight_results import FlightFigures
from syncplan.guidance.flown_lanes import FlownLanes
from syncplan.guidance.flown_team import FlownTeam
from syncplan.orbits.circles import Orbits, phase, position, wrap
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sightings import samples_before

# --- meetings, distances and figures --------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Meetings:
    """Planned meetings of a run.

    Attributes
    ----------
    pairs : (p, 2) bodies, the first a vehicle; those from n on are landmarks
    first_end : (p,) step at which the first meeting is over
    times : (p,) number of meetings with a whole period about them in the run
    period : steps in a period, not rounded
    """

    pairs: Index
    first_end: Array
    times: Index
    period: float


@dataclass(frozen=True, slots=True)
class Nearest:
    """Closest approach of any two vehicles in each trial.

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
    """Return the planned meetings in a run of `steps` steps."""
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
    # a meeting begins half a period before its middle; the first lies wholly in the run
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
    """Return the number of each pair's meetings that were kept (p, lanes) and planned (p,).

    Meetings not over when one of the two is lost, at step `gone` (n + m,), do not count.
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
    """Return the distance from the plan in m and the lead on it in s, each (steps + 1, n, lanes).

    `path` is (steps + 1, n, 3, lanes), at steps of `time` s. The lead is by the angle about the
    centre, within half a period.
    """
    times = time * np.arange(len(path))
    off = path[:, :, :2] - position(orbits, times)[..., None]
    arm = path[:, :, :2] - orbits.centers[:, :, None]
    turned = np.arctan2(arm[:, :, 1], arm[:, :, 0]) - phase(orbits, times)[..., None]
    ahead = wrap(turned) * (orbits.senses / orbits.rate)[:, None]
    return np.hypot(off[:, :, 0], off[:, :, 1]), ahead


def nearest(path: Array, there: Flags) -> Nearest:
    """Return the closest approach of two vehicles on paths (steps + 1, n, 3, lanes).

    `there` (steps + 1, n) marks the vehicles that count.
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
"""Largest phase error, over a period, of a vehicle that has regained its phase after a hold."""


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
    # for a lost vehicle, the time until its loss counts
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
        # the speed on its circle for a vehicle that is held throughout
        slowest=np.where(np.isinf(flown.slowest), orbits.speeds[:, None], flown.slowest).T,
        fastest=np.where(np.isinf(flown.slowest), orbits.speeds[:, None], flown.fastest).T,
        saturated=(flown.saturated / steered).T,
        sought=(flown.sought / steered).T,
        refused=_refused(lanes),
        sightings=np.isfinite(sightings).sum(axis=0),
        settled=_settled(team, ahead),
    )


def without_gone(team: FlownTeam, lanes: FlownLanes) -> FilterStatistics:
    """Return the statistics, with those of lost vehicles over the time before their loss.

    In the sums, lost vehicles have errors of zero, and means are over all samples.
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
    """(lanes, n) share of refused decisions; zero where none are made."""
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
    """Mean variances of the bound, second half: places (lanes, n) m^2 and bias states (lanes, e).

    Also fills in the records' bounds over time.
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
    """Compile the bound along paths of n vehicles, by a run of no steps."""
    run, scratch, lanes, *state, _, _ = specimen(n)
    squares, of_states, along = np.zeros((n, 1)), np.zeros((0, 1)), np.zeros((0, n, 1))
    counted = np.zeros((1, n), dtype=bool)
    bound_lanes(run, squares, of_states, counted, along, 1, scratch, lanes, *state)


def _settled(team: FlownTeam, ahead: Array) -> Array:
    """(lanes, h) s from the end of each hold until the vehicle keeps its phase for a period.

    NaN where it never does, or where less than a period is left.
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

    Variances of bias states are added to `state_squares` (e, lanes), over the second half of the
    run. If k > 0, each place's variance is written to `along` (k, n, lanes) every `every` steps,
    from step 0 on.

    x and P are the state at the start, and then scratch, as are the run's statistics.
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
                # a constant is the same in any frame; a changing state has decayed since
                left = frame.left[k - 3 * n]
                for lane in range(len(lanes)):
                    state_squares[k - 3 * n, lane] += left * left * P[k, k, lane]
