"""Contact windows against an independent look at dense samples, refined by bisection."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits, heading, position, wrap
from syncplan.orbits.contacts import find_windows, merge_windows, reachable_pairs
from syncplan.orbits.sightings import sample_sightings
from syncplan.orbits.team import Sensors, Team
from syncplan.planning.planner import plan
from tests.tools.draws import NOISE
from tests.tools.obstructed import covered
from tests.tools.scenarios import example as scenario_example

SAMPLES = 3000
SHORT = 1e-5
"""Windows and gaps shorter than this many seconds may be absent."""


def _sees(
    orbits: Orbits, landmarks: np.ndarray, sensors: Sensors, a: int, b: int, t: np.ndarray
) -> np.ndarray:
    """Whether a sees b at times t, from positions and headings alone."""
    places = position(orbits, t)
    target = places[:, b] if b < orbits.count else landmarks[b - orbits.count]
    away = target - places[:, a]
    distance = np.linalg.norm(away, axis=1)
    bearing = np.arctan2(away[:, 1], away[:, 0]) - heading(orbits, t)[:, a]
    off = np.abs(wrap(bearing - sensors.boresights[a]))
    half = sensors.fields_of_view[a] / 2.0
    return np.asarray((distance <= sensors.ranges[a]) & ((off <= half) | (half >= np.pi)))


def _margin(
    orbits: Orbits, landmarks: np.ndarray, sensors: Sensors, a: int, b: int, t: float
) -> float:
    """Smallest slack of range (in m over the radius) and view (in rad) at t; its slope matters."""
    places = position(orbits, t)
    target = places[b] if b < orbits.count else landmarks[b - orbits.count]
    away = target - places[a]
    distance = float(np.linalg.norm(away))
    slack = [(sensors.ranges[a] - distance) / orbits.radii[a]]
    half = sensors.fields_of_view[a] / 2.0
    if half < np.pi:
        bearing = np.arctan2(away[1], away[0]) - heading(orbits, t)[a] - sensors.boresights[a]
        slack.append(half - abs(float(wrap(bearing))))
    return float(min(slack, key=abs))


def _changes(seen, low: float, high: float) -> float:  # type: ignore[no-untyped-def]
    """Time of the one change of `seen` between low and high, by bisection."""
    first = bool(seen(np.array([low]))[0])
    for _ in range(60):
        middle = 0.5 * (low + high)
        if bool(seen(np.array([middle]))[0]) == first:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def check(orbits: Orbits, landmarks: np.ndarray, sensors: Sensors) -> None:
    """Compare every pair's windows with dense sampling, both ways."""
    windows = find_windows(Team(orbits, landmarks, sensors, NOISE))
    found = {
        (int(a), int(b)): windows.of(k)
        for k, (a, b) in enumerate(zip(windows.observers, windows.targets, strict=True))
    }
    period = orbits.period
    bodies = orbits.count + len(landmarks)
    for a in range(orbits.count):
        for b in range(bodies):
            if a == b:
                continue
            exact = found.get((a, b), np.zeros((0, 2)))

            def seen(t: np.ndarray, a: int = a, b: int = b) -> np.ndarray:
                return _sees(orbits, landmarks, sensors, a, b, t)

            _check_inside(exact, seen, period)
            _check_edges(exact, seen, orbits, landmarks, sensors, a, b)


def _check_inside(exact, seen, period: float) -> None:  # type: ignore[no-untyped-def]
    """Just inside each window the target is seen; just outside it is not."""
    for start, end in exact:
        if end - start >= period:
            continue
        if end - start > SHORT:
            assert seen(
                np.array([start + 0.3 * SHORT, 0.5 * (start + end), end - 0.3 * SHORT])
            ).all()
    gaps = [
        (exact[k, 1], exact[k + 1, 0] if k + 1 < len(exact) else exact[0, 0] + period)
        for k in range(len(exact))
    ]
    for start, end in gaps:
        if end - start > SHORT:
            outside = np.array([start + 0.3 * SHORT, 0.5 * (start + end), end - 0.3 * SHORT])
            assert not seen(outside).any()


def _check_edges(  # type: ignore[no-untyped-def]
    exact, seen, orbits: Orbits, landmarks: np.ndarray, sensors: Sensors, a: int, b: int
) -> None:
    """Every change that dense sampling finds is an edge, to 1e-9 s where the crossing has slope."""
    period = orbits.period
    t = np.linspace(0.0, period, SAMPLES + 1)
    sampled = seen(t)
    disagree = sampled != covered(exact, t, period)
    edges = np.unique(exact % period) if len(exact) else np.array([])
    for k in np.flatnonzero(disagree):
        # only samples that sit on an edge, to within rounding, may disagree
        assert len(edges)
        assert np.min(np.abs(np.exp(2j * np.pi * (edges - t[k]) / period) - 1.0)) < 1e-6
    for k in np.flatnonzero(sampled[:-1] != sampled[1:]):
        moment = _changes(seen, t[k], t[k + 1])
        slope = abs(
            _margin(orbits, landmarks, sensors, a, b, moment + 1e-6)
            - _margin(orbits, landmarks, sensors, a, b, moment - 1e-6)
        )
        away = np.min(np.abs((edges - moment + 0.5 * period) % period - 0.5 * period))
        # 1e-9 s for slopes above 1e-3 a second; a flatter crossing moves by rounding over slope
        assert away < 1e-9 * max(1.0, 1e-3 / (slope / 2e-6 + 1e-12))


def _team(seed: int) -> tuple[Orbits, np.ndarray, Sensors]:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(2, 4))
    radii = generator.uniform(5.0, 25.0, count)
    if generator.random() < 0.3:
        radii[:] = radii[0]
    centers = generator.uniform(-40.0, 40.0, (count, 2))
    if generator.random() < 0.2:
        centers[1] = centers[0]
        radii[1] = radii[0] * generator.choice([0.5, 1.3])
    view = generator.choice([2.0 * np.pi, 0.15, 1.0, np.pi, 4.0, 6.0], count)
    orbits = Orbits(
        centers,
        radii,
        generator.choice([-1.0, 1.0], count),
        generator.uniform(0.0, 2.0 * np.pi, count),
        rate=float(generator.choice([0.2, 1.0, 3.0])),
    )
    landmarks = np.vstack(
        [centers[0] + generator.uniform(-0.5, 0.5, 2) * radii[0], generator.uniform(-60, 60, 2)]
    )
    sensors = Sensors(
        generator.uniform(8.0, 70.0, count),
        view,
        generator.uniform(-np.pi, np.pi, count),
        np.full(count, 0.1),
        0.1,
    )
    return orbits, landmarks, sensors


@given(st.integers(0, 2**32 - 1))
@example(0)
def test_windows_equal_dense_sampling_with_bisection(seed: int) -> None:
    check(*_team(seed))


def _pair(
    distance: float,
    radii: tuple[float, float] = (20.0, 20.0),
    senses: tuple[float, float] = (1.0, 1.0),
    phases: tuple[float, float] = (0.3, 0.3 + np.pi),
    reach: float = 50.0,
    view: float = 2.0 * np.pi,
    boresight: float = 0.0,
) -> tuple[Orbits, np.ndarray, Sensors]:
    orbits = Orbits(
        np.array([[0.0, 0.0], [distance, 0.0]]),
        np.array(radii),
        np.array(senses),
        np.array(phases),
        rate=1.0,
    )
    sensors = Sensors(
        np.full(2, reach), np.full(2, view), np.full(2, boresight), np.full(2, 0.1), 0.1
    )
    return orbits, np.array([[3.0, 4.0]]), sensors


@pytest.mark.parametrize("senses", [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
@pytest.mark.parametrize("reach", [29.9, 30.1, 60.0, 109.9, 110.1, 500.0])
@pytest.mark.parametrize("view", [2.0 * np.pi, 0.2, np.pi, 5.5])
def test_near_tangent_permanent_and_absent_contact(
    senses: tuple[float, float], reach: float, view: float
) -> None:
    check(*_pair(70.0, senses=senses, phases=(0.3, np.pi - 0.3), reach=reach, view=view))


@pytest.mark.parametrize("senses", [(1.0, 1.0), (1.0, -1.0)])
def test_concentric_circles(senses: tuple[float, float]) -> None:
    for view in (2.0 * np.pi, 0.4, 4.0):
        check(*_pair(0.0, radii=(20.0, 35.0), senses=senses, reach=30.0, view=view, boresight=1.0))


def test_permanent_contact_is_one_window_of_a_period() -> None:
    orbits, landmarks, sensors = _pair(70.0, reach=500.0)
    windows = find_windows(Team(orbits, landmarks, sensors, NOISE))
    for pair in range(len(windows.observers)):
        np.testing.assert_allclose(windows.of(pair), [[0.0, orbits.period]])


def test_contact_exactly_at_the_range_limit_all_the_time_counts() -> None:
    # same circle radius and phase: the distance is constant and equal to the range
    orbits, landmarks, sensors = _pair(50.0, phases=(0.7, 0.7), reach=50.0)
    windows = find_windows(Team(orbits, landmarks, sensors, NOISE))
    np.testing.assert_allclose(windows.of(0), [[0.0, orbits.period]])


def test_a_tangent_of_the_range_opens_no_more_than_an_instant() -> None:
    orbits, landmarks, sensors = _pair(70.0, phases=(0.0, np.pi), reach=30.0)
    windows = find_windows(Team(orbits, landmarks, sensors, NOISE))
    vehicle = windows.of(0)
    assert np.sum(vehicle[:, 1] - vehicle[:, 0]) < 1e-5


def test_same_sense_range_windows_have_their_closed_form() -> None:
    # |q|^2 = D^2 + m^2 - 2 D m cos(tau - tau0), m = 40, D = 70: half width arccos(0.7142857...)
    orbits, landmarks, sensors = _pair(70.0)
    start, end = find_windows(Team(orbits, landmarks, sensors, NOISE)).of(0)[0]
    half = np.arccos((70.0**2 + 40.0**2 - 50.0**2) / (2.0 * 70.0 * 40.0))
    assert abs((end - start) - 2.0 * half) < 1e-12


def test_the_spatial_index_finds_the_same_pairs_as_all_pairs() -> None:
    generator = np.random.default_rng(5)
    count = 700
    orbits = Orbits(
        generator.uniform(0.0, 900.0, (count, 2)),
        generator.uniform(1.0, 30.0, count),
        np.ones(count),
        np.zeros(count),
        1.0,
    )
    landmarks = generator.uniform(0.0, 900.0, (20, 2))
    reach = generator.uniform(5.0, 60.0, count)
    a, b = reachable_pairs(orbits, reach, landmarks)
    centers = np.concatenate([orbits.centers, landmarks])
    radii = np.concatenate([orbits.radii, np.zeros(20)])
    distance = np.hypot(*(centers[None] - centers[:count, None]).transpose(2, 0, 1))
    gap = np.maximum(
        distance - orbits.radii[:, None] - radii, abs(orbits.radii[:, None] - radii) - distance
    )
    gap[np.arange(count), np.arange(count)] = np.inf
    expected = np.argwhere(gap <= reach[:, None])
    np.testing.assert_array_equal(np.column_stack([a, b]), expected)


def test_merged_windows_cover_what_their_parts_cover() -> None:
    merged = merge_windows(np.array([[9.0, 11.0], [0.5, 2.0], [1.0, 3.0]]), 10.0)
    np.testing.assert_allclose(merged, [[9.0, 13.0]])
    np.testing.assert_allclose(merge_windows(np.array([[0.0, 6.0], [5.0, 10.5]]), 10.0), [[0, 10]])
    assert merge_windows(np.zeros((0, 2)), 10.0).shape == (0, 2)


@given(st.integers(0, 2**32 - 1))
def test_sightings_are_the_samples_inside_windows(seed: int) -> None:
    orbits, landmarks, sensors = _team(seed)
    windows = find_windows(Team(orbits, landmarks, sensors, NOISE))
    steps = 400
    sightings = sample_sightings(windows, orbits.period, sensors, 1, steps)
    taken = set(
        zip(
            sightings.steps.tolist(),
            sightings.observers.tolist(),
            sightings.targets.tolist(),
            strict=True,
        )
    )
    assert len(taken) == len(sightings.steps)
    time = np.arange(1, steps + 1) * sensors.sample_time
    for pair, (a, b) in enumerate(zip(windows.observers, windows.targets, strict=True)):
        inside = covered(windows.of(pair), time % orbits.period, orbits.period)
        edges = np.unique(windows.of(pair) % orbits.period)
        for k in range(steps):
            since = (time[k] - edges + 1e-9) % orbits.period
            if len(edges) and since.min() < 2e-9:
                continue
            assert ((k + 1, int(a), int(b)) in taken) == bool(inside[k])


def test_a_pair_exactly_at_reach_is_found_in_large_teams_too() -> None:
    def pairs(count: int) -> set[tuple[int, int]]:
        centers = np.column_stack([9.03 * np.arange(count), np.zeros(count)])
        orbits = Orbits(centers, np.full(count, 2.01), np.ones(count), np.zeros(count), 1.0)
        a, b = reachable_pairs(orbits, np.full(count, 5.01))
        return set(zip(a.tolist(), b.tolist(), strict=True))

    assert {pair for pair in pairs(600) if max(pair) < 400} == pairs(400)


@pytest.mark.parametrize("rate", [0.2, 2.0 * np.pi / 30.0, 1.0, 0.37])
def test_a_sample_on_a_windows_edge_counts_in_every_turn(rate: float) -> None:
    orbits = Orbits(np.zeros((1, 2)), np.array([20.0]), np.ones(1), np.zeros(1), rate)
    sample_time = orbits.period / 12.0
    reach = np.sqrt(2000.0 - 1600.0 * np.cos(np.pi / 6.0))
    sensors = Sensors(
        np.array([reach]), np.array([2.0 * np.pi]), np.zeros(1), np.full(1, 0.1), sample_time
    )
    windows = find_windows(Team(orbits, np.array([[40.0, 0.0]]), sensors, NOISE))
    turns = 20
    sightings = sample_sightings(windows, orbits.period, sensors, 1, 12 * turns)
    assert set((sightings.steps % 12).tolist()) == {0, 1, 11}
    assert len(sightings.steps) == 3 * turns


def test_the_union_of_both_ways_holds_what_either_sees() -> None:
    made = plan(scenario_example("mixed-radii-camera"))
    period = made.orbits.period
    t = np.linspace(0.0, period, 5000, endpoint=False)
    one_sided = 0
    for link in made.links:
        forward, backward = (covered(w, t, period) for w in (link.forward, link.backward))
        np.testing.assert_array_equal(covered(link.windows, t, period), forward | backward)
        one_sided += int(np.any(forward & ~backward)) + int(np.any(backward & ~forward))
    assert one_sided >= 2
