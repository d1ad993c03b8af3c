"""Sweeps: what varies, what is judged anew, and the range that connects a team."""

import networkx as nx
import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.orbits.graphs import rpmg_at
from syncplan.planning.planner import plan
from syncplan.planning.sweeps import connected_range, sweep
from syncplan.planning.swept_keys import SWEPT_KEYS, swept_key
from tests.tools.scenarios import example, small


def test_a_resolved_window_of_one_period_follows_the_rate() -> None:
    scenario = example("paper-grid-same").resolved()
    faster = SWEPT_KEYS["angular_rate"].varied(scenario, 0.5)
    assert faster.window == pytest.approx(2.0 * np.pi / 0.5)
    kept = SWEPT_KEYS["angular_rate"].varied(scenario.model_copy(update={"window_s": 10.0}), 0.5)
    assert kept.window == 10.0


def test_a_speed_gives_way_to_a_swept_rate() -> None:
    assert SWEPT_KEYS["angular_rate"].varied(example("four-ground-robots"), 0.5).orbit.rate == 0.5


def test_at_the_connected_range_the_team_is_connected_at_every_instant() -> None:
    made = plan(small(landmarks_m=[[-300, 0], [-340, 0]]))
    reach = connected_range(made)
    # each landmark needs a vehicle in range, one landmark is of no help to another
    assert 340.0 < reach < 365.0
    wide = plan(SWEPT_KEYS["range"].varied(made.scenario, reach))
    for moment in np.linspace(0.0, wide.orbits.period, 50):
        graph = rpmg_at(wide.windows, wide.orbits.period, float(moment)).to_undirected()
        assert graph.number_of_nodes() == 4
        assert nx.is_connected(graph)
    narrow = plan(SWEPT_KEYS["range"].varied(made.scenario, 0.95 * reach))
    connected = [
        nx.is_connected(rpmg_at(narrow.windows, narrow.orbits.period, float(t)).to_undirected())
        for t in np.linspace(0.0, narrow.orbits.period, 50)
    ]
    assert not all(connected)


def test_what_cannot_be_swept_is_refused_before_anything_runs() -> None:
    scenario = example("paper-grid-same")
    with pytest.raises(InputError, match="can't be swept"):
        sweep(scenario, "colour", [1.0])
    with pytest.raises(InputError, match="no values"):
        sweep(scenario, "range", [])
    with pytest.raises(InputError, match="lists its centres"):
        sweep(scenario, "spacing", [70.0])


@pytest.mark.parametrize(
    ("key", "request_key", "name", "option"),
    [
        ("orbit.angular_rate_rad_s", "angular_rate_rad_s", "angular_rate", "--angular-rate"),
        ("sensor.range_m", "range_m", "range", "--range"),
        ("orbit.radius_m", "radius_m", "radius", "--radius"),
        ("formation.spacing_m", "spacing_m", "spacing", "--spacing"),
    ],
)
def test_every_spelling_of_a_swept_key_follows_from_the_scenarios(
    key: str, request_key: str, name: str, option: str
) -> None:
    found = swept_key(key)
    assert (found.request, found.name, found.option) == (request_key, name, option)
    assert swept_key(request_key) is swept_key(name) is found
