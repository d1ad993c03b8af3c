"""Phases against the paper's rules, brute force, and the relaxation's bound."""

import itertools
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import example as known
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits, relative_motion
from syncplan.orbits.contacts import (
    circle_gaps,
    closest_approach,
    least_distances,
    pairs_nearer_than,
)
from syncplan.planning.plans import Plan
from syncplan.scenario.formations import SHAPES
from syncplan.synchronisation.contact_tables import separation_tolerances
from syncplan.synchronisation.phase_rules import closest_distance, residuals, rules_of
from syncplan.synchronisation.phases import Synchronisation, alternating_senses, synchronise
from tests.tools.on_paper import plan
from tests.tools.phase_teams import cameras, largest_margin_apart, meet_when_shifted, team_of
from tests.tools.scenarios import changed, circling, example, planned

Array = np.ndarray


def _near(centers: Array, reach: float) -> Array:
    a, b = np.triu_indices(len(centers), 1)
    distance = np.hypot(*(centers[a] - centers[b]).T)
    return np.asarray(np.column_stack([a, b])[distance <= reach])


def _solve(centers: Array, pairs: Array, separation: float = 0.0) -> tuple[Synchronisation, Array]:
    """The synchronisation of one sense, and each link's least distance by the exact code."""
    radii, senses, ranges = (np.full(len(centers), one) for one in (20.0, 1.0, 50.0))
    found = synchronise(centers, radii, senses, ranges, pairs, 0.3, separation)
    motion = relative_motion(Orbits(centers, radii, senses, found.phases, 1.0), *pairs.T)
    return found, least_distances(motion)[0]


@cache
def _example(name: str) -> Plan:
    return plan(example(name), bound="never")


def test_neighbours_of_one_sense_are_opposite_on_a_bipartite_graph() -> None:
    made = _example("paper-grid-same")
    assert made.synchronisation is not None
    assert made.synchronisation.method == "closed form"
    assert made.orbits.phases[0] == 0.3
    for link in made.links:
        assert abs(link.residual) < 1e-12
        assert abs(link.min_distance - 30.0) < 1e-9


def test_opposite_senses_meet_on_the_line_of_centres() -> None:
    made = _example("crooked-line-alternate")
    assert set(made.orbits.senses) == {1.0, -1.0}
    for link in made.links:
        assert abs(link.residual) < 1e-9
        span = np.hypot(*(made.orbits.centers[link.a] - made.orbits.centers[link.b]))
        assert abs(link.min_distance - (span - 40.0)) < 1e-9


def test_the_odd_ring_reaches_its_known_optimum_and_the_bound() -> None:
    made = _example("five-ring")
    # a step of 144 degrees: 72 - 40 sin(72 degrees)
    for link in made.links:
        assert abs(link.min_distance - (72.0 - 40.0 * np.sin(np.radians(72.0)))) < 1e-6
    found = made.synchronisation
    assert found is not None
    assert found.bound is not None
    assert found.margin is not None
    assert abs(found.bound - found.margin) < 1e-5
    assert len(found.odd_cycle) == 5


def test_the_triangular_lattice_takes_three_phases() -> None:
    made = _example("triangle-lattice")
    assert len(made.links) == 23
    for link in made.links:
        assert abs(link.min_distance - (70.0 - 20.0 * np.sqrt(3.0))) < 1e-6


def test_a_triangle_alternates_all_but_one_link() -> None:
    made = _example("triangle-alternate")
    same = [link for link in made.links if made.orbits.senses[link.a] == made.orbits.senses[link.b]]
    assert len(made.links) == 3
    assert len(same) == 1
    assert made.alternating_proven


@pytest.mark.parametrize("name", ["five-ring", "triangle-lattice", "triangle-alternate"])
def test_phases_without_the_relaxation_are_as_good_and_say_that_none_bounds_them(name: str) -> None:
    bounded, quick = (plan(example(name), bound="never", margin_bound=one) for one in (True, False))
    assert bounded.synchronisation is not None
    assert quick.synchronisation is not None
    assert bounded.synchronisation.margin is not None
    assert quick.synchronisation.margin == pytest.approx(bounded.synchronisation.margin, abs=1e-4)
    assert bounded.synchronisation.bound is not None
    assert quick.synchronisation.bound is None
    assert quick.synchronisation.bound_note == "no bound: none was requested"


@pytest.mark.parametrize("spacing", [74.0, 80.0, 84.0, 88.0])
def test_links_are_dropped_where_no_phases_serve_all_and_only_there(spacing: float) -> None:
    made = planned(formation={"shape": "ring", "count": 3, "spacing_m": spacing})
    # three phases 120 degrees apart come to spacing - 34.64 m
    served = spacing - 20.0 * np.sqrt(3.0) <= 50.0
    assert len(made.links) + len(made.dropped_links) == 3
    assert ["odd cycle" in one.reason for one in made.dropped_links] == [True] * (not served)


@pytest.mark.parametrize("separation", [31.0, 35.0, 45.0])
def test_separation_bounds_what_phases_may_choose(separation: float) -> None:
    centers = SHAPES["grid"].centers(6, 70.0, 3)
    found, least = _solve(centers, _near(centers, 71.0), separation=separation)
    assert not found.dropped
    assert least.min() >= separation
    assert least.max() <= 50.0


def test_an_odd_ring_keeps_its_separation_and_most_of_its_margin() -> None:
    centers = SHAPES["ring"].centers(5, 72.0)
    pairs = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [0, 4]])
    _found, least = _solve(centers, pairs, separation=35.0)
    # residuals +a four times and -b once, b the least that separation allows
    b = 2.0 * np.arccos((72.0 - 35.0) / 40.0)
    a = (np.pi + b) / 4.0
    assert least.min() >= 35.0
    assert abs(least.max() - (72.0 - 40.0 * np.cos(a / 2.0))) < 2e-3


def test_desync_is_an_offset_from_the_exact_rule() -> None:
    exact = _example("paper-grid-alternate")
    shifted = plan(changed("paper-grid-alternate", orbit={"desync_rad": 0.1}), bound="never")
    np.testing.assert_allclose(shifted.orbits.phases - exact.orbits.phases, 0.1, atol=1e-12)
    assert all(abs(abs(link.residual) - 0.2) < 1e-12 for link in shifted.links)
    assert shifted.observable
    assert not exact.observable


@given(st.integers(0, 2**32 - 1))
def test_the_least_distance_of_a_residual_is_that_of_the_orbits(seed: int) -> None:
    generator = np.random.default_rng(seed)
    centers = generator.uniform(-50.0, 50.0, (2, 2))
    radii = generator.uniform(5.0, 30.0, 2) if seed % 2 else np.full(2, 12.0)
    senses = generator.choice([-1.0, 1.0], 2)
    phases = generator.uniform(0.0, 2.0 * np.pi, 2)
    pairs = np.array([[0, 1]])
    orbits = Orbits(centers, radii, senses, phases, 1.0)
    rules = rules_of(orbits, np.full(2, 50.0), pairs)
    closed = float(closest_distance(rules, residuals(rules, senses * phases))[0])
    (exact,) = pairs_nearer_than(orbits, np.inf)
    tau = np.linspace(0.0, 2.0 * np.pi, 20001)[:, None]
    places = centers + radii[:, None] * np.stack(
        [np.cos(phases + senses * tau), np.sin(phases + senses * tau)], axis=-1
    )
    sampled = float(np.min(np.hypot(*(places[:, 1] - places[:, 0]).T)))
    assert abs(closed - exact.distance) < 1e-9
    assert 0.0 <= sampled - exact.distance + 1e-12 < 0.02


@given(st.integers(0, 2**32 - 1))
def test_the_closest_approach_over_all_pairs_is_the_smallest_of_each(seed: int) -> None:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(2, 9))
    orbits = Orbits(
        generator.uniform(-80.0, 80.0, (count, 2)),
        generator.uniform(5.0, 30.0, count),
        generator.choice([-1.0, 1.0], count),
        generator.uniform(0.0, 6.28, count),
        1.0,
    )
    nearest = closest_approach(orbits)
    assert nearest is not None
    each = pairs_nearer_than(orbits, np.inf)
    assert len(each) == count * (count - 1) // 2
    assert nearest.distance == min(item.distance for item in each)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("syncplan.orbits.contacts.DENSE_LIMIT", 1)
        assert closest_approach(orbits) == nearest


@given(st.integers(0, 2**32 - 1))
def test_the_number_of_alternating_links_is_the_largest(seed: int) -> None:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(2, 8))
    edges = [pair for pair in itertools.combinations(range(count), 2) if generator.random() < 0.6]
    senses, proven = alternating_senses(count, edges, [])
    cut = sum(senses[a] != senses[b] for a, b in edges)
    best = max(
        sum(side[a] != side[b] for a, b in edges)
        for side in itertools.product([0, 1], repeat=count)
    )
    assert proven
    assert cut == best
    assert senses[0] == 1.0


@pytest.mark.parametrize(
    ("count", "reach", "least"),
    [*((n, 50.0, 36.0 * np.sin(np.pi / n)) for n in (2, 3, 4, 5)), (2, 15.0, 3.0), (3, 15.0, 3.0)],
)
def test_vehicles_on_one_circle_spread_out_and_keep_in_contact(
    count: int, reach: float, least: float
) -> None:
    made = planned(formation={"centers_m": [[0, 0]] * count}, sensor={"range_m": reach})
    assert made.approach is not None
    assert made.approach.distance > least
    assert not made.dropped_links
    assert len(made.links) == count * (count - 1) // 2
    assert all(link.tolerance > 0.03 for link in made.links)


@pytest.mark.parametrize(
    ("centers", "senses"),
    [([[0, 0], [0, 0]], [1.0, 1.0]), ([[0, 0], [50, 0], [0, 0]], [1.0, -1.0, 1.0])],
)
def test_vehicles_that_share_a_circle_share_their_sense_in_any_order(
    centers: list[list[float]], senses: list[float]
) -> None:
    radii = [20.0 + 1e-12 * k for k in range(len(centers))]
    orbit = circling(radius_m=radii, direction="alternate")
    made = planned(formation={"centers_m": centers}, orbit=orbit)
    assert made.orbits.senses.tolist() == senses


@pytest.mark.parametrize(
    ("centers", "radii", "reach"),
    [
        ([[0, 0], [0, 0]], [50.0, 10.0], 50.0),
        ([[0, 0], [5, 0]], [50.0, 10.0], 50.0),
        ([[0, 0], [10, 0]], [20.0, 20.0], 20.0),
    ],
)
def test_contact_of_crossing_circles_does_not_hang_on_its_limit(
    centers: list[list[float]], radii: list[float], reach: float
) -> None:
    orbit, sensor = circling(radius_m=radii), {"range_m": reach}
    made = planned(formation={"centers_m": centers}, orbit=orbit, sensor=sensor)
    assert made.links[0].tolerance > 0.05


def test_a_pair_that_nothing_keeps_apart_costs_the_others_nothing() -> None:
    made = planned(
        formation={"centers_m": [[0, 0], [0, 0], [200, 0], [270, 0]], "links": [["v3", "v4"]]},
        orbit=circling(radius_m=[20.0, 21.0, 20.0, 20.0], direction=["ccw", "cw", "ccw", "ccw"]),
        min_separation_m=5.0,
    )
    assert len(made.links) == 1
    assert abs(made.links[0].min_distance - 30.0) < 1e-6
    (close,) = made.too_close
    assert {close.a, close.b} == {0, 1}
    assert abs(close.distance - 1.0) < 1e-9


def test_the_first_vehicle_starts_at_its_phase_whatever_its_sense() -> None:
    for senses in (["cw", "cw"], ["cw", "ccw"]):
        made = planned(orbit=circling(direction=senses, first_phase_rad=0.7))
        assert abs(made.orbits.phases[0] - 0.7) < 1e-12


def test_the_longer_of_two_ranges_makes_the_link() -> None:
    made = planned(sensor=[{"range_m": 5.0}, {"range_m": 50.0}])
    assert len(made.links) == 1
    assert made.links[0].forward.size == 0
    assert made.links[0].backward.size == 2
    assert made.links[0].windows.shape == (1, 2)
    assert made.synchronisation is not None
    assert made.synchronisation.margin == pytest.approx(20.0)


@settings(max_examples=settings().max_examples * 2 // 5)
@given(st.integers(0, 2**32 - 1))
def test_three_linked_vehicles_reach_brute_force_and_stay_below_the_bound(seed: int) -> None:
    generator = np.random.default_rng(seed)
    angle = generator.uniform(1.2, 2.0)
    sides = generator.uniform(50.0, 62.0, 2)
    corner = sides[1] * np.array([np.cos(angle), np.sin(angle)])
    centers = np.array([[0.0, 0.0], [sides[0], 0.0], corner])
    radii = generator.uniform(15.0, 24.0, 3) if seed % 2 else np.full(3, 20.0)
    team = team_of(
        centers,
        np.array([[0, 1], [1, 2], [0, 2]]),
        cameras(3, 100.0, 2.0 * np.pi, 0.0),
        radii=radii,
        senses=generator.choice([-1.0, 1.0], 3),
    )
    found, best = team.synchronised(margin_bound=True), largest_margin_apart(team)
    assert found.margin is not None
    if circle_gaps(centers, radii, team.pairs).min() > 0.0:
        assert found.margin >= best - 0.05
    if found.bound is not None:
        # the relaxation's solver stops at relative gaps of 1e-8, seen up to 3e-6 m here
        assert found.bound >= best - 1e-4
        assert found.margin <= found.bound + 1e-4


@pytest.mark.parametrize("seed", range(12))
def test_the_phase_tolerance_is_where_contact_is_lost(seed: int) -> None:
    """Slip the second vehicle both ways, look for windows, compare with the tolerance reported."""
    generator = np.random.default_rng(seed)
    view = 360.0 if seed % 3 == 0 else float(generator.uniform(40.0, 200.0))
    made = planned(
        formation={"centers_m": [[0, 0], [float(generator.uniform(50, 75)), 0]]},
        orbit=circling(
            radius_m=[20.0, float(generator.uniform(12, 22))],
            direction=["ccw", str(generator.choice(["ccw", "cw"]))],
            desync_rad=[0.0, float(generator.uniform(-0.5, 0.5))],
        ),
        sensor={"range_m": 50.0, "fov_deg": view},
    )
    if not made.links:
        return
    tolerance = made.links[0].tolerance

    for slip in np.linspace(0.0, 0.97 * tolerance, 12):
        assert meet_when_shifted(made, slip)
        assert meet_when_shifted(made, -slip)
    if tolerance < np.pi - 0.1:
        beyond = (tolerance + 0.03, -tolerance - 0.03)
        assert not all(meet_when_shifted(made, slip) for slip in beyond)


OPPOSED = [[0, 0], [70, 0], [13.562158, 35.594416], [90.463662, 59.271268]]
LINKS = [["v1", "v2"], ["v3", "v4"]]


@pytest.mark.parametrize(
    ("centers", "links", "directions", "reach", "least"),
    [
        # v1 and v3 pass each other at 7 m unless phases prevent it
        ([[0, 0], [70, 0], [0, 47], [70, 117]], LINKS, ["ccw", "ccw", "cw", "ccw"], 70.0, 10.0),
        (OPPOSED, LINKS, ["ccw", "ccw", "cw", "cw"], 50.0, 8.0),
        ([[0, 0], [30, 0], [15, 26]], None, "ccw", 50.0, 12.0),
    ],
    ids=["unlisted pairs", "components of opposite senses", "overlapping circles"],
)
def test_separation_holds_whoever_is_linked(
    centers: Any, links: Any, directions: Any, reach: float, least: float
) -> None:
    for first in (0.0, 0.75, 2.0, 3.0, 4.5, 5.893433):
        made = planned(
            formation={"centers_m": centers, "links": links},
            orbit=circling(direction=directions, first_phase_rad=first),
            sensor={"range_m": reach},
            min_separation_m=least,
        )
        assert not made.too_close
        assert made.approach is not None
        assert made.approach.distance >= least
        assert links is None or len(made.links) == 2


def test_large_teams_start_from_a_sparse_spectrum_and_say_that_no_bound_was_computed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    centers = SHAPES["hex"].centers(48, 70.0, 8)
    dense, least = _solve(centers, _near(centers, 90.0))
    assert dense.bound is None
    assert "48 vehicles" in dense.bound_note
    assert least.max() < 35.4
    monkeypatch.setattr("syncplan.synchronisation.margin_search._DENSE_SPECTRUM", 10)
    monkeypatch.setattr(np.linalg, "eigh", None)
    sparse, _ = _solve(centers, _near(centers, 90.0))
    assert sparse.method == dense.method
    assert sparse.margin == pytest.approx(dense.margin, abs=1e-6)


# --- how far a phase may shift --------------------------------------------------------------------


PAIR = np.array([[0, 1]])
RADII = st.floats(5.0, 40.0)
PHASES = st.floats(-3.0, 3.0)
SENSES = st.sampled_from([-1.0, 1.0])


def pair(
    distance: float, radii: tuple[float, float], sense: float, phases: tuple[float, float]
) -> Orbits:
    """Two circles beside each other along x, the first counter-clockwise."""
    centers = np.array([[0.0, 0.0], [distance, 0.0]])
    return Orbits(centers, np.array(radii), np.array([1.0, sense]), np.array(phases), 0.2)


def apart_when_shifted(orbits: Orbits, shifts: np.ndarray) -> np.ndarray:
    """Least distance over a turn with the second phase shifted, one by one."""
    count = len(shifts)
    phases = orbits.phases + np.outer(shifts, [0.0, 1.0])
    centers = np.tile(orbits.centers, (count, 1))
    radii, senses = np.tile(orbits.radii, count), np.tile(orbits.senses, count)
    many = Orbits(centers, radii, senses, phases.ravel(), orbits.rate)
    first = 2 * np.arange(count)
    return least_distances(relative_motion(many, first, first + 1))[0]


def cosines_at(distance: float, radii: tuple[float, float], asked: float) -> np.ndarray:
    """Cosines of the phase differences at which same-sense vehicles come as near as asked.

    Their least distance is |D - m| with m^2 = Ra^2 + Rb^2 - 2 Ra Rb cos(difference), so m is
    D - asked or D + asked; beyond [-1, 1] no difference makes it so, at its ends they only touch.
    """
    m = np.array([distance - asked, distance + asked])
    return (radii[0] ** 2 + radii[1] ** 2 - m[m > 0.0] ** 2) / (2.0 * radii[0] * radii[1])


def least_shift(cosines: np.ndarray, now: float) -> float:
    """Smallest change of the phase difference `now` to one with such a cosine, pi for none."""
    there = np.arccos(cosines[np.abs(cosines) <= 1.0])
    shifts = np.abs(np.angle(np.exp(1j * (np.concatenate([there, -there]) - now))))
    return min(shifts, default=np.pi)


@given(st.floats(1.0, 60.0), RADII, RADII, PHASES, PHASES, st.floats(0.5, 10.0))
@known(1.0, 5.0, 7.0, 0.0, 1.0, 1.0)  # m = 2 = 7 - 5: the least distance touches 1 m
def test_turning_the_same_way_the_tolerance_is_an_arccosine(
    distance: float, ra: float, rb: float, one: float, other: float, asked: float
) -> None:
    orbits = pair(distance, (ra, rb), 1.0, (one, other))
    apart = abs(distance - np.abs(ra * np.exp(1j * one) - rb * np.exp(1j * other)))
    assume(apart > asked + 1e-3)
    cosines = cosines_at(distance, (ra, rb), asked)
    expected = least_shift(cosines, other - one)
    tolerance = separation_tolerances(orbits, PAIR, asked)[0]
    assert tolerance <= expected + 1e-9
    if np.all(np.abs(np.abs(cosines) - 1.0) > 1e-3):
        assert tolerance == pytest.approx(expected, abs=2e-3)
    # where they touch, or nearly, the steps end early: not before they are as near as a centimetre
    elif apart > asked + 0.01:
        nearly = cosines_at(distance, (ra, rb), asked + 0.01)
        assert tolerance >= least_shift(nearly, other - one) - 2e-3


@given(st.floats(5.0, 70.0), RADII, RADII, PHASES, PHASES, SENSES)
def test_without_a_distance_it_is_the_shift_at_which_they_collide(
    distance: float, ra: float, rb: float, one: float, other: float, sense: float
) -> None:
    orbits = pair(distance, (ra, rb), sense, (one, other))
    # where the circles cross: each is there at its own moment, and the shift makes it the same one
    x = (distance**2 + ra**2 - rb**2) / (2.0 * distance)
    expected = np.pi
    if abs(x) < ra:
        for y in (np.sqrt(ra**2 - x**2), -np.sqrt(ra**2 - x**2)):
            turned = np.arctan2(y, x) - one
            meets = np.arctan2(y, x - distance) - sense * turned
            expected = min(expected, abs(np.angle(np.exp(1j * (meets - other)))))
    assume(abs(abs(x) - ra) > 0.05)
    assert separation_tolerances(orbits, PAIR, 0.0)[0] == pytest.approx(expected, abs=2e-3)


@given(st.floats(1.0, 80.0), RADII, RADII, PHASES, PHASES, SENSES, st.floats(0.5, 15.0))
def test_no_smaller_shift_brings_them_too_near(
    distance: float, ra: float, rb: float, one: float, other: float, sense: float, asked: float
) -> None:
    orbits = pair(distance, (ra, rb), sense, (one, other))
    shift = separation_tolerances(orbits, PAIR, asked)[0]
    smaller = np.linspace(-shift, shift, 301)
    if shift > 0.0:
        assert apart_when_shifted(orbits, smaller).min() >= asked - 1e-9
    if shift < np.pi:
        beyond = shift + np.linspace(0.0, 0.02, 41)
        both = np.concatenate([beyond, -beyond])
        assert apart_when_shifted(orbits, both).min() < asked + 0.05


def test_equal_circles_turning_against_each_other_have_tolerances_too() -> None:
    # mirror images 70 m apart on circles of 20 m: 30 m between, whatever the phases
    orbits = pair(70.0, (20.0, 20.0), -1.0, (0.0, np.pi))
    assert separation_tolerances(orbits, PAIR, 29.9)[0] == np.pi
    assert separation_tolerances(orbits, PAIR, 31.0)[0] == 0.0
    assert separation_tolerances(orbits, np.zeros((0, 2), dtype=int), 5.0).shape == (0,)
