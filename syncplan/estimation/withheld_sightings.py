"""Predictions of sightings that are withheld from the filter, to compare settings.

Sightings are withheld in turn, by blocks of BLOCK_S of an observer and a target, so their
predictions do not depend on their own errors, however long these last. A withheld sighting has a
variance so large that the filter learns nothing from it; its innovation and the expected variance
follow as for any other:

    nu ~ N(0, H P H' + sigma^2), or anything at all with probability WILD

No truth is needed. Innovations of used sightings would not do: a filter that treats lasting errors
as independent follows them, predicts the next sighting of the same target well, and is wrong.

Source: Geisser (1975), JASA 70 (predictive sample reuse); Burman, Chow, Nolan (1994), Biometrika 81
(blocks for correlated errors).
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.recorded_run import BLOCK_S, filtered, run_of
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.orbits.sighting_kinds import BEARING, place_of
from syncplan.recordings.log import Log

WILD = 0.01
"""Share of readings that are arbitrary."""

UNTOLD = np.array([1e6, 1e8])
"""Variances of withheld sightings by kind, in rad^2 and m^2."""

STRIDES = (7, 3, 1)
"""Weights of observer, target and block in the number of the turn that withholds them."""

TICK = 1e-4
"""Resolution in s of the times in names; sightings of one target are further apart."""

BODIES = 4096
"""Number above that of a recording's robots and landmarks."""

SPAN_S = 30.0
"""Time span in s whose predictions count as one sample when settings are compared."""

SURE = 2.0
"""Standard errors by which a gain must exceed 0."""

LEAST_RATIO = 1e-3

CLIP = 3.0
"""Standard deviations at which errors are clipped."""


@dataclass(frozen=True, slots=True)
class Predictions:
    """Predictions of withheld sightings from the others.

    Attributes
    ----------
    names : (s,) numbers that identify sightings, whatever the delay
    times : (s,) s since the beginning, as recorded
    kinds : (s,) places in SIGHTING_KINDS
    errors : (s,) sighting less prediction, rad or m
    scores : (s,) log-densities
    """

    names: Index
    times: Array
    kinds: Index
    errors: Array
    scores: Array

    def among(self, others: "Predictions") -> "Predictions":
        """Return those of sightings that `others` predict too, in a common order."""
        _, own, _ = np.intersect1d(self.names, others.names, return_indices=True)
        return Predictions(*(getattr(self, one.name)[own] for one in fields(self)))


@dataclass(frozen=True, slots=True)
class FitVerdict:
    """Comparison of settings with others on the same withheld sightings.

    Attributes
    ----------
    gain, gain_sigma : mean increase of a withheld sighting's log-density, and its standard error;
        infinite if the filter diverges with either
    error_ratio, error_ratio_sigma : RMS of the predictions' mean errors over blocks, relative to
        that of the others, and its standard error; errors are clipped, and in units of the RMS of
        their kind
    white : whether innovations are white noise of the fitted sigmas; if not, the model is wrong,
        and likelier sightings need not mean better estimates
    """

    gain: float
    gain_sigma: float
    error_ratio: float
    error_ratio_sigma: float
    white: bool

    @property
    def is_better(self) -> bool:
        """Whether predictions are likelier, beyond chance, and no less accurate.

        Where innovations are not white they must be more accurate, beyond chance.
        """
        # margin of the squared ratio
        margin = 0.0 if self.white else SURE * 2.0 * self.error_ratio * self.error_ratio_sigma
        return self.gain > SURE * self.gain_sigma and self.error_ratio**2 <= 1.0 - margin


def predictions_of(
    log: Log,
    settings: ReplaySettings,
    options: FilterOptions,
    turns: tuple[int, ...],
    of: int,
    farthest: float,
) -> Predictions:
    """Return predictions of the sightings that `turns`, out of `of`, withhold; one run per turn.

    `farthest` is the largest distance seen, m. Raises NoSolutionError if the filter diverges.
    """
    parts = [_predicted(log, settings, options, turn, of, farthest) for turn in turns]
    columns = zip(*parts, strict=True)
    return Predictions(*(np.concatenate(column) for column in columns))


def _predicted(
    log: Log, settings: ReplaySettings, options: FilterOptions, turn: int, of: int, farthest: float
) -> tuple[Any, ...]:
    run = run_of(log, settings, options)
    seen = run.sightings
    recorded = seen.times + settings.delay
    places = (seen.observers, seen.targets, (recorded // BLOCK_S).astype(np.int64))
    withheld = sum(k * one for k, one in zip(STRIDES, places, strict=True)) % of == turn
    variances = np.where(withheld, UNTOLD[seen.kinds], run.setup.variances)
    made = filtered(replace(run, setup=run.setup._replace(variances=variances)), options)
    taken = withheld & (made.weights > 0.0)
    kinds, errors = seen.kinds[taken], made.innovations[taken]
    variance = 1.0 / made.weights[taken] - UNTOLD[kinds] + run.setup.variances[taken]
    wild = np.where(kinds == place_of(BEARING), 2.0 * np.pi, farthest)
    density = np.exp(-0.5 * errors**2 / variance) / np.sqrt(2.0 * np.pi * variance)
    names = np.rint(recorded[taken] / TICK).astype(np.int64)
    for one, count in ((seen.observers, BODIES), (seen.targets, BODIES), (seen.kinds, 2)):
        names = names * count + one[taken]
    scores = np.log((1.0 - WILD) * density + WILD / wild)
    return names, recorded[taken], kinds, errors, scores


def judged(before: Predictions | None, after: Predictions | None, *, white: bool) -> FitVerdict:
    """Compare `after` with `before` on the withheld sightings that both predict.

    Sums over SPAN_S are the samples, since errors of neighbours are correlated. None stands for
    settings with which the filter diverges; `white` states whether innovations of `after` are.
    """
    if after is None or before is None:
        lost = after is None
        return FitVerdict(-np.inf if lost else np.inf, 0.0, np.inf if lost else 0.0, 0.0, white)
    before, after = before.among(after), after.among(before)
    gain, gain_sigma = _mean(after.scores - before.scores, before.times)
    growth, growth_sigma = _mean(*_growth(before, after))
    ratio = float(np.sqrt(max(1.0 + growth, LEAST_RATIO**2)))
    # to first order
    return FitVerdict(gain, gain_sigma, ratio, 0.5 * growth_sigma / ratio, white)


def _growth(before: Predictions, after: Predictions) -> tuple[Array, Array]:
    """Growth of blocks' squared mean errors, relative to the mean square of their kind, and times.

    Errors of poses persist over a block; noise, and the effect of a wrong delay while a robot turns
    to and fro, average out. Wild errors are clipped.
    """
    streams = before.names % (2 * BODIES**2)
    blocks = np.column_stack([streams, (before.times // BLOCK_S).astype(np.int64)])
    _, first, block = np.unique(blocks, axis=0, return_index=True, return_inverse=True)
    counts = np.bincount(block.ravel())
    growth = np.zeros(len(first))
    for kind in np.unique(before.kinds):
        errors = np.where(before.kinds == kind, [before.errors, after.errors], 0.0)
        # a normal variable's median size is 0.6745 standard deviations
        limit = CLIP * np.median(np.abs(before.errors[before.kinds == kind])) / 0.6745
        squares = [
            (np.bincount(block.ravel(), np.clip(one, -limit, limit)) / counts) ** 2
            for one in errors
        ]
        of_kind = before.kinds[first] == kind
        mean = max(float(squares[0][of_kind].mean()), np.finfo(float).tiny)
        growth[of_kind] = (squares[1] - squares[0])[of_kind] / mean
    return growth, before.times[first]


def _mean(values: Array, times: Array) -> tuple[float, float]:
    """Mean, and its standard error from sums over spans."""
    _, span = np.unique((times // SPAN_S).astype(np.int64), return_inverse=True)
    mean = float(values.mean())
    off = np.bincount(span, values - mean)
    return mean, float(np.sqrt(np.sum(off**2)) / len(values))
