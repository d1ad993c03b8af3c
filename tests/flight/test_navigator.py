"""The navigator: filter and guidance of flights one step at a time, to the same results."""

import io
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import syncplan
from syncplan.errors import InputError
from syncplan.flight.flying import flight_run
from syncplan.flight.navigator import Navigator
from syncplan.flight.onboard_data import Sensed, TimedSighting
from syncplan.guidance.flown_lanes import FlownLanes
from syncplan.orbits.circles import heading, position
from syncplan.planning.plan_flights import FlightRun
from syncplan.planning.plans import Plan
from tests.tools.flown_trials import flown_of
from tests.tools.scenarios import example

WINDY = "examples/scenarios/windy-grid.yaml"
SECONDS = 40.0


@pytest.fixture(scope="module")
def plan() -> Plan:
    return syncplan.plan(syncplan.load_scenario(WINDY), pilot=False)


def lanes_of(run: FlightRun) -> FlownLanes:
    """The first trial of a flight, flown."""
    return flown_of(run, range(1)).lanes


def sensed(lanes: FlownLanes, late: int = 0) -> Iterator[Sensed]:
    """What the team of a flight has read, sample by sample; sightings so many samples late."""
    setup, readings = lanes.setup, lanes.readings
    for k in range(len(readings.speeds)):
        rows = range(0)
        if k >= late:
            rows = range(setup.first[k - late + 1], setup.first[k - late + 2])
        sightings = [
            TimedSighting(
                int(setup.observers[s]),
                int(setup.targets[s]),
                int(setup.kinds[s]),
                float(readings.sightings[s, 0]),
                late,
            )
            for s in rows
        ]
        yield Sensed(readings.speeds[k, :, 0], readings.turn_rates[k, :, 0], sightings)


@pytest.mark.parametrize(
    ("guidance", "filter_", "late"),
    [("track", "ekf", 0), ("track", "robust", 0), ("track", "ekf", 3), ("mpc", "ekf", 0)],
)
def test_it_commands_and_estimates_as_a_flight_does(
    plan: Plan, guidance: str, filter_: str, late: int
) -> None:
    run = flight_run(
        plan, guidance=guidance, filter=filter_, late=late, duration=SECONDS, seed=4, trials=1
    )
    lanes = lanes_of(run)
    navigator = Navigator(plan, guidance=guidance, filter=filter_, late=late, seed=4)
    off = 0.0
    for k, read in enumerate(sensed(lanes, late)):
        # readings of this scenario are the commands
        off = max(
            off, float(np.abs(navigator.command.speeds - lanes.readings.speeds[k, :, 0]).max())
        )
        estimate, _ = navigator.step(read)
    assert off < 1e-9
    assert navigator.too_late == 0
    if not late:
        found = np.concatenate([estimate.poses.ravel(), estimate.errors])
        np.testing.assert_allclose(found, lanes.run.state[0][:, 0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("guidance", "filter_"), [("track", "robust"), ("mpc", "ekf")])
def test_one_that_is_restored_goes_on_to_the_same_bytes(
    plan: Plan, guidance: str, filter_: str
) -> None:
    """The robust filter looks back at where it began, which is elsewhere."""
    run = flight_run(plan, filter=filter_, duration=SECONDS, late=2, trials=1)
    readings = list(sensed(lanes_of(run), late=2))
    assert len(readings) > plan.orbits.period / plan.sensors.sample_time
    start = np.column_stack([position(plan.orbits, 0.0), heading(plan.orbits, 0.0)])
    first = Navigator(plan, guidance=guidance, filter=filter_, late=2, start=start + 1.5)
    for read in readings[:200]:
        first.step(read)
    second = Navigator(plan, guidance=guidance, filter=filter_, late=2)
    second.restore(first.save())
    np.testing.assert_array_equal(second.command.speeds, first.command.speeds)
    for read in readings[200:]:
        a, b = first.step(read), second.step(read)
    np.testing.assert_array_equal(b[0].poses, a[0].poses)
    np.testing.assert_array_equal(b[1].turn_rates, a[1].turn_rates)
    assert second.save() == first.save()


def test_late_sightings_are_waited_for_as_in_a_flight() -> None:
    """A camera that has seen nobody for a period looks for its anchor until a sighting arrives."""
    run = flight_run(example("camera-pair"), late=300, duration=70.0, trials=1)
    lanes, navigator = lanes_of(run), Navigator(example("camera-pair"), late=300)
    assert lanes.flown.sought.any()
    for k, read in enumerate(sensed(lanes, 300)):
        if k >= 300:
            given = lanes.readings.speeds[k, :, 0]
            np.testing.assert_allclose(navigator.command.speeds, given, rtol=0.0, atol=1e-9)
        navigator.step(read)


def test_a_state_of_another_plan_or_of_other_options_is_refused_and_changes_nothing(
    plan: Plan,
) -> None:
    navigator = Navigator(plan, filter="ekf")
    navigator.step(Sensed())
    before = navigator.save()
    orbit = plan.scenario.orbit.model_copy(update={"radius_m": 18.0})
    other = plan.scenario.model_copy(update={"orbit": orbit})
    for one in (
        Navigator(plan, filter="robust"),
        Navigator(plan, filter="ekf", guidance="mpc"),
        Navigator(plan, filter="ekf", late=1),
        Navigator(syncplan.plan(other, pilot=False), filter="ekf"),
    ):
        with pytest.raises(InputError, match="was saved with another plan or other options"):
            navigator.restore(one.save())
    with np.load(io.BytesIO(before)) as stored:
        parts = {name: stored[name] for name in stored.files if name != "heard"}
    cut = io.BytesIO()
    np.savez(cut, **{**parts, "steps": np.array(7)})
    with pytest.raises(InputError, match="is not a saved state of a navigator"):
        navigator.restore(cut.getvalue())
    assert navigator.save() == before


def test_readings_that_are_missing_are_taken_to_be_the_commands(plan: Plan) -> None:
    given, without, some = (Navigator(plan, filter="ekf") for _ in range(3))
    for _ in range(20):
        command = given.command
        given.step(Sensed(command.speeds, command.turn_rates))
        without.step(Sensed())
        speeds = command.speeds.copy()
        speeds[2] = np.nan
        some.step(Sensed(speeds, command.turn_rates))
    np.testing.assert_array_equal(without.command.speeds, given.command.speeds)
    np.testing.assert_array_equal(some.command.speeds, given.command.speeds)


def test_the_order_in_which_sightings_arrive_does_not_matter(plan: Plan) -> None:
    readings = list(sensed(lanes_of(flight_run(plan, filter="ekf", duration=10.0, trials=1))))
    one, other = Navigator(plan, filter="ekf"), Navigator(plan, filter="ekf")
    for read in readings:
        one.step(read)
        other.step(replace(read, sightings=list(reversed(read.sightings))))
    assert any(len(read.sightings) > 1 for read in readings)
    np.testing.assert_array_equal(one.command.speeds, other.command.speeds)


def test_a_sighting_that_is_later_than_it_may_be_is_counted_and_not_used(plan: Plan) -> None:
    late, without = Navigator(plan, filter="ekf", late=1), Navigator(plan, filter="ekf", late=1)
    for k in range(5):
        sightings = [TimedSighting(0, 1, 0, 0.3, age=2)] if k == 4 else []
        late.step(Sensed(sightings=sightings))
        without.step(Sensed())
    assert late.too_late == 1
    np.testing.assert_array_equal(late.command.speeds, without.command.speeds)


def test_sightings_are_named_as_the_scenario_names_them(plan: Plan) -> None:
    navigator = Navigator(plan)
    n = plan.team.count
    found = navigator.named([("v1", "v2", "bearing", 0.3), ("v3", "L1", "bearing", -1.0, 2)])
    assert found == [TimedSighting(0, 1, 0, 0.3), TimedSighting(2, n, 0, -1.0, 2)]
    with pytest.raises(InputError, match="'v9' is unknown; known are v1"):
        navigator.named([("v9", "v2", "bearing", 0.3)])


def test_what_is_no_state_and_no_start_of_the_team_is_refused(plan: Plan) -> None:
    with pytest.raises(InputError, match="is not a saved state of a navigator"):
        Navigator(plan).restore(b"nothing")
    with pytest.raises(InputError, match="must be 6 poses"):
        Navigator(plan, start=np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (Sensed(np.zeros(5)), "must be 6 numbers"),
        (Sensed(sightings=[TimedSighting(0, 1, 1, 30.0)]), "v1 has no sigma for a distance"),
        (Sensed(np.array([4.0] * 5 + [np.inf])), "speeds: must be finite, or NaN"),
        (Sensed(sightings=[TimedSighting(0, 1, 0, np.inf)]), "must be finite, or NaN if it is"),
        (Sensed(sightings=[TimedSighting(2, 2, 0, 0.3)]), "the target of a compass, and of it al"),
        (Sensed(sightings=[TimedSighting(6, 0, 0, 0.1)]), "no such observer"),
    ],
)
def test_what_is_refused_has_not_been_taken_in(plan: Plan, read: Sensed, message: str) -> None:
    navigator = Navigator(plan, late=1)
    navigator.step(Sensed())
    before = navigator.save()
    with pytest.raises(InputError, match=message):
        navigator.step(read)
    assert navigator.save() == before


def test_a_sighting_that_is_nan_was_not_made(plan: Plan) -> None:
    given, without = Navigator(plan), Navigator(plan)
    for _ in range(3):
        given.step(Sensed(sightings=[TimedSighting(0, 1, 0, np.nan)]))
        without.step(Sensed())
    assert given.save() == without.save()
