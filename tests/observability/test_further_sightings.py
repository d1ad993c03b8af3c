"""Distances and compasses: what they add to links, to the rank and to what a loss leaves."""

import numpy as np
import pytest

from syncplan.observability.rank import (
    Assessment,
    assess_remainder,
    assess_team,
    lone_rows,
    pair_rows,
)
from syncplan.observability.spectrum import dense_matrix
from syncplan.orbits.sighting_kinds import of_targets
from syncplan.orbits.sightings import Loss, remainder_of, single_losses
from syncplan.planning.planner import Plan, plan
from tests.tools.draws import draw_equipped_team
from tests.tools.scenarios import changed, circling, planned


def _boats(**keys: object) -> Plan:
    """Twenty boats along a coast, of which one passes the lighthouse."""
    given = {
        "orbit": {"radius_m": 60, "speed_mps": 3, "direction": "ccw"},
        "formation": {"shape": "line", "count": 20, "spacing_m": 180},
        "landmarks_m": {"lighthouse": [-140, 40]},
        "sensor": {
            "range_m": 150,
            "bearing_sigma_rad": 0.02,
            "sample_time_s": 0.5,
            "interval_s": 1.0,
            "range_sigma_m": 2.0,
            "detection_probability": 0.8,
        },
        "heading_sigma_rad": 0.03,
        **keys,
    }
    return planned(**given)


def _ranks(made: Plan) -> tuple[int, int]:
    return made.observability.rank, made.observability.state_dim


def test_twenty_boats_with_compasses_and_one_lighthouse_are_located() -> None:
    assert _ranks(_boats()) == (60, 60)


def test_without_their_compasses_the_boats_turn_about_the_lighthouse() -> None:
    made = _boats(heading_sigma_rad=None)
    assert _ranks(made) == (59, 60)
    (mode,) = made.unobservable
    assert mode.description == "turn of everything about lighthouse"


def test_boats_with_compasses_and_no_lighthouse_shift_but_do_not_turn() -> None:
    made = _boats(landmarks_m=None)
    names = [mode.description for mode in made.unobservable]
    assert names == ["shift of everything along x", "shift of everything along y"]
    assert all(mode.cure.startswith("sightings of a landmark") for mode in made.unobservable)


def test_a_distance_gives_mirror_motion_the_rank_that_bearings_leave_out() -> None:
    bearings = plan(changed("paper-grid-alternate"), bound="never")
    measured = plan(changed("paper-grid-alternate", sensor={"range_sigma_m": 0.5}), bound="never")
    assert {link.rank for link in bearings.links} == {2}
    assert _ranks(measured) == (18, 18)
    assert all(link.rank == 3 and link.reason == "" for link in measured.links)
    assert measured.certificate.holds


def test_a_weak_distance_is_not_taken_for_a_lost_turn() -> None:
    # bearings alone lose the distance; one of 1e6 m sigma leaves it all but lost
    made = plan(changed("paper-grid-alternate", sensor={"range_sigma_m": 1e3}), bound="never")
    for link in made.links:
        assert link.rank == 3 or "never turns" in link.reason or "degenerate" in link.reason
        assert "ratio of radii" not in link.reason


@pytest.mark.parametrize("seed", range(20))
def test_compasses_are_rows_of_their_vehicle_alone(seed: int) -> None:
    team = draw_equipped_team(np.random.default_rng(seed))
    assessed = assess_team(team, team.orbits.period)
    assert all(pair.a < pair.b for pair in pair_rows(team, assessed.sightings))
    alone = dense_matrix(lone_rows(team, assessed.sightings), 3 * team.count)
    own = ~of_targets(assessed.sightings.kinds)
    samples = np.bincount(assessed.sightings.observers[own], minlength=team.count)
    information = np.zeros(3 * team.count)
    information[2::3] = samples / team.sensors.compass_sigmas**2
    np.testing.assert_allclose(alone.T @ alone, np.diag(information), rtol=1e-9)


@pytest.mark.parametrize("seed", range(15))
def test_what_a_loss_leaves_is_what_the_team_left_sees(seed: int) -> None:
    team = draw_equipped_team(np.random.default_rng(seed))
    assessed = assess_team(team, team.orbits.period)
    for loss in single_losses(team):
        left = remainder_of(team, loss)
        if left.team.count:
            _same(assess_remainder(assessed, left), assess_team(left.team, team.orbits.period))


def _same(one: Assessment, other: Assessment) -> None:
    for name in ("steps", "observers", "targets", "kinds"):
        np.testing.assert_array_equal(getattr(one.sightings, name), getattr(other.sightings, name))
    values = one.observability.singular_values, other.observability.singular_values
    np.testing.assert_allclose(*values, rtol=1e-12, atol=1e-12 * (1.0 + values[0][0]))


def test_a_boat_without_its_camera_keeps_its_compass() -> None:
    assessed = assess_team(_boats().team, 120.0)
    left = assess_remainder(assessed, remainder_of(assessed.team, Loss(sensors=(19,))))
    own = ~of_targets(left.sightings.kinds)
    assert np.sum(own & (left.sightings.observers == 19)) == 240
    assert not np.any(~own & (left.sightings.observers == 19))


def test_contact_that_no_sighting_falls_into_says_so() -> None:
    orbit = circling(direction="ccw", first_phase_rad=1.5)
    sensor = {"range_m": 40.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1, "interval_s": 100.0}
    made = planned(orbit=orbit, landmarks_m=[[0, -40]], sensor=sensor)
    (link,), (landmark,) = made.links, made.landmark_links
    assert link.contact > 0.0
    assert link.reason == landmark.reason == "in contact only between sightings (interval_s)"
