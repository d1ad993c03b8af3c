"""Small teams whose phases are chosen, and the best phases of all by brute force."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from syncplan.arrays import Array, Flags, Index, as_pairs
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import circle_gaps, find_windows
from syncplan.orbits.team import Sensors, Team
from syncplan.planning.plans import Plan
from syncplan.synchronisation.contact_tables import contact_of_pairs, seeing_team
from syncplan.synchronisation.phase_rules import closest_distance, rules_of
from syncplan.synchronisation.phases import Synchronisation, synchronise

_TURN = 2.0 * np.pi
_STEPS = {2: 720, 3: 360, 4: 72}
"""Phases of each free vehicle on the grid, by the size of the team."""

_SAMPLES = 4096
_ZOOMS, _ZOOMED = 8, 40


@dataclass(frozen=True)
class PhaseTeam:
    """Circles, senses, sensors and links (e, 2) of a team, and the separation in m it keeps."""

    centers: Array
    radii: Array
    senses: Array
    sensors: Sensors
    pairs: Index
    separation: float

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return len(self.radii)

    def orbits(self, phases: Array) -> Orbits:
        """Return the circles with these phases (n,)."""
        return Orbits(self.centers, self.radii, self.senses, phases, 1.0)

    def flown(self, phases: Array) -> Team:
        """Return the team with these phases (n,), as far as seeing goes."""
        return seeing_team(self.orbits(phases), self.sensors)

    def synchronised(self, *, margin_bound: bool = False) -> Synchronisation:
        """Return the phases that syncplan finds."""
        return synchronise(
            self.centers,
            self.radii,
            self.senses,
            self.sensors.ranges,
            self.pairs,
            0.3,
            self.separation,
            margin_bound=margin_bound,
            sensors=self.sensors,
        )


def team_of(
    centers: Array,
    pairs: Index,
    sensors: Sensors,
    *,
    radii: Array | float = 20.0,
    senses: Array | float = 1.0,
    separation: float = 0.0,
) -> PhaseTeam:
    """Return a team; links out of range of both vehicles are left out."""
    count = len(centers)
    size, turns = np.broadcast_to(radii, count) * 1.0, np.broadcast_to(senses, count) * 1.0
    reach = np.maximum(sensors.ranges[pairs[:, 0]], sensors.ranges[pairs[:, 1]])
    pairs = pairs[circle_gaps(centers, size, pairs) < reach]
    return PhaseTeam(centers, size, turns, sensors, pairs, separation)


def cameras(count: int, reach: float, view: float, boresight: float) -> Sensors:
    """Return equal sensors of `count` vehicles: range in m, field of view and boresight in rad."""
    same = np.ones(count)
    return Sensors(reach * same, view * same, boresight * same, same, 0.1)


def draw_apart(generator: np.random.Generator) -> PhaseTeam:
    """Return a team of 3 or 4 with an all-round view and a separation that it is to keep."""
    count = int(generator.integers(3, 5))
    links = [pair for pair in combinations(range(count), 2) if generator.random() < 0.8]
    equal, one_sense = generator.random(2) < 0.4
    return team_of(
        generator.uniform(0.0, 90.0, (count, 2)),
        as_pairs(links),
        cameras(count, float(generator.uniform(40.0, 80.0)), _TURN, 0.0),
        radii=20.0 if equal else generator.uniform(12.0, 26.0, count),
        senses=1.0 if one_sense else generator.choice([-1.0, 1.0], count),
        separation=float(generator.uniform(3.0, 25.0)),
    )


def draw_seeing(generator: np.random.Generator, *, tree: bool) -> PhaseTeam:
    """Return a team with limited fields of view: a tree of 2 to 6, or 3 or 4 linked throughout.

    Circles do not cross, so that nothing but range and view limits a link.
    """
    count = int(generator.integers(2, 7) if tree else generator.integers(3, 5))
    equal, one_sense, alike = generator.random(3) < 0.5
    radii = np.full(count, 20.0) if equal else generator.uniform(12.0, 26.0, count)
    centers = np.zeros((count, 2))
    links = []
    for k in range(1, count):
        parent = int(generator.integers(0, k))
        links.append((parent, k))
        angle = generator.uniform(0.0, _TURN)
        away = radii[parent] + radii[k] + generator.uniform(0.5, 25.0)
        centers[k] = centers[parent] + away * np.array([np.cos(angle), np.sin(angle)])
    if not tree:
        links = [
            (a, b)
            for a, b in combinations(range(count), 2)
            if np.hypot(*(centers[a] - centers[b])) > radii[a] + radii[b]
        ]
    number = 1 if alike else count
    sensors = cameras(count, 1.0, 1.0, 0.0)
    return team_of(
        centers,
        as_pairs(links),
        Sensors(
            np.broadcast_to(generator.uniform(30.0, 70.0, number), count) * sensors.ranges,
            np.broadcast_to(generator.uniform(0.5, 5.0, number), count) * 1.0,
            np.broadcast_to(generator.uniform(-np.pi, np.pi, number), count) * 1.0,
            sensors.bearing_sigmas,
            0.1,
        ),
        radii=radii,
        senses=1.0 if one_sense else generator.choice([-1.0, 1.0], count),
    )


def meet_when_shifted(made: Plan, slip: float) -> bool:
    """Return whether the first two vehicles see each other with the second's phase slipped, rad."""
    phases = made.orbits.phases + slip * (np.arange(made.orbits.count) == 1)
    pair = np.array([0, 1])
    windows = find_windows(made.team.on(replace(made.orbits, phases=phases)), (pair, pair[::-1]))
    return bool(len(windows.starts))


# --- contact --------------------------------------------------------------------------------------


def contact_curves(team: PhaseTeam, steps: int) -> Array:
    """Return (e, steps) contact, in parts of a period, over theta_a - theta_b = 2 pi j / steps."""
    difference = np.arange(steps) * (_TURN / steps)
    found = []
    for pair in team.pairs.tolist():
        two = np.array(pair)
        chosen = np.tile(two, steps)
        phases = np.zeros((steps, 2))
        phases[:, 0] = team.senses[two[0]] * difference
        orbits = Orbits(
            team.centers[chosen], team.radii[chosen], team.senses[chosen], phases.ravel(), 1.0
        )
        each = 2 * np.arange(steps)
        found.append(
            contact_of_pairs(
                seeing_team(orbits, team.sensors.only(chosen)), np.column_stack([each, each + 1])
            )
        )
    return np.array(found).reshape(len(team.pairs), steps)


def largest_shares(team: PhaseTeam) -> tuple[float, int]:
    """Return the largest smallest share of contact over a grid of phases, and the most links met.

    Links that no phases serve are left out.
    """
    curves = contact_curves(team, 720)
    seen = curves.max(axis=1) > 0.0
    shares = curves[seen] / curves[seen].max(axis=1)[:, None]
    theta = _grid(team.count)
    step = _TURN / 720
    worst = np.full(theta.shape[1], np.inf)
    met = np.zeros(theta.shape[1], dtype=np.int64)
    for (a, b), share in zip(team.pairs[seen].tolist(), shares, strict=True):
        here = share[np.rint((theta[a] - theta[b]) / step).astype(np.int64) % 720]
        worst = np.minimum(worst, here)
        met += here > 0.01
    return float(worst.max()), int(met.max())


def shares_of(team: PhaseTeam, phases: Array, *, lasting: bool = False) -> tuple[Array, Flags]:
    """Return each link's share (e,) of the most that 720 phases give it, and whether any serve it.

    The share of a link that none serve is 1. With `lasting`, the most is that of two neighbouring
    phases: equal circles in step at the edge of range have a peak a thousandth of a radian wide.
    """
    curves = contact_curves(team, 720)
    most = (np.minimum(curves, np.roll(curves, 1, axis=1)) if lasting else curves).max(axis=1)
    contact = contact_of_pairs(team.flown(phases), team.pairs)
    seen = most > 0.0
    return np.where(seen, contact / np.where(seen, most, 1.0), 1.0), seen


# --- margins --------------------------------------------------------------------------------------


def largest_margin_apart(team: PhaseTeam) -> float:
    """Return the largest smallest margin in m of phases that keep the separation, all links served.

    A grid of phases, then ever finer ones around its best. Pairs that no phases keep apart need
    not be. Minus infinity if the grid has no such phases.
    """
    every = as_pairs(list(combinations(range(team.count), 2)))
    rules = rules_of(team.orbits(np.zeros(team.count)), team.sensors.ranges, every)
    residual = np.linspace(-np.pi, np.pi, _SAMPLES + 1)
    least = closest_distance(rules, np.broadcast_to(residual, (len(every), _SAMPLES + 1)))
    linked = {(int(a), int(b)) for a, b in team.pairs}

    def smallest(theta: Array) -> Array:
        worst = np.full(theta.shape[1], np.inf)
        for row, (a, b) in enumerate(every.tolist()):
            away = (theta[a] - theta[b] - rules.offset[row] + np.pi) % _TURN - np.pi
            near = np.interp(away, residual, least[row])
            if least[row].max() >= team.separation:
                worst[near < team.separation] = -np.inf
            if (a, b) in linked:
                worst = np.minimum(worst, rules.reach[row] - near)
        return worst

    theta = _grid(team.count)
    value = smallest(theta)
    best = float(value.max())
    places = theta[:, np.argsort(-value)[:_ZOOMED]]
    width = _TURN / _STEPS[team.count]
    for _ in range(_ZOOMS):
        steps = np.meshgrid(*[np.linspace(-width, width, 5)] * (team.count - 1))
        around = np.stack([np.zeros(steps[0].size), *(one.ravel() for one in steps)])
        finer = places[:, :, None] + around[:, None]
        values = smallest(finer.reshape(team.count, -1)).reshape(places.shape[1], -1)
        best = max(best, float(values.max()))
        places = finer[:, np.arange(len(values)), np.argmax(values, axis=1)]
        width *= 0.5
    return best


def _grid(count: int) -> Array:
    """(n, k) phases on a grid, the first vehicle's 0."""
    steps = np.arange(_STEPS[count]) * (_TURN / _STEPS[count])
    free = np.meshgrid(*[steps] * (count - 1))
    return np.stack([np.zeros(free[0].size), *(one.ravel() for one in free)])
