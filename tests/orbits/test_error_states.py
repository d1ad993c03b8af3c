"""Errors that last: the order of their states."""

from dataclasses import replace

import numpy as np

from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas
from tests.tools.draws import draw_team

CONSTANT = [name for name, state in ERROR_STATES.items() if state.constant]


def test_states_follow_the_poses_in_the_order_of_the_table() -> None:
    team = draw_team(np.random.default_rng(2))
    n = team.count
    odd = np.arange(n) % 2 == 1
    sensors = replace(
        team.sensors,
        bearing_bias_sigmas=np.where(odd, 0.02, 0.0),
        bearing_walk_sigmas=np.where(odd, 0.0, 0.03),
    )
    errors = ErrorSigmas(dict.fromkeys(ERROR_STATES, 0.1), estimated=tuple(ERROR_STATES))
    team = replace(team, sensors=sensors, errors=errors)
    layout = layout_of(team)
    changing = [name for name in ERROR_STATES if name not in CONSTANT]
    assert layout.names == (*CONSTANT, *changing)
    labels = layout.labels([f"v{k + 1}" for k in range(n)])
    assert labels[:4] == ["wind x", "wind y", "speed scale of v1", "speed scale of v2"]
    walking = [label for label in labels if label.startswith("bearing walk")]
    assert walking == [f"bearing walk of v{k + 1}" for k in range(n) if not k % 2]
    assert labels[-len(walking) :] == walking
    assert labels[-len(walking) - 2 :][:2] == [f"gusts x of v{n}", f"gusts y of v{n}"]
    biased = [label for label in labels if label.startswith("bearing bias")]
    assert biased == [f"bearing bias of v{k + 1}" for k in range(n) if k % 2]
    assert layout.size == 3 * n + len(labels) == 3 * n + 2 + 2 * n + n + n + 2 * n
    assert layout_of(team, ["wind"]).size == 3 * n + 2
