"""Crazyswarm2's trajectories: evaluated as its reader does, they are circles to a millimetre."""

import io
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.exporting.formats import ExportOptions, export
from syncplan.exporting.trajectories import TOLERANCE_M, arc_pieces
from syncplan.orbits.circles import Orbits, heading, position
from syncplan.planning.planner import Plan
from tests.tools.exported import contents, mixed_team, team


def _rows(text: bytes) -> Any:
    # what uav_trajectory.py reads: a header, then the first 33 columns
    return np.loadtxt(io.StringIO(text.decode()), delimiter=",", skiprows=1, usecols=range(33))


def _flown(rows: Any, times: Any, kind: Any = np.float64) -> Any:
    """(k, 4) of x, y, z, yaw: each piece from its own time 0 by Horner's rule."""
    rows = np.atleast_2d(rows)
    ends = np.cumsum(rows[:, 0])
    piece = np.minimum(np.searchsorted(ends, times), len(rows) - 1)
    since = (times - (ends - rows[:, 0])[piece]).astype(kind)
    coefficients = rows[piece, 1:].reshape(-1, 4, 8).astype(kind)
    value = np.zeros((len(times), 4), dtype=kind)
    for power in reversed(range(8)):
        value = value * since[:, None] + coefficients[:, :, power]
    return value


@cache
def _small_team() -> Plan:
    """Three that fit a room, turning both ways."""
    return team(
        orbit={
            "radius_m": [0.8, 1.0, 0.5],
            "angular_rate_rad_s": 0.8,
            "direction": ["cw", "ccw", "cw"],
        },
        formation={"centers_m": [[0, 0], [2.2, 0], [1, 2]]},
        geo_origin=None,
        duration_s=60.0,
        sensor={"range_m": 2.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    )


@pytest.mark.parametrize("planned", [mixed_team, _small_team], ids=["large", "small"])
@pytest.mark.parametrize("kind", [np.float64, np.float32], ids=["exactly", "as on board"])
def test_trajectories_stay_within_a_millimetre_of_the_circles(
    planned: Callable[[], Plan], kind: Any
) -> None:
    plan = planned()
    made = export(plan, "crazyswarm", ExportOptions(altitude_m=1.25, force=True))
    duration = plan.scenario.duration_s
    times = np.linspace(0.0, duration, 20_001)
    for k, text in enumerate(contents(made, ".csv").values()):
        rows = _rows(text)
        assert rows[:, 0].sum() == pytest.approx(duration, abs=1e-8)
        flown = _flown(rows, times, kind)
        off = np.hypot(*(flown[:, :2] - position(plan.orbits, times)[:, k]).T)
        assert off.max() < 1e-3
        assert np.abs(flown[:, 2] - 1.25).max() == 0.0
        assert np.abs(flown[:, 3] - heading(plan.orbits, times)[:, k]).max() < 1e-5


def test_pieces_join_up_to_their_third_derivative() -> None:
    for text in contents(export(mixed_team(), "crazyswarm"), ".csv").values():
        rows = _rows(text)
        for axis in range(4):
            pieces = [np.polynomial.Polynomial(row[1 + 8 * axis : 9 + 8 * axis]) for row in rows]
            for before, after, step in zip(pieces, pieces[1:], rows[:, 0], strict=False):
                for order in range(4):
                    end, start = before.deriv(order)(step), after.deriv(order)(0.0)
                    assert end == pytest.approx(start, abs=1e-8)


@given(
    st.floats(0.1, 1000.0), st.floats(0.05, 3.0), st.floats(0.0, 6.3), st.sampled_from([-1.0, 1.0])
)
def test_a_piece_is_off_by_no_more_than_hermites_bound(
    radius: float, angle: float, phase: float, sense: float
) -> None:
    orbits = Orbits(
        np.zeros((1, 2)), np.array([radius]), np.array([sense]), np.array([phase]), angle
    )
    rows = arc_pieces(orbits, 0, 1.0, 1, 0.0)
    times = np.linspace(0.0, 1.0, 101)
    off = np.abs(_flown(rows, times)[:, :2] - position(orbits, times)[:, 0]).max()
    assert off <= radius * (angle / 2.0) ** 8 / 40320.0 + 1e-9 * radius


def test_no_fewer_pieces_would_do() -> None:
    plan = mixed_team()
    for k, text in enumerate(contents(export(plan, "crazyswarm"), ".csv").values()):
        count = len(_rows(text)) - 1
        rows = arc_pieces(plan.orbits, k, 100.0, count, 0.0)
        times = np.linspace(0.0, 100.0, 20_001)
        off = np.abs(_flown(rows, times)[:, :2] - position(plan.orbits, times)[:, k]).max()
        assert off > 0.9 * TOLERANCE_M


def test_a_short_trajectory_is_still_a_table() -> None:
    made = export(mixed_team(), "crazyswarm", ExportOptions(duration=0.5))
    assert all(_rows(text).shape == (2, 33) for text in contents(made, ".csv").values())


def test_more_pieces_than_a_crazyflie_holds_are_reported_or_refused() -> None:
    assert any(
        "a Crazyflie holds 31" in one for one in export(team(duration_s=500.0), "crazyswarm").notes
    )
    assert not any("a Crazyflie" in one for one in export(mixed_team(), "crazyswarm").notes)
    with pytest.raises(InputError, match="give a shorter one") as caught:
        export(mixed_team(), "crazyswarm", ExportOptions(duration=600_000.0))
    assert caught.value.key == "duration"
