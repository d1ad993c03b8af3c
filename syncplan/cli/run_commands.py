"""The commands that run the filter: validate, sweep, fly, replay."""

from collections.abc import Callable
from dataclasses import replace
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syncplan.cli import arguments, console
from syncplan.cli.arguments import (
    RequireFlown,
    RequireGo,
    RequireObservable,
    RequireRobust,
    optional,
    robust_status,
    verdict_status,
)
from syncplan.errors import InputError
from syncplan.estimation.filter_options import SweepOptions, ValidationOptions
from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.guidance.flight_options import FlightOptions
from syncplan.recordings.recording_formats import STAMPS, Stamps
from syncplan.scenario.dotted_keys import SWEPT_KEYS, SweptKey, SweptOption, swept_key

if TYPE_CHECKING:
    from syncplan.recordings.log import Log
    from syncplan.reports.replay_report import ReplayDocument


runs = typer.Typer()


Key = Annotated[
    str | None,
    optional(
        "--key",
        help="Dotted name of any scenario key that holds a number, such as sensor.range_sigma_m; "
        "give its values with --values",
        autocompletion=arguments.numeric_keys_from,
    ),
]
Values = Annotated[str | None, optional("--values", help="Values of --key, such as 0.1,0.3,1")]


@runs.command(
    name="validate",
    epilog="\b\nExample: syncplan validate plan.json --trials 500 --seed 1 -o report.json",
)
@arguments.takes_options(ValidationOptions)
def _validate(
    subject: arguments.SubjectFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    *,
    options: ValidationOptions,
    threads: arguments.Threads = None,
    require_observable: RequireObservable = False,
    require_go: RequireGo = False,
    require_flown: RequireFlown = False,
    require_robust: RequireRobust = False,
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    """Run the filter on a plan: Monte Carlo errors beside the bound, and consistency."""
    console.say_begun(subject, "trials")
    from syncplan.planning.filter_choice import choose_filter
    from syncplan.planning.plan_files import in_world, plan_of
    from syncplan.planning.validation import validate
    from syncplan.planning.variations import stress_worlds, stressed
    from syncplan.reports.validation_report import stress_document, validation_document

    flown = plan_of(arguments.loaded_file(subject, output, max_vehicles))
    chosen = choose_filter(flown, options).applied(options)
    there = in_world(flown, options.truth)
    console.compile_filter(chosen, [there.team.count])
    status = 0
    if options.stress or require_robust:
        worlds = len(stress_worlds(there.scenario)) + 1
        with console.progress_bar("trials", worlds * options.trials) as progress:
            test = stressed(flown, options, threads=threads, progress=progress)
        result, report = test.nominal, stress_document(test)
        status = robust_status(test) if require_robust else 0
    else:
        with console.progress_bar("trials", options.trials) as progress:
            result = validate(flown, options, threads=threads, progress=progress)
        report = validation_document(result)
    console.deliver_report(report, output, format_)
    return status or verdict_status(
        result, observable=require_observable, go=require_go, flown=require_flown
    )


def _with_options_of_swept_keys(command: Callable[..., int]) -> Callable[..., int]:
    """Add an option for each key in SWEPT_KEYS to the command's keyword arguments."""
    own = signature(command)
    options = [
        Parameter(
            one.name,
            Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[str | None, optional(one.option, help=_help_of(one))],
        )
        for one in SWEPT_KEYS.values()
    ]
    known = [one for one in own.parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
    later = [one for one in known if one.kind is Parameter.KEYWORD_ONLY]
    parameters = [*(one for one in known if one not in later), *options, *later]
    setattr(command, "__signature__", own.replace(parameters=parameters))  # noqa: B010
    return command


def _help_of(key: SweptOption) -> str:
    text = f"{key.many} in {key.unit}"
    return f"{text}, such as {','.join(map(str, key.example))}" if key.example else text


@runs.command(
    name="sweep",
    epilog="\b\n"
    "Example: syncplan sweep scenario.yaml --angular-rate 0.2,0.4,0.6,0.8,1.0 --connected",
)
@_with_options_of_swept_keys
@arguments.takes_options(
    SweepOptions, without=("substeps", "gate_probability", "with_series", "model")
)
def _sweep(
    scenario: arguments.ScenarioFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    *,
    key: Key = None,
    values: Values = None,
    options: SweepOptions,
    threads: arguments.Threads = None,
    max_vehicles: arguments.MaxVehicles = None,
    **swept: Any,
) -> int:
    """Vary one key: plan and validate each value, tables like the paper's Tables 1 and 2."""
    from syncplan.planning.plan_files import in_world
    from syncplan.planning.variations import planned_rows, validated
    from syncplan.reports.validation_report import sweep_document, validation_document
    from syncplan.scenario.loading import load_scenario
    from syncplan.scenario.models import MAX_VEHICLES

    varied, numbers_of_it = _swept(swept, key, values)
    console.check_output(output, scenario)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    planned = planned_rows(loaded, varied.name, numbers_of_it, connected=options.connected)
    teams = [in_world(row.plan, options.truth).true_team for row in planned]
    console.compile_filter(options, [team.count for team in teams])
    with console.progress_bar("trials", options.trials * len(planned)) as progress:
        rows = validated(varied.name, planned, options, threads=threads, progress=progress)
    reports = [validation_document(row.validation) for row in rows]
    console.deliver_report(sweep_document(varied.name, rows, reports), output, format_)
    return 0


def _swept(
    given: dict[str, str | None], name: str | None, values: str | None
) -> tuple[SweptKey, list[float]]:
    """Return the swept key and its values."""
    chosen = [(SWEPT_KEYS[name], text) for name, text in given.items() if text is not None]
    if (name is None) != (values is None):
        raise InputError("--key and --values go together; give both", key="sweep")
    if len(chosen) + (name is not None) != 1:
        options = ", ".join(one.option for one in SWEPT_KEYS.values())
        raise InputError(f"give exactly one of {options}, or --key with --values", key="sweep")
    if name is not None and values is not None:
        return _key_named(name), arguments.numbers(values, "--values")
    ((key, text),) = chosen
    return key, arguments.numbers(text, key.option)


def _key_named(name: str) -> SweptKey:
    try:
        return swept_key(name)
    except InputError as error:
        raise InputError(error.problem, key="--key") from None


@runs.command(
    name="fly",
    epilog="\b\n"
    "Example: syncplan fly plan.json --trials 200 --wind 1.5,0 --lose v3@60 -o flight.json",
)
@arguments.takes_options(FlightOptions, without=("substeps", "model"))
def _fly(
    subject: arguments.SubjectFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    *,
    options: FlightOptions,
    threads: arguments.Threads = None,
    require_observable: RequireObservable = False,
    require_go: RequireGo = False,
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    """Fly a plan in closed loop: vehicles steer by their estimates, in wind, with losses."""
    console.say_begun(subject, "flights")
    from syncplan.flight.flying import flight_run
    from syncplan.planning.plan_files import plan_of
    from syncplan.planning.plan_flights import conclude_flight, fly_part
    from syncplan.reports.flight_report import flight_document

    plan = plan_of(arguments.loaded_file(subject, output, max_vehicles))
    run = flight_run(plan, options)
    console.compile_flight(run.team)
    with console.progress_bar("flights", options.trials) as progress:
        part = fly_part(run, 0, run.trials, threads=threads, progress=progress)
    flight = conclude_flight(run, [part])
    console.deliver_report(flight_document(flight), output, format_)
    return verdict_status(flight.plan, observable=require_observable, go=require_go)


replays = typer.Typer()


Recording = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        help="Recording: a folder of CSV files or of MRCLAM's files, a ROS 2 bag, or an archive of "
        "any of these",
    ),
]


@replays.command(
    name="replay",
    epilog="\b\nExample: syncplan replay mrclam6 --landmarks 7,15 --series -o report.json",
)
@arguments.takes_options(ReplayOptions)
def _replay(
    log: Recording,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    stamps: Annotated[Stamps, typer.Option(help=STAMPS)] = "header",
    *,
    options: ReplayOptions,
) -> int:
    """Run the filter on recorded odometry and sightings, and compare it with the truth if recorded.

    Without truth, the report has estimates and the filter's own sigmas in place of errors.
    """
    recording = _opened(log, output, stamps)
    known = {str(name): name for name in recording.landmark_names}
    if options.landmarks is not None:
        numbered = tuple(known.get(str(name), name) for name in options.landmarks)
        options = replace(options, landmarks=numbered)
    document = _document(recording, options)
    console.deliver_report(document, output, format_)
    return 0


def _document(recording: "Log", asked: ReplayOptions) -> "ReplayDocument":
    """Run a replay, show its progress, and return its report."""
    from syncplan.estimation.replay_tuning import MOST_RUNS, tuned
    from syncplan.estimation.replays import replay_with
    from syncplan.reports.replay_report import replay_document

    settings, options = asked.settings, asked.filter_options
    settings.check_start(recording.name, has_truth=recording.has_truth)
    console.compile_filter(options, [len(recording.robots)])
    tuning = None
    if asked.tune:
        with console.progress_bar("filter runs", MOST_RUNS) as progress:
            tuning = tuned(recording, settings, options, progress)
    readings = sum(len(robot.times) for robot in recording.robots) * (1 + settings.distances)
    with console.progress_bar("sightings", readings) as progress:
        replayed = replay_with(recording, settings, options, tuning, progress)
    return replay_document(replayed)


def _opened(folder: Path, output: Path | None, stamps: Stamps) -> "Log":
    """Load a recording; check that the output can be written and is none of its files."""
    from syncplan.recordings.recording_formats import load_log, recorded_files_in

    console.check_output(output)
    recording = load_log(folder, stamps=stamps)
    console.check_output(output, *map(str, recorded_files_in(folder)))
    return recording
