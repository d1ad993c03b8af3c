"""The posterior bound by lumps of sightings, beside the exact recursion."""

from typing import Any

import numpy as np
import pytest

from syncplan.estimation import lumped_bound as lumps
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.referred_system import ReferredSystem
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.planning import planner
from syncplan.planning.planner import Plan, plan
from tests.tools.scenarios import example, small

BIASES = {"speed_scale_sigma": 0.02, "turn_rate_bias_sigma_rad_s": 0.005}


def _grid(count: int, **keys: Any) -> dict[str, Any]:
    return {
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
        "formation": {"shape": "grid", "count": count, "columns": 5, "spacing_m": 70.0},
        "landmarks_m": [[-40.0, 0.0], [-40.0, 70.0]],
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "duration_s": 100.0,
        **keys,
    }


CASES = {
    "a grid": lambda: plan(_grid(20), bound="never"),
    "a grid with wind and biases": lambda: plan(
        _grid(10, motion=BIASES, wind={"sigma_mps": 1.0}), bound="never"
    ),
    "mixed radii and cameras": lambda: plan(example("mixed-radii-camera"), bound="never"),
    "a part that is not observable": lambda: plan(example("landmark-bridge"), bound="never"),
}


def _system(made: Plan, duration: float) -> ReferredSystem:
    team = made.team
    steps = round(duration / team.sensors.sample_time)
    return ReferredSystem.along(team, made.windows, steps, layout_of(team))


@pytest.mark.parametrize("name", CASES)
def test_lumps_of_one_sample_leave_out_nothing(name: str) -> None:
    system = _system(CASES[name](), 40.0)
    exact, found = system.bound(system.start), lumps._bound(system, system.start, 1)
    np.testing.assert_allclose(found.position_variance, exact.position_variance, rtol=1e-4)
    np.testing.assert_allclose(found.heading_variance, exact.heading_variance, rtol=1e-4)
    if exact.errors is not None and found.errors is not None:
        np.testing.assert_allclose(found.errors, exact.errors, rtol=1e-4)


@pytest.mark.parametrize("name", CASES)
def test_the_error_of_lumps_is_below_its_estimate(name: str) -> None:
    made = CASES[name]()
    exact = posterior_bound(made.team, made.windows, made.scenario.duration_s)
    found = posterior_bound(made.team, made.windows, made.scenario.duration_s, lumped=True)
    off = np.max(np.abs(found.rms_second_half() / exact.rms_second_half() - 1.0))
    assert exact.accuracy == 0.0
    assert 0.0 < off < found.accuracy < 0.05
    if "grid" in name:
        # placed at the first sample of each lump, rows would be off by more
        assert off < 0.003
    assert found.position_variance.shape == exact.position_variance.shape


def test_rows_of_a_pair_are_lumped_within_a_contact_and_keep_their_information() -> None:
    system = _system(plan(_grid(10), bound="never"), 100.0)
    run = lumps.lumped(system.run, 19, 1e9)
    assert len(run.rows.entries) < len(system.run.rows.entries) / 5

    def information(rows: Any) -> Any:
        dense = np.zeros((len(rows.entries), system.run.size))
        number = np.arange(len(dense))[:, None]
        np.add.at(dense, (number, rows.columns), rows.entries)
        return dense.T @ dense

    whole = information(system.run.rows)
    np.testing.assert_allclose(information(run.rows), whole, atol=1e-9 * whole.max())


def test_errors_that_change_are_predicted_exactly() -> None:
    made = plan(example("windy-grid"), bound="never")
    changing = any(not ERROR_STATES[name].constant for name in layout_of(made.team).names)
    found = posterior_bound(made.team, made.windows, 20.0, lumped=True)
    assert (found.accuracy == 0.0) == changing


def test_a_large_team_is_predicted_by_lumps_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    given = small()
    exact = plan(given, bound="always").prediction
    monkeypatch.setattr(planner, "BOUND_WORK_LIMIT", 1.0)
    made = plan(given, bound="always")
    assert "lumped over a sixteenth of a period, to an estimated" in made.prediction.note
    assert made.start_up is None
    assert exact.rms is not None
    assert made.prediction.rms == pytest.approx(exact.rms, rel=0.02)
    (finding,) = (one for one in made.verdict.findings if one.message == made.prediction.note)
    assert (finding.code, finding.level) == ("bound-estimated", "note")
