"""Rival estimates of a trial, compared on later sightings until one is clearly more likely.

An estimate that may replace another is a hypothesis. Both run on as filters, and each new sighting
adds to the log-likelihood of either

    log p = -(nu^2 / S + log 2 pi S) / 2

with its own innovation nu and variance S. The rival replaces the present estimate once its
log-likelihood leads by CLEARLY. It is dropped once it trails by as much, or after a period. This is
Wald's sequential test of the likelihood ratio, evaluated every eighth of a period.

While the present estimate is right, the likelihood ratio has expectation 1 and never gains on
average, whatever the rival is. So by Ville's inequality, the probability that it ever exceeds
exp(CLEARLY) is at most exp(-CLEARLY) = 1e-6: this bounds how often a right estimate is given up,
for each rival. A lost estimate is given up within an eighth of a period from the first sighting
that shows it.

Sources
-------
sequential test : Wald, "Sequential Tests of Statistical Hypotheses", Annals of Mathematical
    Statistics 16, 1945
its error : Ville, "Etude critique de la notion de collectif", 1939
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.filter_setup import FilterSetup, Readings, State, run_without_truth
from syncplan.estimation.lane_filter import EXTENDED

CLEARLY = math.log(1e6)
"""Lead in log-likelihood at which one of two estimates is accepted as right."""

LOOKS = 8
"""Number of times per period that leads are checked."""


@dataclass(slots=True)
class Rivals:
    """Present estimates of some lanes, and a rival of each.

    Attributes
    ----------
    lanes : (k,) of the run
    present, rival : states of these lanes
    began : (3n + e, k) state from which the rival started
    lead : (k,) log-likelihood of the rival over that of the present estimate
    at : step that both have reached
    """

    lanes: Index
    present: State
    rival: State
    began: Array
    lead: Array
    at: int

    @classmethod
    def of(cls, lanes: Index, present: State, rival: State, at: int) -> "Rivals":
        """Return rivals without a lead; they change the given states in place."""
        return cls(lanes, present, rival, rival[0].copy(), np.zeros(len(lanes)), at)

    @classmethod
    def none(cls, state: State) -> "Rivals":
        """Return empty rivals, for no lane of a state."""
        nobody = np.zeros(0, dtype=np.int64)
        return cls.of(nobody, lanes_of_state(state, nobody), lanes_of_state(state, nobody), 0)

    def joined(self, other: "Rivals") -> "Rivals":
        """Return these rivals joined with those of other lanes at the same step."""

        def both(a: Array, b: Array) -> Array:
            return np.concatenate([a, b], axis=-1)

        return Rivals(
            np.concatenate([self.lanes, other.lanes]),
            (both(self.present[0], other.present[0]), both(self.present[1], other.present[1])),
            (both(self.rival[0], other.rival[0]), both(self.rival[1], other.rival[1])),
            both(self.began, other.began),
            both(self.lead, other.lead),
            other.at,
        )

    def advance(self, setup: FilterSetup, readings: Readings, end: int) -> None:
        """Advance both estimates to step `end` and update the rival's lead."""
        if not len(self.lanes):
            return
        window = _window(setup, readings, self.lanes, self.at, end)
        lead = _likelihood(*window, self.rival) - _likelihood(*window, self.present)
        # not finite: one of the two has broken down
        broken = ~np.isfinite(lead)
        lead[broken] = np.where(_is_finite(self.rival)[broken], np.inf, -np.inf)
        self.lead += lead
        self.at = end

    @property
    def ahead(self) -> Flags:
        """Whether the rival is clearly more likely, (k,)."""
        return np.asarray(self.lead > CLEARLY)

    @property
    def undecided(self) -> Flags:
        """Whether neither is clearly more likely, (k,)."""
        return np.asarray(np.abs(self.lead) <= CLEARLY)

    def take(self, kept: Flags) -> "Rivals":
        """Return the rivals of the lanes `kept`."""
        return Rivals(
            self.lanes[kept],
            lanes_of_state(self.present, kept),
            lanes_of_state(self.rival, kept),
            self.began[..., kept],
            self.lead[kept],
            self.at,
        )


def lanes_of_state(state: State, lanes: Index | Flags) -> State:
    """Return a copy of some lanes of a state."""
    x, P = state
    return np.ascontiguousarray(x[..., lanes]), np.ascontiguousarray(P[..., lanes])


def _is_finite(state: State) -> Flags:
    """Whether each estimate is finite, (lanes,)."""
    return np.asarray(np.isfinite(state[0]).all(axis=0))


def _window(
    setup: FilterSetup, readings: Readings, lanes: Index, begin: int, end: int
) -> tuple[FilterSetup, Readings]:
    """Set-up and readings of some lanes from step `begin` to step `end`, as a run without truth.

    Its step 0 is step `begin`, whose sightings it excludes.
    """
    first = setup.first[begin + 1 : end + 2]
    seen = slice(int(first[0]), int(first[-1]))
    of_steps = slice(begin, end)
    own = setup._replace(
        spans=setup.spans[of_steps],
        compared=np.full(end - begin + 1, -1),
        first=np.concatenate([[0], first - first[0]]),
        observers=setup.observers[seen],
        targets=setup.targets[seen],
        kinds=setup.kinds[seen],
        variances=setup.variances[seen],
    )
    read = Readings(
        initial=np.ascontiguousarray(readings.initial[..., lanes]),
        speeds=np.ascontiguousarray(readings.speeds[of_steps][..., lanes]),
        turn_rates=np.ascontiguousarray(readings.turn_rates[of_steps][..., lanes]),
        sightings=np.ascontiguousarray(readings.sightings[seen][..., lanes]),
    )
    return own, read


def _likelihood(setup: FilterSetup, readings: Readings, state: State) -> Array:
    """Log-likelihood (lanes,) of the sightings, less a constant; advances the state in place.

    A sighting that the gate rejects counts as one at the gate.
    """
    run = run_without_truth(setup, readings, innovations=True)
    EXTENDED.advance(run, state, 0, len(setup.spans))
    innovations, weights = np.moveaxis(run.statistics.innovations, 1, 0)
    taken = weights > 0.0
    cost = np.square(innovations) * weights - np.log(np.where(taken, weights, 1.0))
    rejected = setup.gate + np.log(setup.variances)[:, None]
    missed = np.isnan(readings.sightings)
    return np.asarray(-0.5 * np.where(taken, cost, np.where(missed, 0.0, rejected)).sum(axis=0))
