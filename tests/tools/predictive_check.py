"""What a decision of guidance `mpc` breaks, found in NumPy from the decision alone.

Neither the solver nor the kernels take part: flights are flown again from the estimates with the
exact arcs of `predictive_model`'s formula, commands are held against limits one by one.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.guidance.flight_setup import FlightLimits
from syncplan.guidance.predictive_guidance import Decision, PredictiveOptions, Status
from syncplan.orbits.circles import unit


@dataclass(frozen=True, slots=True)
class DecisionCheck:
    """By how much a decision breaks its constraints, the worst of the team; 0 where it does not.

    Attributes
    ----------
    speed, turn_rate : m/s, rad/s beyond limits
    speed_change, turn_rate_change : m/s, rad/s beyond the most change in a step
    place, heading : m, rad between the predicted poses and the commands flown again
    nearest : m, least distance of two decided flights at the steps of the horizon; inf without
    """

    speed: float
    turn_rate: float
    speed_change: float
    turn_rate_change: float
    place: float
    heading: float
    nearest: float


def check_decision(
    decision: Decision,
    step: float,
    poses: Array,
    winds: Array,
    before: Array,
    limits: FlightLimits,
    options: PredictiveOptions,
) -> DecisionCheck:
    """Return what a decision breaks; `step` s is that of the horizon.

    `poses` (n, 3), `winds` (n, 2) and `before` (n, 2) are what was decided from. The first change
    is that from `before` brought within limits. Who is held changes commands as it likes.
    """
    most = np.stack([limits.most_speeds, limits.most_turn_rates], axis=-1)[:, None]
    least = np.stack([limits.least_speeds, -limits.most_turn_rates], axis=-1)[:, None]
    flights = decision.flights
    beyond = np.maximum(np.maximum(flights - most, least - flights), 0.0)
    whole = np.concatenate([np.clip(before[:, None], least, most), flights], axis=1)
    steered = decision.status != Status.HELD
    changed = np.abs(np.diff(whole, axis=1)) - options.change_share * (most - least)
    changed = np.maximum(changed[steered], 0.0)
    flown = _flown(flights, step, poses, winds)
    return DecisionCheck(
        speed=float(beyond[..., 0].max()),
        turn_rate=float(beyond[..., 1].max()),
        speed_change=float(changed[..., 0].max(initial=0.0)),
        turn_rate_change=float(changed[..., 1].max(initial=0.0)),
        place=float(np.hypot(*np.moveaxis(flown - decision.poses, -1, 0)[:2]).max()),
        heading=float(np.abs(flown - decision.poses)[..., 2].max()),
        nearest=_nearest(flown[..., :2]),
    )


def _flown(flights: Array, step: float, poses: Array, winds: Array) -> Array:
    """(n, N + 1, 3) poses along exact arcs, with the wind."""
    turns = step * flights[..., 1]
    headings = poses[:, 2:] + np.cumsum(np.pad(turns, ((0, 0), (1, 0))), axis=1)
    chords = step * flights[..., 0] * np.sinc(0.5 * turns / np.pi)
    ways = chords[..., None] * unit(headings[:, :-1] + 0.5 * turns) + step * winds[:, None]
    places = poses[:, None, :2] + np.cumsum(np.pad(ways, ((0, 0), (1, 0), (0, 0))), axis=1)
    return np.concatenate([places, headings[..., None]], axis=-1)


def _nearest(places: Array) -> float:
    """Least distance in m of two of (n, N + 1, 2) places at one step."""
    a, b = np.triu_indices(len(places), 1)
    return float(np.hypot(*np.moveaxis(places[a] - places[b], -1, 0)).min(initial=np.inf))
