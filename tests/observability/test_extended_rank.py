"""Rank with errors as states: known ranks, dense algebra, and words for what is lost."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.observability.error_modes import (
    ErrorMode,
    ExtendedObservability,
    assess_extended,
    judge_errors,
)
from syncplan.observability.rank import Assessment, assess_team
from syncplan.observability.referred_rows import dense_rows, state_rows
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.planning import planner
from syncplan.planning.plans import Plan
from syncplan.reports.plan_report import plan_document
from syncplan.scenario.specification import Scenario
from tests.tools.draws import draw_equipped_team
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed, circling, findings_of, planned

SIGMAS = {
    "wind": ("wind", "sigma_mps", 1.0),
    "speed_scale": ("motion", "speed_scale_sigma", 0.02),
    "turn_rate_bias": ("motion", "turn_rate_bias_sigma_rad_s", 0.005),
    "bearing_bias": ("sensor", "bearing_bias_sigma_rad", 0.02),
}

ALTERNATING = "speed scales of v1, v3 and v5 against v2, v4 and v6, with a turn of the team"


def _grid(name: str, *kinds: str, **keys: object) -> Scenario:
    """The example with errors of these kinds as states."""
    given: dict[str, dict[str, float]] = {}
    for section, key, sigma in map(SIGMAS.__getitem__, kinds):
        given.setdefault(section, {})[key] = sigma
    return changed(name, **given, **keys)


def _planned(formation: str, *kinds: str, **keys: object) -> Plan:
    return plan(_grid(formation, *kinds, **keys), bound="never")


def _extended(made: Plan) -> ExtendedObservability:
    assert made.error_verdict is not None
    assert made.error_verdict.extended is not None
    return made.error_verdict.extended


def _modes(made: Plan) -> tuple[ErrorMode, ...]:
    assert made.error_verdict is not None
    return made.error_verdict.modes


@pytest.mark.parametrize(
    ("formation", "desync"), [("paper-grid-same", 0.0), ("paper-grid-alternate", 0.2)]
)
@pytest.mark.parametrize(
    ("kinds", "number"),
    [
        (("wind",), 2),
        (("turn_rate_bias",), 6),
        (("bearing_bias",), 6),
        (("wind", "turn_rate_bias", "bearing_bias"), 14),
    ],
)
def test_wind_and_biases_are_determined_in_one_window(
    formation: str, desync: float, kinds: tuple[str, ...], number: int
) -> None:
    made = _planned(formation, *kinds, orbit={"desync_rad": desync})
    found = _extended(made)
    assert (found.rank, found.state_dim) == (18 + number, 18 + number)
    assert found.poses_determined
    assert found.singular_values[-1] > 1e-5 * found.singular_values[0]
    verdict = plan_document(made).observability
    assert verdict.states is not None
    assert [one.state for one in verdict.states] == [
        "position",
        "heading",
        *(kind.replace("_", " ") for kind in kinds),
    ]
    assert all(one.determined and not one.undetermined for one in verdict.states)
    assert not findings_of(made, "needs-prior") + findings_of(made, "error-undetermined")


@pytest.mark.parametrize("more", [(), ("turn_rate_bias",), ("wind", "bearing_bias")])
def test_speed_scale_is_one_short_on_the_grid_of_one_sense(more: tuple[str, ...]) -> None:
    made = _planned("paper-grid-same", "speed_scale", *more)
    found = _extended(made)
    assert found.rank == found.state_dim - 1
    assert found.gap > 1e6
    assert made.observable
    assert not found.poses_determined
    (finding,) = findings_of(made, "needs-prior")
    assert finding.level == "warning"
    assert ALTERNATING in finding.message
    assert finding.cure is not None
    assert "motion.speed_scale_sigma; a compass" in finding.cure.text
    verdict = plan_document(made).observability
    assert verdict.states is not None
    assert verdict.extended is not None
    lacking = {one.state: one.undetermined for one in verdict.states if not one.determined}
    assert list(lacking) == ["position", "heading", "speed scale"]
    assert lacking["speed scale"] == [f"speed scale of v{k}" for k in range(1, 7)]
    assert [one.description for one in verdict.extended.undetermined] == [ALTERNATING]
    assert made.verdict.go


@pytest.mark.parametrize(
    ("formation", "keys"),
    [
        ("paper-grid-same", {"heading_sigma_rad": 0.05}),
        ("paper-grid-alternate", {"orbit": {"desync_rad": 0.2}}),
    ],
)
def test_what_cures_the_speed_scales_does(formation: str, keys: dict[str, object]) -> None:
    made = _planned(formation, "speed_scale", **keys)
    found = _extended(made)
    assert (found.rank, found.state_dim) == (24, 24)
    assert not findings_of(made, "needs-prior")


def test_a_vehicle_that_sees_nobody_has_a_bearing_bias_that_nobody_can_detect() -> None:
    scenario = _grid("paper-grid-same")
    sensors = [one.model_dump(exclude_none=True) for one in scenario.sensors]
    sensors = [{**one, "bearing_bias_sigma_rad": 0.02} for one in sensors]
    sensors[0]["range_m"] = 1.0
    made = plan(changed("paper-grid-same", sensor=sensors), bound="never")
    found = _extended(made)
    assert made.observable
    assert found.poses_determined
    assert (found.rank, found.state_dim) == (23, 24)
    determined = found.determined[found.layout.columns["bearing_bias"][:, 0]]
    assert determined.tolist() == [False] + 5 * [True]
    (finding,) = findings_of(made, "error-undetermined")
    assert (finding.level, finding.subjects) == ("note", ("v1",))
    assert "bearing bias of v1; rank 23 of 24" in finding.message
    assert "compass" not in (finding.cure.text if finding.cure else "")


def test_without_landmarks_nobody_can_detect_the_wind() -> None:
    # all drift alike; that the team shifts and turns is said elsewhere
    made = planned(wind={"sigma_mps": 1.0})
    assert [one.description for one in made.unobservable][:2] == [
        "shift of everything along x",
        "shift of everything along y",
    ]
    assert [one.description for one in _modes(made)] == ["wind x", "wind y"]
    assert not any(one.moves_poses for one in _modes(made))


def test_without_landmarks_nobody_can_detect_that_all_is_larger() -> None:
    # circles grow with the speed scales, and the distances between them
    orbit = circling(first_phase_rad=0.7)
    formation = {"centers_m": [[0.0, 0.0], [70.0, 0.0], [30.0, 64.0]]}
    made = planned(formation=formation, orbit=orbit, motion={"speed_scale_sigma": 0.02})
    (mode,) = _modes(made)
    assert mode.description == "speed scales of v1, v2 and v3, with a stretch of the team"
    assert mode.moves_poses
    assert "compass" not in mode.cure


def test_errors_that_trade_against_each_other_are_named_together() -> None:
    two = [{"range_m": 50.0, "bearing_bias_sigma_rad": 0.02}] * 2
    (mode,) = _modes(planned(sensor=two))
    assert mode.description == "bearing biases of v1 against v2, with motions of the team"
    alone = planned(
        formation={"centers_m": [[0.0, 0.0]]},
        landmarks_m=[[35.0, 10.0]],
        motion={"turn_rate_bias_sigma_rad_s": 0.005},
        wind={"sigma_mps": 1.0},
    )
    (mode,) = _modes(alone)
    assert mode.description == "wind x, wind y, and turn rate bias of v1, with a shift of v1"
    assert mode.states == ("wind x", "wind y", "turn rate bias of v1")


def test_errors_that_change_or_are_not_estimated_have_no_column() -> None:
    gusts = {"wind": {"gust_sigma_mps": 0.2}}
    walks = {"sensor": {"bearing_walk": {"sigma_rad": 0.1, "time_s": 1e6}}}
    for changing in ({}, gusts, walks):
        made = plan(changed("paper-grid-same", **changing), bound="never")
        assert made.error_verdict is None
        assert not {"extended", "states"} & set(plan_document(made).as_json()["observability"])
    left_out = _grid("paper-grid-same", "wind", "speed_scale", filter={"estimate": ["wind"]})
    made = plan(left_out, bound="never")
    assert _extended(made).state_dim == 20
    assessed = assess_team(made.team, made.scenario.window)
    whole = assess_extended(assessed, tuple(ERROR_STATES))
    assert whole is not None
    assert (whole.rank, whole.state_dim) == (25, 26)


def test_too_many_states_are_counted_and_not_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner, "MOST_STATES", 19)
    made = _planned("paper-grid-same", "wind")
    (finding,) = findings_of(made, "error-undetermined")
    assert "not checked for 20 states" in finding.message
    assert plan_document(made).observability.extended is None


# --- against other computations ------------------------------------------------------------------


@cache
def _assessments() -> list[tuple[Assessment, ExtendedObservability]]:
    """Eighty drawn teams with errors as states."""
    found: list[tuple[Assessment, ExtendedObservability]] = []
    seed = 0
    while len(found) < 80:
        seed += 1
        team = draw_equipped_team(np.random.default_rng(seed))
        assessed = assess_team(team, team.orbits.period)
        extended = assess_extended(assessed)
        if extended is not None and len(assessed.sightings.steps):
            found.append((assessed, extended))
    return found


def _rows(assessed: Assessment, found: ExtendedObservability) -> Array:
    """All rows in full, errors in units of their sigmas."""
    layout = found.layout
    return dense_rows(state_rows(assessed.team, assessed.sightings, layout), layout.size)


def test_singular_values_and_null_space_are_those_of_all_rows() -> None:
    short = 0
    for assessed, found in _assessments():
        rows = _rows(assessed, found)
        values = np.zeros(found.state_dim)
        whole = np.linalg.svd(rows, compute_uv=False)
        values[: len(whole)] = whole[: found.state_dim]
        np.testing.assert_allclose(found.singular_values, values, atol=1e-12 * values[0])
        if len(found.null_space):
            unseen = np.linalg.norm(rows @ found.null_space.T, axis=0)
            assert unseen.max() < 1e-6 * values[0]
            short += 1
    assert short > 10


def test_poses_are_determined_where_the_errors_cannot_make_up_for_them() -> None:
    both = [0, 0]
    for assessed, found in _assessments():
        judged = np.linalg.svd(_without_errors(assessed, found), compute_uv=False)
        values = np.concatenate([found.singular_values, judged]) / found.singular_values[0]
        clear = 1e3 * RANK_TOLERANCE
        if np.any((values > 1e-12) & (values < clear)):
            continue
        full = len(judged) == 3 * found.layout.count and bool(values.min() > clear)
        assert found.poses_determined == full
        assert assessed.observability.observable or not full
        both[full] += 1
    assert min(both) > 5


def _without_errors(assessed: Assessment, found: ExtendedObservability) -> Array:
    """The columns of poses, with all that the errors' columns span taken out."""
    rows, poses = _rows(assessed, found), 3 * found.layout.count
    errors = rows[:, poses:]
    left, values, _ = np.linalg.svd(errors, full_matrices=False)
    span = left[:, values > 1e-10 * values[0]] if values.size and values[0] else left[:, :0]
    return np.asarray(rows[:, :poses] - span @ (span.T @ rows[:, :poses]))


def test_one_mode_is_named_for_each_dimension_that_errors_lack() -> None:
    for assessed, found in _assessments()[:40]:
        names = [f"v{k + 1}" for k in range(assessed.team.count)]
        verdict = judge_errors(assessed, names, 1000)
        assert verdict is not None
        missing = len(found.null_space) - len(assessed.observability.null_space)
        assert len(verdict.modes) == missing
        named = {state for mode in verdict.modes for state in mode.states}
        begin = 3 * assessed.team.count
        labels = np.array(found.layout.labels(names))
        assert set(labels[~found.determined[begin:]].tolist()) >= named
        if not missing:
            assert found.determined[begin:].all()


def test_a_team_of_the_same_sigmas_and_no_priors_is_judged_alike_at_any_scale() -> None:
    made = _planned("paper-grid-same", "speed_scale", "wind")
    team = made.team
    small_errors = replace(
        team.errors, sigmas={**team.errors.sigmas, "speed_scale": 1e-4, "wind": 1e-2}
    )
    found = assess_extended(assess_team(replace(team, errors=small_errors), made.scenario.window))
    assert found is not None
    assert (found.rank, found.poses_determined) == (_extended(made).rank, False)
