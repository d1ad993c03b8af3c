"""How errors and poses go on together from one moment to another, h seconds later:

    x <- F x,    place by heading           J (p(t + h) - p(t))
                 place by wind              h
                 place by speed scale       p(t + h) - p(t)
                 heading by turn-rate bias  h
                 place by turn-rate bias    h J R u(phi(t + h)) - (p(t + h) - p(t)) / (d omega)
                 place by gusts             Ts (1 - a^M) / (1 - a)
                 gusts, bearing walk        a^M of themselves,  a = exp(-Ts / correlation time)

with M samples in h seconds. Few entries of F depend on the circles. As factors of rows they are
cheap to apply and to differentiate.

Sources
-------
moves of constant errors : syncplan.orbits.error_states
gusts : sums of geometric series over the samples of a step
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.refinement.problem import RefineProblem

_Entry = tuple[int, int, int, float]
"""Row, column, which value it takes, factor."""


@dataclass(frozen=True, slots=True)
class Passage:
    """How the state of m errors goes on for some seconds, its positions scaled.

    Attributes
    ----------
    steady : (m, m) what of F is the same for all circles
    by_place : (q, 4 n) the entries that vary, by how far each vehicle goes, (2 n,), and where it
        then is from its centre, (2 n,)
    taken, given : (q, m), (m, q) 1 at the column, and at the row, of each of these entries
    noise : (m, m) of gusts and walks that come up on the way
    """

    steady: ca.DM
    by_place: ca.DM
    taken: ca.DM
    given: ca.DM
    noise: ca.DM

    @classmethod
    def of(cls, problem: RefineProblem, layout: StateLayout, seconds: float) -> "Passage":
        """Return the passage of `seconds` s."""
        count, span = layout.count, _Span.of(problem, seconds)
        steady = np.zeros((layout.size, layout.size))
        varying: dict[tuple[int, int], Array] = {}
        for row, column, value, size in _entries(layout, span):
            if value == 4 * count:
                steady[row, column] += size
            else:
                varying.setdefault((row, column), np.zeros(4 * count))[value] += size
        rows, columns = np.array([*varying]).T
        unit = np.eye(layout.size)
        return cls(
            steady=_sparse(steady),
            by_place=_sparse(np.array([*varying.values()])),
            taken=_sparse(unit[columns]),
            given=_sparse(unit[:, rows]),
            noise=_sparse(_noise(layout, span)),
        )

    def moved(self, after: ca.MX, before: ca.MX) -> ca.MX:
        """Return (q, k) the entries that vary, for arms (2 n, k) before and after."""
        return self.by_place @ ca.vertcat(after - before, after)

    def onward(self, matrix: ca.MX, moved: ca.MX) -> ca.MX:
        """Return F times a matrix (m, c)."""
        varying = ca.repmat(moved, 1, matrix.size2()) * (self.taken @ matrix)
        return ca.densify(self.steady @ matrix + self.given @ varying)

    def back(self, matrix: ca.MX, moved: ca.MX) -> ca.MX:
        """Return F's transpose times a matrix (m, c)."""
        varying = ca.repmat(moved, 1, matrix.size2()) * (self.given.T @ matrix)
        return ca.densify(self.steady.T @ matrix + self.taken.T @ varying)

    def carried(self, covariance: ca.MX, moved: ca.MX) -> ca.MX:
        """Return (m, m) the covariance at the end."""
        return self.onward(self.onward(covariance, moved).T, moved) + self.noise

    def carried_slopes(
        self, covariance: ca.MX, moved: ca.MX, weights: ca.MX
    ) -> tuple[ca.MX, ca.MX]:
        """Return how much `weights` (m, m), symmetric, times `carried` grow.

        By the covariance, (m, m), and by the entries that vary, (q, 1).
        """
        by_covariance = self.back(self.back(weights, moved).T, moved)
        columns = self.taken @ self.onward(covariance, moved).T
        return by_covariance, 2.0 * ca.sum2((self.given.T @ weights) * columns)


def _sparse(matrix: Array) -> ca.DM:
    return ca.sparsify(ca.DM(matrix))


@dataclass(frozen=True, slots=True)
class _Span:
    """How long a passage takes, and what it does to gusts.

    Attributes
    ----------
    seconds, samples, sample_time : s, how many samples that is, and s of one
    scale : m, of positions
    rate : (n,) rad/s, of each vehicle's phase
    push : s, how far a gust moves a vehicle that it had at the beginning
    spread, joint : s^2, s: variance of how far later gusts move it, and its covariance with the
        gust left at the end, for gusts of variance 1
    """

    seconds: float
    samples: float
    sample_time: float
    scale: float
    rate: Array
    push: float
    spread: float
    joint: float

    @classmethod
    def of(cls, problem: RefineProblem, seconds: float) -> "_Span":
        """Return what `seconds` s do in a problem."""
        orbits, sample_time = problem.orbits, problem.sensors.sample_time
        kept_each = float(np.exp(-sample_time / problem.team.errors.gust_time))
        samples = seconds / sample_time
        kept = kept_each**samples
        once, twice = (1.0 - kept) / (1.0 - kept_each), (1.0 - kept**2) / (1.0 - kept_each**2)
        # within one sample later gusts move nothing yet
        later = 1.0 if samples > 1.0 else 0.0
        fresh_each = 1.0 - kept_each**2
        spread = fresh_each * (samples - 2.0 * once + twice) / (1.0 - kept_each) ** 2
        return cls(
            seconds=seconds,
            samples=samples,
            sample_time=sample_time,
            scale=problem.scale,
            rate=orbits.senses * orbits.rate,
            push=sample_time * once,
            spread=later * sample_time**2 * spread,
            joint=later * sample_time * fresh_each * (once - twice) / (1.0 - kept_each),
        )

    def kept(self, time: float) -> float:
        """Return the share that is left of an error with a correlation time in s."""
        return float(float(np.exp(-self.sample_time / time)) ** self.samples)


@dataclass(frozen=True, slots=True)
class _Own:
    """The state of one vehicle, and the values that F is made of.

    Attributes
    ----------
    x, y, heading : rows of its pose
    gone, arm : which values are x and y of how far it goes, and of where it then is
    one : which value is 1
    rate : rad/s of its phase
    """

    x: int
    y: int
    heading: int
    gone: tuple[int, int]
    arm: tuple[int, int]
    one: int
    rate: float

    @classmethod
    def of(cls, vehicle: int, count: int, span: _Span) -> "_Own":
        """Return those of one of `count` vehicles."""
        first, second = 2 * vehicle, 2 * count + 2 * vehicle
        return cls(
            x=3 * vehicle,
            y=3 * vehicle + 1,
            heading=3 * vehicle + 2,
            gone=(first, first + 1),
            arm=(second, second + 1),
            one=4 * count,
            rate=float(span.rate[vehicle]),
        )


def _by_wind(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    far = span.seconds / span.scale
    return [(own.x, columns[0], own.one, far), (own.y, columns[1], own.one, far)]


def _by_speed_scale(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    return [(own.x, columns[0], own.gone[0], 1.0), (own.y, columns[0], own.gone[1], 1.0)]


def _by_turn_rate_bias(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    (column,) = columns
    return [
        (own.x, column, own.arm[1], -span.seconds),
        (own.x, column, own.gone[0], -1.0 / own.rate),
        (own.y, column, own.arm[0], span.seconds),
        (own.y, column, own.gone[1], -1.0 / own.rate),
        (own.heading, column, own.one, span.seconds),
    ]


def _by_nothing(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    return []


def _by_gusts(own: _Own, span: _Span, columns: list[int]) -> list[_Entry]:
    entries = []
    for row, column in zip((own.x, own.y), columns, strict=True):
        entries.append((row, column, own.one, span.push / span.scale))
    return entries


_MOVES = {
    "wind": _by_wind,
    "speed_scale": _by_speed_scale,
    "turn_rate_bias": _by_turn_rate_bias,
    "bearing_bias": _by_nothing,
    "gusts": _by_gusts,
    "bearing_walk": _by_nothing,
}
"""What a unit of each error in ERROR_STATES adds to F, but for clock offsets: they are left out."""


def _entries(layout: StateLayout, span: _Span) -> list[_Entry]:
    """The entries of F; those of one place add up."""
    count = layout.count
    entries: list[_Entry] = [(k, k, 4 * count, 1.0) for k in range(layout.size)]
    for vehicle in range(count):
        own = _Own.of(vehicle, count, span)
        entries += [(own.x, own.heading, own.gone[1], -1.0)]
        entries += [(own.y, own.heading, own.gone[0], 1.0)]
        for name in layout.names:
            columns = layout.columns[name][vehicle]
            if np.all(columns >= 0):
                for row, column, value, size in _MOVES[name](own, span, columns.tolist()):
                    unit = 1.0 if row == column else layout.sigmas[column - 3 * count]
                    entries.append((row, column, value, size * unit))
    for column in range(layout.first_changing, layout.size):
        left = span.kept(float(layout.times[column - 3 * count]))
        entries.append((column, column, 4 * count, left - 1.0))
    return entries


def _noise(layout: StateLayout, span: _Span) -> Array:
    """(m, m) what errors that come up on the way add."""
    noise = np.zeros((layout.size, layout.size))
    for column in range(layout.first_changing, layout.size):
        left = span.kept(float(layout.times[column - 3 * layout.count]))
        noise[column, column] = 1.0 - left**2
    for name in layout.names:
        if not ERROR_STATES[name].drifts:
            continue
        for vehicle, columns in enumerate(layout.columns[name].tolist()):
            for axis, column in enumerate(columns):
                row, far = 3 * vehicle + axis, layout.sigmas[column - 3 * layout.count] / span.scale
                noise[row, row] += far**2 * span.spread
                noise[row, column] = noise[column, row] = far * span.joint
    return noise
