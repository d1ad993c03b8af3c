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
from syncplan.orbits.circles import Orbits, position
from syncplan.orbits.contacts import Windows, closest_approach, find_windows, met_pairs
from syncplan.orbits.sightings import remainder_of, single_losses
from syncplan.orbits.team import Team, team_of
from syncplan.planning.judged_team import landmark_limit, separation_limit
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief, Prefer
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

LARGE_TEAM = 10
"""Number of vehicles beyond which a candidate counts as several: its cost grows as their square."""

SCREENED = 0.2
"""Share of an evaluation that a candidate with a fault counts as."""

WHOLE_STEPS, BODY_STEPS = (0.1, 0.03, 0.01), (0.3, 0.1, 0.03, 0.01)
"""Standard deviations of steps in the unit cube: of a whole formation, and of one body."""

BODY_SHARE = 0.8
"""Share of steps that move a single body."""

_COLLISION = 1e-6
"""Share of the radius up to which a distance counts as none."""

_APART = 0.1
"""Share of the radius by which two landmarks are apart, at the least."""

OF_LOSS = 0.25
"""Share of an evaluation that a loss counts as: less than its cost, as there is more to search."""

STRAY = 3.0
"""Multiple of the predicted error by which vehicles may come nearer in flight than planned."""

UNFIT = 1e6
"""Value of a candidate with a fault, plus the size of its faults."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Number of vehicles and of landmarks, and whether senses alternate."""

    vehicles: int
    landmarks: int
    alternate: bool = False

    def cost(self, prefer: Prefer) -> float:
        """Return the cost of the team, without its sensors."""
        return self.vehicles * prefer.vehicle + self.landmarks * prefer.landmark

    def __str__(self) -> str:
        """Return the numbers in words."""
        return f"{self.vehicles} vehicles and {self.landmarks} landmarks"


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

    Attributes
    ----------
    size : number of coordinates of a point
    spent : number of candidates judged, weighed by team size and by the losses that were judged
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
        # every second vehicle turns the other way where senses alternate
        self._senses = np.where(cell.alternate * np.arange(cell.vehicles) % 2, -1.0, 1.0)
        self._weight = max(1.0, (cell.vehicles / LARGE_TEAM) ** 2)
        self.spent = 0.0
        # which body a coordinate moves, 0 for what all share, and whether it goes round
        shared = np.zeros(1 + self._ranged)
        vehicles, others = np.split(1 + np.arange(cell.vehicles + cell.landmarks), [cell.vehicles])
        parts = shared, vehicles, vehicles.repeat(2), others.repeat(self._each)
        self._bodies = np.concatenate(parts)
        self._round = np.repeat([False, True, False, self._each == 1], [*map(len, parts)])
        self.size = len(self._bodies)
        self._bare = self._bare_team()
        sited = replace(self._bare[0], landmarks=np.zeros((cell.landmarks, 2)))
        self._losses = single_losses(sited) if brief.need.losses else []

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
        """Return the scenario and the orbits at a point (size,).

        The run begins at the moment of the period after which vehicles stay apart for longest:
        until sightings show where they are, they are off by the initial errors.
        """
        candidate = self.candidate(point)
        keys = self.keys(candidate)
        team = self._team(candidate)
        pairs = sorted(met_pairs(team, find_windows(team)))
        # phases are free, so just those pairs are links that meet
        keys["formation"]["links"] = [(f"v{a + 1}", f"v{b + 1}") for a, b in pairs]
        scenario, orbits = scenario_from(keys), self._orbits(candidate)
        turns = np.arange(SAMPLES) * 2.0 * np.pi / SAMPLES
        places = position(orbits, turns / orbits.rate)
        a, b = np.triu_indices(orbits.count, 1)
        limit = separation_limit(scenario).least(orbits.radii)
        limit += STRAY * self.brief.initial_sigma.position_m
        near = (np.hypot(*(places[:, a] - places[:, b]).T) < limit).any(axis=0)
        begin = max(range(SAMPLES), key=lambda k: np.argmax(np.roll(near, -k)))
        phases = (orbits.phases + orbits.senses * turns[begin]) % (2.0 * np.pi)
        return scenario, replace(orbits, phases=phases)

    # --- judgement --------------------------------------------------------------------------------

    def value(self, point: Array, limit: float = np.inf) -> float:
        """Return the worst predicted RMS error in m at a point, or UNFIT and the size of faults.

        Where the need must hold after losses, it is the worst after any single loss. As soon as a
        part of it exceeds `limit`, that part is returned.
        """
        candidate = self.candidate(point)
        fault = sum(self.faults(candidate).values())
        if fault > 0.0:
            self.spent += SCREENED
            return UNFIT + fault
        self.spent += self._weight
        team = self._team(candidate)
        windows, length = find_windows(team), PERIODS * team.orbits.period
        try:
            worst = float(posterior_bound(team, windows, length).rms_second_half().max())
            if worst > limit:
                return worst
            near = self._nearness(candidate, STRAY * worst)
            if near > 0.0:
                return UNFIT + near
            if self._losses:
                worst = max(worst, self._after_losses(team, windows, length, limit))
        except NoSolutionError:
            return UNFIT
        return worst

    def _after_losses(self, team: Team, windows: Windows, length: float, limit: float) -> float:
        """The worst error in m after any loss, or the first that exceeds a limit."""
        whole, worst = LossBounds.along(team, windows, length), 0.0
        for k, loss in enumerate(tuple(self._losses)):
            self.spent += OF_LOSS * self._weight
            error = float(whole.after(remainder_of(team, loss)).rms_second_half().max())
            if error > worst:
                worst = error
                # the loss that decides comes first next time, as it soon exceeds a limit
                self._losses.insert(0, self._losses.pop(k))
            if worst > limit:
                break
        return worst

    def faults(self, candidate: Candidate) -> dict[str, float]:
        """Return the size of each fault of a candidate, by the requirement that it misses.

        Sizes are shares of lengths. Vehicles count as too close only without other faults.
        """
        centers, sites, radius = candidate.centers, candidate.landmarks, candidate.radius
        radii = np.full(self.cell.vehicles, radius)
        clear = self._area.path_clearances(centers, radii)
        area = float(np.maximum(-clear, 0.0).sum()) / radius
        faults = {"area": area + self.measure.shortfall(centers, radii), "landmarks": 0.0}
        if len(sites):
            away = np.hypot(*(centers[:, None] - sites[None]).transpose(2, 0, 1))
            limit = landmark_limit(self._bare[1]).least(radii)
            near = np.maximum(limit - np.abs(away - radius), 0.0)
            a, b = np.triu_indices(len(sites), 1)
            apart, least = np.hypot(*(sites[a] - sites[b]).T), _APART * radius
            faults["landmarks"] = float(near.sum() + np.maximum(least - apart, 0.0).sum()) / least
        if not any(faults.values()):
            faults["separation"] = self._nearness(candidate)
        return faults

    def _nearness(self, candidate: Candidate, margin: float = 0.0) -> float:
        """Share by which vehicles come nearer than the least distance and a margin in m."""
        least = separation_limit(self._bare[1]).least(np.full(self.cell.vehicles, candidate.radius))
        # without a limit, vehicles that turn against each other still need circles of their own
        wanted = least + margin if least > 0.0 else _COLLISION * candidate.radius
        nearest = closest_approach(self._orbits(candidate))
        return 0.0 if nearest is None else max(1.0 - nearest.distance / wanted, 0.0)

    # --- points near others -----------------------------------------------------------------------

    def step(self, generator: np.random.Generator) -> Array:
        """Return a random step (size,) of one vehicle or landmark, or of all of the formation."""
        whole = generator.uniform() >= BODY_SHARE
        deviation = generator.choice(WHOLE_STEPS if whole else BODY_STEPS)
        chosen = whole | (self._bodies == generator.choice(self._bodies))
        return np.where(chosen, deviation * generator.standard_normal(self.size), 0.0)

    def shifted(self, point: Array, step: Array) -> Array:
        """Return a point after a step, in the cube; phases, and places on an edge, go round."""
        after = point + step
        return np.where(self._round, after % 1.0, np.clip(after, 0.0, 1.0))

    def joined(self, point: Array, cell: Cell, generator: np.random.Generator) -> Array:
        """Return the point of a smaller cell with further vehicles and landmarks, at random.

        In half of the cases, these vehicles fly on circles of others with the same sense.
        """
        more = generator.uniform(size=self.size)
        bodies, count = self._bodies, self.cell.vehicles
        given = (bodies <= cell.vehicles) | (bodies > count) & (bodies <= count + cell.landmarks)
        more[given] = point
        first = 1 + self._ranged + count
        places = more[first : first + 2 * count].reshape(-1, 2)
        for k in range(cell.vehicles, count if generator.uniform() < 0.5 else 0):
            (same,) = np.nonzero(self._senses[:k] == self._senses[k])
            places[k] = places[same[int(places[k, 0] * len(same))]] if len(same) else places[k]
        return more

    def _team(self, candidate: Candidate) -> Team:
        """The team of a candidate on the coarse sample grid."""
        team = coarse(self._bare[0].on(self._orbits(candidate)))
        return replace(team, landmarks=candidate.landmarks)

    def _orbits(self, candidate: Candidate) -> Orbits:
        radius, phases = candidate.radius, candidate.phases % (2.0 * np.pi)
        radii, rate = np.full(self.cell.vehicles, radius), candidate.speed / radius
        return Orbits(candidate.centers, radii, self._senses, phases, rate)

    def _bare_team(self) -> tuple[Team, Scenario]:
        """A team of the cell with the brief's sensors and noise, anywhere, and its scenario."""
        apart = 3.0 * self.brief.vehicle.least_radius(self.brief.vehicle.speeds[1])
        candidate = replace(
            self.candidate(np.full(self.size, 0.5)),
            centers=apart * np.arange(self.cell.vehicles)[:, None] * np.array([[1.0, 0.0]]),
            landmarks=np.zeros((0, 2)),
        )
        scenario = scenario_from(self.keys(candidate))
        return team_of(scenario, self._orbits(candidate)), scenario


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
