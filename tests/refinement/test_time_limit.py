"""The time of a refinement: what is left out once it is over, and what never is."""

import time
from typing import Any

import pytest

from syncplan.arrays import Array
from syncplan.planning.planner import Plan, plan
from syncplan.refinement.ipopt import SolverRun, StagedSolver, Steering
from syncplan.refinement.measures import Measurement, measure
from syncplan.refinement.refiner import refine
from tests.tools.scenarios import small
from tests.tools.smooth_problems import record_of


@pytest.fixture(scope="module")
def pair() -> Plan:
    return plan(small(landmarks_m=[[0.0, 40.0], [70.0, 40.0]]))


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """An entry for each measurement of a candidate, of which each start has three."""
    looks: list[int] = []

    def counted(*given: Any, **also: Any) -> Measurement:
        looks.append(1)
        return measure(*given, **also)

    def three(self: StagedSolver, start: Array, steering: Steering) -> SolverRun:
        return SolverRun((start,) * 3, "done", steering.over, 1, 0.0, 0.0, ())

    monkeypatch.setattr("syncplan.refinement.parallel_starts.measure", counted)
    monkeypatch.setattr(StagedSolver, "solve", three)
    return looks


def test_once_time_is_over_the_sharpest_candidate_that_passes_is_enough(
    pair: Plan, measured: list[int]
) -> None:
    better = refine(pair, starts=1, workers=1, time_limit_s=1e-6)
    assert record_of(better).cut_short
    assert len(measured) == 1


def test_within_the_time_all_candidates_are_measured(pair: Plan, measured: list[int]) -> None:
    refine(pair, starts=1, workers=1, time_limit_s=1e6)
    assert len(measured) == 3


def test_the_time_includes_the_measurement_of_the_plan_itself(
    pair: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, real = [0.0], time.monotonic

    def slowly(*given: Any, **also: Any) -> Measurement:
        now[0] += 1000.0
        return measure(*given, **also)

    monkeypatch.setattr("syncplan.refinement.refiner.measure", slowly)
    monkeypatch.setattr(time, "monotonic", lambda: real() + now[0])
    better = refine(pair, starts=1, workers=1, time_limit_s=500.0)
    assert record_of(better).cut_short
