"""Placement: drawings of link graphs, shapes by their gap, and reasons where there is none."""

import itertools
import math
import tracemalloc
from typing import Any

import numpy as np
import pytest

from syncplan.errors import InputError, NoSolutionError
from syncplan.placement.centers import Placement, place
from syncplan.placement.drawing import MARGIN_SHARE
from syncplan.scenario.areas import Area
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, small

Edges = list[tuple[int, int]]


def path(count: int) -> Edges:
    return [(k, k + 1) for k in range(count - 1)]


def ring(count: int) -> Edges:
    return [*path(count), (0, count - 1)]


def star(leaves: int) -> Edges:
    return [(0, k + 1) for k in range(leaves)]


def shape_edges(shape: str, count: int, columns: int) -> Edges:
    return [(int(a), int(b)) for a, b in SHAPES[shape].neighbours(count, columns)]


def tree(count: int, seed: int, degree: int = 4) -> Edges:
    """A random tree in which no vertex has more than `degree` neighbours."""
    generator = np.random.default_rng(seed)
    free = {0: degree}
    edges = []
    for new in range(1, count):
        old = int(generator.choice([v for v, left in free.items() if left]))
        free[old] -= 1
        free[new] = degree - 1
        edges.append((old, new))
    return edges


def linked(
    edges: Edges, radius: Any = 20.0, sensed: float = 50.0, direction: str = "ccw", **changes: Any
) -> Scenario:
    links = [[f"v{a + 1}", f"v{b + 1}"] for a, b in edges]
    return small(
        orbit=circling(radius_m=radius, direction=direction),
        formation={"links": links},
        sensor={"range_m": sensed, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        **changes,
    )


def every_gap(placement: Placement) -> dict[tuple[int, int], float]:
    """Gap of each pair of circles, from the scenario as a user would read it."""
    centers = placement.scenario.centers
    radius = placement.scenario.orbit.radius_m
    radii = radius if isinstance(radius, list) else [radius] * len(centers)
    return {
        (a, b): math.dist(centers[a], centers[b]) - radii[a] - radii[b]
        for a, b in itertools.combinations(range(len(centers)), 2)
    }


def assert_drawn(placement: Placement, edges: Edges, sensed: float) -> None:
    gaps = every_gap(placement)
    assert max(gaps[min(a, b), max(a, b)] for a, b in edges) <= sensed * (1.0 - MARGIN_SHARE)
    assert min(gaps.values()) >= 0.01 * sensed
    assert placement.smallest_gap == pytest.approx(min(gaps.values()), abs=1e-9)
    expected = [gaps[int(a), int(b)] for a, b in placement.links]
    np.testing.assert_allclose(placement.gaps, expected, atol=1e-9)


GRAPHS = {
    "pair": path(2),
    "path": path(9),
    **{f"ring of {count}": ring(count) for count in (3, 4, 5, 7, 12)},
    "grid 3 x 3": shape_edges("grid", 9, 3),
    "grid 5 x 5": shape_edges("grid", 25, 5),
    # so many that only the pairs nearby are used
    "grid 7 x 7": shape_edges("grid", 49, 7),
    "hex patch": shape_edges("hex", 14, 4),
    "star of 5": star(5),
    "star of 6": star(6),
    **{f"tree {seed}": tree(12, seed) for seed in (0, 2, 3, 4, 5)},
}


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize(("radius", "sensed"), [(20.0, 50.0), (50.0, 10.0)])
def test_a_graph_that_can_be_drawn_is_drawn_at_any_range(
    name: str, radius: float, sensed: float
) -> None:
    assert_drawn(place(linked(GRAPHS[name], radius, sensed)), GRAPHS[name], sensed)


def test_unequal_circles_and_ranges_are_drawn_each_by_its_own() -> None:
    edges = tree(10, 5)
    placement = place(linked(edges, [10.0 + 5.0 * (k % 4) for k in range(10)], 20.0))
    assert_drawn(placement, edges, 20.0)
    mixed = small(
        formation={"links": [["a", "b"], ["b", "c"]]},
        sensor=[{"range_m": range_m} for range_m in (5.0, 5.0, 40.0)],
    )
    # The better of the two sensors decides.
    near, far = place(mixed).gaps
    assert near <= 5.0 * (1.0 - MARGIN_SHARE)
    assert 5.0 < far <= 40.0 - 5.0 * MARGIN_SHARE


def test_without_landmark_or_area_the_drawing_is_about_the_origin() -> None:
    centers = place(linked(tree(6, 1))).centers
    np.testing.assert_allclose(centers.min(axis=0) + centers.max(axis=0), 0.0, atol=1e-9)


def test_the_same_seed_gives_the_same_centres_to_the_last_bit() -> None:
    scenario = linked(ring(5), landmarks_m=[[190.0, 0.0], [190.0, 70.0]])
    first, again = place(scenario, seed=3), place(scenario, seed=3)
    assert first.centers.tolist() == again.centers.tolist()
    assert place(scenario, seed=4).centers.tolist() != first.centers.tolist()


# --- refusals -------------------------------------------------------------------------------------


def refusal(scenario: Scenario, **options: Any) -> str:
    with pytest.raises(NoSolutionError) as caught:
        place(scenario, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_star_with_more_leaves_than_fit_round_it_is_refused_with_the_reason() -> None:
    message = refusal(linked(star(7), 50.0, 10.0))
    assert "v1-v8" in message
    assert "7 circles are linked to v1, but at most 6 fit round it" in message
    assert "range 10 m less margin 0.2 m" in message


def test_a_crowd_of_unequal_circles_is_refused_only_where_they_do_not_fit() -> None:
    # Six equal circles fit round their like, more of smaller ones.
    small_leaves = [50.0, *[20.0] * 9]
    assert_drawn(place(linked(star(9), small_leaves, 10.0)), star(9), 10.0)
    assert "v1-v2" in refusal(linked(star(13), [50.0, *[20.0] * 13], 10.0))


def test_a_graph_that_can_not_be_drawn_names_the_link_that_fails() -> None:
    complete = list(itertools.combinations(range(4), 2))
    message = refusal(linked(complete, 50.0, 10.0))
    # Two triangles on a shared side: the far corners are sqrt(3) sides apart at least.
    assert message.count("link v") == 1
    assert "circles 67.4 m apart, range 10 m less margin 0.2 m" in message
    assert "give a longer range, smaller circles or fewer links" in message


def test_a_separation_larger_than_the_range_is_refused_at_once() -> None:
    message = refusal(linked(path(3), min_separation_m=60.0))
    assert "link v1-v2" in message
    assert "at least 60 m apart" in message


def test_a_separation_within_the_range_holds_for_every_pair() -> None:
    placement = place(linked(ring(6), min_separation_m=45.0))
    assert min(every_gap(placement).values()) >= 45.0


def test_centres_that_are_given_are_not_placed() -> None:
    with pytest.raises(InputError, match=r"formation\.centers_m: the centres are already given"):
        place(small())
    with pytest.raises(InputError, match=r"formation\.spacing_m"):
        place(small(formation={"shape": "ring", "count": 3, "spacing_m": 70.0}))


@pytest.mark.parametrize("options", [{"margin": 50.0}, {"starts": 0}])
def test_options_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"^{next(iter(options))}: "):
        place(linked(path(2)), **options)


def test_the_margin_is_what_refinement_will_keep() -> None:
    assert place(linked(path(2), refine={"margin_m": 4.0})).margin == 4.0
    assert place(linked(path(2))).margin == 1.0
    assert place(linked(path(3), 50.0, 10.0), margin=9.0).gaps.max() <= 1.0


# --- areas and landmarks --------------------------------------------------------------------------

SQUARE = [[0.0, 0.0], [250.0, 0.0], [250.0, 250.0], [0.0, 250.0]]
CORNER = [[0.0, 0.0], [400.0, 0.0], [400.0, 100.0], [100.0, 100.0], [100.0, 400.0], [0.0, 400.0]]
HOLE = [[110.0, 110.0], [140.0, 110.0], [140.0, 140.0], [110.0, 140.0]]


@pytest.mark.parametrize(
    ("edges", "area", "kept_out"),
    [(path(9), SQUARE, []), (path(9), CORNER, []), (ring(8), SQUARE, [HOLE])],
    ids=["a path folds", "a path turns the corner", "a ring goes round"],
)
def test_circles_lie_within_the_area_and_clear_of_what_is_kept_out(
    edges: Edges, area: list[list[float]], kept_out: list[list[list[float]]]
) -> None:
    placement = place(linked(edges, area_m=area, keep_out_m=kept_out))
    assert_drawn(placement, edges, 50.0)
    exact = Area(np.array(area), tuple(np.array(one) for one in kept_out))
    clear = exact.clearances(placement.centers, np.full(len(placement.centers), 20.0))
    assert clear.min() >= 0.0
    assert placement.clearance == clear.min()
    # there is room for a twentieth of the radius, as flights stray
    assert clear.min() > 0.99


@pytest.mark.parametrize("width", [40.1, 40.5, 41.9])
def test_circles_fill_an_area_that_leaves_no_room(width: float) -> None:
    strip = [[0.0, 0.0], [width, 0.0], [width, 400.0], [0.0, 400.0]]
    placement = place(linked(path(3), area_m=strip))
    assert_drawn(placement, path(3), 50.0)
    assert placement.clearance >= 0.0


def test_a_circle_that_fits_nowhere_in_the_area_is_refused() -> None:
    strip = [[0.0, 0.0], [30.0, 0.0], [30.0, 400.0], [0.0, 400.0]]
    assert "v1: its circle of radius 20 m fits nowhere" in refusal(linked(path(3), area_m=strip))
    tight = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]]
    assert "encloses 1e+04 m2" in refusal(linked(path(9), area_m=tight))


@pytest.mark.parametrize(
    ("edges", "landmarks"),
    [
        (shape_edges("grid", 9, 3), [[190.0, 0.0], [190.0, 70.0]]),
        (path(9), [[0.0, 0.0], [600.0, 0.0]]),
        ([(0, 1), (1, 2), (3, 4)], [[190.0, 0.0], [190.0, 70.0], [900.0, 0.0]]),
    ],
    ids=["beside one another", "far apart", "for two groups"],
)
def test_every_group_sights_two_landmarks(edges: Edges, landmarks: list[list[float]]) -> None:
    placement = place(linked(edges, landmarks_m=landmarks))
    assert_drawn(placement, edges, 50.0)
    centers = np.array(placement.scenario.centers)
    off = [
        abs(math.dist(centers[vehicle], landmarks[landmark]) - 20.0)
        for vehicle, landmark in placement.sightings
    ]
    np.testing.assert_allclose(placement.sighting_distances, off, atol=1e-9)
    assert max(off) <= 49.0
    groups = 2 if len(landmarks) > 2 else 1
    assert len(placement.sightings) == 2 * groups
    assert np.all(np.diff(placement.sightings[:, 1].reshape(groups, 2)) > 0)


def test_landmarks_further_apart_than_the_links_span_are_refused() -> None:
    # Two reaches of 69 m and one link of 40 + 49 m.
    message = refusal(linked(path(2), landmarks_m=[[0.0, 0.0], [900.0, 0.0]]))
    assert "at most 227 m apart, the nearest two are 900 m apart" in message
    served = place(linked(path(2), landmarks_m=[[0.0, 0.0], [226.0, 0.0]]))
    assert served.sighting_distances.max() <= 49.0


def test_landmarks_out_of_the_reach_of_the_area_are_refused() -> None:
    landmarks = [[900.0, 0.0], [800.0, 0.0]]
    message = refusal(linked(path(3), area_m=SQUARE, landmarks_m=landmarks))
    assert "no circle in the area comes within range of L1" in message


# --- shapes by their gap --------------------------------------------------------------------------


def gapped(shape: str, radii: Any, count: int, gap: float = 30.0, **changes: Any) -> Scenario:
    orbit = circling(radius_m=radii)
    formation = {"shape": shape, "count": count, "gap_m": gap}
    formation |= {"columns": 3} if shape in ("grid", "hex") else {}
    return small(orbit=orbit, formation=formation, **changes)


@pytest.mark.parametrize("shape", SHAPES)
def test_equal_circles_a_gap_apart_make_the_regular_shape(shape: str) -> None:
    placement = place(gapped(shape, 20.0, 7))
    np.testing.assert_allclose(placement.centers, SHAPES[shape].centers(7, 70.0, 3), atol=1e-9)
    np.testing.assert_allclose(placement.gaps, 30.0, atol=1e-9)
    assert placement.iterations == 0


@pytest.mark.parametrize("shape", ["line", "ring"])
@pytest.mark.parametrize("radii", [[12.0], [10.0, 25.0], [30.0, 10.0, 15.0, 20.0, 12.0]])
def test_neighbours_of_any_radii_are_the_gap_apart(shape: str, radii: list[float]) -> None:
    placement = place(gapped(shape, radii, len(radii)))
    np.testing.assert_allclose(placement.gaps, 30.0, atol=1e-9)
    assert len(placement.gaps) == len(radii) - (shape == "line" or len(radii) < 3)


def test_a_ring_about_one_huge_circle_has_its_centre_beyond_the_longest_side() -> None:
    radii = np.array([100.0, 100.0, 2.0])
    centers = SHAPES["ring"].gap_centers(radii, 1.0)
    assert centers is not None
    np.testing.assert_allclose(np.hypot(*centers.T), np.hypot(*centers[0]))
    sides = np.hypot(*(centers - np.roll(centers, -1, axis=0)).T)
    np.testing.assert_allclose(sides, [201.0, 103.0, 103.0], atol=1e-9)
    turn = np.diff(np.arctan2(centers[:, 1], centers[:, 0])) % (2.0 * np.pi)
    assert turn[0] > np.pi
    assert turn.sum() < 2.0 * np.pi


def test_a_ring_that_folds_circles_over_each_other_is_refused() -> None:
    message = refusal(gapped("ring", [100.0, 1.0, 100.0, 1.0], 4, 1.0))
    assert "v1 and v3: circles cross by" in message


@pytest.mark.parametrize("shape", ["grid", "hex"])
def test_grids_of_unequal_circles_come_as_near_the_gap_as_they_can(shape: str) -> None:
    radii = [10.0 + 5.0 * (k * 7 % 4) for k in range(9)]
    placement = place(gapped(shape, radii, 9))
    pairs = SHAPES[shape].neighbours(9, 3)
    np.testing.assert_array_equal(placement.links, pairs)
    # A grid bends till all gaps are met; a hex patch has more neighbours than freedom.
    spread = 1e-6 if shape == "grid" else 5.0
    np.testing.assert_allclose(placement.gaps, 30.0, atol=spread)
    np.testing.assert_array_equal(placement.centers[0], 0.0)
    off = placement.gaps - 30.0
    pull = np.zeros((9, 2))
    for (a, b), stress in zip(pairs, off, strict=True):
        along = placement.centers[b] - placement.centers[a]
        pull[a] += stress * along / np.hypot(*along)
        pull[b] -= stress * along / np.hypot(*along)
    # Least squares: the gaps' misses, as springs, balance at every circle.
    np.testing.assert_allclose(pull, 0.0, atol=1e-2)


def test_neighbours_of_a_shape_are_the_pairs_one_spacing_apart() -> None:
    for shape, count, columns in itertools.product(SHAPES, (1, 2, 7, 12), (1, 3, 4)):
        centers = SHAPES[shape].centers(count, 1.0, columns)
        apart = {
            (a, b)
            for a, b in itertools.combinations(range(count), 2)
            if math.dist(centers[a], centers[b]) < 1.0 + 1e-9
        }
        assert {(int(a), int(b)) for a, b in SHAPES[shape].neighbours(count, columns)} == apart


def test_a_gap_below_the_separation_is_refused() -> None:
    message = refusal(gapped("ring", 20.0, 5, 5.0, min_separation_m=10.0))
    assert "formation.gap_m 5: less than min_separation_m 10" in message


def test_a_shape_stays_where_it_is_defined_and_is_refused_outside_the_area() -> None:
    message = refusal(gapped("line", 20.0, 3, area_m=SQUARE))
    assert "v1: its circle lies 20 m across area_m" in message


# --- what comes out -------------------------------------------------------------------------------


def test_the_scenario_keeps_all_but_what_led_to_the_centres() -> None:
    given = linked(path(3), landmarks_m=[[0.0, 0.0], [50.0, 0.0]], min_separation_m=1.0)
    scenario = place(given).scenario
    again = scenario_from(scenario.model_dump(mode="json"))
    assert again.centers == scenario.centers
    assert again.formation.links == given.formation.links
    assert (again.landmarks, again.min_separation_m) == (given.landmarks, 1.0)
    assert scenario.formation.placed
    shape = place(gapped("hex", 20.0, 7)).scenario.formation
    assert (shape.shape, shape.count, shape.gap_m, shape.columns) == (None, None, None, None)


def test_ten_thousand_circles_a_gap_apart_are_placed_in_little_memory() -> None:
    tracemalloc.start()
    placed = place(gapped("grid", 20.0, 10_000, duration_s=100.0))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert placed.smallest_gap == pytest.approx(30.0)
    # all pairs would take 800 MB
    assert peak < 200e6


def test_names_of_vehicles_are_kept_in_order() -> None:
    scenario = place(small(formation={"links": [["v7", "v2"], ["v2", "v9"]]})).scenario
    assert scenario.vehicle_names == ["v2", "v7", "v9"]
    assert scenario.formation.links == [("v7", "v2"), ("v2", "v9")]


def test_every_listed_link_of_a_placed_ring_comes_into_contact() -> None:
    scenario = linked(ring(6), direction="alternate", landmarks_m=[[190.0, 0.0], [190.0, 70.0]])
    made = plan(place(scenario).scenario, bound="never")
    assert [(link.a, link.b) for link in made.links] == ring(6)
    assert not made.dropped_links
    assert len({link.b for link in made.landmark_links}) == 2


@pytest.mark.parametrize("gap", [20.0, 49.9, 80.0])
def test_a_gap_near_or_beyond_the_range_is_met_too(gap: float) -> None:
    placed = place(gapped("grid", [20.0, 25.0, 20.0, 20.0], 4, gap))
    np.testing.assert_allclose(placed.gaps, gap, atol=1e-6)


WALL = [[-2.0, -15.0], [2.0, -15.0], [2.0, 15.0], [-2.0, 15.0]]


def beside_a_wall(links: Edges, landmarks: list[list[float]]) -> Scenario:
    walls: Any = {"obstacles_m": [WALL], "keep_out_m": [WALL]}
    return linked(links, radius=6.0, sensed=15.0, landmarks_m=landmarks, **walls)


def test_a_drawing_whose_links_see_each_other_is_taken_before_one_across_a_wall() -> None:
    scenario = beside_a_wall(path(3), [[-15.0, 0.0], [15.0, 0.0]])
    first, best = (place(scenario, starts=starts, seed=1) for starts in (1, 8))
    assert first.hidden.tolist() == [[0, 1]]
    assert best.hidden.tolist() == []
    assert best.notes == []
    served = plan(best.scenario, bound="never")
    assert served.dropped_links == ()
    (lost,) = plan(first.scenario, bound="never").dropped_links
    assert (lost.a, lost.b) == (0, 1)


def test_what_no_drawing_brings_into_sight_is_named() -> None:
    # one landmark is within the wall
    found = place(beside_a_wall(path(2), [[0.0, 0.0], [15.0, 0.0]]), starts=2)
    assert 2 in found.hidden[:, 1]
    assert 3 not in found.hidden[:, 1]
    assert "and L1 come within range, but obstacles_m hides them" in found.notes[-1]
