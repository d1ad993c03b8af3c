"""The commands that run the filter: validate, sweep, fly, replay."""

from dataclasses import replace
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syncplan.cli import arguments, console
from syncplan.cli.arguments import optional
from syncplan.cli.requirements import status_of, takes_requirements
from syncplan.errors import InputError
from syncplan.estimation.filter_options import SweepOptions
from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.recordings.recording_formats import STAMPS, Stamps
from syncplan.scenario.dotted_keys import SWEPT_KEYS, SweptKey, SweptOption, swept_key
from syncplan.studies.study import Study
from syncplan.studies.study_table import STUDIES

if TYPE_CHECKING:
    from syncplan.recordings.log import Log


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


# --- studies of plans -----------------------------------------------------------------------------


_THREADS = Parameter("threads", Parameter.KEYWORD_ONLY, default=None, annotation=arguments.Threads)


def _offer(study: Study) -> None:
    """Add the command of a study of a plan."""

    @runs.command(
        name=study.verb,
        epilog=f"\b\nExample: syncplan {study.verb} {study.example}",
        help=study.sentence,
    )
    @arguments.takes_options(study.options, without=(*study.left_out, *study.hidden))
    @takes_requirements(*study.requires)
    @arguments.replacing(
        "threads", [_THREADS] if study.parallel else [], lambda given: given.get("threads")
    )
    def _run(
        subject: arguments.SubjectFile,
        output: arguments.Output = None,
        format_: arguments.Shown = console.Format.auto,
        *,
        options: Any,
        threads: int | None,
        required: tuple[str, ...],
        max_vehicles: arguments.MaxVehicles = None,
    ) -> int:
        console.say_begun(subject, study.unit)
        from syncplan.planning.plan_files import plan_of
        from syncplan.reports.presentations import report_of

        if "robust" in required:
            options = replace(options, stress=True)
        plan = plan_of(arguments.loaded_file(subject, output, max_vehicles))
        result = console.carried_out(study, plan, options, threads)
        console.deliver_report(report_of(result), output, format_)
        return status_of(result, required)


for _study in STUDIES.values():
    if _study.example:
        _offer(_study)


# --- sweeps ---------------------------------------------------------------------------------------


def _help_of(key: SweptOption) -> str:
    text = f"{key.many} in {key.unit}"
    return f"{text}, such as {','.join(map(str, key.example))}" if key.example else text


_SWEPT = [
    Parameter(
        key.name,
        Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[str | None, optional(key.option, help=_help_of(key))],
    )
    for key in SWEPT_KEYS.values()
]
"""Options of the keys that have one."""


sweeps = typer.Typer()


@sweeps.command(
    name="sweep",
    epilog="\b\n"
    "Example: syncplan sweep scenario.yaml --angular-rate 0.2,0.4,0.6,0.8,1.0 --connected",
    help=STUDIES["sweep"].sentence,
)
@arguments.replacing("swept", _SWEPT, dict)
@arguments.takes_options(STUDIES["sweep"].options, without=STUDIES["sweep"].left_out)
def _sweep(
    scenario: arguments.ScenarioFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    *,
    swept: dict[str, Any],
    key: Key = None,
    values: Values = None,
    options: SweepOptions,
    threads: arguments.Threads = None,
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    from syncplan.planning.plan_files import in_world
    from syncplan.planning.variations import planned_rows
    from syncplan.reports.presentations import report_of
    from syncplan.scenario.loading import load_scenario
    from syncplan.scenario.models import MAX_VEHICLES
    from syncplan.studies.sweeps import PlannedSweep

    varied, numbers = _swept(swept, key, values)
    console.check_output(output, scenario)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    rows = planned_rows(loaded, varied.name, numbers, connected=options.connected)
    teams = [in_world(row.plan, options.truth).true_team for row in rows]
    console.compile_filter(options, [team.count for team in teams])
    with console.progress_bar("trials", options.trials * len(rows)) as progress:
        planned = PlannedSweep(varied.name, rows)
        result = STUDIES["sweep"].run(planned, options, console.execution(threads, progress))
    console.deliver_report(report_of(result), output, format_)
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


# --- replays --------------------------------------------------------------------------------------


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
    help=f"{STUDIES['replay'].sentence}\n\nWithout truth, the report has estimates and the "
    "filter's own sigmas in place of errors.",
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
    from syncplan.recordings.log import overview_of
    from syncplan.reports.presentations import report_of

    recording = _opened(log, output, stamps)
    known = {str(name): name for name in recording.landmark_names}
    if options.landmarks is not None:
        numbered = tuple(known.get(str(name), name) for name in options.landmarks)
        options = replace(options, landmarks=numbered)
    options.settings.check_start(recording.name, has_truth=recording.has_truth)
    console.compile_filter(options.filter_options, [len(recording.robots)])
    study = STUDIES["replay"]
    with console.progress_bar(study.unit, study.work(overview_of(recording), options)) as progress:
        replayed = study.run(recording, options, console.execution(None, progress))
    console.deliver_report(report_of(replayed), output, format_)
    return 0


def _opened(folder: Path, output: Path | None, stamps: Stamps) -> "Log":
    """Load a recording; check that the output can be written and is none of its files."""
    from syncplan.recordings.recording_formats import load_log, recorded_files_in

    console.check_output(output)
    recording = load_log(folder, stamps=stamps)
    console.check_output(output, *map(str, recorded_files_in(folder)))
    return recording
