"""Candidates beside the exact plan: what a point means, its faults, its error; what none meets."""

from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.designs.candidates import OF_LOSS, SAMPLES, UNFIT, Cell, Space, coarse
from syncplan.designs.cell_search import search
from syncplan.designs.impossibility import proof_against
from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief
from syncplan.scenario.purposes import PurposeMeasure
from tests.tools.briefs import brief, broken, within

EASY: dict[str, Any] = {"purpose": {"keep": {"count": 1, "spread_m": 1.0}}}
"""A purpose that any formation serves."""

SENSOR = {"range_m": 90.0, "sample_time_s": 0.25}


def _space(cell: Cell, **keys: Any) -> Space:
    return Space(brief(**EASY, **keys), cell)


def test_faults_are_those_of_the_plan() -> None:
    space = _space(Cell(3, 2), keep_out_m=[[[90.0, 50.0], [110.0, 50.0], [100.0, 70.0]]])
    generator = np.random.default_rng(1)
    fits = 0
    for _ in range(50):
        point = generator.uniform(0.0, 1.0, space.size)
        faults = space.faults(space.candidate(point))
        if any(faults.values()):
            assert space.value(point) >= UNFIT
            continue
        fits += 1
        made = space.plan(point)
        assert broken(space.brief, made) == []
        codes = {one.code for one in made.verdict.stops}
        assert codes <= {"unobservable"}
    assert fits > 5


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"sensor": {"bearing_sigma_rad": 0.05, "interval_s": 1.0, **SENSOR, "range_sigma_m": 1.0}},
        {
            "heading_sigma_rad": 0.02,
            "motion": {"speed_sigma_mps": 0.2, "turn_rate_sigma_rad_s": 0.1},
        },
        {"wind": {"sigma_mps": 0.5}, "vehicle": {"speed_mps": [4.0, 7.0], "min_radius_m": 10.0}},
    ],
)
def test_the_error_on_the_coarse_grid_is_that_of_the_plan(keys: dict[str, Any]) -> None:
    space, generator = _space(Cell(3, 2), **keys), np.random.default_rng(2)
    compared: list[float] = []
    while len(compared) < 6:
        point = generator.uniform(0.0, 1.0, space.size)
        coarse = space.value(point)
        if coarse < UNFIT:
            made = space.plan(point)
            assert made.prediction.rms is not None
            compared.append(coarse / float(made.prediction.rms.max()))
    # rare sightings fall on other samples, and the rest is a little too good
    assert 0.85 < np.min(compared) <= np.max(compared) < 1.1
    assert 0.93 < np.median(compared) < 1.03


@pytest.mark.parametrize("interval", [0.25, 0.5, 20.0])
def test_fewer_samples_hold_as_much_information_a_second(interval: float) -> None:
    sensor = {**SENSOR, "interval_s": interval, "range_sigma_m": 0.5}
    space = _space(Cell(2, 2), sensor=sensor, heading_sigma_rad=0.1)
    team = space.plan(np.random.default_rng(7).uniform(0.0, 1.0, space.size)).team
    few = coarse(team)
    assert few.sensors.sample_time * SAMPLES <= team.orbits.period * (1.0 + 1e-9)
    of_targets = [("bearing_sigmas", "every"), ("range_sigmas", "every")]
    for name, every in [*of_targets, ("compass_sigmas", "compass_every")]:
        spent = [
            getattr(one.sensors, name) ** 2 * one.sensors.sample_time * getattr(one.sensors, every)
            for one in (team, few)
        ]
        np.testing.assert_allclose(spent[1], spent[0])
    for name in ("speed_sigma", "turn_rate_sigma"):
        densities = [getattr(one.noise, name) ** 2 * one.sensors.sample_time for one in (team, few)]
        assert densities[1] == pytest.approx(densities[0])


def test_a_loss_counts_where_the_need_must_hold_after_it() -> None:
    needs = ({"worst_rms_m": 2.0}, {"worst_rms_m": 2.0, "losses": 1})
    whole, after = (_space(Cell(3, 2), need=need) for need in needs)
    points = np.random.default_rng(5).uniform(0.0, 1.0, (500, whole.size))
    point = next(point for point in points if whole.value(point) < UNFIT)
    assert after.value(point) > whole.value(point)


def test_landmarks_stand_where_the_brief_lets_them() -> None:
    generator = np.random.default_rng(3)
    sites = [[10.0, 10.0], [190.0, 10.0], [100.0, 100.0]]
    for landmarks in ({"max": 2}, {"max": 2, "on_edge": True}, {"candidates_m": sites}):
        space = _space(Cell(2, 2), landmarks=landmarks)
        for _ in range(20):
            found = space.candidate(generator.uniform(0.0, 1.0, space.size)).landmarks
            assert found.shape == (2, 2)
            assert found[0].tolist() != found[1].tolist()
            if "candidates_m" in landmarks:
                assert all(place in sites for place in found.tolist())
            elif "on_edge" in landmarks:
                x, y = found.T
                edge = np.minimum(np.minimum(x, 200.0 - x), np.minimum(y, 120.0 - y))
                np.testing.assert_allclose(edge, 0.0, atol=1e-9)
    given = _space(Cell(2, 3), landmarks={"given": sites})
    assert given.candidate(np.full(given.size, 0.5)).landmarks.tolist() == sites


def test_a_search_is_never_worse_than_its_start() -> None:
    given = brief(**EASY)
    long = search(given, Cell(3, 2), 100, (1,))
    assert long.fits
    # few candidates more hardly find a better one
    again = search(given, Cell(3, 2), 2, (2,), [long])
    assert again.value <= long.value
    assert again.evaluations >= 2


def test_a_search_begins_with_the_best_of_its_starts() -> None:
    given = brief(**EASY, landmarks={"max": 3})
    starts = [search(given, Cell(2, 2), 30, (seed,)) for seed in range(3)]
    # a landmark more cannot worsen what the others show
    for landmarks in (2, 3):
        best = search(given, Cell(2, landmarks), 1, (3,), starts)
        assert best.value <= min(start.value for start in starts) * (1.0 + 1e-9)


def test_senses_alternate_where_the_cell_says_so() -> None:
    for alternate, senses in ((False, [1.0, 1.0, 1.0]), (True, [1.0, -1.0, 1.0])):
        space = _space(Cell(3, 2, alternate))
        made = space.plan(np.random.default_rng(6).uniform(0.0, 1.0, space.size))
        assert made.orbits.senses.tolist() == senses


def test_a_larger_cell_begins_with_the_smaller_ones_formation() -> None:
    small, large = _space(Cell(2, 1)), _space(Cell(3, 2))
    generator = np.random.default_rng(4)
    point = generator.uniform(0.0, 1.0, small.size)
    before, sharing = small.candidate(point), 0
    for _ in range(100):
        after = large.candidate(large.joined(point, small.cell, generator))
        np.testing.assert_array_equal(after.centers[:2], before.centers)
        np.testing.assert_array_equal(after.phases[:2], before.phases)
        np.testing.assert_array_equal(after.landmarks[:1], before.landmarks)
        assert after.radius == before.radius
        sharing += after.centers[2].tolist() in before.centers.tolist()
    # half of them share a circle with another vehicle
    assert 30 < sharing < 70


@pytest.mark.parametrize("landmarks", [{"max": 2}, {"max": 2, "on_edge": True}])
def test_a_step_moves_one_body_or_all_and_stays_in_the_cube(landmarks: dict[str, Any]) -> None:
    space, generator = _space(Cell(3, 2), landmarks=landmarks), np.random.default_rng(9)
    point = generator.uniform(0.0, 1.0, space.size)
    before, bodies = space.candidate(point), set[tuple[bool, ...]]()
    for _ in range(300):
        near = space.shifted(point, space.step(generator))
        assert np.all((near >= 0.0) & (near <= 1.0))
        after = space.candidate(near)
        rows = zip(
            [*before.centers, *before.landmarks], [*after.centers, *after.landmarks], strict=True
        )
        if after.radius == before.radius:
            bodies.add(tuple(bool(np.any(a != b)) for a, b in rows))
    # each of three vehicles and two landmarks alone
    alone = {tuple(k == body for k in range(5)) for body in range(5)}
    assert bodies == alone


def test_a_run_begins_when_vehicles_stay_apart_for_longest() -> None:
    space, generator = _space(Cell(3, 2, alternate=True)), np.random.default_rng(10)
    cases = 0
    for _ in range(20):
        point = generator.uniform(0.0, 1.0, space.size)
        scenario, orbits = space.formation(point)
        # the circles are those of the candidate, all at another moment
        turned = orbits.senses * (orbits.phases - 2.0 * np.pi * point[1:4])
        np.testing.assert_allclose(np.exp(1j * turned), np.exp(1j * turned[0]))
        limit = 0.1 * orbits.radii[0] + 3.0 * scenario.initial_sigma.position_m
        times = np.linspace(0.0, 2.0 * orbits.period, 9600, endpoint=False)
        places = orbits.centers + orbits.radii[:, None] * np.stack(
            [
                np.cos(orbits.phases + orbits.senses * orbits.rate * times[:, None]),
                np.sin(orbits.phases + orbits.senses * orbits.rate * times[:, None]),
            ],
            axis=-1,
        )
        apart = np.stack([np.hypot(*(places[:, k] - places[:, k - 1]).T) for k in range(3)])
        near = np.flatnonzero((apart < limit).any(axis=0))
        if len(near) and len(near) < 9600:
            cases += 1
            gaps = np.diff(near)
            # by a sample at either end
            assert near[0] >= gaps.max() - 2 * 100
    assert cases > 3


def test_a_candidate_that_cannot_beat_the_limit_costs_less() -> None:
    need = {"worst_rms_m": 2.0, "losses": 1}
    space = _space(Cell(3, 3), need=need, landmarks={"max": 3})
    generator = np.random.default_rng(5)
    points = [generator.uniform(0.0, 1.0, space.size) for _ in range(300)]
    point = next(point for point in points if space.value(point) < UNFIT)
    before = space.spent
    worst = space.value(point)
    # all of three vehicles, three sensors and three landmarks, and the whole team
    assert space.spent - before == 1.0 + 9.0 * OF_LOSS
    before = space.spent
    part = space.value(point, 0.5 * worst)
    assert 0.5 * worst < part <= worst
    # the loss that decided comes first
    assert space.spent - before <= 1.0 + OF_LOSS


# --- what no formation meets ----------------------------------------------------------------------


PLANTED: list[tuple[dict[str, Any], str]] = [
    ({"vehicle": {"speed_mps": 5.0, "min_radius_m": 61.0}}, "limits"),
    ({"vehicle": {"speed_mps": 20.0, "bank_deg": 25.0}}, "limits"),
    ({"vehicle": {"speed_mps": [8.0, 9.0], "turn_rate_rad_s": 0.1}}, "limits"),
    ({"keep_out_m": [[[20.0, 20.0], [180.0, 20.0], [180.0, 100.0], [20.0, 100.0]]],
      "vehicle": {"speed_mps": 5.0, "min_radius_m": 12.0}}, "limits"),
    ({"landmarks": {"max": 0}}, "rank"),
    ({"landmarks": {"max": 1}}, "rank"),
    ({"landmarks": {"max": 0}, "heading_sigma_rad": 0.05}, "rank"),
    ({"landmarks": {"max": 2}, "need": {"worst_rms_m": 99.0, "losses": 1}}, "rank"),
    ({"landmarks": {"max": 1}, "need": {"worst_rms_m": 99.0, "losses": 1},
      "heading_sigma_rad": 0.05}, "rank"),
    ({"purpose": {"cover": {"share": 0.9, "swath_m": 12.0}}}, "area"),
    ({"purpose": {"visit_m": [[100.0, 60.0], [230.0, 60.0]]}}, "area"),
    ({"team": {"max": 6}, "purpose": {"keep": {"count": 6, "spread_m": 160.0}}}, "area"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "kind"), PLANTED)
def test_a_planted_impossibility_is_proven_and_no_formation_contradicts_it(
    keys: dict[str, Any], kind: str
) -> None:
    given = brief(**keys)
    proof = proof_against(given)
    assert proof is not None
    assert proof.kind == kind
    if kind == "rank":
        assert not _observable_somewhere(given)
    else:
        assert not _fits_somewhere(given, 500, np.random.default_rng(1))


def test_what_a_formation_serves_is_never_proven_impossible() -> None:
    generator = np.random.default_rng(2)
    served = 0
    for _ in range(150):
        radius = float(generator.uniform(5.0, 60.0))
        purposes: list[dict[str, Any]] = [
            {"cover": {"share": float(generator.uniform(0.1, 0.9)),
                       "swath_m": float(generator.uniform(5.0, 60.0))}},
            {"visit_m": generator.uniform(-20.0, 220.0, (2, 2)).tolist(), "within_m": 15.0},
            {"keep": {"count": 3, "spread_m": float(generator.uniform(20.0, 180.0))}},
        ]  # fmt: skip
        given = brief(
            vehicle={"speed_mps": 5.0, "min_radius_m": radius},
            team={"max": 3},
            purpose=purposes[int(generator.integers(3))],
        )
        if _fits_somewhere(given, 40, generator):
            served += 1
            assert proof_against(given) is None
    assert served > 20


def _circles(given: Brief, generator: np.random.Generator) -> tuple[Array, Array]:
    low, high = np.min(given.area_m, axis=0), np.max(given.area_m, axis=0)
    least = given.vehicle.least_radius(given.vehicle.speeds[0])
    centers = generator.uniform(low, high, (given.team.max, 2))
    # as large as the walls let each be, or as small as it can be
    wall = np.minimum(centers - low, high - centers).min(axis=1)
    share = generator.uniform(0.0, 1.0, given.team.max)
    return centers, least + share * np.maximum(wall - least, 0.0)


def _fits_somewhere(given: Brief, draws: int, generator: np.random.Generator) -> bool:
    """Whether some drawn circles stay within the area and serve the purpose, by sampling."""
    area = Area.of(given.area_m, given.keep_out_m)
    measure = PurposeMeasure.of(given.purpose, area, 0)
    turn = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    way = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    for _ in range(draws):
        centers, radii = _circles(given, generator)
        paths = (centers[:, None] + radii[:, None, None] * way).reshape(-1, 2)
        if not within(np.array(given.area_m), paths).all():
            continue
        if any(within(np.array(one), paths).any() for one in given.keep_out_m or []):
            continue
        if measure.room(centers, radii) >= 0.0:
            return True
    return False


def _observable_somewhere(given: Brief) -> bool:
    """Whether some drawn formation is observable with all landmarks that may be, less losses."""
    easy = brief(
        **given.model_dump(include={"landmarks", "heading_sigma_rad"}, exclude_none=True),
        purpose={"keep": {"count": 1, "spread_m": 1.0}},
        sensor={"range_m": 500.0},
    )
    space = Space(easy, Cell(3, max(easy.landmarks.most - given.need.losses, 0)))
    points = np.random.default_rng(3).uniform(0.0, 1.0, (20, space.size))
    return any(space.plan(point).observable for point in points)
