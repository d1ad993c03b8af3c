"""Requests that are drawn to break the service: a draw can be repeated."""

import numpy as np

from tests.tools.mutations import draw_request, valid_scenarios


def test_the_same_draw_is_the_same_request() -> None:
    scenarios = valid_scenarios()

    def sent(seed: int, number: int) -> list[bytes]:
        drawn = draw_request(np.random.default_rng([seed, number]), scenarios, ["0" * 36])
        return drawn.pieces()

    assert [sent(5, k) for k in range(50)] == [sent(5, k) for k in range(50)]
    assert sent(5, 1) != sent(6, 1)
