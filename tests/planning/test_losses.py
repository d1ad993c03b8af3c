"""Losses: what is left is judged as if it had been planned that way from the start."""

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

import syncplan
from syncplan.errors import InputError
from syncplan.estimation.bounds import LossBounds, posterior_bound
from syncplan.observability.loss_ranks import decisive_losses
from syncplan.observability.rank import assess_remainder, assess_team
from syncplan.orbits.lost_parts import (
    lost_together,
    names_of,
    phrase_of,
    possible_losses,
    scenario_after,
)
from syncplan.orbits.sightings import BLIND_RANGE_M, Loss, remainder_of, single_losses
from syncplan.orbits.team import sensors_of
from syncplan.planning import planner
from syncplan.planning.loss_study import WhatIfDocument, what_if
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from tests.searches.losses import draw
from tests.tools.draws import draw_equipped_team
from tests.tools.lost import differences, drawn_plan, from_scratch, independent_rank
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed, example, findings_of, planned, small

SINGLE_POINT = "single-point-of-failure"
SEEDS = st.integers(0, 2**32 - 1)


@cache
def grid() -> Plan:
    """The paper's grid."""
    return plan(example("paper-grid-same"), bound="never")


@cache
def study() -> WhatIfDocument:
    """Each single loss of the paper's grid, with the errors predicted."""
    return syncplan.what_if(example("paper-grid-same"))


EQUIPPED: dict[str, Any] = {
    "sensor": [{"range_m": 50.0, "range_sigma_m": 0.3}, {"range_m": 50.0}],
    "heading_sigma_rad": [None, 0.1],
}
"""Each of a pair has one kind of sensor beside bearings."""
SIGHTED = [[0.0, 40.0], [70.0, 40.0]]


# --- judged afresh --------------------------------------------------------------------------------


@settings(max_examples=4)
@given(SEEDS)
def test_a_loss_is_judged_as_the_reduced_scenario_planned_from_scratch(seed: int) -> None:
    whole = drawn_plan(np.random.default_rng(seed), most_vehicles=4)
    for outcome in what_if(whole, threads=1).losses:
        assert differences(outcome, from_scratch(whole, outcome.lost)) == []


@pytest.mark.parametrize("number", [779217476288])
def test_losses_that_differed_once_are_those_of_the_reduced_scenario(number: int) -> None:
    assert draw(number)[0] == []


def test_the_rank_without_a_sensor_is_that_of_sampled_sightings() -> None:
    whole = plan(example("mixed-radii-camera"), bound="never", margin_bound=False)
    ranks = {one.lost[0]: one.rank for one in what_if(whole, bound="never").losses}
    for k, vehicle in enumerate(whole.scenario.vehicle_names):
        assert ranks[f"sensor:{vehicle}"] == independent_rank(whole, {k})


@given(SEEDS)
def test_the_losses_that_end_observability_are_those_whose_remainder_is_not_observable(
    seed: int,
) -> None:
    team = draw_equipped_team(np.random.default_rng(seed))
    assessed = assess_team(team, team.orbits.period)
    losses = single_losses(team)
    left = [assess_remainder(assessed, remainder_of(team, loss)) for loss in losses]
    expected = [
        loss
        for loss, one in zip(losses, left, strict=True)
        if assessed.observability.observable and not one.observability.observable
    ]
    assert decisive_losses(assessed, losses) == expected


def test_the_bound_after_a_loss_is_the_bound_of_what_is_left() -> None:
    whole = plan(example("mixed-radii-camera"), bound="never")
    # two pass so near that the weight of their sightings rests on the mean radius
    centers = whole.orbits.centers.copy()
    centers[1] = centers[0] + 1e-3 * whole.orbits.radii[0]
    team = whole.team.on(replace(whole.orbits, centers=centers, phases=whole.orbits.phases * 0.0))
    for made in (whole.team, team):
        windows = assess_team(made, whole.scenario.window).windows
        bounds = LossBounds.along(made, windows, 60.0)
        for loss in (Loss(), *possible_losses(made, 1), Loss((0,), (1,), (0,))):
            left = remainder_of(made, loss)
            expected = posterior_bound(left.team, left.windows(windows), 60.0)
            found = bounds.after(left)
            assert np.allclose(found.position_variance, expected.position_variance, rtol=1e-7)
            assert np.allclose(found.heading_variance, expected.heading_variance, rtol=1e-7)


def test_outcomes_are_the_same_on_any_number_of_threads() -> None:
    whole = plan(example("paper-grid-same"))
    one, three = (what_if(whole, threads=k) for k in (1, 3))
    assert one == three


# --- what is judged -------------------------------------------------------------------------------


def test_losing_either_eye_of_the_team_ends_observability() -> None:
    # of paper-grid-same, v3 alone sees L1 and v4 alone L2: each is needed, and so is its sensor
    found = study()
    assert len(found.losses) == 6 + 6 + 2
    eyes = {"v3", "v4", "sensor:v3", "sensor:v4", "L1", "L2"}
    assert sorted(found.critical) == sorted([name] for name in eyes)
    assert found.baseline.observable
    assert found.baseline.lost == []
    harms = [(one.state_dim - one.rank, one.worst_predicted_rms_m) for one in found.losses]
    assert harms == sorted(harms, reverse=True)
    for one in found.losses:
        assert one.observable == (one.lost not in found.critical)
        assert one.verdict.go == one.observable
        assert len(one.unobservable) == one.state_dim - one.rank


def test_pairs_that_are_critical_hold_nothing_that_is_critical_alone() -> None:
    found = what_if(grid(), losses=2, bound="never")
    alone = {names[0] for names in found.critical if len(names) == 1}
    pairs = [names for names in found.critical if len(names) == 2]
    assert ["v1", "v5"] in pairs
    assert not any(set(names) & alone for names in pairs)
    lost = [tuple(one.lost) for one in found.losses]
    assert len(set(lost)) == len(lost) == 14 + 14 * 13 // 2 - 6
    assert ("v1", "sensor:v1") not in lost


def test_a_vehicle_that_cannot_see_is_still_seen() -> None:
    whole = grid()
    (blind,) = what_if(whole, ["sensor:v1"], bound="never").losses
    assert list(blind.predicted_rms_m.vehicles) == whole.scenario.vehicle_names
    assert blind.observable
    (gone,) = what_if(whole, ["v1"], bound="never").losses
    assert list(gone.predicted_rms_m.vehicles) == whole.scenario.vehicle_names[1:]
    assert gone.state_dim == 15


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["v9"], "'v9': is neither a vehicle (v1, v2) nor a landmark (none)"),
        (["sensor:v9"], "a vehicle's sensor is named sensor:v1"),
        (["v1", "v1"], "stands twice"),
        (["v1", "sensor:v1"], "is lost with v1"),
        (["v1", "v2"], "leaves no vehicle"),
        (["distance:v2"], "v2: has no distance sensor to lose; sensor.range_sigma_m gives one"),
        (["compass:v1"], "v1: has no compass to lose; heading_sigma_rad gives one"),
        (["distance:v1", "sensor:v1"], "distance:v1: is lost with sensor:v1; name one of them"),
        (["compass:v2", "v2"], "compass:v2: is lost with v2"),
        (["gyro:v2"], "is neither a vehicle"),
    ],
)
def test_a_loss_that_cannot_be_is_refused_with_the_remedy(names: list[str], said: str) -> None:
    with pytest.raises(InputError, match=f"^lose: .*{re.escape(said)}"):
        lost_together(names, small(**EQUIPPED))


@pytest.mark.parametrize("changes", [{"lose": "v1"}, {"losses": 3}, {"bound": "maybe"}])
def test_options_out_of_range_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"^{next(iter(changes))}: "):
        what_if(small(), **changes)


def test_the_scenario_of_what_is_left_can_be_planned() -> None:
    whole = grid().scenario
    left = scenario_after(whole, Loss(vehicles=(1,), sensors=(3,), landmarks=(0,)))
    assert left.vehicle_names == ["v1", "v3", "v4", "v5", "v6"]
    assert left.landmark_names == ["L2"]
    assert [one.range_m for one in left.sensors][2] == BLIND_RANGE_M
    assert all("v2" not in pair for pair in left.formation.links or [])
    assert plan(left, bound="never").team.count == 5


def test_a_loss_is_judged_without_the_purpose_that_takes_all_vehicles() -> None:
    keep = {"count": 2, "spread_m": 70.0}
    given = planned(purpose={"keep": keep}, landmarks_m=[[0.0, 45.0], [70.0, -40.0]])
    assert given.verdict.go
    losses = what_if(given).losses
    assert {len(one.predicted_rms_m.vehicles) for one in losses} == {1, 2}
    assert "purpose-missed" not in {one.code for lost in losses for one in lost.verdict.findings}


def test_a_link_that_only_the_lost_sensor_could_keep_is_left_out() -> None:
    sensors = [{"range_m": 50.0}, {"range_m": 10.0}]
    linked = small(
        formation={"centers_m": [[0.0, 0.0], [70.0, 0.0]], "links": [["v1", "v2"]]}, sensor=sensors
    )
    left = scenario_after(plan(linked, bound="never").scenario, Loss(sensors=(0,)))
    assert left.formation.links == []


# --- sensors of one kind of sighting --------------------------------------------------------------


def test_compasses_and_distance_sensors_are_lost_where_there_are_some() -> None:
    made = planned(**EQUIPPED, landmarks_m=SIGHTED)
    losses = [names_of(one, made.scenario) for one in possible_losses(made.team, 1)]
    assert {"distance:v1", "compass:v2"} < {name for (name,) in losses}
    assert not {"distance:v2", "compass:v1"} & {name for (name,) in losses}
    for loss in possible_losses(made.team, 2):
        assert lost_together(names_of(loss, made.scenario), made.scenario) == loss
    assert phrase_of("compass:v2") == "the compass of v2"
    assert lost_together(["compass:v2", "sensor:v2"], made.scenario).sensors == (1,)


@pytest.mark.parametrize("name", ["distance:v1", "compass:v2", "sensor:v2", "v1", "v2"])
def test_what_a_loss_leaves_is_what_its_scenario_says(name: str) -> None:
    made = planned(**EQUIPPED, landmarks_m=SIGHTED)
    loss = lost_together([name], made.scenario)
    left = remainder_of(made.team, loss)
    stated = sensors_of(scenario_after(made.scenario, loss))
    for attribute in ("ranges", "range_sigmas", "compass_sigmas"):
        assert_array_equal(getattr(left.team.sensors, attribute), getattr(stated, attribute))


def test_the_loss_of_a_compass_is_named_where_it_ends_observability() -> None:
    # one landmark, seen by bearing and distance: the compass ends the turn about it
    made = planned(
        sensor={"range_m": 60.0, "range_sigma_m": 0.3},
        heading_sigma_rad=[0.1, None],
        landmarks_m=[[35.0, 10.0]],
    )
    found = what_if(made, bound="never")
    assert ["compass:v1"] in found.critical
    (finding,) = findings_of(made, SINGLE_POINT)
    assert "the compass of v1" in finding.message


def test_an_error_whose_only_vehicle_is_lost_is_no_longer_estimated() -> None:
    biased = small(
        sensor=[{"range_m": 50.0, "bearing_bias_sigma_rad": 0.01}, {"range_m": 50.0}],
        filter={"estimate": ["bearing_bias"]},
    )
    left = scenario_after(biased.resolved(), Loss(vehicles=(0,)))
    assert left.estimated == []


@cache
def traded() -> Plan:
    """A grid whose speed scales trade against a turn of the team unless a heading is known."""
    motion = {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01, "speed_scale_sigma": 0.02}
    compasses = [0.05, *[None] * 5]
    return plan(
        changed("paper-grid-same", motion=motion, heading_sigma_rad=compasses), bound="never"
    )


@pytest.fixture(scope="module")
def one_compass() -> WhatIfDocument:
    """What losses do to it."""
    return what_if(traded(), bound="never", threads=1)


def test_a_lost_compass_shows_which_errors_it_determined(one_compass: WhatIfDocument) -> None:
    before = one_compass.baseline.extended
    assert before is not None
    assert before.undetermined == []
    assert (before.rank, before.state_dim) == (24, 24)
    (lost,) = [one for one in one_compass.losses if one.lost == ["compass:v1"]]
    assert lost.observable
    assert lost.extended is not None
    (mode,) = lost.extended.undetermined
    assert mode.description == (
        "speed scales of v1, v3 and v5 against v2, v4 and v6, with a turn of the team"
    )
    assert "needs-prior" in {one.code for one in lost.verdict.findings}


def test_errors_after_a_loss_are_those_of_the_reduced_scenario(one_compass: WhatIfDocument) -> None:
    for name in ("v2", "sensor:v3", "compass:v1"):
        (outcome,) = [one for one in one_compass.losses if one.lost == [name]]
        whole = traded()
        loss = lost_together([name], whole.scenario)
        orbits = remainder_of(whole.team, loss).team.orbits
        reduced = scenario_after(whole.scenario, loss)
        afresh = judge(reduced, orbits, bound="never").error_verdict
        assert outcome.extended is not None
        assert afresh is not None
        modes = [one.description for one in outcome.extended.undetermined]
        assert modes == [one.description for one in afresh.modes]


# --- the verdict ----------------------------------------------------------------------------------


def test_a_plan_names_its_single_points_of_failure() -> None:
    (found,) = findings_of(grid(), SINGLE_POINT)
    assert found.level == "note"
    assert found.subjects == ("v3", "v4", "L1", "L2")
    assert found.message == (
        "losing any one of v3 or its sensor, v4 or its sensor, L1, L2 ends observability"
    )


def test_a_plan_that_survives_every_loss_says_nothing_of_it() -> None:
    # each of two vehicles sees all three landmarks
    places = [[30.0, 45.0], [40.0, -45.0], [35.0, 60.0]]
    safe = planned(landmarks_m=places, sensor={"range_m": 120.0})
    assert what_if(safe, bound="never").critical == []
    assert findings_of(safe, SINGLE_POINT) == []


def test_a_team_too_large_to_be_searched_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner, "LARGEST_SEARCHED", 1)
    (said,) = findings_of(plan(example("paper-grid-same"), bound="never"), SINGLE_POINT)
    assert said.level == "note"
    assert "not checked for 6 vehicles" in said.message
    assert findings_of(plan(example("paper-grid-alternate"), bound="never"), SINGLE_POINT) == []


def test_the_finding_names_what_the_study_finds_critical() -> None:
    for name in ("five-ring", "four-ground-robots"):
        judged = plan(example(name), bound="never", margin_bound=False)
        critical = what_if(judged, bound="never").critical
        named = {one.removeprefix("sensor:") for names in critical for one in names}
        assert named == {name for one in findings_of(judged, SINGLE_POINT) for name in one.subjects}


# --- documents ------------------------------------------------------------------------------------


def test_a_study_reads_back() -> None:
    found = study()
    assert WhatIfDocument.model_validate_json(found.model_dump_json()) == found
    for one in found.losses:
        errors = [error for error in one.predicted_rms_m.vehicles.values() if error is not None]
        assert one.worst_predicted_rms_m == max(errors)


def test_the_study_shows_itself_in_one_line_and_as_rows() -> None:
    found = what_if(grid(), bound="never")
    assert repr(found) == "<WhatIf 'paper-grid-same': 14 losses judged, 6 critical>"
    assert found.losses[0].worst_predicted_rms_m is None
    assert "was not asked for" in found.losses[0].predicted_rms_m.note
    assert found._repr_html_().count("<tr>") == 1 + 1 + 14
