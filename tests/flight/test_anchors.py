"""Anchors: a tree of largest least slack; circles that move to them."""

from itertools import product

import numpy as np
import pytest

from syncplan.arrays import Array, Index
from syncplan.estimation.correction_kernels import correction_of
from syncplan.flight.flying import flight_run
from syncplan.guidance.anchors import Anchors, anchors_of
from syncplan.guidance.flight_setup import Contact
from syncplan.guidance.tracking_law import move_circles
from syncplan.orbits.circles import Orbits, relative_motion
from syncplan.orbits.contacts import find_windows, least_distances
from syncplan.orbits.team import Sensors, Team
from syncplan.planning.plan_flights import FlightRun
from tests.tools.draws import NOISE
from tests.tools.on_paper import plan
from tests.tools.scenarios import example

LANES = np.zeros(1, dtype=np.int8)


def _team(seed: int, count: int = 4) -> Team:
    """Vehicles and two landmarks anywhere."""
    generator = np.random.default_rng([17, seed])
    orbits = Orbits(
        generator.uniform(0.0, 120.0, (count, 2)),
        generator.uniform(10.0, 25.0, count),
        np.where(generator.random(count) < 0.5, 1.0, -1.0),
        generator.uniform(0.0, 6.28, count),
        0.2,
    )
    sensors = Sensors(
        generator.uniform(20.0, 60.0, count),
        np.full(count, 7.0),
        np.zeros(count),
        np.full(count, 0.1),
        0.1,
    )
    return Team(orbits, generator.uniform(0.0, 120.0, (2, 2)), sensors, NOISE)


def _slacks(team: Team) -> Array:
    """(n + m, n + m) largest slack of the meetings of two bodies, from sampled paths."""
    windows, n = find_windows(team), team.count
    found = np.full((n + len(team.landmarks),) * 2, -np.inf)
    for o, t in zip(windows.observers, windows.targets, strict=True):
        motion = relative_motion(team.orbits, np.array([o]), np.array([t]), team.landmarks)
        slack = team.sensors.ranges[o] - least_distances(motion)[0][0]
        found[o, t] = found[t, o] = max(found[o, t], slack)
    return found


def _reached(slacks: Array, n: int) -> list[int]:
    """The vehicles with a way to any landmark."""
    meet = slacks > -np.inf
    there = meet[:n, n:].any(axis=1)
    for _ in range(n):
        there |= (meet[:n, :n] & there).any(axis=1)
    return np.flatnonzero(there).tolist()


@pytest.mark.parametrize("seed", range(12))
def test_no_spanning_tree_has_larger_slacks(seed: int) -> None:
    """Every choice of anchors of four vehicles without a cycle, those with a way to a landmark."""
    team = _team(seed)
    slacks, n = _slacks(team), team.count
    found = anchors_of(team, find_windows(team), 0.0)
    reached = _reached(slacks, n)
    best = -np.inf
    for chosen in product(range(n + 2), repeat=len(reached)):
        anchors = np.full(n, -1)
        anchors[reached] = chosen
        values = [slacks[i, anchors[i]] for i in reached]
        if min(values, default=0.0) > -np.inf and _ends(anchors, reached):
            best = max(best, float(np.sum(values)))
    assert found.slacks[reached].sum() == pytest.approx(best if reached else 0.0)


def _ends(anchors: Index, reached: list[int]) -> bool:
    for i in reached:
        at, steps = i, 0
        while 0 <= at < len(anchors) and steps <= len(anchors):
            at, steps = int(anchors[at]), steps + 1
        if at < len(anchors):
            return False
    return True


@pytest.mark.parametrize("seed", range(10))
def test_each_vehicle_follows_its_anchor_and_none_is_left_out(seed: int) -> None:
    team = _team(seed, 6)
    found = anchors_of(team, find_windows(team), 0.0)
    assert sorted(found.order.tolist()) == list(range(6))
    place = {int(vehicle): k for k, vehicle in enumerate(found.order)}
    for i, anchor in enumerate(found.bodies.tolist()):
        assert anchor >= 6 or anchor < 0 or place[anchor] < place[i]


def _grid() -> tuple[FlightRun, Anchors]:
    run = flight_run(plan(example("windy-grid"), bound="never", pilot=False), duration=60.0)
    team = run.team
    return run, anchors_of(team.team, team.windows, run.limits.separation)


def test_without_landmarks_a_part_is_anchored_in_its_best_met_vehicle() -> None:
    run, _ = _grid()
    team, windows = run.team.team, run.team.windows
    there = np.array([True] * 6 + [False] * 2)
    left = there[windows.targets]
    found = anchors_of(team, windows, 0.0, left, there)
    assert (found.bodies < 0).sum() == 1
    root = int(np.flatnonzero(found.bodies < 0)[0])
    assert root == found.order[0]
    assert found.most[root] == found.furthest[root] == 0.0
    assert found.slacks[root] == np.inf


def test_nobody_meets_anybody_and_all_stay_where_they_are() -> None:
    run, _ = _grid()
    windows = run.team.windows
    none = np.zeros(len(windows.observers), dtype=bool)
    found = anchors_of(run.team.team, windows, 0.0, none)
    assert found.bodies.tolist() == [-1] * 6


def test_circles_come_no_nearer_than_the_asked_separation() -> None:
    run, wide = _grid()
    team, windows = run.team.team, run.team.windows
    close = anchors_of(team, windows, 25.0)
    vehicles = (wide.bodies >= 0) & (wide.bodies < 6)
    assert np.all(close.furthest[vehicles] <= wide.furthest[vehicles])
    gap = 30.0  # of neighbours in this plan
    np.testing.assert_allclose(close.furthest[vehicles], gap - 25.0)
    np.testing.assert_allclose(wide.most[vehicles], 0.5 * gap)
    np.testing.assert_allclose(wide.furthest[vehicles], 0.85 * gap)


def test_a_vehicle_that_was_not_seen_for_longer_than_a_period_goes_furthest() -> None:
    """Without an anchor it is on its own circle; `test_closed_loop` has what else moves one."""
    run, _ = _grid()
    contact, states = run.team.setup.contact, run.team.filter_setup().states
    bodies = contact.anchors.bodies.tolist()
    leaf = next(i for i in range(6) if i not in bodies and 0 <= bodies[i] < 6)
    work, sure = correction_of(states, 20, 1), np.zeros((20, 20, 1))
    moved, seen = np.zeros((6, 2, 1)), np.zeros((6, 1), dtype=np.int64)

    def look(step: int, contact: Contact = contact) -> Array:
        sought = np.zeros_like(seen)
        move_circles(contact, states, sure, step, seen, moved, sought, work, LANES)
        return moved[..., 0].copy()

    assert contact.patience == 315
    assert np.all(look(315) == 0.0)
    own = look(316)
    assert np.hypot(*(own[leaf] - own[bodies[leaf]])) == pytest.approx(
        contact.anchors.furthest[leaf]
    )
    seen[:] = 315
    assert np.all(look(316) == 0.0)
    moved[:], alone = 5.0, contact.anchors.bodies.copy()
    alone[leaf] = -1
    lone = contact._replace(anchors=contact.anchors._replace(bodies=alone))
    assert np.all(look(316, lone) == 0.0)
