"""Readings of the filter in each trial, drawn from the trial's own generator.

Trial k draws standard normal numbers from SeedSequence(seed, spawn_key=(k,)), the k-th child of
SeedSequence(seed), in this order: initial pose (n, 3), speed readings (steps, n), turn-rate
readings (steps, n), sightings (s,) in their order; then the lasting errors that the team has, in
the order of ERROR_STATES: wind (2,), speed scales (n,), turn-rate biases (n,), bearing biases
(n,), gusts (steps + 1, n, 2), bearing walks (steps + 1, n), clock offsets (n,). If sightings may
be missed, uniform numbers follow, one for each sample, observer and target with p < 1, in the
order of sightings: bearing and distance are missed together. If bearings may be false, another one
follows for each sighting: below the share of false ones, it determines where in view the bearing
points. So adding a key leaves all draws before its own unchanged.

Errors are drawn whether or not the filter estimates them. In wind and gusts headings differ from
trial to trial (`drawn_errors`); each trial's true headings then determine which targets are in
view.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.drawn_errors import AirMotion, DrawnErrors, error_draws, motion_in_air
from syncplan.estimation.filter_setup import FilterSetup, Readings, Truth
from syncplan.orbits.circles import unit, wrap
from syncplan.orbits.contacts import BOUNDARY_SLACK, Windows, find_windows
from syncplan.orbits.error_states import ERROR_STATES, StateLayout
from syncplan.orbits.sighting_kinds import (
    SIGHTING_KINDS,
    measured_by_kind,
    of_targets,
    sigmas_by_kind,
    turns_by_kind,
)
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Team

FULL_VIEW = 2.0 * np.pi

FILTERS_OWN = 1
"""Spawn key, below a trial's, of the numbers that its filter draws."""


def filter_stream(seed: int, trial: int) -> np.random.SeedSequence:
    """Return the stream of the random numbers that the filter of a trial draws."""
    return np.random.SeedSequence(seed, spawn_key=(trial, FILTERS_OWN))


def split_draws(
    seed: int, trials: range, sizes: tuple[int, ...], normal: int | None = None
) -> list[Array]:
    """Return the draws of trials, an array (size, lanes) for each size.

    The first `normal` arrays are standard normal numbers, all if None; the others are uniform.
    """
    draws, total = np.empty((len(trials), sum(sizes))), sum(sizes[:normal])
    for trial, row in zip(trials, draws, strict=True):
        sequence = np.random.SeedSequence(seed, spawn_key=(trial,))
        generator = np.random.Generator(np.random.PCG64(sequence))
        generator.standard_normal(out=row[:total])
        if total < len(row):
            generator.random(out=row[total:])
    return np.split(draws.T, np.cumsum(sizes)[:-1])


def in_moving_air(team: Team) -> bool:
    """Return whether the air may move; headings then differ from trial to trial."""
    return any(np.any(one.sigma(team) > 0.0) for one in ERROR_STATES.values() if one.act == "drift")


def has_misses(team: Team) -> bool:
    """Return whether sightings may be missed."""
    return bool(np.any(team.sensors.detection < 1.0))


def has_false_bearings(team: Team) -> bool:
    """Return whether bearings may be false."""
    return bool(np.any(team.sensors.false_bearings > 0.0))


def possible_sightings(team: Team, windows: Windows, steps: int) -> Sightings:
    """Return the sightings possible at k = 1..steps in any trial.

    `windows` are those of the nominal headings. In moving air, the view differs from trial to
    trial, so every target within range counts.
    """
    sensors = team.sensors
    if in_moving_air(team) and np.any(sensors.fields_of_view < FULL_VIEW):
        around = replace(sensors, fields_of_view=np.full(team.count, FULL_VIEW))
        windows = find_windows(replace(team, sensors=around))
    return sample_sightings(windows, team.orbits.period, sensors, 1, steps)


@dataclass(frozen=True, slots=True)
class TrialReadings:
    """Readings of any trials of a run.

    Attributes
    ----------
    team : team whose noise and errors are drawn
    truth : (steps + 1, n, 3) m, m, rad, at nominal headings
    setup : of the filter
    layout : of the filter's states
    sightings : (s,) without noise, at nominal headings; angles are not wrapped
    sigmas : (s,)
    seed : of all trials
    """

    team: Team
    truth: Array
    setup: FilterSetup
    layout: StateLayout
    sightings: Array
    sigmas: Array
    seed: int

    @classmethod
    def of(
        cls, team: Team, truth: Array, setup: FilterSetup, layout: StateLayout, seed: int
    ) -> "TrialReadings":
        """Return the readings of a team along a truth (steps + 1, n, 3)."""
        return cls(
            team=team,
            truth=truth,
            setup=setup,
            layout=layout,
            sightings=measured_by_kind(setup.kinds, *_away(truth, setup)),
            sigmas=sigmas_by_kind(team.sensors, setup.kinds, setup.observers),
            seed=seed,
        )

    def drawn(self, trials: range) -> tuple[Readings, Truth]:
        """Return noisy readings of trials with all their bias errors, and the truth."""
        steps, n, lanes = len(self.truth) - 1, self.team.count, len(trials)
        poses, speeds, turn_rates, sightings, lasting, *made = self._draws(trials)
        errors = DrawnErrors.of(self.team, steps, lasting)
        flown = self._flown(errors)
        noise = self.team.noise
        initial = (self._pose_sigmas()[:, None] * poses).reshape(n, 3, lanes)
        initial[:, :2] += self.truth[0, :, :2, None]
        initial[:, 2] += flown.headings[0]
        read, turned = np.empty((steps, n, lanes)), np.empty((steps, n, lanes))
        np.multiply(speeds.reshape(read.shape), noise.speed_sigma, out=read)
        np.multiply(turn_rates.reshape(turned.shape), noise.turn_rate_sigma, out=turned)
        read += flown.speeds * (1.0 / (1.0 + errors.constant("speed")))
        turned += flown.turn_rates - errors.constant("turn")
        readings = Readings(
            initial=np.ascontiguousarray(initial),
            speeds=read,
            turn_rates=turned,
            sightings=self._sighted(flown, errors, sightings, *made),
        )
        constants, changing = errors.states(self.layout, steps, lanes)
        flown_poses = np.empty((steps + 1, n, 3, flown.headings.shape[-1]))
        flown_poses[:, :, :2] = self.truth[:, :, :2, None]
        flown_poses[:, :, 2] = flown.headings
        return readings, Truth(flown_poses, constants, changing)

    def stream(self, trial: int) -> np.random.SeedSequence:
        """Return the stream of the random numbers that the filter of a trial draws."""
        return filter_stream(self.seed, trial)

    def _draws(self, trials: range) -> list[Array]:
        """Draws of poses, speeds, turn rates, sightings, errors, misses, false bearings.

        Each is (d, lanes).
        """
        steps, n = len(self.truth) - 1, self.team.count
        errors = error_draws(self.team, steps)
        normal = (3 * n, steps * n, steps * n, len(self.sightings), errors)
        missed = int(self._groups()[-1]) + 1 if self._misses() else 0
        sizes = (*normal, missed, len(self.sightings) if has_false_bearings(self.team) else 0)
        return split_draws(self.seed, trials, sizes, len(normal))

    def _pose_sigmas(self) -> Array:
        noise = self.team.noise
        deviations = [noise.position_sigma, noise.position_sigma, noise.heading_sigma]
        return np.tile(deviations, self.team.count)

    def _flown(self, errors: DrawnErrors) -> AirMotion:
        """Motion in each trial, in a single lane if all trials are alike."""
        orbits, steps = self.team.orbits, len(self.truth) - 1
        if in_moving_air(self.team):
            drift = np.asarray(errors.drift())
            return motion_in_air(orbits, self.team.sensors.sample_time, steps, drift)
        return AirMotion(
            headings=self.truth[:, :, 2, None],
            speeds=np.broadcast_to(orbits.speeds[:, None], (steps, orbits.count, 1)),
            turn_rates=np.broadcast_to(orbits.turn_rates[:, None], (steps, orbits.count, 1)),
        )

    def _sighted(
        self, flown: AirMotion, errors: DrawnErrors, noise: Array, detected: Array, false: Array
    ) -> Array:
        """Measured sightings (s, lanes); NaN where out of view or missed."""
        setup = self.setup
        found = np.multiply(noise, self.sigmas[:, None], order="C")
        late = any(ERROR_STATES[name].delays for name in errors.values)
        found += self._taken_later(flown, errors) if late else self.sightings[:, None]
        for name, values in errors.values.items():
            shifted = ERROR_STATES[name].shifts
            if shifted:
                chosen = setup.kinds == list(SIGHTING_KINDS).index(shifted)
                at = np.minimum(setup.sighted_at[chosen], len(values) - 1)
                found[chosen] += values[at, setup.observers[chosen], 0]
        if in_moving_air(self.team):
            step = setup.sighted_at
            turned = flown.headings[step, setup.observers]
            turned -= self.truth[step, setup.observers, 2, None]
            if np.any(self.team.sensors.fields_of_view < FULL_VIEW):
                found[self._out_of_view(turned)] = np.nan
            if not late:
                turned *= turns_by_kind(setup.kinds)[:, None]
                found += turned
        if len(false):
            self._mislead(found, noise, false)
        if len(detected):
            shares = self.team.sensors.detection[setup.observers]
            found[(detected[self._groups()] >= shares[:, None]) & self._missable()[:, None]] = (
                np.nan
            )
        return found

    def _mislead(self, found: Array, noise: Array, draws: Array) -> None:
        """Replace the share of false bearings by bearings anywhere in view, with their noise."""
        sensors, observers = self.team.sensors, self.setup.observers
        shares = sensors.false_bearings[observers]
        shares[self.setup.kinds != list(SIGHTING_KINDS).index("bearing")] = 0.0
        half = np.minimum(0.5 * sensors.fields_of_view[observers], np.pi)
        row, lane = np.nonzero((draws < shares[:, None]) & np.isfinite(found))
        where = 2.0 * draws[row, lane] / shares[row] - 1.0
        seen = sensors.boresights[observers[row]] + half[row] * where
        found[row, lane] = seen + self.sigmas[row] * noise[row, lane]

    def _taken_later(self, flown: AirMotion, errors: DrawnErrors) -> Array:
        """Sightings (s, lanes) without noise, at times shifted by each observer's clock offset.

        Positions follow the circles; headings go on as in the last sample. The view is that at the
        time of the stamp.
        """
        setup, orbits, time = self.setup, self.team.orbits, self.team.sensors.sample_time
        observers, targets, count = setup.observers, setup.targets, self.team.count
        among, step = np.where(targets < count, targets, observers), setup.sighted_at
        offsets = np.asarray(errors.constant("delay"))[observers]
        found = np.empty(offsets.shape)
        for lane, later in enumerate(offsets.T):
            at = step + later / time
            ahead = flown.headings[..., min(lane, flown.headings.shape[-1] - 1)]
            psi = ahead[step, observers]
            turned = psi - ahead[step - 1, observers]
            there, here = (
                orbits.centers[own]
                + orbits.radii[own, None]
                * unit(orbits.phases[own] + orbits.senses[own] * orbits.rate * time * at)
                for own in (among, observers)
            )
            if len(setup.landmarks):
                fixed = setup.landmarks[np.maximum(targets - count, 0)]
                there = np.where((targets < count)[:, None], there, fixed)
            heading = psi + (at - step) * turned
            found[:, lane] = measured_by_kind(setup.kinds, (there - here).T, heading)
        return found

    def _out_of_view(self, turned: Array) -> Flags:
        """Whether targets are out of view of headings `turned` from the nominal, (s, lanes)."""
        setup, sensors = self.setup, self.team.sensors
        away, heading = _away(self.truth, setup)
        ahead = np.arctan2(away[1], away[0]) - heading - sensors.boresights[setup.observers]
        half = 0.5 * sensors.fields_of_view[setup.observers] * (1.0 + BOUNDARY_SLACK)
        half[~of_targets(setup.kinds) | (half >= np.pi)] = np.inf
        return np.asarray(np.abs(wrap(ahead[:, None] - turned)) > half[:, None])

    def _misses(self) -> bool:
        return has_misses(self.team) and bool(self._missable().any())

    def _missable(self) -> Flags:
        """Whether each sighting may be missed, (s,)."""
        some = self.team.sensors.detection[self.setup.observers] < 1.0
        return np.asarray(some & of_targets(self.setup.kinds))

    def _groups(self) -> Index:
        """Index (s,) of each sighting's draw, common to one sample, observer and target."""
        setup, missable = self.setup, self._missable()
        of = np.column_stack([setup.sighted_at, setup.observers, setup.targets])[missable]
        new = np.ones(len(of), dtype=bool)
        new[1:] = np.any(of[1:] != of[:-1], axis=1)
        groups = np.zeros(len(missable), dtype=np.int64)
        groups[missable] = np.cumsum(new) - 1
        # the last must be the largest: sightings that can't be missed point at another's draw
        return np.maximum.accumulate(groups)


def _away(truth: Array, setup: FilterSetup) -> tuple[Array, Array]:
    """Vectors (2, s) m from observer to target, and nominal headings (s,) rad of observers."""
    step = setup.sighted_at
    fixed = np.broadcast_to(setup.landmarks, (len(truth), *setup.landmarks.shape))
    places = np.concatenate([truth[:, :, :2], fixed], axis=1)
    away = places[step, setup.targets] - places[step, setup.observers]
    return away.T, truth[step, setup.observers, 2]
