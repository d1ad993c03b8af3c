"""How much faster the compiled Monte Carlo is than the same filter written with filterpy.

Both filter the paper's grid (section 5.1, all vehicles turning the same way, 200 s) with the same
readings; that they end at the same state is checked before anything is timed.

    python benchmarks/montecarlo.py
"""

import sys
import time
from pathlib import Path

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure
from syncplan.arrays import Array
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.lane_filter import EXTENDED
from syncplan.estimation.montecarlo import run_trials
from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.noise import Noise
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Sensors, Team
from syncplan.runtime.machine import usable_cores

Scene = tuple[Team, Sightings, int]

STEPS = 2000
SEED = 1

LEAST_TIMES = 200.0
"""How many times as fast as filterpy a trial is to be, for each core."""


def paper_grid_same() -> Scene:
    """Return team, sightings and steps of paper-grid-same: neighbours in opposite phase."""
    centers = np.array([[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]], dtype=float)
    landmarks = np.array([[190.0, 0.0], [190.0, 70.0]])
    opposite = np.pi * np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
    orbits = Orbits(centers, np.full(6, 20.0), np.ones(6), 0.3 + opposite, 0.2)
    sensors = Sensors(np.full(6, 50.0), np.full(6, 2 * np.pi), np.zeros(6), np.full(6, 0.1), 0.1)
    noise = Noise(0.1, 0.01, 5.0, 0.1)
    team = Team(orbits, landmarks, sensors, noise)
    windows = find_windows(team)
    sightings = sample_sightings(windows, orbits.period, sensors, 1, STEPS)
    return team, sightings, STEPS


class TeamFilter(ExtendedKalmanFilter):  # type: ignore[misc]
    """The team's filter as one writes it with filterpy: (x, y, heading) of each vehicle."""

    def __init__(self, x: Array, P: Array, noise: Noise, sample_time: float) -> None:
        super().__init__(dim_x=len(x), dim_z=1)
        self.x, self.P, self.sample_time = x, P, sample_time
        self.reading_variances = np.array([noise.speed_sigma**2, noise.turn_rate_sigma**2])

    def move(self, speeds: Array, turn_rates: Array) -> None:
        """Predict along exact arcs: F, Q and the state of all vehicles."""
        dt, n = self.sample_time, len(speeds)
        half = 0.5 * turn_rates * dt
        sinc = np.sinc(half / np.pi)
        slope = (np.cos(half) - sinc) / half
        cos, sin = np.cos(self.x[2::3] + half), np.sin(self.x[2::3] + half)
        dx, dy = speeds * dt * sinc * cos, speeds * dt * sinc * sin
        by_turn = (
            0.5 * speeds * dt**2 * np.array([slope * cos - sinc * sin, slope * sin + sinc * cos])
        )
        self.F, self.Q = np.eye(3 * n), np.zeros((3 * n, 3 * n))
        for i in range(n):
            self.F[3 * i : 3 * i + 2, 3 * i + 2] = -dy[i], dx[i]
            G = np.array(
                [
                    [sinc[i] * dt * cos[i], by_turn[0, i]],
                    [sinc[i] * dt * sin[i], by_turn[1, i]],
                    [0.0, dt],
                ]
            )
            self.Q[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = (G * self.reading_variances) @ G.T
        self.moved = np.column_stack([dx, dy, turn_rates * dt]).ravel()
        self.predict()

    def predict_x(self, u: object = 0) -> None:
        """Called by filterpy's predict."""
        self.x = self.x + self.moved


def bearing_row(x: Array, observer: int, target: int, landmarks: Array) -> Array:
    """Return the bearing's derivative (1, 3n)."""
    dx, dy = _away(x, observer, target, landmarks)
    square = dx**2 + dy**2
    row = np.zeros((1, len(x)))
    row[0, 3 * observer : 3 * observer + 3] = dy / square, -dx / square, -1.0
    if 3 * target < len(x):
        row[0, 3 * target : 3 * target + 2] = -dy / square, dx / square
    return row


def bearing(x: Array, observer: int, target: int, landmarks: Array) -> Array:
    """Return the bearing (1,) in rad."""
    dx, dy = _away(x, observer, target, landmarks)
    return np.array([np.arctan2(dy, dx) - x[3 * observer + 2]])


def _away(x: Array, observer: int, target: int, landmarks: Array) -> Array:
    n = len(x) // 3
    place = x[3 * target : 3 * target + 2] if target < n else landmarks[target - n]
    return np.asarray(place - x[3 * observer : 3 * observer + 2])


def filterpy_trial(scene: Scene, trial: int) -> Array:
    """Return the final error (n, 3) of one trial, drawn as by syncplan.estimation.montecarlo."""
    team, sightings, steps = scene
    orbits, landmarks, sensors, noise = team.orbits, team.landmarks, team.sensors, team.noise
    n, times = orbits.count, np.arange(steps + 1) * sensors.sample_time
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(SEED, spawn_key=(trial,))))
    truth = np.concatenate([position(orbits, times), heading(orbits, times)[..., None]], axis=2)
    sigmas = np.tile([noise.position_sigma, noise.position_sigma, noise.heading_sigma], n)
    start = truth[0].ravel() + sigmas * random.standard_normal(3 * n)
    speeds = orbits.speeds + noise.speed_sigma * random.standard_normal((steps, n))
    turn_rates = orbits.turn_rates + noise.turn_rate_sigma * random.standard_normal((steps, n))
    slips = random.standard_normal(len(sightings.steps))
    first = sightings.first_of_steps(steps)
    kalman = TeamFilter(start, np.diag(sigmas**2), noise, sensors.sample_time)
    for k in range(1, steps + 1):
        kalman.move(speeds[k - 1], turn_rates[k - 1])
        true = truth[k].ravel()
        for s in range(first[k], first[k + 1]):
            o, t = int(sightings.observers[s]), int(sightings.targets[s])
            sigma = sensors.bearing_sigmas[o]
            z = bearing(true, o, t, landmarks) + sigma * slips[s]
            pair = (o, t, landmarks)
            kalman.update(z, bearing_row, bearing, np.array([[sigma**2]]), pair, pair, _difference)
    error = kalman.x.reshape(n, 3) - truth[steps]
    error[:, 2] = wrap(error[:, 2])
    return np.asarray(error)


def _difference(a: Array, b: Array) -> Array:
    return wrap(a - b)


def main(trials: int = 1000, filterpy_trials: int = 3) -> dict[str, float]:
    """Return seconds per trial of both, their ratio, and how far their final errors differ."""
    scene = paper_grid_same()
    if not EXTENDED.is_compiled(scene[0].count):
        print("compiling the filter's kernels, once", file=sys.stderr)
    compiled = run_trials(*scene, FilterOptions(trials=filterpy_trials, seed=SEED))
    begin = time.perf_counter()
    errors = np.array([filterpy_trial(scene, trial) for trial in range(filterpy_trials)])
    slow = (time.perf_counter() - begin) / filterpy_trials
    difference = float(np.abs(errors - compiled.final_errors).max())
    if not difference < 1e-6:
        raise RuntimeError(f"the two filters differ by {difference}: nothing to compare")
    timings = []
    for threads in (1, None):
        begin = time.perf_counter()
        run_trials(*scene, FilterOptions(trials=trials, seed=SEED), threads=threads)
        timings.append((time.perf_counter() - begin) / trials)
    return {
        "filterpy_s": slow,
        "one_thread_s": timings[0],
        "all_cores_s": timings[1],
        "ratio_one_thread": slow / timings[0],
        "ratio_all_cores": slow / timings[1],
        "difference": difference,
    }


def figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of the Monte Carlo's result."""
    name, least = "Monte Carlo, a trial of 6 vehicles over 200 s", LEAST_TIMES * usable_cores()
    return [
        Figure(f"{name}: filterpy", result["filterpy_s"], "s"),
        Figure(f"{name}: one thread", result["one_thread_s"], "s"),
        Figure(f"{name}: all cores", result["all_cores_s"], "s"),
        Figure(f"{name}: faster than filterpy, one thread", result["ratio_one_thread"], "x"),
        Figure(f"{name}: faster than filterpy, all cores", result["ratio_all_cores"], "x", least),
    ]


if __name__ == "__main__":
    found = main()
    print(f"{'':24}{'ms per trial':>14}{'times as fast':>15}")
    print(f"{'filterpy':24}{1e3 * found['filterpy_s']:14.2f}{1:15.0f}")
    for name, label in (
        ("one_thread", "syncplan, one thread"),
        ("all_cores", "syncplan, all cores"),
    ):
        print(f"{label:24}{1e3 * found[name + '_s']:14.2f}{found['ratio_' + name]:15.0f}")
    print(f"final errors agree to {found['difference']:.1e}")
