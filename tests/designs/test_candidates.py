"""Candidates: what a point means, its faults, and its error beside that of the exact plan."""

from typing import Any

import numpy as np
import pytest

from syncplan.designs.candidates import SAMPLES, UNFIT, Cell, Space, coarse
from syncplan.designs.cell_search import search
from tests.tools.briefs import brief, broken

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
        faults = space.faults(point)
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
    space, generator = _space(Cell(3, 2)), np.random.default_rng(8)
    start = generator.uniform(0.2, 0.8, space.size)
    long = search(space, 200, (1,), start)
    assert long.fits
    # two candidates more hardly find a better one
    assert search(space, 2, (2,), long.point).value <= long.value


def test_senses_alternate_where_the_cell_says_so() -> None:
    for alternate, senses in ((False, [1.0, 1.0, 1.0]), (True, [1.0, -1.0, 1.0])):
        space = _space(Cell(3, 2, alternate))
        made = space.plan(np.random.default_rng(6).uniform(0.0, 1.0, space.size))
        assert made.orbits.senses.tolist() == senses


def test_a_larger_cell_begins_with_the_smaller_ones_formation() -> None:
    small, large = _space(Cell(2, 1)), _space(Cell(3, 2))
    point = np.random.default_rng(4).uniform(0.0, 1.0, small.size)
    before, after = small.candidate(point), large.candidate(large.extended(point, small.cell, 0))
    np.testing.assert_array_equal(after.centers[:2], before.centers)
    np.testing.assert_array_equal(after.phases[:2], before.phases)
    np.testing.assert_array_equal(after.landmarks[:1], before.landmarks)
    assert after.radius == before.radius
