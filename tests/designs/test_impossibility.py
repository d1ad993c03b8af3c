"""Proofs beside planted formations: none where they meet a brief just so, most where none can."""

import numpy as np
import pytest
from hypothesis import example as known
from hypothesis import given
from hypothesis import strategies as st

from syncplan.designs.impossibility import proof_against
from syncplan.scenario.brief import brief_of
from tests.tools.briefs import brief
from tests.tools.planted_briefs import draw_impossible, draw_planted


@given(st.integers(0, 2**32 - 1))
# distances on a map grid; a smallest circle as large as the area's largest; two centres beside it
@known(68)
@known(272)
@known(384)
@known(632)
@known(760)
@known(980)
def test_what_a_formation_just_meets_is_never_proven_impossible(number: int) -> None:
    assert proof_against(draw_planted(np.random.default_rng(number), edge=True).brief) is None


@pytest.mark.parametrize(
    "first",
    [
        pytest.param(0, marks=pytest.mark.documented),
        *(pytest.param(first, marks=pytest.mark.documented) for first in (500, 1000, 1500)),
    ],
)
def test_no_planted_brief_is_proven_impossible(first: int) -> None:
    for number in range(first, first + 500):
        planted = draw_planted(np.random.default_rng(number), edge=number % 4 == 0)
        assert proof_against(planted.brief) is None, number


def test_two_centres_between_shallow_corners_are_not_proven_impossible() -> None:
    assert proof_against(brief_of("tests/data/briefs/impossible-edge.json")) is None


def test_circles_that_go_round_large_keep_outs_are_not_proven_impossible() -> None:
    # with half the spread as radius, the discs lie where the circles do, keep-outs included
    squares = [[[x, 15.0], [x + 50.0, 15.0], [x + 50.0, 65.0], [x, 65.0]] for x in (15.0, 95.0)]
    given = brief(
        area_m=[[0.0, 0.0], [160.0, 0.0], [160.0, 80.0], [0.0, 80.0]],
        keep_out_m=squares,
        vehicle={"speed_mps": 5.0, "min_radius_m": 39.0},
        purpose={"keep": {"count": 2, "spread_m": 78.0}},
    )
    assert proof_against(given) is None


@pytest.mark.parametrize(
    ("first", "draws"), [(0, 60), pytest.param(60, 240, marks=pytest.mark.long)]
)
def test_what_is_asked_1_per_cent_beyond_the_possible_is_proven_impossible(
    first: int, draws: int
) -> None:
    numbers = range(first, first + draws)
    proofs = [proof_against(draw_impossible(np.random.default_rng(number))) for number in numbers]
    # where the draw misses the largest circle, its brief may be possible
    assert sum(proof is not None for proof in proofs) >= 0.97 * draws


def test_landmarks_that_one_loss_leaves_enough_of_are_no_proof() -> None:
    need = {"worst_rms_m": 2.0, "losses": 1}
    assert proof_against(brief(need=need, landmarks={"max": 3})) is None
    assert proof_against(brief(need=need, landmarks={"max": 2}, heading_sigma_rad=0.1)) is None
