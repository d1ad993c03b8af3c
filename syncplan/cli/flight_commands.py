"""The command that flies plans in closed loop."""

from enum import StrEnum
from typing import Annotated

import typer

from syncplan.cli.arguments import (
    Duration,
    MaxVehicles,
    Output,
    Seed,
    Shown,
    SubjectFile,
    Threads,
    Trials,
    beginning_with,
    numbers,
)
from syncplan.cli.console import (
    Format,
    announce_flight,
    check_output,
    deliver_document,
    progress_bar,
)
from syncplan.cli.filter_arguments import DEFAULT_CHOICE, Choice, Gate
from syncplan.cli.required_verdicts import RequireGo, RequireObservable, verdict_status
from syncplan.cli.truth_option import TruthKeys, truth_of
from syncplan.errors import InputError
from syncplan.flight.flight_options import DEFAULT_GATE, GUIDANCES, FlightOptions

flights = typer.Typer()

DEFAULTS = FlightOptions()
GuidanceName = StrEnum("GuidanceName", {name: name for name in GUIDANCES})  # type: ignore[misc]
DEFAULT_GUIDANCE = GuidanceName(DEFAULTS.guidance)

Guidance = Annotated[
    GuidanceName,
    typer.Option(
        help="How vehicles steer. "
        + " ".join(f"{name}: {one.sentence}" for name, one in GUIDANCES.items()),
        autocompletion=beginning_with(GUIDANCES),
    ),
]
FlightFilter = Annotated[
    Choice, typer.Option("--filter", help="The filter; auto is the scenario's, or robust")
]
Lose = Annotated[
    list[str] | None,
    typer.Option(
        help="Lose a vehicle (v3@60, at 60 s), its sensor (sensor:v3@60) or a landmark (L1@60); "
        "may be given several times",
        show_default=False,
    ),
]
Hold = Annotated[
    list[str] | None,
    typer.Option(
        help="Hold a vehicle: v2@100:20, from 100 s on for 20 s. It stands still in the air, or "
        "circles where speed has a least, and drifts with the wind; may be given several times",
        show_default=False,
    ),
]
Dropout = Annotated[float, typer.Option(help="Share of sightings that are lost on their way")]
Outliers = Annotated[
    float,
    typer.Option(
        help="Share of bearings that are false, anywhere in view; the gate is then "
        f"{DEFAULT_GATE:g} if not given"
    ),
]
Mistaken = Annotated[
    float,
    typer.Option(help="Share of sightings that are of another vehicle in sight than is thought"),
]
Late = Annotated[int, typer.Option(help="Samples after which sightings arrive")]
Wind = Annotated[
    str | None,
    typer.Option(
        help="True wind x,y in m/s, such as 1.5,0; drawn by the scenario's wind.sigma_mps if not "
        "given",
        show_default=False,
    ),
]
FlightSeries = Annotated[
    bool,
    typer.Option(
        "--series",
        help="Add figures over time to the report, and the tracks of the first trials",
    ),
]


@flights.command(
    name="fly",
    epilog="Example: syncplan fly plan.json --trials 200 --wind 1.5,0 --lose v3@60 -o flight.json",
)
def _fly(
    subject: SubjectFile,
    output: Output = None,
    format_: Shown = Format.auto,
    trials: Trials = DEFAULTS.trials,
    seed: Seed = DEFAULTS.seed,
    duration: Duration = None,
    guidance: Guidance = DEFAULT_GUIDANCE,
    filter_: FlightFilter = DEFAULT_CHOICE,
    gate: Gate = None,
    lose: Lose = None,
    hold: Hold = None,
    dropout: Dropout = DEFAULTS.dropout,
    outliers: Outliers = DEFAULTS.outliers,
    mistaken: Mistaken = DEFAULTS.mistaken,
    late: Late = DEFAULTS.late,
    wind: Wind = None,
    truth: TruthKeys = None,
    series: FlightSeries = False,
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

    options = FlightOptions(
        trials=trials,
        seed=seed,
        duration=duration,
        guidance=guidance.value,
        filter=filter_.value,
        gate_probability=gate,
        lose=tuple(lose or ()),
        hold=tuple(hold or ()),
        dropout=dropout,
        outliers=outliers,
        mistaken=mistaken,
        late=late,
        wind=_velocity(wind),
        with_series=series,
        truth=truth_of(truth),
    )
    check_output(output, subject)
    plan = plan_of(load(subject, max_vehicles=max_vehicles or MAX_VEHICLES), pilot=False)
    run = flight_run(plan, options)
    announce_flight()
    with progress_bar("flights", trials) as progress:
        part = fly_part(run, 0, trials, threads=threads, progress=progress)
    flight = conclude_flight(run, [part])
    deliver_document("flight", flight_document(flight), output, format_)
    return verdict_status(flight.plan, observable=require_observable, go=require_go)


def _velocity(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    found = numbers(text, "--wind")
    if len(found) != 2:
        raise InputError(f"{text!r}: give two numbers, x,y in m/s, such as 1.5,0", key="--wind")
    return found[0], found[1]
