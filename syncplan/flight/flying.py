"""The study `fly`: a plan flown many times in closed loop."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from syncplan.guidance.flight_options import FlightOptions
from syncplan.options import lists_options
from syncplan.planning.filter_choice import FilterChoice, asked_filter, flown_filter
from syncplan.planning.plan_files import PlanSubject, in_world, planned
from syncplan.planning.plan_flights import (
    Flight,
    FlightRun,
    set_up_flight,
)

ROBUST_IN_FLIGHT = FilterChoice(
    "robust", "vehicles that steer by a lost filter are lost too; robust looks for its start"
)


@lists_options(FlightOptions)
def fly(
    subject: PlanSubject,
    options: FlightOptions | None = None,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> Flight:
    """Fly a plan many times, with vehicles that steer by their own estimates.

    Give `options`, or changes of it by name: trials=100, seed=0, duration=None (s, the
    scenario's), guidance="track" (or "mpc", or "none" for open loop), filter="auto" (the
    scenario's, or robust), gate_probability=None, with_series=False. Faults and disturbances are
    truth=None (keys of the simulated world, beside those of the scenario's truth),
    lose=("v3@60",), hold=("v2@100:20",), dropout=0, outliers=0, mistaken=0, late=0 and wind=None
    (m/s; drawn by the scenario's sigma). The same seed gives the same bytes on any number of
    threads. `progress` is called with the number of trials done. Raises InputError naming the
    argument at fault.
    """
    run = flight_run(subject, options, **changes)
    flight: Flight = run.whole(threads=threads, progress=progress)
    return flight


def flight_run(
    subject: PlanSubject, options: FlightOptions | None = None, **changes: Any
) -> FlightRun:
    """Return the set-up of a flight."""
    chosen = replace(options or FlightOptions(), **changes)
    plan = planned(subject)
    choice = asked_filter(plan.scenario, chosen) or flown_filter(plan) or ROBUST_IN_FLIGHT
    return set_up_flight(in_world(plan, chosen.truth), chosen, choice)
