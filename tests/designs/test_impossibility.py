"""Proofs that no formation meets a brief, repeated by brute force."""

from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.designs.candidates import Cell, Space
from syncplan.designs.impossibility import proof_against
from syncplan.scenario.areas import Area
from syncplan.scenario.brief import Brief
from syncplan.scenario.purposes import PurposeMeasure
from tests.tools.briefs import brief, within

PLANTED: list[tuple[dict[str, Any], str]] = [
    ({"vehicle": {"speed_mps": 5.0, "min_radius_m": 61.0}}, "limits"),
    ({"vehicle": {"speed_mps": 20.0, "bank_deg": 25.0}}, "limits"),
    ({"vehicle": {"speed_mps": [8.0, 9.0], "turn_rate_rad_s": 0.1}}, "limits"),
    ({"keep_out_m": [[[20.0, 20.0], [180.0, 20.0], [180.0, 100.0], [20.0, 100.0]]],
      "vehicle": {"speed_mps": 5.0, "min_radius_m": 12.0}}, "limits"),
    ({"landmarks": {"max": 0}}, "rank"),
    ({"landmarks": {"max": 1}}, "rank"),
    ({"landmarks": {"max": 0}, "heading_sigma_rad": 0.05}, "rank"),
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
    """Whether some drawn formation is observable with all landmarks that may be."""
    easy = brief(
        **given.model_dump(include={"landmarks", "heading_sigma_rad"}, exclude_none=True),
        purpose={"keep": {"count": 1, "spread_m": 1.0}},
        sensor={"range_m": 500.0},
    )
    space = Space(easy, Cell(3, easy.landmarks.most))
    points = np.random.default_rng(3).uniform(0.0, 1.0, (20, space.size))
    return any(space.plan(point).observable for point in points)
