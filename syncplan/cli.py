"""The command line: plan, validate, sweep, schema. Heavy packages load inside the commands."""

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from typer.exceptions import TyperException

from syncplan import __version__
from syncplan.errors import InputError, SyncplanError
from syncplan.streams import (
    Format,
    deliver,
    open_closed_streams,
    progress_bar,
    refuse_overwriting,
    say,
    say_notes,
)

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["main"]

INTERNAL_FAULT = 1
NOT_OBSERVABLE = 3
INTERRUPTED = 130

OPTIONS = {
    "trials": "--trials",
    "seed": "--seed",
    "duration": "--duration",
    "substeps": "--substeps",
    "threads": "--threads",
    "gate_probability": "--gate",
}
"""Options by the name of the library's argument that they set."""

JSON_SCHEMA = "https://json-schema.org/draft/2020-12/schema"

LARGE_TEAM = 500
"""Teams above this size take several seconds to judge: people are told."""

app = typer.Typer(
    name="syncplan",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Synchronised circular orbits that let a team of robots localise itself.",
    epilog="Example: syncplan plan examples/scenarios/paper-grid-same.yaml -o plan.json",
)


class Bound(StrEnum):
    """When the posterior bound is computed."""

    auto = "auto"
    always = "always"
    never = "never"


class Model(StrEnum):
    """How the filter integrates its readings."""

    arc = "arc"
    euler = "euler"


class Contract(StrEnum):
    """Documents that have a schema."""

    scenario = "scenario"
    plan = "plan"
    validation = "validation"


Scenario = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="Scenario file, YAML or JSON; - is standard input")
]
Subject = Annotated[
    str, typer.Argument(metavar="PLAN|SCENARIO", help="Plan or scenario file; - is standard input")
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", help="File to write the JSON to", show_default=False),
]
Shown = Annotated[
    Format,
    typer.Option("--format", help="Standard output: auto is a table at a terminal, JSON elsewhere"),
]
Trials = Annotated[int, typer.Option(help="Number of Monte Carlo trials")]
Seed = Annotated[int, typer.Option(help="Seed of all random numbers")]
Duration = Annotated[
    float | None,
    typer.Option(help="Length of each run in s; the scenario's if not given", show_default=False),
]
Threads = Annotated[
    int | None, typer.Option(help="Threads; all cores if not given", show_default=False)
]
MaxVehicles = Annotated[
    int | None,
    typer.Option(min=1, help="Accept teams up to this size (default 2000)", show_default=False),
]
RequireObservable = Annotated[
    bool, typer.Option("--require-observable", help="Exit with 3 if the plan is not observable")
]


@app.command(
    name="plan", epilog="Example: syncplan plan scenario.yaml -o plan.json --require-observable"
)
def _plan(
    scenario: Scenario,
    output: Output = None,
    format_: Shown = Format.auto,
    bound: Annotated[
        Bound, typer.Option(help="Compute the posterior bound: auto leaves very large teams out")
    ] = Bound.auto,
    steady: Annotated[
        bool, typer.Option("--steady", help="Add the error once it has become periodic")
    ] = False,
    require_observable: RequireObservable = False,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Find phases for a scenario and judge the plan: meetings, observability, predicted error."""
    from syncplan.loading import load_scenario
    from syncplan.plan_report import plan_document
    from syncplan.planner import plan
    from syncplan.sections import MAX_VEHICLES

    refuse_overwriting(scenario, output)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    if loaded.size > LARGE_TEAM and sys.stderr.isatty():
        say(f"judging the rank of {3 * loaded.size} states takes some time ...")
    made = plan(loaded, bound=bound.value, steady=steady)
    document = plan_document(made)

    def show(console: "Console") -> None:
        from syncplan.tables import show_plan

        show_plan(document, console)

    if deliver(document.as_json(), output, format_, show) is Format.json:
        say_notes(document.notes)
    return _verdict(made.observable, require_observable)


@app.command(
    name="validate",
    epilog="Example: syncplan validate plan.json --trials 500 --seed 1 -o report.json",
)
def _validate(
    subject: Subject,
    output: Output = None,
    format_: Shown = Format.auto,
    trials: Trials = 200,
    seed: Seed = 0,
    duration: Duration = None,
    model: Annotated[
        Model, typer.Option(help="How the filter integrates its readings")
    ] = Model.arc,
    substeps: Annotated[int, typer.Option(help="Euler sub-steps per sample")] = 10,
    gate: Annotated[
        float | None,
        typer.Option(help="Probability of the innovation gate, such as 0.999", show_default=False),
    ] = None,
    series: Annotated[
        bool, typer.Option("--series", help="Add errors and sigmas over time to the report")
    ] = False,
    threads: Threads = None,
    require_observable: RequireObservable = False,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Prove a plan with the filter: Monte Carlo errors beside the bound, and consistency."""
    from syncplan.planfile import load
    from syncplan.planner import judge, plan
    from syncplan.sections import MAX_VEHICLES
    from syncplan.validation import check_run, validate
    from syncplan.validation_report import validation_document

    check_run(trials, seed)
    refuse_overwriting(subject, output)
    loaded = load(subject, max_vehicles=max_vehicles or MAX_VEHICLES)
    flown = (
        plan(loaded.scenario) if loaded.orbits is None else judge(loaded.scenario, loaded.orbits)
    )
    _announce_compilation(flown.orbits.count)
    with progress_bar("trials", trials) as progress:
        result = validate(
            flown,
            trials=trials,
            seed=seed,
            duration=duration,
            model=model.value,
            substeps=substeps,
            gate_probability=gate,
            with_series=series,
            threads=threads,
            progress=progress,
        )
    document = validation_document(result)

    def show(console: "Console") -> None:
        from syncplan.tables import show_validation

        show_validation(document, console)

    if deliver(document.as_json(), output, format_, show) is Format.json:
        say_notes(document.notes)
    return _verdict(flown.observable, require_observable)


@app.command(
    name="sweep",
    epilog="Example: syncplan sweep scenario.yaml --angular-rate 0.2,0.4,0.6,0.8,1.0 --connected",
)
def _sweep(
    scenario: Scenario,
    output: Output = None,
    format_: Shown = Format.auto,
    angular_rate: Annotated[
        str | None, typer.Option(help="Rates in rad/s, such as 0.2,0.4", show_default=False)
    ] = None,
    range_: Annotated[
        str | None, typer.Option("--range", help="Sensor ranges in m", show_default=False)
    ] = None,
    radius: Annotated[str | None, typer.Option(help="Radii in m", show_default=False)] = None,
    spacing: Annotated[
        str | None, typer.Option(help="Spacings of the shape in m", show_default=False)
    ] = None,
    connected: Annotated[
        bool,
        typer.Option(
            "--connected", help="Add a row with a range that connects the team at every instant"
        ),
    ] = False,
    trials: Trials = 200,
    seed: Seed = 0,
    duration: Duration = None,
    threads: Threads = None,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Vary one key: plan and validate each value, tables like the paper's Tables 1 and 2."""
    from syncplan.loading import load_scenario
    from syncplan.sections import MAX_VEHICLES
    from syncplan.sweeps import sweep
    from syncplan.validation import check_run
    from syncplan.validation_report import sweep_document, validation_document

    given = {
        "angular_rate": angular_rate,
        "range": range_,
        "radius": radius,
        "spacing": spacing,
    }
    chosen = [(name, text) for name, text in given.items() if text is not None]
    if len(chosen) != 1:
        raise InputError(
            "give exactly one of --angular-rate, --range, --radius, --spacing", key="sweep"
        )
    name, text = chosen[0]
    values = _numbers(text, f"--{name.replace('_', '-')}")
    check_run(trials, seed)
    refuse_overwriting(scenario, output)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    _announce_compilation(loaded.size)
    with progress_bar("trials", trials * (len(values) + connected)) as progress:
        rows = sweep(
            loaded,
            name,
            values,
            trials=trials,
            seed=seed,
            duration=duration,
            connected=connected,
            threads=threads,
            progress=progress,
        )
    reports = [validation_document(row.validation) for row in rows]

    def show(console: "Console") -> None:
        from syncplan.tables import show_sweep

        show_sweep(name.replace("_", " "), [row.label for row in rows], reports, console)

    deliver(sweep_document(name, rows, reports), output, format_, show)
    return 0


@app.command(name="schema", epilog="Example: syncplan schema scenario")
def _schema(
    contract: Annotated[Contract, typer.Argument(help="Which document")] = Contract.scenario,
    output: Output = None,
) -> int:
    """Print the JSON Schema of a document."""
    if contract is Contract.scenario:
        from syncplan.scenario import Scenario as ScenarioModel

        schema = ScenarioModel.model_json_schema()
    elif contract is Contract.plan:
        from syncplan.document import PlanDocument

        schema = PlanDocument.model_json_schema(mode="serialization")
    else:
        from syncplan.document import ValidationDocument

        schema = ValidationDocument.model_json_schema(mode="serialization")
    deliver({"$schema": JSON_SCHEMA, **schema}, output, Format.json, None)
    return 0


@app.callback(invoke_without_command=True)
def _version(
    version: Annotated[bool, typer.Option("--version", help="Print the version")] = False,
) -> None:
    if version:
        sys.stdout.write(f"syncplan {__version__}\n")
        raise typer.Exit


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 1 internal fault, 2 bad input, 3, 4 as documented."""
    try:
        open_closed_streams()
        status = app(arguments, standalone_mode=False)
        sys.stdout.flush()
    except InputError as error:
        option = OPTIONS.get(error.key)
        say(f"{option}: {error.problem}" if option else str(error))
        status = error.exit_code
    except SyncplanError as error:
        say(str(error))
        status = error.exit_code
    except TyperException as error:
        if error.format_message():
            say(_usage_fault(error, sys.argv[1:] if arguments is None else arguments))
        status = error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except BrokenPipeError:
        # the reader has gone: point standard output elsewhere so that the exit stays silent
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 0
    except MemoryError:
        say("out of memory: the team or the window is too large for this machine")
        status = INTERNAL_FAULT
    except OSError as error:
        # all files are read and written elsewhere: this is standard output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        say(f"standard output: can't be written: {error.strerror}")
        status = InputError.exit_code
    except Exception as error:
        if os.environ.get("SYNCPLAN_DEBUG"):
            raise
        where = f"{type(error).__name__}: {error}"
        say(f"internal fault, {where} (SYNCPLAN_DEBUG=1 shows where; please report it)")
        status = INTERNAL_FAULT
    if status == INTERRUPTED:
        say("interrupted; nothing was written")
    sys.exit(status if isinstance(status, int) else 0)


def _usage_fault(error: TyperException, arguments: list[str]) -> str:
    """One line for a wrong argument, with its value where the parser does not repeat it."""
    message = " ".join(error.format_message().split())
    for name in getattr(getattr(error, "param", None), "opts", []):
        for k, given in enumerate(arguments):
            value = None
            if given == name and k + 1 < len(arguments):
                value = arguments[k + 1]
            elif given.startswith(f"{name}="):
                value = given.partition("=")[2]
            if value is not None and repr(value) not in message:
                return f"{name}: {value!r}: {message}"
    return message


def _verdict(observable: bool, required: bool) -> int:
    if required and not observable:
        say("the plan is not observable (--require-observable)")
        return NOT_OBSERVABLE
    return 0


def _announce_compilation(count: int) -> None:
    from syncplan.ekf import kernels_are_compiled

    if not kernels_are_compiled(count):
        say("compiling the filter's kernels, once; this takes some seconds ...")


def _numbers(text: str, option: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{text!r}: must be numbers with commas between, such as 0.2,0.4", key=option
        ) from None
