"""Sweeps: what varies, what is judged anew, and the range that connects a team."""

from typing import Any

import networkx as nx
import numpy as np
import pytest
from pydantic import ValidationError

from syncplan.errors import InputError
from syncplan.planning.plans import Plan
from syncplan.planning.variations import connected_range, sweep
from syncplan.plotting.study_figures import sweep_spec
from syncplan.reports.validation_report import SweepReport, sweep_document
from syncplan.scenario.dotted_keys import IN_TRUTH, SWEPT_KEYS, SweptOption, numeric_keys, swept_key
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.measurement_graphs import union_over
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, example, small


def test_a_resolved_window_of_one_period_follows_the_rate() -> None:
    scenario = example("paper-grid-same").resolved()
    faster = SWEPT_KEYS["angular_rate"].varied(scenario, 0.5)
    assert faster.window == pytest.approx(2.0 * np.pi / 0.5)
    kept = SWEPT_KEYS["angular_rate"].varied(scenario.model_copy(update={"window_s": 10.0}), 0.5)
    assert kept.window == 10.0


def test_a_speed_gives_way_to_a_swept_rate() -> None:
    assert SWEPT_KEYS["angular_rate"].varied(example("four-ground-robots"), 0.5).orbit.rate == 0.5


def _connected(made: Plan) -> list[bool]:
    """Whether all are connected, at moments of a period."""
    period = made.orbits.period
    graphs = [
        union_over(made.windows, period, moment, 0.0).to_undirected()
        for moment in np.linspace(0.0, period, 50).tolist()
    ]
    return [one.number_of_nodes() == 4 and nx.is_connected(one) for one in graphs]


def test_at_the_connected_range_the_team_is_connected_at_every_instant() -> None:
    made = plan(small(landmarks_m=[[-300, 0], [-340, 0]]))
    reach = connected_range(made)
    # each landmark needs a vehicle in range, one landmark is of no help to another
    assert 340.0 < reach < 365.0
    wide, narrow = (
        plan(SWEPT_KEYS["range"].varied(made.scenario, share * reach)) for share in (1.0, 0.95)
    )
    assert all(_connected(wide))
    assert not all(_connected(narrow))


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("colour", [1.0], "can't be swept"),
        ("range_sigma_m", [1.0], r"did you mean sensor\.range_sigma_m"),
        ("sensor.intervall_s", [1.0], r"did you mean sensor\.interval_s"),
        ("motion.speed_scale_sigma", [3.0], r"^motion\.speed_scale_sigma: 3.0: must be"),
        ("motion.lag_s", [0.0, 1.0], r"^name: 'motion\.lag_s' can't be swept: it matters in"),
        ("range", [], "no values"),
        ("spacing", [70.0], "lists its centres"),
    ],
)
def test_what_cannot_be_swept_is_refused(name: str, values: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        sweep(example("paper-grid-same"), name, values)


def test_every_spelling_of_a_swept_key_follows_from_the_scenarios() -> None:
    found = swept_key("orbit.angular_rate_rad_s")
    assert isinstance(found, SweptOption)
    assert (found.request, found.name) == ("angular_rate_rad_s", "angular_rate")
    assert found.option == "--angular-rate"
    assert swept_key(found.request) is swept_key(found.name) is found


def test_any_number_is_set_for_all_vehicles_and_nothing_else_changes() -> None:
    scenario = scenario_from(
        {
            "orbit": circling(),
            "formation": {"shape": "line", "count": 2, "spacing_m": 70.0},
            "sensor": [{"range_m": 50.0}, {"range_m": 40.0}],
            "heading_sigma_rad": [0.1, 0.2],
            "geo_origin": {"lat_deg": 1.0, "lon_deg": 2.0},
        }
    )
    before = _numbers(scenario)
    assert {"heading_sigma_rad", "wind.sigma_mps", "orbit.speed_mps"} <= set(numeric_keys())
    own = {key: one for key, one in numeric_keys().items() if not key.startswith(IN_TRUTH)}
    for key, one in own.items():
        value = 2 if one.whole else 0.5
        after = _numbers(swept_key(key).varied(scenario, value))
        assert after[key] == [value] * (2 if key.startswith("sensor.") else 1), key
        changed = {k for k in before if after.get(k) != before[k]}
        assert changed - {key} == INSTEAD.get(key, set())


INSTEAD = {
    "orbit.speed_mps": {"orbit.angular_rate_rad_s"},
    "formation.gap_m": {"formation.spacing_m"},
    "motion.position_random_walk_m_sqrt_s": {"motion.speed_sigma_mps"},
    "motion.angle_random_walk_rad_sqrt_s": {"motion.turn_rate_sigma_rad_s"},
}


def _numbers(scenario: Scenario) -> dict[str, list[Any]]:
    """Every value of a scenario by its dotted key; of a list of sections, each one's."""
    found: dict[str, list[Any]] = {}
    for key, value in scenario.model_dump(exclude_none=True).items():
        if isinstance(value, dict):
            found |= {f"{key}.{inner}": [one] for inner, one in value.items()}
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for inner in {name for one in value for name in one}:
                each = [one.get(inner) for one in value]
                if isinstance(each[0], dict):
                    found |= {f"{key}.{inner}.{k}": [one[k] for one in each] for k in each[0]}
                else:
                    found[f"{key}.{inner}"] = each
        else:
            found[key] = [value]
    return found


def test_a_sigma_of_each_reading_takes_the_place_of_a_random_walk() -> None:
    walk = small(motion={"angle_random_walk_rad_sqrt_s": 0.003})
    swept = swept_key("motion.turn_rate_sigma_rad_s").varied(walk, 0.02).motion
    assert (swept.turn_rate_sigma_rad_s, swept.angle_random_walk_rad_sqrt_s) == (0.02, None)


def test_the_report_of_a_sweep_of_any_key_names_it_and_draws_its_unit() -> None:
    rows = sweep(small(), "sensor.range_sigma_m", [0.1, 1.0], trials=2, duration=5.0)
    report = sweep_document(rows)
    assert report.swept == "sensor.range_sigma_m"
    assert SweepReport.model_validate(report.as_json()) == report
    assert sweep_spec(report)["layout"]["xaxis"]["title"]["text"] == "sensor range sigma, m"
    with pytest.raises(ValidationError, match="did you mean"):
        SweepReport.model_validate({**report.model_dump(), "swept": "sensor.range_sigma"})
