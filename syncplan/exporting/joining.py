"""How a vehicle joins its circle at the right phase and stays in step, for each kind of file."""

from syncplan.exporting.exported_files import Written
from syncplan.exporting.loiter_turns import ACCELERATION
from syncplan.exporting.scheduled_plan import ScheduledPlan, start_of


def procedure(flown: ScheduledPlan, written: Written) -> list[str]:
    """Return the steps in order, for those who fly."""
    if written.kind in ("loiter_turns", "waypoints"):
        return [*_before_a_mission(flown, written), *_start_of_a_mission(flown, written)]
    if written.kind == "trajectories":
        return [*_start_of_trajectories(flown), *_off_time(flown)]
    return [*_start_by_oneself(flown), *_off_time(flown)]


# --- missions -----------------------------------------------------------------------------------


def _before_a_mission(flown: ScheduledPlan, written: Written) -> list[str]:
    steps = [
        "Take-off and landing are not in the mission: take off first, then start the mission in "
        "the air (ArduPilot refuses one without a take-off from the ground). Until a vehicle is on "
        "its circle, keep it at an altitude of its own and clear of all circles."
    ]
    if any(written.parameters):
        steps.insert(
            0, "Set the autopilot_parameters of each vehicle on it; CIRCLE_RATE is signed."
        )
    return steps


def _start_of_a_mission(flown: ScheduledPlan, written: Written) -> list[str]:
    known = start_of(flown.plan) is not None
    period = f"{flown.plan.orbits.period:.6g} s"
    again = (
        "A vehicle that misses time 0 holds at entry.position_m; make start_item its current item "
        f"a whole number of periods ({period}) later."
    )
    if flown.is_copter:
        join = [
            "The mission flies to entry.position_m and stops there. "
            + (
                "It waits for entry.time by the vehicle's own UTC clock, then begins to circle: "
                "start it early enough. A vehicle without a clock (it takes GPS, or a ground "
                "station that sends SYSTEM_TIME) does not wait at all, and one that arrives too "
                "late waits for the next day."
                if known
                else "Then it circles at once, so that its phase depends on when it arrives: hold "
                "each vehicle at its entry.position_m and make start_item the current item of all "
                "at the same moment, time 0. With a start_time in the scenario, missions wait for "
                "it by themselves."
            ),
            _lag(flown),
            again,
        ]
    else:
        when = "entry.time" if known else "a moment that all agree on, time 0,"
        join = [
            "A mission does not wait: start each one so that its vehicle passes entry.position_m "
            f"at {when} on entry.course_deg, and hold the vehicle nearby until then.",
            again,
        ]
    hold = (
        "Between waypoints the mission commands leg_speed_mps, because legs are shorter than "
        "arcs; see the notes on corners."
        if written.leg_speeds
        else "On the circle every vehicle takes one period for a turn, whatever its radius."
    )
    return [*join, hold, _check(), _stand_by()]


def _lag(flown: ScheduledPlan) -> str:
    speeds = flown.plan.orbits.speeds
    spread = float(speeds.max() - speeds.min()) / (2.0 * ACCELERATION)
    between = (
        "the same for all, because all fly at one speed"
        if spread < 0.01
        else f"up to {spread:.2g} s apart"
    )
    return (
        "A start from rest costs speed_mps / (2 a), where a is the acceleration in waypoint flight "
        f"({ACCELERATION:g} m/s^2 by default): {between}. Only the difference between vehicles "
        "matters."
    )


def _stand_by() -> str:
    return (
        "A vehicle that is further off leaves its circle, holds at its entry point at an altitude "
        "of its own, and joins again as if it had missed time 0."
    )


# --- other files --------------------------------------------------------------------------------


def _start_of_trajectories(flown: ScheduledPlan) -> list[str]:
    return [
        "Let every vehicle take off and hover at entry.position_m with yaw entry.heading_rad, one "
        "after the other where paths cross; then start all trajectories by one broadcast, at time "
        "0.",
        "A trajectory begins at speed_mps. From hover a vehicle lags behind it at first and "
        "catches up; vehicles of the same speed lag alike.",
        "Have the next command ready at the end of the trajectory, or start it again: after whole "
        "turns it ends where it began.",
    ]


def _start_by_oneself(flown: ScheduledPlan) -> list[str]:
    known = flown.plan.scenario.start_time is not None
    when = "start_time" if known else "a moment that all agree on (time 0)"
    period = flown.plan.orbits.period
    return [
        "Take-off and landing are the operator's; wait clear of all circles, each vehicle at an "
        "altitude of its own.",
        f"Be at entry.position_m at {when}, under way on entry.course_deg at speed_mps; come in "
        "along the tangent. A vehicle that starts there from rest loses speed / (2 acceleration) "
        "seconds: start it that much earlier.",
        "A vehicle that misses it passes the same point a whole number of periods "
        f"({period:.6g} s) later.",
        "From then on hold speed_mps over ground on the circle: every vehicle then takes one "
        "period for a turn, whatever its radius.",
    ]


def _off_time(flown: ScheduledPlan) -> list[str]:
    return [
        _check(),
        "A vehicle late by s seconds (s < 0: early), at most half a period, flies one turn at "
        "speed_mps period_s / (period_s - s); if that is too fast or too slow, it waits at an "
        "altitude of its own and joins a period later.",
    ]


def _check() -> str:
    return (
        "Check the time at which each entry point is passed, every turn. While all others are on "
        "time, one vehicle may be off by tolerance_s before a planned meeting is lost, and by "
        "separation_tolerance_s before it comes nearer than min_separation_m to another; two that "
        "are both off share the tolerance."
    )
