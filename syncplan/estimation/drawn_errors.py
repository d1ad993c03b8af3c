"""Lasting errors drawn for each trial, by name and as the true states of a layout.

In moving air, vehicles keep their circles over ground by heading, airspeed and turn rate. In a
sample the air moves by T (wind + gust), and the vehicle moves over ground along a chord of its
circle, so through the air it moves by

    a_k = p(t_k) - p(t_k-1) - T (wind + gust_k-1)

where gusts are held over a sample, as in the filter. A vehicle that turns evenly by
w_k T = psi_k - psi_k-1 flies along a_k if it heads half-way along b_k, the direction of a_k. No
smooth heading does that exactly at each sample: psi_k = 2 b_k - psi_k-1 would, but oscillates for
ever about a smooth heading. So the heading is interpolated from the directions around it,

    psi_k = (5 (b_k + b_k+1) - (b_k-1 + b_k+2)) / 8
    v_k = |a_k| / (T s(w_k T / 2)),     s(x) = sin(x) / x

With these weights the heading half-way differs from b_k by only a sixteenth of the fourth
difference of the directions. These sum to differences of third order: a filter that knows all
errors and starts right strays by fourth order in T in steady wind. Among gusts it strays by
0.15 v T times the standard deviation of the angle by which a sample's gust turns the direction.
Without wind the directions turn evenly, and headings are tangents of the circle.

Source: the displacement along an arc, as in docs/theory.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, position
from syncplan.orbits.error_states import ERROR_STATES, ErrorState, StateLayout
from syncplan.orbits.team import Team

LEAST_SCALE = -0.9
"""Least speed scale drawn, with which a vehicle moves a tenth of its reading."""


@dataclass(frozen=True, slots=True)
class DrawnErrors:
    """Lasting errors of trials, side by side.

    Attributes
    ----------
    values : by name, the values of each error that the team has: (times, n, axes, lanes), where
        times is 1 for constant errors and steps + 1 for others, and n is 1 for common ones
    """

    values: Mapping[str, Array]

    @classmethod
    def of(cls, team: Team, steps: int, draws: Array) -> "DrawnErrors":
        """Return the errors from standard normal draws (d, lanes), d from error_draws."""
        lanes, begin, values = draws.shape[1], 0, {}
        for name, state in _present(team).items():
            shape = _shape(state, team.count, steps)
            end = begin + int(np.prod(shape))
            drawn = draws[begin:end].reshape(*shape, lanes)
            sigma = state.sigma(team)[: shape[1]]
            if state.times is not None:
                kept = np.exp(-team.sensors.sample_time / state.times(team))
                drawn = _gauss_markov(drawn, kept[:, None, None])
            own = None if state.times is None else drawn
            values[name] = np.multiply(drawn, sigma[:, None, None], out=own, order="C")
            if state.act == "speed":
                np.maximum(values[name], LEAST_SCALE, out=values[name])
            begin = end
        return cls(values)

    def constant(self, act: str) -> Array | float:
        """Return the sum of each vehicle's constant errors with effect `act`; 0 if none.

        Each error has one component. The sum broadcasts to (n, lanes).
        """
        acting = [name for name in self._acting(act) if ERROR_STATES[name].constant]
        return sum((self.values[name][0, :, 0] for name in acting), 0.0)

    def shifts(self, kind: str) -> Array | float:
        """Return the shift of each vehicle's sightings of a kind.

        It broadcasts to (times, n, lanes), times as in `drift`; 0 where there is no such error.
        """
        shifting = [name for name in self.values if ERROR_STATES[name].shifts == kind]
        return sum((self.values[name][:, :, 0] for name in shifting), 0.0)

    def drift(self) -> Array | float:
        """Return the air's velocity at each vehicle in m/s.

        It broadcasts to (times, n, 2, lanes), where times is 1 or steps + 1. Zero where there is
        neither wind nor gust.
        """
        return sum((self.values[name] for name in self._acting("drift")), 0.0)

    def _acting(self, act: str) -> list[str]:
        return [name for name in self.values if ERROR_STATES[name].act == act]

    def states(self, layout: StateLayout, steps: int, lanes: int) -> tuple[Array, Array]:
        """Return a layout's true constants (c, lanes), and other states (steps + 1, g, lanes)."""
        parts: dict[bool, list[Array]] = {True: [], False: []}
        for name in layout.names:
            constant, place = ERROR_STATES[name].constant, layout.columns[name]
            # all vehicles have the same column of a common error
            held = (place[:1] if ERROR_STATES[name].common else place) >= 0
            times = 1 if constant else steps + 1
            true = self.values.get(name, np.zeros((1, *held.shape, 1)))
            shape = times, *held.shape, lanes
            whole = true if true.shape == shape else np.broadcast_to(true, shape)
            own = whole.reshape(times, -1, lanes) if held.all() else whole[:, held]
            parts[constant].append(own)
        return _stacked(parts[True], 1, lanes)[0], _stacked(parts[False], steps + 1, lanes)


def error_draws(team: Team, steps: int) -> int:
    """Return the number of standard normal draws for the errors of a trial."""
    return sum(int(np.prod(_shape(one, team.count, steps))) for one in _present(team).values())


def _present(team: Team) -> dict[str, ErrorState]:
    """The errors that any vehicle of the team has, by name."""
    return {name: one for name, one in ERROR_STATES.items() if np.any(one.sigma(team) > 0.0)}


def _shape(state: ErrorState, count: int, steps: int) -> tuple[int, int, int]:
    return (1 if state.constant else steps + 1, 1 if state.common else count, len(state.axes))


def _stacked(parts: list[Array], times: int, lanes: int) -> Array:
    """Concatenate parts (times, states, lanes) along the states; there may be none."""
    if len(parts) == 1 and len(parts[0]) == times:
        return np.ascontiguousarray(parts[0])
    return np.concatenate([np.zeros((times, 0, lanes)), *parts], axis=1)


def _gauss_markov(draws: Array, decay: Array) -> Array:
    """Return a stationary process of unit variance along the first axis; a step keeps `decay`."""
    from syncplan.estimation.air_kernels import correlate

    found = np.multiply(draws, np.sqrt(1.0 - decay * decay), order="C")
    found[0] = draws[0]
    decays = np.broadcast_to(decay, found.shape[1:]).ravel()
    correlate(found.reshape(len(found), -1), decays)
    return found


# --- motion in moving air -------------------------------------------------------------------------


AT_ONCE = 64
"""Samples processed at once, so that their data stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class AirMotion:
    """Motion of vehicles through the air, a lane for each trial.

    Attributes
    ----------
    headings : (steps + 1, n, lanes) rad, continuous
    speeds : (steps, n, lanes) m/s, through the air
    turn_rates : (steps, n, lanes) rad/s
    """

    headings: Array
    speeds: Array
    turn_rates: Array


def motion_in_air(orbits: Orbits, time: float, steps: int, drift: Array) -> AirMotion:
    """Return the motion that keeps vehicles on their circles for `steps` samples of `time` s.

    `drift` is the air's velocity in m/s, (1 or steps + 1, n or 1, 2, lanes), held from each sample
    to the next.
    """
    from syncplan.estimation.air_kernels import steer, turn_by_series

    # moved[k + 1] is the displacement in sample k; two samples before and after are needed
    moved = np.diff(position(orbits, time * np.arange(-2, steps + 3)), axis=0)
    shape = steps, orbits.count, drift.shape[-1]
    flown = AirMotion(np.empty((steps + 1, *shape[1:])), np.empty(shape), np.empty(shape))
    room = np.empty((5, min(AT_ONCE, steps) + 4, *shape[1:]))
    for begin in range(0, steps, AT_ONCE):
        own = slice(begin, min(begin + AT_ONCE, steps))
        work = room[:, : own.stop - begin + 4]
        x, y, across, along, turns = work
        if not turn_by_series(moved, drift, time, begin, work):
            np.arctan2(across[:-1], along[:-1], out=turns[:-1])
        if begin == 0:
            flown.headings[0] = np.arctan2(y[1], x[1])
            flown.headings[0] += 0.125 * (4.0 * turns[1] - turns[2] + turns[0])
        speeds, steady, ahead = flown.speeds[own], flown.turn_rates[own], flown.headings[1:][own]
        if not steer(work, time, flown.headings[begin], ahead, speeds, steady):
            np.sqrt(x[2:-2] * x[2:-2] + y[2:-2] * y[2:-2], out=speeds)
            speeds /= time * np.sinc(steady / (2.0 * np.pi))
        steady /= time
    return flown
