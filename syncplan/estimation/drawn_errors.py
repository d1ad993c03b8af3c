"""Lasting errors as they are drawn for each trial, by name and as the true states of a layout."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.error_states import ERROR_STATES, ErrorState, StateLayout
from syncplan.orbits.team import Team

LEAST_SCALE = -0.9
"""A vehicle that moves less than a tenth of what it reads is drawn as moving a tenth."""


@dataclass(frozen=True, slots=True)
class DrawnErrors:
    """The errors of trials side by side.

    Attributes
    ----------
    values : by name, of the errors that the team has: (times, n, axes, lanes), where times is 1
        for errors that are constant and steps + 1 for others, and n is 1 for common ones
    """

    values: Mapping[str, Array]

    @classmethod
    def of(cls, team: Team, steps: int, draws: Array) -> "DrawnErrors":
        """Return the errors from standard normal draws (d, lanes), d as by error_draws."""
        lanes, begin, values = draws.shape[1], 0, {}
        for name, state in _present(team).items():
            shape = _shape(state, team.count, steps)
            end = begin + int(np.prod(shape))
            drawn = draws[begin:end].reshape(*shape, lanes)
            sigma = state.sigma(team)[: shape[1]]
            if state.times is not None:
                kept = np.exp(-team.sensors.sample_time / state.times(team))
                drawn = _gauss_markov(drawn, kept[:, None, None])
            values[name] = np.multiply(drawn, sigma[:, None, None], order="C")
            begin = end
        if "speed_scale" in values:
            np.maximum(values["speed_scale"], LEAST_SCALE, out=values["speed_scale"])
        return cls(values)

    def own(self, name: str) -> Array | float:
        """Return each vehicle's, (n, lanes), of an error that is one number; 0 if there is none."""
        return self.values[name][0, :, 0] if name in self.values else 0.0

    def shifts(self, kind: str) -> Array | float:
        """Return what is added to each vehicle's sightings of a kind.

        It broadcasts to (times, n, lanes), times as in `drift`; 0 where there is no such error.
        """
        shifting = [name for name in self.values if ERROR_STATES[name].shifts == kind]
        return sum((self.values[name][:, :, 0] for name in shifting), 0.0)

    def drift(self) -> Array | float:
        """Return the air's velocity at each vehicle, m/s, that broadcasts to (times, n, 2, lanes).

        Times are 1 or steps + 1. Zero where there is neither wind nor gust.
        """
        return sum((self.values[name] for name in ("wind", "gusts") if name in self.values), 0.0)

    def states(self, layout: StateLayout, steps: int, lanes: int) -> tuple[Array, Array]:
        """Return the true constants (c, lanes) of a layout, and (steps + 1, g, lanes) of others."""
        parts: dict[bool, list[Array]] = {True: [], False: []}
        for name in layout.names:
            constant, place = ERROR_STATES[name].constant, layout.columns[name]
            # of a common error, the first vehicle's column is everyone's
            held = (place[:1] if ERROR_STATES[name].common else place) >= 0
            times = 1 if constant else steps + 1
            true = self.values.get(name, np.zeros((1, *held.shape, 1)))
            whole = np.broadcast_to(true, (times, *held.shape, lanes))
            parts[constant].append(whole[:, held])
        return _stacked(parts[True], 1, lanes)[0], _stacked(parts[False], steps + 1, lanes)


def error_draws(team: Team, steps: int) -> int:
    """Return how many standard normal numbers the errors of a trial take."""
    return sum(int(np.prod(_shape(one, team.count, steps))) for one in _present(team).values())


def _present(team: Team) -> dict[str, ErrorState]:
    """The errors that any vehicle of the team has, by name."""
    return {name: one for name, one in ERROR_STATES.items() if np.any(one.sigma(team) > 0.0)}


def _shape(state: ErrorState, count: int, steps: int) -> tuple[int, int, int]:
    return (
        1 if state.constant else steps + 1,
        1 if state.common else count,
        len(state.axes),
    )


def _stacked(parts: list[Array], times: int, lanes: int) -> Array:
    """Parts (times, states, lanes) one after another; there may be none."""
    return np.concatenate([np.zeros((times, 0, lanes)), *parts], axis=1)


def _gauss_markov(draws: Array, decay: Array) -> Array:
    """A stationary process of unit variance along the first axis, of which `decay` is kept."""
    found = np.multiply(draws, np.sqrt(1.0 - decay * decay), order="C")
    found[0] = draws[0]
    rows = found.reshape(len(found), -1)
    decay = np.broadcast_to(decay, found.shape[1:]).ravel()
    left, last = np.empty(rows.shape[1]), rows[0]
    for row in rows[1:]:
        np.multiply(last, decay, out=left)
        np.add(row, left, out=row)
        last = row
    return found
