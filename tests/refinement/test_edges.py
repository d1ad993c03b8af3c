"""Refinement with little to work with, or little time: it returns a plan or says why it can't."""

import time
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.planning.plans import Plan
from syncplan.refinement.ipopt import SolverRun, StagedSolver, Steering
from syncplan.refinement.measures import Measurement, measure
from tests.tools.on_paper import plan, refine
from tests.tools.scenarios import small
from tests.tools.smooth_problems import record_of

pytestmark = pytest.mark.usefixtures("short_exact_search")

PERIOD_S = 2.0 * np.pi / 0.2
NOTHING_SEEN = {"formation": {"centers_m": [[0.0, 0.0], [500.0, 0.0]]}, "landmarks_m": None}
SHARED = {"centers_m": [[0.0, 0.0], [0.0, 0.0]]}
LANDMARKS = [[0.0, 45.0], [70.0, -40.0]]

THIN: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "one vehicle": ({"formation": {"centers_m": [[0.0, 0.0]]}}, {}),
    "nothing to vary": ({"formation": {"centers_m": [[0.0, 0.0]]}}, {"vary": ["phases"]}),
    **{
        f"nothing seen, {objective}": (NOTHING_SEEN, {"objective": objective})
        for objective in ("predicted_rms", "trace", "min_eigenvalue")
    },
    "no landmarks": ({"landmarks_m": None}, {"objective": "logdet"}),
    "one orbit for all": ({"formation": SHARED}, {"objective": "logdet"}),
    "few samples a turn": (
        {"sensor": {"range_m": 50.0, "sample_time_s": PERIOD_S / 5.0}},
        {"objective": "min_eigenvalue"},
    ),
    "a window of two samples": ({"window_s": 0.15}, {"objective": "logdet"}),
    "a box of no size": ({}, {"vary": ["centers"], "center_box_m": 1e-9}),
    "radii held fast": ({}, {"vary": ["radii"], "radius_m": [20.0, 20.0]}),
}


def _given(**changes: Any) -> Plan:
    return plan(small(**{"landmarks_m": LANDMARKS, "duration_s": 20.0, **changes}))


@pytest.mark.parametrize("case", THIN)
def test_thin_problems_come_back_no_worse(case: str) -> None:
    changes, options = THIN[case]
    given = _given(**changes)
    record = record_of(refine(given, starts=1, workers=1, **options))
    assert record.improved or record.reason
    assert record.after.rank >= record.before.rank
    objective = record.objective
    assert record.after.cost(objective) <= record.before.cost(objective)


def test_hardly_any_time_gives_the_plan_back() -> None:
    given = _given()
    record = record_of(refine(given, time_limit_s=1e-9, workers=1))
    assert (record.improved, record.cut_short) == (False, True)
    assert "cut short" in record.reason
    assert "time_limit_s" in record.reason


def test_named_vehicles_keep_their_names() -> None:
    given = _given(formation={"centers_m": {"ann": [0.0, 0.0], "bob": [70.0, 0.0]}})
    refined = refine(given, starts=1, workers=1, objective="logdet")
    assert record_of(refined).improved
    assert refined.scenario.vehicle_names == ["ann", "bob"]


AREA = [[-40.0, -40.0], [130.0, -40.0], [130.0, 60.0], [-40.0, 60.0]]


def test_vehicles_are_not_flown_into_each_other_where_no_separation_is_asked_for() -> None:
    """Bearings say most from nearby, and here the centres may go anywhere."""
    given = _given(area_m=AREA)
    refined = refine(given, starts=1, workers=1, objective="trace")
    assert given.approach is not None
    assert refined.approach is not None
    assert record_of(refined).improved
    assert refined.approach.distance >= min(given.approach.distance, 10.0) * (1.0 - 1e-6)


def test_a_margin_that_is_asked_for_holds_in_the_result_even_if_the_plan_had_less() -> None:
    """The circles are 30 m apart and may come 10 m nearer; a margin of 15 m is there already."""
    given = _given()
    for margin, reached in ((15.0, True), (28.0, True), (40.0, False)):
        refined = refine(given, starts=1, workers=1, margin_m=margin)
        record = record_of(refined)
        assert record.improved == reached
        if reached:
            assert refined.links[0].min_distance <= 50.0 - margin + 1e-6
        else:
            assert "contact of v1-v2" in record.reason


def test_circles_that_start_outside_their_area_end_inside_or_not_at_all() -> None:
    given = _given(area_m=[[-21.0, -21.0], [93.0, -21.0], [93.0, 30.0], [-21.0, 30.0]])
    moved = _given(area_m=[[-17.0, -21.0], [97.0, -21.0], [97.0, 30.0], [-17.0, 30.0]])
    for one in (given, moved):
        refined = refine(one, starts=1, workers=1)
        assert record_of(refined).improved
        area = np.array(one.scenario.area_m)
        reach = refined.orbits.radii[:, None]
        assert np.all(refined.orbits.centers - reach >= area.min(axis=0) - 1e-6)
        assert np.all(refined.orbits.centers + reach <= area.max(axis=0) + 1e-6)


# --- the time -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("time_s", "looks"), [(1e-6, 1), (1e6, 3)])
def test_once_time_is_over_the_sharpest_candidate_that_passes_is_enough(
    monkeypatch: pytest.MonkeyPatch, time_s: float, looks: int
) -> None:
    def three(self: StagedSolver, start: Array, steering: Steering) -> SolverRun:
        return SolverRun((start,) * 3, "done", steering.over, 1, 0.0, 0.0, ())

    measured = Mock(wraps=measure)
    monkeypatch.setattr("syncplan.refinement.parallel_starts.measure", measured)
    monkeypatch.setattr(StagedSolver, "solve", three)
    better = refine(_given(), starts=1, workers=1, time_limit_s=time_s)
    assert record_of(better).cut_short == (looks == 1)
    assert measured.call_count == looks


def test_the_time_includes_the_measurement_of_the_plan_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, real = [0.0], time.monotonic

    def slowly(*given: Any, **also: Any) -> Measurement:
        now[0] += 1000.0
        return measure(*given, **also)

    monkeypatch.setattr("syncplan.refinement.refiner.measure", slowly)
    monkeypatch.setattr(time, "monotonic", lambda: real() + now[0])
    better = refine(_given(), starts=1, workers=1, time_limit_s=500.0)
    assert record_of(better).cut_short
