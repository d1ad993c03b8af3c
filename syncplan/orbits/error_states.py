"""Lasting errors: wind, gusts, scales and biases, and their effects on a vehicle.

Noise is new at each sample; these errors persist, so a filter can estimate them as further states
beside the poses. With s = t - t0, p the place along the circle, phi the phase, d the sense, omega
the rate, R the radius, u(phi) = (cos phi, sin phi) and J a quarter turn counter-clockwise, a unit
of a constant error moves the vehicle by

    wind             (common)  dp = s w
    speed_scale      (each)    dp = p(t) - p(t0)
    turn_rate_bias   (each)    dpsi = s
                               dp = J (s R u(phi(t)) - R / (d omega) [sin phi(t) - sin phi(t0),
                                                                      cos phi(t0) - cos phi(t)])
    bearing_bias     (each)    nothing, but adds 1 to each bearing of its observer
    clock_offset     (each)    nothing, but adds dz/dt to each sighting z of its observer

The others are first-order Gauss-Markov processes, one for each vehicle: after s they keep
exp(-s / T) of their value, with T the correlation time. They have no column here; filter and
posterior bound propagate them from sample to sample:

    gusts            (each)    dp grows by Ts times the gust at each sample
    bearing_walk     (each)    nothing, but adds 1 to each bearing of its observer

With a speed scale c, a vehicle moves 1 + c times its reading. With a bias b, it turns b faster than
its reading. A bearing bias or walk makes bearings too large by its value. With a clock offset,
sightings stamped t were taken that much later: the observer has moved on by its velocity and turned
by its rate, and each target has moved on by its own velocity.

Source: integration of the unicycle model along a circle, differentiated.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import Orbits, perpendicular, unit
from syncplan.orbits.team import Team


@dataclass(frozen=True, slots=True)
class ErrorState:
    """Lasting error that can be a state of the filter.

    Attributes
    ----------
    unit : in words
    axes : names of its components; one empty name for a scalar
    common : whether one value holds for all vehicles
    sigma : of a team, the standard deviation for each vehicle, (n,)
    act : its effect: a share added to the "speed", a "turn" rate, a "drift" of the air, a "shift"
        of readings, or a "delay" of stamps
    moves : of orbits, vehicles (s,) and times (s,) s, the displacement of the vehicles by then for
        a unit of each component: (axes, 3, s) m, m, rad
    shifts : name of the kind of sighting whose values it is added to; empty if none
    times : of a team, the correlation time for each vehicle in s, (n,); None for a constant
    """

    unit: str
    axes: tuple[str, ...]
    common: bool
    act: str
    sigma: Callable[[Team], Array]
    moves: Callable[[Orbits, Index, Array], Array]
    shifts: str = ""
    times: Callable[[Team], Array] | None = None

    @property
    def constant(self) -> bool:
        """Whether it stays the same through a run."""
        return self.times is None

    @property
    def drifts(self) -> bool:
        """Whether it changes, and moves the place by Ts times its value at each sample."""
        return self.act == "drift" and not self.constant

    @property
    def delays(self) -> bool:
        """Whether it is added to the time of sightings."""
        return self.act == "delay"


@dataclass(frozen=True, slots=True)
class StateLayout:
    """Layout of a team's states: 3 n of poses, then those of the named errors.

    Attributes
    ----------
    names : of the errors, constants first, otherwise in the order of ERROR_STATES
    columns : by name, the column (n, axes) of each vehicle's error, the same for all where it is
        common; -1 where a vehicle has none
    sigmas : (size - 3 n,) standard deviation of each further state
    times : (size - 3 n,) s, correlation time of each; infinite for constants
    """

    names: tuple[str, ...]
    columns: Mapping[str, Index]
    sigmas: Array
    times: Array
    count: int

    @property
    def size(self) -> int:
        """Number of states."""
        return 3 * self.count + len(self.sigmas)

    @property
    def first_changing(self) -> int:
        """Column of the first state that is not constant; all from there on change."""
        changing = [
            columns[columns >= 0].min()
            for name, columns in self.columns.items()
            if not ERROR_STATES[name].constant
        ]
        return int(min(changing, default=self.size))

    @property
    def units(self) -> list[str]:
        """Unit of each further state, in words."""
        found = [""] * len(self.sigmas)
        for name, columns in self.columns.items():
            for column in columns[columns >= 0].tolist():
                found[column - 3 * self.count] = ERROR_STATES[name].unit
        return found

    def labels(self, vehicles: Sequence[str]) -> list[str]:
        """Return a label of each further state: `wind x`, `speed scale of v1`."""
        texts = [""] * len(self.sigmas)
        for name in self.names:
            state = ERROR_STATES[name]
            for vehicle, row in zip(vehicles, self.columns[name], strict=True):
                for axis, column in zip(state.axes, row.tolist(), strict=True):
                    words = " ".join(filter(None, [name.replace("_", " "), axis]))
                    if column >= 0:
                        whose = "" if state.common else f" of {vehicle}"
                        texts[column - 3 * self.count] = words + whose
        return texts


def layout_of(
    team: Team, names: Sequence[str] | None = None, *, filtered: Team | None = None
) -> StateLayout:
    """Return the layout of a team's states, with the errors that its filter estimates.

    `names` gives other errors as states; those without a sigma are left out. Constants that the
    filter of the team `filtered` estimates have the sigmas that it assumes.
    """
    wanted = team.errors.estimated if names is None else names
    count = team.orbits.count
    columns: dict[str, Index] = {}
    sigmas: list[float] = []
    times: list[float] = []
    # constants first: changing states are propagated together
    for name, state in sorted(ERROR_STATES.items(), key=lambda item: not item[1].constant):
        sigma = state.sigma(team)
        if filtered is not None and state.constant and name in filtered.errors.estimated:
            own = state.sigma(filtered)
            sigma = np.where(own > 0.0, own, sigma)
        if name not in wanted or not np.any(sigma > 0.0):
            continue
        has = np.ones(1, dtype=bool) if state.common else sigma > 0.0
        axes, begin = len(state.axes), 3 * count + len(sigmas)
        place = np.full((len(has), axes), -1, dtype=np.int64)
        place[has] = begin + np.arange(int(has.sum()) * axes).reshape(-1, axes)
        columns[name] = np.repeat(place, count, axis=0) if state.common else place
        sigmas += np.repeat(sigma[:1] if state.common else sigma[has], axes).tolist()
        each = np.full(count, np.inf) if state.times is None else state.times(team)
        times += np.repeat(each[:1] if state.common else each[has], axes).tolist()
    return StateLayout(
        tuple(columns), MappingProxyType(columns), np.array(sigmas), np.array(times), count
    )


def _wind(orbits: Orbits, vehicles: Index, times: Array) -> Array:
    moves = np.zeros((2, 3, len(times)))
    moves[0, 0] = moves[1, 1] = times
    return moves


def _speed_scale(orbits: Orbits, vehicles: Index, times: Array) -> Array:
    begin, now = _arms(orbits, vehicles, times)
    moves = np.zeros((1, 3, len(times)))
    moves[0, :2] = (now - begin).T
    return moves


def _turn_rate_bias(orbits: Orbits, vehicles: Index, times: Array) -> Array:
    begin, now = _arms(orbits, vehicles, times)
    rate = (orbits.senses[vehicles] * orbits.rate)[:, None]
    # the arms a quarter turn clockwise are (sin, -cos) of the phases
    passed = -perpendicular(now - begin) / rate
    moves = np.zeros((1, 3, len(times)))
    moves[0, :2] = perpendicular(times[:, None] * now - passed).T
    moves[0, 2] = times
    return moves


def _still(orbits: Orbits, vehicles: Index, times: Array) -> Array:
    return np.zeros((1, 3, len(times)))


def _no_closed_form(orbits: Orbits, vehicles: Index, times: Array) -> Array:
    raise TypeError("gusts are carried from sample to sample; they have no closed form")


def _arms(orbits: Orbits, vehicles: Index, times: Array) -> tuple[Array, Array]:
    """(s, 2) m from the centre to the vehicle, at time 0 and at each of the times."""
    radii, phases = orbits.radii[vehicles][:, None], orbits.phases[vehicles]
    turned = phases + orbits.senses[vehicles] * orbits.rate * times
    return radii * unit(phases), radii * unit(turned)


def _same(name: str) -> Callable[[Team], Array]:
    def sigma(team: Team) -> Array:
        return np.full(team.orbits.count, float(team.errors.of(name)))

    return sigma


_PLANE = ("x", "y")

ERROR_STATES: Mapping[str, ErrorState] = MappingProxyType(
    {
        "wind": ErrorState("m/s", _PLANE, True, "drift", _same("wind"), _wind),
        "speed_scale": ErrorState("1", ("",), False, "speed", _same("speed_scale"), _speed_scale),
        "turn_rate_bias": ErrorState(
            "rad/s", ("",), False, "turn", _same("turn_rate_bias"), _turn_rate_bias
        ),
        "bearing_bias": ErrorState(
            "rad",
            ("",),
            False,
            "shift",
            lambda team: team.sensors.bearing_bias_sigmas,
            _still,
            shifts="bearing",
        ),
        "gusts": ErrorState(
            "m/s",
            _PLANE,
            False,
            "drift",
            _same("gusts"),
            _no_closed_form,
            times=lambda team: np.full(team.orbits.count, team.errors.gust_time),
        ),
        "bearing_walk": ErrorState(
            "rad",
            ("",),
            False,
            "shift",
            lambda team: team.sensors.bearing_walk_sigmas,
            _still,
            shifts="bearing",
            times=lambda team: team.sensors.bearing_walk_times,
        ),
        "clock_offset": ErrorState("s", ("",), False, "delay", _same("clock_offset"), _still),
    }
)
"""Lasting errors by name, in the order in which trials draw them. Layouts put constants first."""
