"""A formation as numbers between 0 and 1: its scenario, its faults and its predicted error.

    numbers -> circles, phases and landmarks -> faults -> posterior bound on a coarse sample grid

All vehicles have one radius and one speed. Phases are free: the rules of synchronisation serve
links, not errors, and finding phases by them takes longer than the bound. A candidate is first
screened: area, keep-outs, landmarks, purpose and distances cost a fraction of a millisecond. The
error of one that passes is that of the exact bound with fewer samples: sightings sharper in
proportion, motion noise of the same density.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import LossBounds, posterior_bound
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import closest_approach, find_windows, met_pairs
from syncplan.orbits.sightings import remainder_of, single_losses
from syncplan.orbits.team import Team, team_of
from syncplan.planning.judged_team import landmark_limit, separation_limit
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.purposes import PurposeMeasure
from syncplan.scenario.rules import excess
from syncplan.scenario.specification import Scenario

PERIODS = 10
"""Length of the run that errors are predicted for, in periods."""

SAMPLES = 48
"""Samples in a period of the coarse grid, about."""

FIELD_POINTS = 3000
"""Number of grid points in the box around the area, about."""

TRIES = 30
"""Number of random places for a further vehicle or landmark."""

_APART = 0.1
"""Share of the radius by which two landmarks are apart, at the least."""

UNFIT = 1e6
"""Value of a candidate with a fault, plus the size of its faults."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Number of vehicles and of landmarks, and whether senses alternate."""

    vehicles: int
    landmarks: int
    alternate: bool = False


@dataclass(frozen=True, slots=True)
class Candidate:
    """A formation.

    Attributes
    ----------
    radius, speed : m, m/s, of all vehicles
    phases : (n,) rad
    centers : (n, 2) m
    landmarks : (k, 2) m
    """

    radius: float
    speed: float
    phases: Array
    centers: Array
    landmarks: Array


class Space:
    """Candidates of a cell as points of a unit cube.

    Parameters
    ----------
    brief, cell : whose candidates
    """

    def __init__(self, brief: Brief, cell: Cell) -> None:
        self.brief, self.cell = brief, cell
        self._area = Area.of(brief.area_m, brief.keep_out_m)
        self.measure = PurposeMeasure.of(brief.purpose, self._area, FIELD_POINTS)
        self._corners, self._largest = self._area.corners, self._area.largest_radius()
        self._ranged = brief.vehicle.speeds[0] < brief.vehicle.speeds[1]
        sites = brief.landmarks
        self._sites = np.array(sites.listed, dtype=float).reshape(-1, 2)
        self._each = 0 if sites.given else 1 if sites.on_edge else 2
        self._bare = self._bare_team()

    @property
    def size(self) -> int:
        """Number of coordinates of a point."""
        return 1 + self._ranged + 3 * self.cell.vehicles + self._each * self.cell.landmarks

    def candidate(self, point: Array) -> Candidate:
        """Return the candidate at a point (size,) of the unit cube."""
        count = self.cell.vehicles
        slowest, fastest = self.brief.vehicle.speeds
        share, speed = float(point[0]), slowest
        if self._ranged:
            speed += (fastest - slowest) * float(point[1])
        phases, places, sites = np.split(point[1 + self._ranged :], [count, 3 * count])
        least = self.brief.vehicle.least_radius(speed)
        radius = least * (max(self._largest, least) / least) ** share
        low, high = self._corners
        middle = 0.5 * (low + high)
        first, last = np.minimum(low + radius, middle), np.maximum(high - radius, middle)
        return Candidate(
            radius=float(radius),
            speed=speed,
            phases=2.0 * np.pi * phases,
            centers=first + (last - first) * places.reshape(-1, 2),
            landmarks=self._landmarks(sites),
        )

    def _landmarks(self, places: Array) -> Array:
        sites, (low, high) = self.brief.landmarks, self._corners
        if sites.given:
            return self._sites
        if sites.on_edge:
            return self._area.on_edge(places)
        wished = low + (high - low) * places.reshape(-1, 2)
        if not sites.candidates_m:
            return self._area.nearest(wished)
        # each the nearest site that is left
        left, chosen = np.ones(len(self._sites), dtype=bool), []
        for place in wished:
            away = np.where(left, np.hypot(*(self._sites - place).T), np.inf)
            chosen.append(int(np.argmin(away)))
            left[chosen[-1]] = False
        return np.asarray(self._sites[np.sort(chosen)])

    def keys(self, candidate: Candidate) -> dict[str, Any]:
        """Return the keys of a candidate's scenario."""
        brief, vehicle = self.brief, self.brief.vehicle
        orbit: dict[str, Any] = {"radius_m": candidate.radius, "speed_mps": candidate.speed}
        if self.cell.alternate:
            orbit["direction"] = ["ccw" if sense > 0.0 else "cw" for sense in self._senses]
        limits: dict[str, Any] = {}
        if self._ranged:
            limits["speed_mps"] = list(vehicle.speeds)
        if vehicle.turn_rate_rad_s is not None:
            limits["turn_rate_rad_s"] = vehicle.turn_rate_rad_s
        return {
            **({"name": brief.name} if brief.name else {}),
            "orbit": orbit,
            "formation": {"centers_m": candidate.centers.tolist()},
            "landmarks_m": candidate.landmarks.tolist(),
            **brief.shared_keys(),
            **({"limits": limits} if limits else {}),
            "duration_s": PERIODS * 2.0 * np.pi * candidate.radius / candidate.speed,
        }

    def plan(self, point: Array) -> Plan:
        """Return the plan at a point (size,), judged by the exact code."""
        return judge(*self.formation(point))

    def formation(self, point: Array) -> tuple[Scenario, Orbits]:
        """Return the scenario and the orbits at a point (size,)."""
        one = self.candidate(point)
        keys = self.keys(one)
        team = self._team(one)
        pairs = sorted(met_pairs(team, find_windows(team)))
        names = [(f"v{a + 1}", f"v{b + 1}") for a, b in pairs]
        # phases are free, so just those pairs are links that meet
        keys["formation"]["links"] = names
        return scenario_from(keys), self._orbits(one)

    # --- judgement --------------------------------------------------------------------------------

    def value(self, point: Array) -> float:
        """Return the worst predicted RMS error in m at a point, or UNFIT and the size of faults.

        Where the need must hold after losses, it is the worst after any single loss.
        """
        one = self.candidate(point)
        fault = sum(self._faults(one).values())
        if fault > 0.0:
            return UNFIT + fault
        team = self._team(one)
        windows, length = find_windows(team), PERIODS * team.orbits.period
        try:
            worst = float(posterior_bound(team, windows, length).rms_second_half().max())
            if self.brief.need.losses:
                whole = LossBounds.along(team, windows, length)
                for loss in single_losses(team):
                    left = whole.after(remainder_of(team, loss)).rms_second_half()
                    worst = max(worst, float(left.max()))
        except NoSolutionError:
            return UNFIT
        return worst

    def faults(self, point: Array) -> dict[str, float]:
        """Return the size of each fault at a point, by the requirement that it misses."""
        return self._faults(self.candidate(point))

    def _faults(self, one: Candidate) -> dict[str, float]:
        """Sizes of faults as shares of lengths; those of vehicles too close only without others."""
        radii = np.full(self.cell.vehicles, one.radius)
        clear = self._area.path_clearances(one.centers, radii)
        area = float(np.maximum(-clear, 0.0).sum()) / one.radius
        faults = {"area": area + self.measure.shortfall(one.centers, radii), "landmarks": 0.0}
        if len(one.landmarks):
            away = np.hypot(*(one.centers[:, None] - one.landmarks[None]).transpose(2, 0, 1))
            limit = landmark_limit(self._bare[1]).least(radii)
            near = np.maximum(limit - np.abs(away - one.radius), 0.0)
            a, b = np.triu_indices(len(one.landmarks), 1)
            apart = np.hypot(*(one.landmarks[a] - one.landmarks[b]).T)
            least = _APART * one.radius
            faults["landmarks"] = float(near.sum() + np.maximum(least - apart, 0.0).sum()) / least
        if not any(faults.values()):
            least = separation_limit(self._bare[1]).least(radii)
            nearest = closest_approach(self._orbits(one))
            distance = least if nearest is None else nearest.distance
            faults["separation"] = max(1.0 - distance / least, 0.0) if least > 0.0 else 0.0
        return faults

    def extended(self, point: Array, cell: Cell, seed: int) -> Array:
        """Return the point of a smaller cell with further vehicles and landmarks.

        Of so many random places for them, these are the best.
        """
        generator = np.random.default_rng((seed, self.cell.vehicles, self.cell.landmarks))
        tries = generator.uniform(0.0, 1.0, (TRIES, self.size))
        return min((self._joined(point, cell, one) for one in tries), key=self.value)

    def _joined(self, point: Array, cell: Cell, more: Array) -> Array:
        """The point of a smaller cell, and beyond its coordinates those of another point."""
        more = more.copy()
        own, count = 1 + self._ranged, self.cell.vehicles
        ends = own, own + cell.vehicles, own + 3 * cell.vehicles
        begins = 0, own, own + count, own + 3 * count
        for begin, part in zip(begins, np.split(point, ends), strict=True):
            more[begin : begin + len(part)] = part
        return more

    def _team(self, one: Candidate) -> Team:
        """The team of a candidate on the coarse sample grid."""
        team = coarse(self._bare[0].on(self._orbits(one)))
        return replace(team, landmarks=one.landmarks)

    def _orbits(self, one: Candidate) -> Orbits:
        radii, phases = np.full(self.cell.vehicles, one.radius), one.phases % (2.0 * np.pi)
        return Orbits(one.centers, radii, self._senses, phases, one.speed / one.radius)

    @property
    def _senses(self) -> Array:
        """Senses (n,): every second vehicle turns the other way where they alternate."""
        senses = np.ones(self.cell.vehicles)
        if self.cell.alternate:
            senses[1::2] = -1.0
        return senses

    def _bare_team(self) -> tuple[Team, Scenario]:
        """A team of the cell with the brief's sensors and noise, anywhere, and its scenario."""
        point = np.full(self.size, 0.5)
        count = self.cell.vehicles
        apart = 3.0 * self.brief.vehicle.least_radius(self.brief.vehicle.speeds[1])
        one = replace(
            self.candidate(point),
            centers=apart * np.arange(count)[:, None] * np.array([[1.0, 0.0]]),
            landmarks=np.zeros((0, 2)),
        )
        scenario = scenario_from(self.keys(one))
        zeros = np.zeros(count)
        circles = Orbits(one.centers, zeros + one.radius, zeros + 1.0, zeros, scenario.orbit.rate)
        return team_of(scenario, circles), scenario


def check_samples(brief: Brief) -> None:
    """Raise InputError if the run of a candidate may have more samples than a scenario's may."""
    slowest = brief.vehicle.speeds[0]
    area = Area.of(brief.area_m, brief.keep_out_m)
    radius = max(area.largest_radius(), brief.vehicle.least_radius(slowest))
    period = 2.0 * np.pi * radius / slowest
    problem = excess(PERIODS * period, brief.sensor.sample_time_s, period, brief.team.max)
    if problem:
        raise InputError(
            f"{PERIODS} periods of the largest circle: {problem}", key="sensor.sample_time_s"
        )


def coarse(team: Team) -> Team:
    """Return the team with about SAMPLES samples in a period and the same information.

    A sighting stands for all of its share of time, and motion noise keeps its density.
    """
    sensors, wished = team.sensors, team.orbits.period / SAMPLES
    interval = sensors.sample_time * int(sensors.every.max())
    every = max(int(np.ceil(interval / wished - 1e-9)), 1)
    time = wished if every == 1 else interval / every
    sharper = np.sqrt(interval / time) if every == 1 else 1.0
    compass = np.sqrt(sensors.sample_time * int(np.max(sensors.compass_every)) / time)
    slower = np.sqrt(sensors.sample_time / time)
    return replace(
        team,
        sensors=replace(
            sensors,
            sample_time=time,
            every=np.full_like(sensors.every, every),
            bearing_sigmas=sensors.bearing_sigmas * sharper,
            range_sigmas=sensors.range_sigmas * sharper,
            compass_every=np.ones_like(sensors.compass_every),
            compass_sigmas=sensors.compass_sigmas * compass,
        ),
        noise=replace(
            team.noise,
            speed_sigma=team.noise.speed_sigma * slower,
            turn_rate_sigma=team.noise.turn_rate_sigma * slower,
        ),
    )
