"""The pilot's filter: extended or second-order, all trials side by side in plain NumPy.

It takes in all sightings of an instant at once. With second-order noise, each has the variance that
its tangent leaves out beside its own: `second_order`.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3 (extended Kalman filter).
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.pilot_model import Seen, arcs_of, solved
from syncplan.estimation.pilot_readings import PilotReadings


@dataclass(slots=True)
class PilotFilter:
    """The filters of all trials.

    Attributes
    ----------
    x : (trials, n, 3) m, m, rad, estimates
    P : (trials, 3 n, 3 n) covariances, of errors at time 0
    gone : (trials, n + 1, 2) m, J D: the way predicted since time 0, turned; 0 of landmarks, last
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
        """Take in the sightings of sample k."""
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
        """Add errors (trials, 3 n) at time 0 to the estimates."""
        found = errors.reshape(self.x.shape)
        self.x[..., :2] += found[..., :2] + found[..., 2:] * self.gone[:, :-1]
        self.x[..., 2] += found[..., 2]
