"""The filter's own model along the nominal path, dense, in each moment's own state.

Independent of the code under test: errors stand at each sample as they are then, not referred to
time 0; wind, scales, biases and gusts act in the transition. Only the order of the states is taken
from their layout.
"""

from collections.abc import Iterator

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import heading, position, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import StateLayout
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, sigmas_by_kind
from syncplan.orbits.sightings import sample_sightings
from syncplan.orbits.team import Team


def start_of(team: Team, layout: StateLayout) -> Array:
    """Return the (size, size) covariance at time 0, in m, rad and the units of the errors."""
    noise = team.noise
    pose = [noise.position_sigma, noise.position_sigma, noise.heading_sigma]
    return np.diag(np.concatenate([np.tile(pose, team.count), layout.sigmas]) ** 2)


def transition(team: Team, layout: StateLayout, k: int) -> tuple[Array, Array]:
    """Return (size, size) F and Q from sample k - 1 to sample k."""
    orbits, noise, dt = team.orbits, team.noise, team.sensors.sample_time
    now, after = heading(orbits, (k - 1) * dt), heading(orbits, k * dt)
    way = position(orbits, k * dt) - position(orbits, (k - 1) * dt)
    F, Q = np.eye(layout.size), np.zeros((layout.size, layout.size))
    for i in range(team.count):
        v, w = orbits.speeds[i], orbits.turn_rates[i]
        x, y, psi = range(3 * i, 3 * i + 3)
        F[x, psi], F[y, psi] = -way[i, 1], way[i, 0]
        by_speed = np.append(way[i] / v, 0.0)
        ahead = np.array([np.cos(after[i]), np.sin(after[i])])
        chord = np.array([np.sin(after[i]) - np.sin(now[i]), np.cos(now[i]) - np.cos(after[i])])
        by_rate = np.append(v * (dt * ahead / w - chord / w**2), dt)
        Q[x : psi + 1, x : psi + 1] = noise.speed_sigma**2 * np.outer(by_speed, by_speed)
        Q[x : psi + 1, x : psi + 1] += noise.turn_rate_sigma**2 * np.outer(by_rate, by_rate)
        effects = {
            "wind": dt * np.eye(3)[:2],
            "speed_scale": v * by_speed[None],
            "turn_rate_bias": by_rate[None],
            "gusts": dt * np.eye(3)[:2],
        }
        for name, moved in effects.items():
            for axis, column in enumerate(layout.columns.get(name, np.zeros((0, 0)))[i : i + 1].T):
                if column[0] >= 0:
                    F[x : psi + 1, column[0]] = moved[axis]
    if "gusts" in layout.names:
        own = layout.columns["gusts"].ravel()
        kept = np.exp(-dt / team.errors.gust_time)
        F[own, own] = kept
        Q[own, own] = team.errors.of("gusts") ** 2 * (1.0 - kept**2)
    for i, column in enumerate(layout.columns.get("bearing_walk", np.zeros((0, 1)))[:, 0]):
        if column >= 0:
            kept = np.exp(-dt / team.sensors.bearing_walk_times[i])
            F[column, column] = kept
            Q[column, column] = team.sensors.bearing_walk_sigmas[i] ** 2 * (1.0 - kept**2)
    return F, Q


def dense_run(
    team: Team, layout: StateLayout, steps: int
) -> Iterator[tuple[Array, Array, Array, Index]]:
    """Yield F, Q, rows over their sigmas (m, size) and their sightings (m, 3) of samples 1 on.

    The sightings are observers, targets and kinds.
    """
    seen = sample_sightings(find_windows(team), team.orbits.period, team.sensors, 1, steps)
    sigmas = sigmas_by_kind(team.sensors, seen.kinds, seen.observers)
    names = list(SIGHTING_KINDS)
    for k in range(1, steps + 1):
        places = position(team.orbits, k * team.sensors.sample_time)
        bodies = np.concatenate([places, team.landmarks])
        own = np.flatnonzero(seen.steps == k)
        H = np.zeros((len(own), layout.size))
        for row, s in zip(H, own, strict=True):
            a, b, kind = int(seen.observers[s]), int(seen.targets[s]), names[seen.kinds[s]]
            q = bodies[b] - bodies[a]
            rho = np.hypot(*q)
            clock = int(layout.columns.get("clock_offset", np.full((a + 1, 1), -1))[a, 0])
            if clock >= 0:
                row[clock] = _rate(team, k * team.sensors.sample_time, a, b, kind)
            if kind == "compass":
                row[3 * a + 2] = 1.0
                row /= sigmas[s]
                continue
            slope = q / rho if kind == "distance" else np.array([-q[1], q[0]]) / rho**2
            row[3 * a : 3 * a + 2] = -slope
            if b < team.count:
                row[3 * b : 3 * b + 2] = slope
            if kind == "bearing":
                row[3 * a + 2] = -1.0
                for name in ("bearing_bias", "bearing_walk"):
                    shifted = layout.columns.get(name)
                    if shifted is not None and shifted[a, 0] >= 0:
                        row[shifted[a, 0]] = 1.0
            row *= np.sqrt(team.sensors.detection[a]) / sigmas[s]
        sightings = np.column_stack([seen.observers[own], seen.targets[own], seen.kinds[own]])
        yield *transition(team, layout, k), H, sightings


def _rate(team: Team, time: float, a: int, b: int, kind: str) -> float:
    """How fast a sighting changes, by finite differences."""
    step, read = 1e-4, []
    for at in (time + step, time - step):
        bodies = np.concatenate([position(team.orbits, at), team.landmarks])
        q, psi = bodies[b] - bodies[a], heading(team.orbits, at)[a]
        read.append(float(SIGHTING_KINDS[kind].measured(q, psi)))
    gone = read[0] - read[1]
    return (gone if kind == "distance" else float(wrap(gone))) / (2.0 * step)


def dense_covariances(team: Team, layout: StateLayout, steps: int) -> Iterator[Array]:
    """Yield the covariance of a filter with these states after each sample, from time 0 on."""
    P = start_of(team, layout)
    yield P
    for F, Q, H, _ in dense_run(team, layout, steps):
        P = F @ P @ F.T + Q
        gain = np.linalg.solve(H @ P @ H.T + np.eye(len(H)), H @ P).T
        P = P - gain @ H @ P
        P = 0.5 * (P + P.T)
        yield P


def dense_true_covariances(
    team: Team, own: StateLayout, whole: StateLayout, steps: int
) -> Iterator[Array]:
    """Yield what the errors of the filter with `own` truly are, in the layout of all errors."""
    held = list(range(3 * team.count))
    for name in own.names:
        place = dict(zip(own.columns[name].ravel(), whole.columns[name].ravel(), strict=True))
        held += [int(place[column]) for column in sorted(place) if column >= 0]
    P, C = start_of(team, own), start_of(team, whole)
    yield C
    runs = zip(dense_run(team, own, steps), dense_run(team, whole, steps), strict=True)
    for (F, Q, H, _), (all_F, all_Q, all_H, _) in runs:
        P = F @ P @ F.T + Q
        gain = np.linalg.solve(H @ P @ H.T + np.eye(len(H)), H @ P).T
        P = P - gain @ H @ P
        wide = np.zeros((whole.size, len(H)))
        wide[held] = gain
        left = np.eye(whole.size) - wide @ all_H
        C = left @ (all_F @ C @ all_F.T + all_Q) @ left.T + wide @ wide.T
        yield C
