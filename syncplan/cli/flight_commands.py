"""The command that flies plans in closed loop."""

import typer

from syncplan.cli.arguments import (
    MaxVehicles,
    Output,
    Shown,
    SubjectFile,
    Threads,
    takes_options,
)
from syncplan.cli.console import (
    Format,
    announce_flight,
    check_output,
    deliver_document,
    progress_bar,
)
from syncplan.cli.required_verdicts import RequireGo, RequireObservable, verdict_status
from syncplan.flight.flight_options import FlightOptions

flights = typer.Typer()


@flights.command(
    name="fly",
    epilog="Example: syncplan fly plan.json --trials 200 --wind 1.5,0 --lose v3@60 -o flight.json",
)
@takes_options(FlightOptions, without=("substeps", "model"))
def _fly(
    subject: SubjectFile,
    output: Output = None,
    format_: Shown = Format.auto,
    *,
    options: FlightOptions,
    threads: Threads = None,
    require_observable: RequireObservable = False,
    require_go: RequireGo = False,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Fly a plan in closed loop: vehicles steer by their estimates, in wind, with losses."""
    from syncplan.flight.flying import conclude_flight, flight_run, fly_part
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.reports.flight_report import flight_document
    from syncplan.scenario.models import MAX_VEHICLES

    check_output(output, subject)
    plan = plan_of(load(subject, max_vehicles=max_vehicles or MAX_VEHICLES), pilot=False)
    run = flight_run(plan, options)
    announce_flight()
    with progress_bar("flights", options.trials) as progress:
        part = fly_part(run, 0, run.trials, threads=threads, progress=progress)
    flight = conclude_flight(run, [part])
    deliver_document("flight", flight_document(flight), output, format_)
    return verdict_status(flight.plan, observable=require_observable, go=require_go)
