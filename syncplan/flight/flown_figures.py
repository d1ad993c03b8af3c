"""Figures of trials that have been flown: errors of estimates, and how the plan was kept."""

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.estimation.filter_setup import SAMPLE_EVERY, start_of
from syncplan.estimation.filter_statistics import FilterStatistics, empty_series, empty_statistics
from syncplan.estimation.kernels import lanes_of
from syncplan.flight.bound_along import bound_lanes
from syncplan.flight.flight_measures import kept_meetings, meetings_of, nearest, off_plan
from syncplan.flight.flight_results import FlightFigures
from syncplan.flight.flown_lanes import FlownLanes
from syncplan.flight.flown_team import FlownTeam
from syncplan.orbits.sightings import samples_before

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
    scratch = empty_statistics(width, empty_series(team.size, 0, wanted=False))
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
        side_by_side,
        *start_of(setup, lanes.readings),
    )
    late = team.steps - team.steps // 2
    with np.errstate(invalid="ignore"):
        return (squares / counted.sum(axis=0)[:, None]).T, of_states.T / late


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
