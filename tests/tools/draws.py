"""Random teams, a good part of them close to degenerate, for searches and property tests."""

from dataclasses import replace

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Sensors, Team

NOISE = Noise(speed_sigma=0.1, turn_rate_sigma=0.01, position_sigma=5.0, heading_sigma=0.1)


def draw_tree(
    generator: np.random.Generator, radii: Array, reach: float, clear: float
) -> Array | None:
    """Return centres (n, 2) along a random tree, neighbours within reach; None if none was found.

    All circles are more than `clear` times the reach apart.
    """
    centers = np.zeros((len(radii), 2))
    for k in range(1, len(radii)):
        for _ in range(200):
            parent = int(generator.integers(0, k))
            turn = generator.uniform(0.0, 2.0 * np.pi)
            away = radii[k] + radii[parent] + reach * generator.uniform(0.3, 0.85)
            centers[k] = centers[parent] + away * np.array([np.cos(turn), np.sin(turn)])
            apart = np.hypot(*(centers[:k] - centers[k]).T) - radii[:k] - radii[k]
            if np.all(apart > clear * reach):
                break
        else:
            return None
    return centers


def draw_team(generator: np.random.Generator, most: int = 5) -> Team:
    """Return a team of 1 to `most` vehicles along a random tree, with 1 to 4 landmarks.

    Near-degenerate on purpose, each with a probability of about a half: radii equal up to
    1e-10..1e-1, phases on the exact rule up to a residual of 1e-10..1, landmarks as near to each
    other as 1e-4 radii, fields of view narrow, one-way ranges, and the one-way degenerate ratio.
    """
    count = int(generator.integers(1, most + 1))
    size = 10.0 ** generator.uniform(-1.0, 2.0)
    radii = size * (
        generator.uniform(0.4, 1.6, count)
        if generator.random() < 0.4
        else 1.0 + _tiny(generator, count)
    )
    senses = generator.choice([-1.0, 1.0], count)
    if generator.random() < 0.3:
        senses[:] = senses[0]
    centers = np.zeros((count, 2))
    phases = generator.uniform(0.0, 2.0 * np.pi, count)
    for k in range(1, count):
        parent = int(generator.integers(0, k))
        bearing = generator.choice([0.0, 0.5, 1.0, 1.5]) * np.pi
        if generator.random() < 0.5:
            bearing = generator.uniform(0.0, 2.0 * np.pi)
        gap = size * generator.uniform(-0.5, 2.0)
        reach = radii[k] + radii[parent] + gap
        centers[k] = centers[parent] + reach * np.array([np.cos(bearing), np.sin(bearing)])
        if generator.random() < 0.7:
            same = senses[k] == senses[parent]
            rule = phases[parent] + np.pi if same else 2.0 * bearing + np.pi - phases[parent]
            phases[k] = rule + float(_tiny(generator, 1)[0])
        elif generator.random() < 0.5 and radii[k] < radii[parent] and senses[k] == senses[parent]:
            phases[k] = phases[parent] + np.arccos(radii[k] / radii[parent])
    return Team(
        Orbits(centers, radii, senses, phases, rate=1.0),
        _landmarks(generator, centers, radii, size),
        _sensors(generator, count, size),
        NOISE,
    )


def draw_equipped_team(generator: np.random.Generator, most: int = 5) -> Team:
    """Return a team of `draw_team` with further sensors, lasting errors and obstacles.

    A quarter has none. The others have each with a probability of about a half: distances and
    compasses on some vehicles, with sigmas over three orders of magnitude, sightings at intervals,
    misses, errors of each kind as states, and triangles that block sight.
    """
    team = draw_team(generator, most)
    if generator.random() < 0.25:
        return team
    count, size = team.count, float(team.orbits.radii.mean())

    def some(values: Array, without: float) -> Array:
        has = generator.random(count) < generator.choice([0.0, 0.5, 1.0])
        return np.where(has, values, without)

    sensors = replace(
        team.sensors,
        range_sigmas=some(size * 10.0 ** generator.uniform(-3.0, 0.0, count), np.inf),
        compass_sigmas=some(10.0 ** generator.uniform(-3.0, 0.0, count), np.inf),
        every=some(np.floor(generator.uniform(1.0, 6.0, count)), 1.0).astype(np.int64),
        detection=some(generator.uniform(0.05, 1.0, count), 1.0),
        bearing_bias_sigmas=some(10.0 ** generator.uniform(-3.0, -1.0, count), 0.0),
    )
    speed = size * team.orbits.rate
    wind, gust, scale, bias = (
        float(generator.choice([0.0, 10.0 ** generator.uniform(-3.0, -0.5)])) for _ in range(4)
    )
    sigmas = {
        "wind": wind * speed,
        "gusts": gust * speed,
        "speed_scale": scale,
        "turn_rate_bias": bias * team.orbits.rate,
    }
    triangles = [
        team.orbits.centers[generator.integers(0, count)]
        + size * (generator.uniform(-2.0, 2.0, 2) + generator.uniform(-0.5, 0.5, (3, 2)))
        for _ in range(int(generator.choice([0, 0, 1, 2])))
    ]
    # drawn last: all before stay as they were
    sensors = replace(
        sensors,
        bearing_walk_sigmas=some(10.0 ** generator.uniform(-3.0, -1.0, count), 0.0),
        bearing_walk_times=10.0 ** generator.uniform(0.0, 2.0, count) / team.orbits.rate,
    )
    clock = float(generator.choice([0.0, 10.0 ** generator.uniform(-3.0, -1.0)]))
    sigmas["clock_offset"] = clock / team.orbits.rate
    errors = ErrorSigmas(sigmas, estimated=tuple(ERROR_STATES))
    return replace(team, sensors=sensors, errors=errors, obstacles=tuple(triangles))


def draw_parallel_team(generator: np.random.Generator) -> Team:
    """Return a row of vehicles whose lines of sight hardly turn, with up to two landmarks.

    Radii are equal and phases on the rules to a share of 1e-9 to 1e-3; of two landmarks, half are
    as near to each other. Sensors are those of `draw_equipped_team`.
    """
    team = draw_equipped_team(generator, most=6)
    count, size = team.count, float(team.orbits.radii.mean())
    off, apart = 10.0 ** generator.uniform(-9.0, -3.0, 2)
    centers = size * np.column_stack([2.3 * np.arange(count), np.zeros(count)])
    phases = np.pi * np.arange(count)
    senses = np.ones(count)
    if generator.random() < 0.7:
        senses[1::2] = -1.0
    number = int(generator.integers(3))
    landmarks = centers[generator.integers(0, count, number)]
    landmarks += size * generator.uniform(-1.5, 1.5, (number, 2))
    if number == 2 and generator.random() < 0.5:
        landmarks[1] = landmarks[0] + apart * size * generator.uniform(-1.0, 1.0, 2)
    orbits = replace(
        team.orbits,
        centers=centers,
        radii=size * (1.0 + off * generator.uniform(-1.0, 1.0, count)),
        senses=senses,
        phases=phases + off * generator.uniform(-1.0, 1.0, count),
    )
    return replace(team, orbits=orbits, landmarks=landmarks)


def sightings_of(team: Team, last_step: int) -> Sightings:
    """Return what the team sees from step 0 to `last_step`."""
    windows = find_windows(team)
    return sample_sightings(windows, team.orbits.period, team.sensors, 0, last_step)


def _tiny(generator: np.random.Generator, count: int) -> Array:
    sizes = 10.0 ** generator.uniform(-10.0, -0.5, count)
    return np.asarray(generator.choice([-1.0, 1.0], count) * sizes)


def _landmarks(generator: np.random.Generator, centers: Array, radii: Array, size: float) -> Array:
    number = int(generator.integers(1, 5))
    near = generator.integers(0, len(radii), number)
    angle = generator.uniform(0.0, 2.0 * np.pi, number)
    distance = generator.uniform(0.0, 2.5, number) * size
    places = centers[near] + distance[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    if number > 1 and generator.random() < 0.5:
        offset = 10.0 ** generator.uniform(-4.0, 0.0) * size
        turn = generator.uniform(0.0, 2.0 * np.pi)
        places[1] = places[0] + offset * np.array([np.cos(turn), np.sin(turn)])
    return np.asarray(places)


def _sensors(generator: np.random.Generator, count: int, size: float) -> Sensors:
    ranges = size * generator.uniform(0.5, 4.0, count)
    if generator.random() < 0.5:
        ranges[:] = ranges[0]
    view = np.full(count, 2.0 * np.pi)
    if generator.random() < 0.3:
        view = generator.uniform(0.2, 2.0 * np.pi, count)
    return Sensors(
        ranges=ranges,
        fields_of_view=view,
        boresights=generator.uniform(-np.pi, np.pi, count),
        bearing_sigmas=generator.uniform(0.01, 0.2, count),
        sample_time=2.0 * np.pi / generator.uniform(15.0, 120.0),
    )
