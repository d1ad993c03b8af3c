"""Polynomial trajectories of degree 7 as Crazyswarm2 reads them, one CSV file for each vehicle.

A row is a piece: its duration, then eight coefficients each of x, y, z and yaw, lowest power
first. Source: `uav_trajectory.py` of Crazyswarm2's package crazyflie_py.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.orbits.circles import Orbits, heading

TOLERANCE_M = 1e-4
"""Largest distance between a piece and its arc: a tenth of what is asked for."""

MOST_PIECES = 31
"""What a Crazyflie's trajectory memory of 4,096 bytes holds (crtp_commander_high_level.h)."""

MOST_PIECES_WRITTEN = 200_000
"""Of all vehicles together."""

FEWEST_PIECES = 2
"""A table of one row is read as a vector by loaders that call numpy.loadtxt without more ado."""

ORDER = 8

HEADER = ",".join(
    ["Duration", *(f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(ORDER))]
)


def write_crazyswarm(flown: ScheduledPlan) -> Written:
    """Return a trajectory file for each vehicle, in the plan's own frame, yaw along the path.

    Pieces join with continuous position, velocity, acceleration and jerk; yaw is exact and not
    wrapped.
    """
    orbits = flown.plan.orbits
    names = [f"{flown.title}-{label}.trajectory.csv" for label in flown.labels]
    files, longest = [], 0
    for k, name in enumerate(names):
        count = _piece_count(float(orbits.radii[k]), orbits.rate * flown.duration)
        longest = max(longest, count)
        if longest * orbits.count > MOST_PIECES_WRITTEN:
            raise InputError(
                f"{flown.duration:g}: makes trajectories of {longest:,} pieces; a Crazyflie holds "
                f"{MOST_PIECES}: give a shorter one",
                key="duration",
            )
        rows = arc_pieces(orbits, k, flown.duration, count, flown.altitudes[k])
        lines = [HEADER, *(",".join(f"{value:.12g}" for value in row) for row in rows.tolist())]
        files.append(ExportedFile(name, ("\n".join(lines) + "\n").encode()))
    notes = ["upload as absolute (not relative) trajectories, and start all at once from the entry"]
    if longest > MOST_PIECES:
        notes.append(
            f"trajectories of up to {longest} pieces: a Crazyflie holds {MOST_PIECES}; "
            "fly fewer turns, and the file again and again"
        )
    return Written(tuple(files), kind="trajectories", own_files=tuple(names), notes=tuple(notes))


def arc_pieces(orbits: Orbits, k: int, duration: float, count: int, altitude: float) -> Array:
    """Return (count, 33) rows of vehicle k: duration in s, then coefficients in m, rad and s.

    Each piece meets the circle in position, velocity, acceleration and jerk at both ends. A
    polynomial of degree 7 that does so is off by at most R (delta / 2)^8 / 8! on each axis, delta
    the angle of the piece (error of Hermite interpolation).
    """
    step = duration / count
    rate = orbits.senses[k] * orbits.rate
    phases = orbits.phases[k] + rate * step * np.arange(count)
    rows = np.zeros((count, 1 + 4 * ORDER))
    rows[:, 0] = step
    for axis, shift in enumerate((0.0, -np.pi / 2.0)):
        arc = _hermite(phases + shift, rate * step) * orbits.radii[k]
        arc[:, 0] += orbits.centers[k, axis]
        rows[:, 1 + axis * ORDER : 1 + (axis + 1) * ORDER] = arc / step ** np.arange(ORDER)
    rows[:, 1 + 2 * ORDER] = altitude
    rows[:, 1 + 3 * ORDER] = heading(orbits, step * np.arange(count))[:, k]
    rows[:, 2 + 3 * ORDER] = rate
    return rows


def _piece_count(radius: float, angle: float) -> int:
    """Fewest pieces of an arc of `angle` rad within TOLERANCE_M, no piece above a third turn."""
    half = math.pow(TOLERANCE_M * math.factorial(ORDER) / radius, 1.0 / ORDER)
    return max(FEWEST_PIECES, math.ceil(angle / min(2.0 * half, 2.0 * math.pi / 3.0) - 1e-9))


def _hermite(phases: Array, angle: float) -> Array:
    """(k, 8) coefficients in s on [0, 1] that meet cos(phase + angle s) three times over at ends.

    The first four are Taylor's; the others make the derivatives right at s = 1.
    """
    powers = np.arange(ORDER)
    derivatives = np.arange(4)
    start = _cosine_derivatives(phases, angle)
    end = _cosine_derivatives(phases + angle, angle)
    # falling[j, p]: the j-th derivative of s^p at s = 1
    falling = np.array([[math.perm(int(p), int(j)) for p in powers] for j in derivatives], float)
    low = start / np.array([math.factorial(int(j)) for j in derivatives])
    high = np.linalg.solve(falling[:, 4:], (end - low @ falling[:, :4].T).T).T
    return np.hstack([low, high])


def _cosine_derivatives(phases: Array, angle: float) -> Array:
    """(k, 4) derivatives by s, from none to three, of cos(phase + angle s) at s = 0."""
    order = np.arange(4)
    return np.asarray(np.cos(phases[:, None] + order * np.pi / 2.0) * angle**order)
