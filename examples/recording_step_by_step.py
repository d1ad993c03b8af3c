"""A recording of real robots through the filter of a navigator, one step at a time.

`syncplan replay` runs the filter on a whole recording at once. On the robots it would run step by
step, and this program does: each step takes what was read since the last one. The estimates are
those of the replay, to rounding; where `robust` has just found its start, the replay counts the
estimate before, this program the one after. Name a recording, such as a
folder of MRCLAM; without one, the program records two simulated robots first.
"""

import csv
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import syncplan
from syncplan.estimation.recorded_run import run_of
from syncplan.estimation.replays import OPTIONS, online_filter_of, steps_of
from syncplan.orbits.circles import Orbits, heading, position


@dataclass(frozen=True)
class Found:
    """RMS position error over all robots in m, step by step and of the replay; steps taken."""

    online_m: float
    replay_m: float
    steps: int


def main(recording: str | None = None) -> Found:
    """Return the errors of a recording's filter, run step by step and at once."""
    if recording is None:
        with tempfile.TemporaryDirectory() as folder:
            return main(str(recorded(Path(folder))))
    log = syncplan.load_log(recording)
    whole = syncplan.replay(log, window=0.0)
    run = run_of(log, whole.settings, OPTIONS)
    online, squares = online_filter_of(run, OPTIONS), []
    for step in steps_of(run):
        online.step(step.speeds, step.turn_rates, step.arrived, step.span)
        if step.sample >= 0:
            off = online.poses[:, :2] - run.truth[step.sample, :, :2]
            squares.append(np.square(off).sum(axis=1).mean())
    error = float(np.sqrt(np.mean(squares)))
    return Found(error, float(whole.accuracy.overall().position), online.steps)


def recorded(folder: Path) -> Path:
    """Write what two robots on circles read in a minute and a half; return the folder."""
    draw = np.random.default_rng(4)
    places = {"L1": (4.0, 2.0), "L2": (-3.0, -3.0), "L3": (6.0, -3.0)}
    orbits = Orbits(
        centers=np.array([[0.0, 0.0], [3.0, 0.0]]),
        radii=np.array([1.5, 1.2]),
        senses=np.array([1.0, -1.0]),
        phases=np.array([0.0, 2.0]),
        rate=0.3,
    )
    odometry, sightings, truth = [], [], []
    for time in np.arange(0.0, 90.0, 0.1).tolist():
        where, ahead = position(orbits, time), heading(orbits, time)
        for k, name in enumerate(("r1", "r2")):
            truth.append((name, time, *where[k], ahead[k]))
            speed = orbits.speeds[k] + draw.normal(0.0, 0.02)
            odometry.append((name, time, speed, orbits.turn_rates[k] + draw.normal(0.0, 0.02)))
            bodies = places | {"r2" if k == 0 else "r1": tuple(where[1 - k])}
            target = list(bodies)[round(10.0 * time) % len(bodies)]
            away = np.array(bodies[target]) - where[k]
            bearing = np.arctan2(away[1], away[0]) - ahead[k] + draw.normal(0.0, 0.05)
            sightings.append((name, time, target, bearing))
    write(folder / "odometry.csv", "robot,time_s,speed_mps,turn_rate_rad_s", odometry)
    write(folder / "sightings.csv", "robot,time_s,target,bearing_rad", sightings)
    write(folder / "truth.csv", "robot,time_s,x_m,y_m,heading_rad", truth)
    write(folder / "landmarks.csv", "name,x_m,y_m", [(name, *at) for name, at in places.items()])
    return folder


def write(file: Path, head: str, rows: Sequence[tuple[object, ...]]) -> None:
    """Write a table as a CSV file."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([tuple(head.split(",")), *rows])


if __name__ == "__main__":
    found = main(*sys.argv[1:2])
    print(f"{found.steps} steps: RMS {found.online_m:.3f} m; replayed {found.replay_m:.3f} m")
