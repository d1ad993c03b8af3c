"""Fit of a recording's sigmas and delay to its first third, judged on the rest.

The likelihood of the sightings is that of the filter's innovations: each has density N(nu; 0, S),
and one that the gate rejects has that of an arbitrary reading. Truth is needed only for a start at
the true poses. The fit takes these steps:

    delay                        the best of a few
    bearing, motion, delay       by the simplex method of Nelder and Mead, from bearings alone
    motion                       again, after the sigma of a bearing has grown
    distance                     the best of many, the rest held

    bearing, its walk            by the simplex, from the better of the given settings and that fit

Lasting errors of sightings keep innovations alike for seconds, which a likelihood of white ones
does not show: where sums over blocks scatter more (`recorded_run`), the kind's sigma grows by as
much. Nor can a likelihood of innovations judge a fit: its worth shows on sightings of the rest that
are withheld from the filter (`withheld_sightings`).

The fit is accepted if, compared with the given settings, it makes the rest's withheld sightings
likelier, beyond chance, and predicts them no worse, or better if innovations are not white.
Otherwise the rest runs with the given settings. The fit must also win against the given settings
with the fitted delay: a right delay improves predicted bearings of turning robots so much that it
would hide wrong sigmas. A bearing walk is then fitted from the better settings and judged likewise,
also against the first fit if that has won: it models lasting errors, which white sigmas can only
grow to cover.

If the start is given, the rest starts from the estimate of the filter with the same settings at the
end of the first third, with the sigmas of its least known robot.

Source: Bar-Shalom, Li, Kirubarajan (2001), 11.3; Nelder, Mead (1965).

A further setting to fit is a line of FITTED. The simplex method works on logarithms of sigmas, and
on a delay in a unit that counts as much as a factor of e in a sigma.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.consistency import recorded_nis
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.recorded_run import FilteredRun, RecordedRun, filtered, lasting_of, run_of
from syncplan.estimation.replay_settings import LARGEST_DELAY, ReplaySettings
from syncplan.estimation.trials import series
from syncplan.estimation.withheld_sightings import (
    WILD,
    FitVerdict,
    Predictions,
    judged,
    predictions_of,
)
from syncplan.orbits.sighting_kinds import BEARING, DISTANCE, place_of
from syncplan.recordings.log import Log
from syncplan.scenario.filters import FILTERS

# --- fitted settings ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FittedSetting:
    """A setting that can be fitted.

    Attributes
    ----------
    of_noise : whether it belongs to the settings' `noise` rather than to the settings themselves
    least, largest : limits of a fit, in the setting's own unit
    unit : unit of the simplex on a linear scale; None for a logarithmic one
    """

    of_noise: bool
    least: float
    largest: float
    unit: float | None = None

    def scaled(self, value: float) -> float:
        """Return the simplex coordinate of a value."""
        if self.unit is None:
            return float(np.log(np.clip(value, self.least, self.largest)))
        return value / self.unit

    def value(self, scaled: float) -> float:
        """Return the value of a simplex coordinate, clipped to the limits."""
        value = float(np.exp(min(scaled, 50.0))) if self.unit is None else scaled * self.unit
        return min(max(value, self.least), self.largest)


FITTED: Mapping[str, FittedSetting] = MappingProxyType(
    {
        "bearing_sigma": FittedSetting(of_noise=False, least=1e-4, largest=3.0),
        "range_sigma": FittedSetting(of_noise=False, least=1e-4, largest=1e3),
        "speed_sigma": FittedSetting(of_noise=True, least=1e-4, largest=1e3),
        "turn_rate_sigma": FittedSetting(of_noise=True, least=1e-4, largest=1e2),
        "bearing_walk_sigma": FittedSetting(of_noise=False, least=1e-4, largest=1.0),
        "bearing_walk_time": FittedSetting(of_noise=False, least=0.1, largest=1e3),
        "delay": FittedSetting(
            of_noise=False, least=-LARGEST_DELAY, largest=LARGEST_DELAY, unit=0.25
        ),
    }
)
"""Settings by name, in rad, m, m/s and rad/s per sample, rad, s, s."""


def point_of(settings: ReplaySettings, names: Sequence[str]) -> Array:
    """Return the simplex coordinates (k,) of the named settings."""
    found = []
    for name in names:
        holder = settings.noise if FITTED[name].of_noise else settings
        found.append(FITTED[name].scaled(getattr(holder, name)))
    return np.array(found)


def settings_at(settings: ReplaySettings, names: Sequence[str], point: Array) -> ReplaySettings:
    """Return settings with the named ones at a point; raises InputError for one out of bounds."""
    values = {
        name: FITTED[name].value(one) for name, one in zip(names, point.tolist(), strict=True)
    }
    noise = {name: value for name, value in values.items() if FITTED[name].of_noise}
    own: dict[str, Any] = {name: value for name, value in values.items() if name not in noise}
    return replace(settings, **own, noise=replace(settings.noise, **noise))


FIT_SHARE = 1.0 / 3.0
"""Share of the recording, from its beginning, that settings are fitted to."""

MOST_RUNS = 300
"""Largest number of filter runs: scans, simplexes and comparisons."""

TURNS = 3
"""Number of runs, one of which withholds each sighting."""

DELAYS = np.linspace(-0.5, 0.5, 11)
RANGE_SIGMAS = np.geomspace(0.005, 5.0, 19)
FEWEST_SIGHTINGS = 50
STEP = 0.4
RUNS_OF_SIMPLEX = 70
MOTION = ("speed_sigma", "turn_rate_sigma")
WALK = ("bearing_sigma", "bearing_walk_sigma", "bearing_walk_time")
WALK_SIGMA = 0.03
"""Sigma in rad from which a fit of the walk begins, unless one was given."""

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Tuning:
    """Settings fitted to the beginning of a recording, and their verdict on the rest.

    Attributes
    ----------
    before, after : settings as given, and as fitted
    used : the accepted of the two, with portion and start of the rest
    duration : s, length of the part fitted to
    runs : number of filter runs
    gain : mean growth of the log-likelihood of a withheld sighting, in the part fitted to
    verdict, beside_delay : comparison of the fit, on the rest, with the given settings, and with
        these at the fitted delay
    bearing_growth, range_growth : factors by which lasting errors enlarge sigmas, at least 1; 1 for
        a kind that is not used
    """

    before: ReplaySettings
    after: ReplaySettings
    used: ReplaySettings
    duration: float
    runs: int
    gain: float
    verdict: FitVerdict
    beside_delay: FitVerdict
    bearing_growth: float
    range_growth: float

    @property
    def accepted(self) -> bool:
        """Whether the rest runs with the fitted settings."""
        return self.verdict.is_better and self.beside_delay.is_better


def tuned(
    log: Log, settings: ReplaySettings, options: FilterOptions, progress: Progress | None = None
) -> Tuning:
    """Return settings fitted to the first third of a recording, and their verdict on the rest.

    `progress` is called with the number of filter runs so far, MOST_RUNS at most. Raises InputError
    if sightings are too few.
    """
    fit = _Fit(log, settings, options, progress)
    none = dict.fromkeys((BEARING_PLACE, DISTANCE_PLACE), 1.0)
    growth = dict(none)
    found = fit.of_motion_and(fit.kinds[0], growth)
    if len(fit.kinds) > 1:
        found = fit.of_distances(found, growth)
    given, late = fit.settings, replace(fit.settings, delay=found.delay)
    verdicts = fit.verdicts((given, late), found)
    if BEARING_PLACE in fit.kinds:
        rivals = (given, late, found) if all(one.is_better for one in verdicts) else (given,)
        walking = fit.of_walk(rivals[-1])
        others = fit.verdicts(rivals, walking)
        if all(one.is_better for one in others):
            # for bearings, the walk replaces the growth of their sigma
            growth = growth | {BEARING_PLACE: 1.0} if len(rivals) > 1 else none
            found, verdicts = walking, others
    accepted = all(one.is_better for one in verdicts)
    return Tuning(
        before=settings,
        after=found,
        used=fit.rest(found if accepted else given),
        duration=fit.duration,
        runs=fit.runs,
        gain=fit.gain(found),
        verdict=verdicts[0],
        beside_delay=verdicts[:2][-1],
        bearing_growth=growth[BEARING_PLACE],
        range_growth=growth[DISTANCE_PLACE],
    )


BEARING_PLACE, DISTANCE_PLACE = place_of(BEARING), place_of(DISTANCE)


class _Fit:
    """Fit of settings to a recording, with a count of filter runs."""

    def __init__(
        self, log: Log, settings: ReplaySettings, options: FilterOptions, progress: Progress | None
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

    def of_motion_and(self, kind: int, growth: dict[int, float]) -> ReplaySettings:
        """Fit motion, delay and a kind's sigma to this kind alone; set its growth.

        Errors of distances last longest, so motion is not fitted to them if there are bearings.
        """
        key = "bearing_sigma" if kind == BEARING_PLACE else "range_sigma"
        alone = replace(self.settings, distances=kind != BEARING_PLACE)
        delays = [alone.delay, *(alone.delay + one for one in DELAYS.tolist() if one)]
        costs = [self.cost(replace(alone, delay=one)) for one in delays]
        alone = replace(alone, delay=delays[int(np.argmin(costs))])
        alone = self.simplex(alone, (key, *MOTION, "delay"))
        growth[kind] = self.growth(alone, kind)
        # motion need not explain lasting errors of sightings
        alone = settings_at(alone, (key,), point_of(alone, (key,)) + np.log(growth[kind]))
        alone = self.simplex(alone, MOTION)
        return replace(alone, distances=self.settings.distances)

    def of_distances(self, found: ReplaySettings, growth: dict[int, float]) -> ReplaySettings:
        """Fit the sigma of distances as well; set their growth."""
        trials = [replace(found, range_sigma=one) for one in RANGE_SIGMAS.tolist()]
        found = trials[int(np.argmin([self.cost(one) for one in trials]))]
        growth[DISTANCE_PLACE] = self.growth(found, DISTANCE_PLACE)
        return replace(found, range_sigma=found.range_sigma * growth[DISTANCE_PLACE])

    def of_walk(self, best: ReplaySettings) -> ReplaySettings:
        """Fit a bearing walk, and the sigma beside it, to bearings alone."""
        sigma = best.bearing_walk_sigma or WALK_SIGMA
        alone = replace(best, distances=False, bearing_walk_sigma=sigma)
        return replace(self.simplex(alone, WALK), distances=best.distances)

    def rest(self, settings: ReplaySettings) -> ReplaySettings:
        """Return settings for the rest, with a given start moved to the end of the fitted part."""
        later = replace(settings, portion=(FIT_SHARE, 1.0))
        if settings.start != "given":
            return later
        _, made = self.run(settings, with_series=True)
        kept = series(made.result)
        noise = replace(
            settings.noise,
            position_sigma=float(kept.axis_sigma[-1].max()),
            heading_sigma=float(kept.heading_sigma[-1].max()),
        )
        return replace(later, start_poses=made.estimates[-1], noise=noise)

    def verdicts(
        self, rivals: Sequence[ReplaySettings], fitted: ReplaySettings
    ) -> list[FitVerdict]:
        """Compare fitted settings with each of `rivals` on the rest."""
        after = self.rest(fitted)
        found = self.of(after)
        white = found is not None and self.is_white(after)
        return [judged(self.of(self.rest(one)), found, white=white) for one in rivals]

    def of(self, settings: ReplaySettings) -> Predictions | None:
        """Return all predictions; None if the filter diverges."""
        self.count(TURNS)
        turns = tuple(range(TURNS))
        try:
            return predictions_of(self.log, settings, self.options, turns, TURNS, self.farthest)
        except (InputError, NoSolutionError):
            return None

    def is_white(self, settings: ReplaySettings) -> bool:
        """Return whether innovations are white, by sums over blocks and NIS."""
        run, made = self.run(settings)
        if any(lasting_of(run, made, kind).lasts for kind in self.kinds):
            return False
        result, gate = made.result, self.options.gate_probability
        nis = recorded_nis(float(result.nis_sums[0]), int(result.accepted[0]), gate)
        return nis.verdict == "consistent"

    def run(
        self, settings: ReplaySettings, *, with_series: bool = False
    ) -> tuple[RecordedRun, FilteredRun]:
        """Run the filter with settings."""
        self.count(1)
        run = run_of(self.log, settings, self.options)
        return run, filtered(run, replace(self.options, with_series=with_series))

    def count(self, runs: int) -> None:
        """Count further runs of the filter."""
        self.runs += runs
        if self.progress is not None:
            self.progress(min(self.runs, MOST_RUNS))

    def cost(self, settings: ReplaySettings) -> float:
        """Mean negative log-likelihood of innovations; infinite if the filter diverges."""
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

    def gain(self, after: ReplaySettings) -> float:
        """Return the gain of fitted settings on the sightings that they were fitted to."""
        return judged(self.of(self.settings), self.of(after), white=True).gain

    def simplex(self, start: ReplaySettings, names: tuple[str, ...]) -> ReplaySettings:
        """Minimise the cost over the named settings, starting from `start`."""
        from scipy.optimize import minimize

        begin = point_of(start, names)
        found = minimize(
            lambda point: self.cost(settings_at(start, names, point)),
            begin,
            method="Nelder-Mead",
            options={
                "initial_simplex": np.vstack([begin, begin + STEP * np.eye(len(names))]),
                "maxfev": RUNS_OF_SIMPLEX,
                "xatol": 0.05,
                "fatol": 1e-3,
            },
        )
        return settings_at(start, names, found.x)

    def growth(self, settings: ReplaySettings, kind: int) -> float:
        """Return the factor, at least 1, by which lasting errors enlarge the sigma of a kind."""
        return lasting_of(*self.run(settings), kind).growth
