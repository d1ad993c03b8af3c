"""Anchors: the body that keeps each vehicle in contact with the team, and the slack of contact.

A meeting still takes place while a vehicle is off its place by no more than the slack, which is the
range less the least distance of the two in the plan. Anchors maximise the least slack on the way
from a vehicle to the landmarks: they form a spanning tree of the meetings, grown from the landmarks
by the largest slack first. In a part of the team without a way to a landmark, the tree grows from
the vehicle with the most meetings, which has no anchor.

Source: Prim (1957), Shortest connection networks and some generalizations, for a tree of largest
instead of smallest edges.
"""

from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import relative_motion
from syncplan.orbits.contacts import Windows, least_distances
from syncplan.orbits.team import Team

NEARER, NEAREST = 0.5, 0.15
"""Share of the least distance to its anchor that remains when a circle moves: normally, and after a
period without a sighting. A circle may move until it is centred on a landmark."""


class Anchors(NamedTuple):
    """The anchor of each of n vehicles.

    Fields
    ------
    order : (n,) vehicles, each after its anchor; empty if circles stay where they are
    bodies : (n,) anchor of each vehicle; from n on a landmark, -1 for none
    toward : (n, 2) unit vector from the centre of the vehicle's circle to its anchor's
    slacks : (n,) m, distance by which the vehicle may be off its place and still meet its anchor
    most, furthest : (n,) m, largest shift of its circle towards its anchor: normally, and after a
        period without a sighting
    """

    order: Index
    bodies: Index
    toward: Array
    slacks: Array
    most: Array
    furthest: Array


def anchors_of(
    team: Team,
    windows: Windows,
    separation: float,
    left: Flags | None = None,
    there: Flags | None = None,
) -> Anchors:
    """Return the anchors of a team; no two vehicles are to come nearer than `separation` m.

    `left` (p,) marks the pairs of the windows that still meet, `there` (n + m,) the bodies that
    take part; None marks all.
    """
    n, orbits = team.count, team.orbits
    left = np.ones(len(windows.observers), dtype=bool) if left is None else left
    there = np.ones(n + len(team.landmarks), dtype=bool) if there is None else there
    observers, targets = windows.observers[left], windows.targets[left]
    least = least_distances(relative_motion(orbits, observers, targets, team.landmarks))[0]
    slack = team.sensors.ranges[observers] - least
    bodies = n + len(team.landmarks)
    slacks, gaps = np.full((bodies, bodies), -np.inf), np.zeros((bodies, bodies))
    np.maximum.at(slacks, (observers, targets), slack)
    slacks = np.maximum(slacks, slacks.T)
    gaps[observers, targets] = gaps[targets, observers] = least
    order, chosen = _tree(slacks, n, there)
    centers = np.concatenate([orbits.centers, np.reshape(team.landmarks, (-1, 2))])
    own = np.arange(n)
    anchored = np.maximum(chosen, 0)
    away = centers[anchored] - centers[:n]
    distance = np.hypot(away[:, 0], away[:, 1])
    gap = gaps[own, anchored]
    most, furthest = (
        np.where(chosen >= n, distance, gap - np.maximum(separation, share * gap))
        for share in (NEARER, NEAREST)
    )
    return Anchors(
        order=order,
        bodies=chosen,
        toward=np.ascontiguousarray(away / np.where(distance > 0.0, distance, 1.0)[:, None]),
        slacks=np.where(chosen < 0, np.inf, slacks[own, anchored]),
        most=np.where(chosen < 0, 0.0, np.maximum(most, 0.0)),
        furthest=np.where(chosen < 0, 0.0, np.maximum(furthest, 0.0)),
    )


def _tree(slacks: Array, n: int, there: Flags) -> tuple[Index, Index]:
    """Vehicles in the order in which the tree reaches them, and the body each is reached from."""
    reached = np.zeros(len(slacks), dtype=bool)
    reached[n:] = there[n:]
    order: list[int] = []
    chosen = np.full(n, -1, dtype=np.int64)
    while len(order) < n:
        edges = np.where(reached[:, None] & ~reached[:n], slacks[:, :n], -np.inf)
        best = int(np.argmax(edges)) if edges.size else 0
        body, vehicle = divmod(best, n)
        if edges.size and edges.flat[best] > -np.inf:
            chosen[vehicle] = body
        else:
            meets = np.isfinite(slacks[:n, :n]).sum(axis=1)
            vehicle = int(np.argmax(np.where(reached[:n], -1, meets)))
        reached[vehicle] = True
        order.append(vehicle)
    return np.array(order, dtype=np.int64), chosen
