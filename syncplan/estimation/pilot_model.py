"""Model of the pilot in plain NumPy: arcs, rows of sightings and their second-order noise.

Errors are referred to time 0, so prediction only adds noise. Let D be a vehicle's displacement
since then as predicted, without corrections, and J a quarter turn counter-clockwise. An error of
position and heading (a, psi) at time 0 later becomes

    (a + J D psi, psi)

which is the product of the filter's own transitions, in closed form. Leading axes are trials, or
trials and samples.

The filter, extended or second-order, processes all sightings of an instant at once, all trials
side by side. Second-order noise adds to each sighting's variance that of the terms which
linearisation omits: `second_order`.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3 (extended Kalman filter).
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.pilot_readings import PilotReadings
from syncplan.orbits.sighting_kinds import (
    ACROSS,
    ALONG,
    BEARING,
    SIGHTING_KINDS,
    place_of,
    turns_by_kind,
)
from syncplan.orbits.team import Team

_BEARINGS = place_of(BEARING)

_ANGLES = np.array([kind.unit == "rad" for kind in SIGHTING_KINDS.values()])
"""Whether sightings of each kind are angles, equal up to whole turns."""

_TURNED = np.array([-1.0, 1.0])
"""Signs that make a quarter turn counter-clockwise of swapped coordinates."""


NEAREST_SQUARE = 1e-12
"""Least squared distance in m^2, which keeps variances finite."""


@dataclass(frozen=True, slots=True)
class Arcs:
    """Displacements of vehicles in a sample, along arcs, by their readings; (..., n, 2) each.

    Attributes
    ----------
    moved, left : m, the displacement, and the same turned a quarter turn counter-clockwise
    by_speed : s, derivative of `moved` by the speed
    by_turn : m s, derivative by the turn rate
    """

    moved: Array
    left: Array
    by_speed: Array
    by_turn: Array

    def gains(self, team: Team, gone: Array) -> Array:
        """Return (..., n, 3, 2) errors at time 0 for one standard deviation of each reading.

        `gone` (..., n, 2) m is J D after the sample.
        """
        time, noise = team.sensors.sample_time, team.noise
        found = np.zeros((*gone.shape[:-1], 3, 2))
        found[..., :2, 0] = noise.speed_sigma * self.by_speed
        found[..., :2, 1] = noise.turn_rate_sigma * (self.by_turn - time * gone)
        found[..., 2, 1] = noise.turn_rate_sigma * time
        return found


def arcs_of(speeds: Array, turn_rates: Array, headings: Array, time: float) -> Arcs:
    """Return arcs of `time` s from headings (..., n) rad, by readings (..., n)."""
    half = 0.5 * time * turn_rates
    chord = (time * np.sinc(half / np.pi))[..., None]
    middle = headings + half
    ahead = np.stack([np.cos(middle), np.sin(middle)], axis=-1)
    moved = speeds[..., None] * chord * ahead
    left = moved[..., ::-1] * _TURNED
    # the chord turns half as far as the heading, and shortens: sinc' = -h/3 + h^3/30 ...
    shorter = 0.5 * time * speeds * (half * half * half / 30.0 - half / 3.0)
    by_turn = time * (0.5 * left + shorter[..., None] * ahead)
    return Arcs(moved, left, chord * ahead, by_turn)


@dataclass(frozen=True, slots=True)
class Seen:
    """Geometry of m sightings of n vehicles in each of the trials.

    Attributes
    ----------
    count : n
    kinds, observers, targets : (m,) all landmarks have number n
    q : (trials, m, 2) m, position of the target relative to the observer
    headings : (trials, m) rad, of the observer
    here, there : (trials, m, 2) m, J D of the observer and of the target; 0 for a landmark
    """

    count: int
    kinds: Index
    observers: Index
    targets: Index
    q: Array
    headings: Array
    here: Array
    there: Array

    @classmethod
    def of(
        cls,
        run: PilotReadings,
        sightings: slice,
        places: Array,
        headings: Array,
        gone: Array,
        steps: Index | None = None,
    ) -> "Seen":
        """Return the geometry of a run's `sightings`, seen from estimates.

        `places` (trials, n + m, 2) m, `headings` (trials, n) rad and `gone` (trials, n + 1, 2) m
        are of one sample. If `steps` (m,) is given, they have an axis of samples after the first,
        which it indexes.
        """
        seen, n = run.sightings, run.team.count
        observers, targets = seen.observers[sightings], seen.targets[sightings]
        moving = np.minimum(targets, n)
        at: tuple[slice | Index, ...] = (slice(None),) if steps is None else (slice(None), steps)
        return cls(
            count=n,
            kinds=seen.kinds[sightings],
            observers=observers,
            targets=moving,
            q=places[(*at, targets)] - places[(*at, observers)],
            headings=headings[(*at, observers)],
            here=gone[(*at, observers)],
            there=gone[(*at, moving)],
        )

    def innovation(self, measured: Array) -> Array:
        """Return the innovations (trials, m), with angles within half a turn."""
        off = measured - self._expected()
        turns = 2.0 * np.pi * np.floor((off + np.pi) / (2.0 * np.pi))
        return np.asarray(off - np.where(_ANGLES[self.kinds], turns, 0.0))

    def rows(self) -> Array:
        """Return rows (trials, m, 3 n): derivatives of the sightings by errors at time 0."""
        return self._rows(self._slopes(), turns_by_kind(self.kinds))

    def second_order(self, P: Array) -> Array:
        """Return the variance (trials, m) of the second-order terms, which the rows omit.

        P (trials, 3 n, 3 n) is the covariance of errors at time 0.
        """
        squared = np.maximum(np.sum(self.q**2, axis=-1), NEAREST_SQUARE)
        along = self.q / squared[..., None]
        ways = self._rows(np.stack([along, along[..., ::-1] * _TURNED], axis=1), 0.0)
        reduced = (ways.reshape(len(P), -1, P.shape[-1]) @ P).reshape(ways.shape)
        aa, bb = np.moveaxis(np.einsum("lwmj,lwmj->lwm", ways, reduced), 1, 0)
        ab = np.einsum("lmj,lmj->lm", ways[:, 0], reduced[:, 1])
        pairs = {(ALONG, ACROSS): (aa, bb, ab), (ACROSS, ACROSS): (bb, bb, bb)}
        found = np.zeros(self.headings.shape)
        for place, kind in enumerate(SIGHTING_KINDS.values()):
            term, own = kind.second_order, np.flatnonzero(self.kinds == place)
            if term is not None and len(own):
                one, other, both = (each[:, own] for each in pairs[term.ways])
                size = term.size(np.sqrt(squared[:, own]))
                found[:, own] = (one * other + both * both) * size * size
        return found

    def _rows(self, slopes: Array, turned: Array | float) -> Array:
        """Rows (trials, ..., m, 3 n) from dz / dq (trials, ..., m, 2) and dz / dpsi (m,)."""
        found = np.zeros((*slopes.shape[:-1], self.count + 1, 3))
        each = np.arange(len(self.kinds))
        for end, vehicles, gone, turn in (
            (slopes, self.targets, self.there, 0.0),
            (-slopes, self.observers, self.here, turned),
        ):
            way = gone if slopes.ndim == 3 else gone[:, None]
            found[..., each, vehicles, :2] = end
            found[..., each, vehicles, 2] = np.einsum("...i,...i->...", end, way) + turn
        return found.reshape(*slopes.shape[:-1], -1)[..., : 3 * self.count]

    def _expected(self) -> Array:
        if np.all(self.kinds == _BEARINGS):
            return np.asarray(np.arctan2(self.q[..., 1], self.q[..., 0]) - self.headings)
        found = np.empty(self.headings.shape)
        for place, kind in enumerate(SIGHTING_KINDS.values()):
            own = np.flatnonzero(self.kinds == place)
            found[:, own] = kind.measured(np.moveaxis(self.q[:, own], -1, 0), self.headings[:, own])
        return found

    def _slopes(self) -> Array:
        found = np.empty(self.q.shape)
        for place, kind in enumerate(SIGHTING_KINDS.values()):
            own = np.flatnonzero(self.kinds == place)
            if not len(own):
                continue
            away = np.moveaxis(self.q[:, own], -1, 0)
            found[:, own] = np.moveaxis(kind.slopes(away, np.ones(away.shape[1:])), 0, -1)
        return found


def solved(matrices: Array, sides: Array) -> Array:
    """Return the solutions of a batch of linear systems; NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, sides), dtype=np.float64)
    except np.linalg.LinAlgError:
        found = np.full_like(sides, np.nan)
        for lane, (matrix, side) in enumerate(zip(matrices, sides, strict=True)):
            try:
                found[lane] = np.linalg.solve(matrix, side)
            except np.linalg.LinAlgError:
                continue
        return found


# --- the filter -----------------------------------------------------------------------------------


@dataclass(slots=True)
class PilotFilter:
    """Filters of all trials.

    Attributes
    ----------
    x : (trials, n, 3) m, m, rad, estimates
    P : (trials, 3 n, 3 n) covariances of errors at time 0
    gone : (trials, n + 1, 2) m, J D: displacement predicted since time 0, turned; the last, for
        landmarks, is 0
    second_order : whether sightings have second-order noise
    """

    x: Array
    P: Array
    gone: Array
    second_order: bool

    @classmethod
    def at_start(cls, run: PilotReadings, *, second_order: bool) -> "PilotFilter":
        """Return the filters at sample 0."""
        trials, n = run.initial.shape[:2]
        P = np.zeros((trials, 3 * n, 3 * n))
        P[:] = np.diag(np.tile(run.spread**2, n))
        return cls(run.initial.copy(), P, np.zeros((trials, n + 1, 2)), second_order)

    def predict(self, run: PilotReadings, k: int) -> None:
        """Advance by the readings of sample k, along arcs."""
        trials, n = self.x.shape[:2]
        time, turn_rates = run.team.sensors.sample_time, run.turn_rates[k - 1]
        arcs = arcs_of(run.speeds[k - 1], turn_rates, self.x[..., 2], time)
        self.x[..., :2] += arcs.moved
        self.x[..., 2] += time * turn_rates
        self.gone[:, :n] += arcs.left
        gains = arcs.gains(run.team, self.gone[:, :n])
        own = np.einsum("liaib->liab", self.P.reshape(trials, n, 3, n, 3))
        own += gains @ np.swapaxes(gains, -1, -2)

    def correct(self, run: PilotReadings, k: int) -> None:
        """Process the sightings of sample k."""
        own = slice(run.first[k], run.first[k + 1])
        if own.start == own.stop:
            return
        places = run.with_landmarks(self.x[..., :2])
        seen = Seen.of(run, own, places, self.x[..., 2], self.gone)
        rows = seen.rows()
        reduced = self.P @ np.swapaxes(rows, 1, 2)
        spread = rows @ reduced
        variances = np.einsum("lmm->lm", spread)
        variances += run.variances[own]
        if self.second_order:
            variances += seen.second_order(self.P)
        gain = solved(spread, np.swapaxes(reduced, 1, 2))
        self.P -= reduced @ gain
        self.change((seen.innovation(run.measured[:, own])[:, None] @ gain)[:, 0])

    def change(self, errors: Array) -> None:
        """Correct the estimates by errors (trials, 3 n) at time 0."""
        found = errors.reshape(self.x.shape)
        self.x[..., :2] += found[..., :2] + found[..., 2:] * self.gone[:, :-1]
        self.x[..., 2] += found[..., 2]
