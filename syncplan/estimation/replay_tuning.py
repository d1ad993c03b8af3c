"""Sigmas and delay of a recording's sensors, from the innovations of its first third.

The likelihood of what was seen, given what was seen before, is that of the filter's innovations:
each has density N(nu; 0, S), and one that the gate rejects that of a reading that may be anything.
No truth is needed but for a start at it. In turn

    delay                        the best of a few
    bearing, motion, delay       by the simplex method of Nelder and Mead, from bearings alone
    motion                       again, as the sigma of a bearing has grown
    distance                     the best of many, the rest held

Errors of sightings that last give innovations that are alike for seconds, which a likelihood of
white ones does not see: the sum of k of them then scatters by more than root k. Where it does over
blocks of BLOCK_S, by observer and target, the kind's sigma grows by as much.

Where the start is given, the rest starts where the filter with the fitted settings was then, as
well known as its least known robot.

Source: Bar-Shalom, Li, Kirubarajan (2001), 5.4 (innovations) and 11.3; Nelder, Mead (1965).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filters import FILTERS
from syncplan.estimation.recorded_run import FilteredRun, RecordedRun, filtered, run_of
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.trials import series
from syncplan.orbits.bearings import BEARING
from syncplan.orbits.distances import DISTANCE
from syncplan.orbits.sighting_kinds import place_of
from syncplan.recordings.log import Log

__all__ = ["FIT_SHARE", "MOST_RUNS", "Tuning", "tuned"]

FIT_SHARE = 1.0 / 3.0
"""Of the recording, from its beginning, that is fitted to."""

MOST_RUNS = 200
"""Of the filter: of scans, both simplexes and what follows."""

DELAYS = np.linspace(-0.5, 0.5, 11)
RANGE_SIGMAS = np.geomspace(0.005, 5.0, 19)
FEWEST_SIGHTINGS = 50
WILD = 0.01
"""Share of the readings that may be anything."""

BLOCK_S = 10.0
SURE = 3.0
"""Standard errors beyond which innovations count as alike."""

DELAY_UNIT = 0.25
"""s: what the simplex takes for as far as a sigma e times as large."""

STEP = 0.4
RUNS_OF_SIMPLEX = 80
OF_MOTION = ("speed_sigma", "turn_rate_sigma")
LEAST = 1e-4

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Tuning:
    """Settings fitted to the beginning of a recording.

    Attributes
    ----------
    before, after : settings
    duration : s, that was fitted to
    runs : of the filter
    gain, gain_on_rest : by which the log-likelihood of a sighting grew, on average: of those
        fitted to, and of the later ones
    bearing_growth, range_growth : by what sigmas are larger as errors of sightings last, at least
        1; 1 for a kind that is not used
    """

    before: ReplaySettings
    after: ReplaySettings
    duration: float
    runs: int
    gain: float
    gain_on_rest: float
    bearing_growth: float
    range_growth: float


def tuned(
    log: Log, settings: ReplaySettings, options: FilterOptions, progress: Progress | None = None
) -> Tuning:
    """Return settings whose sigmas and delay fit the first third of a recording.

    `progress` is called with the number of filter runs so far, MOST_RUNS at most. Raises InputError
    where too little was seen.
    """
    fit = _Fit(log, settings, options, progress)
    first = fit.kinds[0]
    key = "bearing_sigma" if first == BEARING_PLACE else "range_sigma"
    # one kind alone: distances have errors that last longest
    alone = replace(fit.settings, distances=first != BEARING_PLACE)
    delays = [settings.delay, *(settings.delay + one for one in DELAYS.tolist() if one)]
    costs = [fit.cost(replace(alone, delay=one)) for one in delays]
    alone = replace(alone, delay=delays[int(np.argmin(costs))])
    alone = fit.simplex(alone, (key, "speed_sigma", "turn_rate_sigma", "delay"))
    growth = {first: fit.growth(alone, first)}
    # what lasting errors of sightings explain, motion need not
    alone = _at(alone, (key,), _point(alone, (key,)) + np.log(growth[first]))
    alone = fit.simplex(alone, ("speed_sigma", "turn_rate_sigma"))
    found = replace(alone, distances=settings.distances)
    if len(fit.kinds) > 1:
        trials = [replace(found, range_sigma=one) for one in RANGE_SIGMAS.tolist()]
        found = trials[int(np.argmin([fit.cost(one) for one in trials]))]
        growth[DISTANCE_PLACE] = fit.growth(found, DISTANCE_PLACE)
        found = replace(found, range_sigma=found.range_sigma * growth[DISTANCE_PLACE])
    rest: dict[str, Any] = {"portion": (FIT_SHARE, 1.0)}
    before_rest, after_rest = replace(settings, **rest), replace(found, **rest)
    if settings.start == "given":
        end = fit.end(found)
        before_rest, after_rest = end.as_start_of(before_rest), end.as_start_of(after_rest)
    return Tuning(
        before=settings,
        after=after_rest,
        duration=fit.duration,
        runs=fit.runs,
        gain=fit.cost(fit.settings) - fit.cost(found),
        gain_on_rest=fit.cost(before_rest) - fit.cost(after_rest),
        bearing_growth=growth.get(BEARING_PLACE, 1.0),
        range_growth=growth.get(DISTANCE_PLACE, 1.0),
    )


BEARING_PLACE, DISTANCE_PLACE = place_of(BEARING), place_of(DISTANCE)


@dataclass(frozen=True, slots=True)
class _End:
    """Where the filter was at the end of what was fitted to: (n, 3), and sigmas in m and rad."""

    poses: Array
    position_sigma: float
    heading_sigma: float

    def as_start_of(self, settings: ReplaySettings) -> ReplaySettings:
        """Settings that start there."""
        known_to = {
            "position_sigma": self.position_sigma,
            "heading_sigma": self.heading_sigma,
        }
        noise = replace(settings.noise, **known_to)
        return replace(settings, start_poses=self.poses, noise=noise)


class _Fit:
    """Runs of the filter on the beginning of a recording, counted."""

    def __init__(
        self,
        log: Log,
        settings: ReplaySettings,
        options: FilterOptions,
        progress: Progress | None,
    ) -> None:
        self.log, self.progress, self.runs = log, progress, 0
        self.settings = replace(settings, portion=(0.0, FIT_SHARE))
        # from a known start the plainest filter is as good as any
        model = next(iter(FILTERS)) if settings.start == "truth" else options.filter
        self.options = replace(options, filter=model)
        run = run_of(log, self.settings, self.options)
        self.duration, seen = run.clock.duration, run.sightings.kinds
        self.kinds = np.unique(seen).tolist()
        if len(seen) < FEWEST_SIGHTINGS:
            problem = f"{len(seen)} sightings in its first third are too few to fit sigmas to"
            raise InputError(problem, source=log.name)
        self.farthest = max(float(np.nanmax(one.ranges, initial=1.0)) for one in log.robots)

    def run(
        self, settings: ReplaySettings, *, with_series: bool = False
    ) -> tuple[RecordedRun, FilteredRun]:
        """The filter's run with settings."""
        self.runs += 1
        if self.progress is not None:
            self.progress(min(self.runs, MOST_RUNS))
        run = run_of(self.log, settings, self.options)
        return run, filtered(run, replace(self.options, with_series=with_series))

    def end(self, settings: ReplaySettings) -> _End:
        """Where the filter with settings is at the end."""
        _, made = self.run(settings, with_series=True)
        kept = series(made.result)
        return _End(
            poses=made.estimates[-1],
            position_sigma=float(kept.axis_sigma[-1].max()),
            heading_sigma=float(kept.heading_sigma[-1].max()),
        )

    def cost(self, settings: ReplaySettings) -> float:
        """The mean negative log-likelihood of a sighting; infinite where the filter diverges."""
        try:
            run, made = self.run(settings)
        except (InputError, NoSolutionError):
            return np.inf
        wild = np.where(run.sightings.kinds == BEARING_PLACE, 2.0 * np.pi, self.farthest)
        used = made.weights > 0.0
        nu, inverse = made.innovations[used], made.weights[used]
        density = np.log((1.0 - WILD) * np.sqrt(inverse / (2.0 * np.pi)))
        total = float(np.sum(density - 0.5 * nu**2 * inverse))
        total += float(np.sum(np.log(WILD / wild[~used])))
        return -total / max(len(used), 1)

    def simplex(self, start: ReplaySettings, keys: tuple[str, ...]) -> ReplaySettings:
        """The settings near `start` of the least cost, in the named sigmas and the delay."""
        from scipy.optimize import minimize

        def cost(point: Array) -> float:
            try:
                return self.cost(_at(start, keys, point))
            except InputError:
                return np.inf

        begin = _point(start, keys)
        found = minimize(
            cost,
            begin,
            method="Nelder-Mead",
            options={
                "initial_simplex": np.vstack([begin, begin + STEP * np.eye(len(keys))]),
                "maxfev": RUNS_OF_SIMPLEX,
                "xatol": 0.05,
                "fatol": 1e-3,
            },
        )
        return _at(start, keys, found.x)

    def growth(self, settings: ReplaySettings, kind: int) -> float:
        """By what the sigma of a kind is larger as errors of its sightings last, at least 1."""
        run, made = self.run(settings)
        seen, used = run.sightings, (made.weights > 0.0) & (run.sightings.kinds == kind)
        if not used.any():
            return 1.0
        scaled = (made.innovations * np.sqrt(made.weights))[used]
        block = (seen.times[used] // BLOCK_S).astype(np.int64)
        blocks = np.column_stack([seen.observers[used], seen.targets[used], block])
        _, number = np.unique(blocks, axis=0, return_inverse=True)
        sums = np.bincount(number.ravel(), scaled)
        ratio = float(np.sum(sums**2) / np.sum(scaled**2))
        # of white innovations the ratio is 1, give or take root of 2 / blocks
        return float(np.sqrt(ratio)) if ratio > 1.0 + SURE * np.sqrt(2.0 / len(sums)) else 1.0


def _point(settings: ReplaySettings, keys: tuple[str, ...]) -> Array:
    """Logarithms of sigmas, and the delay in its unit."""
    return np.array(
        [
            settings.delay / DELAY_UNIT
            if key == "delay"
            else np.log(max(getattr(settings.noise if key in OF_MOTION else settings, key), LEAST))
            for key in keys
        ]
    )


def _at(settings: ReplaySettings, keys: tuple[str, ...], point: Array) -> ReplaySettings:
    """The settings at a point; raises InputError where a value is out of all bounds."""
    given = dict(zip(keys, point.tolist(), strict=True))
    values = {
        key: value * DELAY_UNIT if key == "delay" else float(np.exp(value))
        for key, value in given.items()
    }
    noise = {key: values.pop(key) for key in OF_MOTION if key in values}
    changes: dict[str, Any] = {**values, "noise": replace(settings.noise, **noise)}
    return replace(settings, **changes)
