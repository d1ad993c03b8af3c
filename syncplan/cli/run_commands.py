"""The commands that run the filter: validate, sweep, replay."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.arguments import (
    Duration,
    MaxVehicles,
    Output,
    RequireObservable,
    ScenarioFile,
    Seed,
    Shown,
    SubjectFile,
    Threads,
    Trials,
    numbers,
    verdict_status,
)
from syncplan.cli.console import Format, deliver, progress_bar, refuse_overwriting, say, say_notes
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filters import FILTERS

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["runs"]

runs = typer.Typer()


DEFAULTS = FilterOptions()
Model = StrEnum("Model", {name: name for name in FILTERS})  # type: ignore[misc]
DEFAULT_MODEL = Model(DEFAULTS.model)
ModelOption = Annotated[Model, typer.Option(help="How the filter integrates its readings")]


@runs.command(
    name="validate",
    epilog="Example: syncplan validate plan.json --trials 500 --seed 1 -o report.json",
)
def _validate(
    subject: SubjectFile,
    output: Output = None,
    format_: Shown = Format.auto,
    trials: Trials = DEFAULTS.trials,
    seed: Seed = DEFAULTS.seed,
    duration: Duration = None,
    model: Annotated[
        Model, typer.Option(help="How the filter integrates its readings")
    ] = DEFAULT_MODEL,
    substeps: Annotated[int, typer.Option(help="Euler sub-steps per sample")] = DEFAULTS.substeps,
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
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.planning.validation import validate
    from syncplan.reports.validation_report import validation_document
    from syncplan.scenario.models import MAX_VEHICLES

    options = FilterOptions(
        trials=trials,
        seed=seed,
        duration=duration,
        model=model.value,
        substeps=substeps,
        gate_probability=gate,
        with_series=series,
    )
    refuse_overwriting(subject, output)
    loaded = load(subject, max_vehicles=max_vehicles or MAX_VEHICLES)
    flown = plan_of(loaded)
    _announce_compilation(options, flown.team.count)
    with progress_bar("trials", trials) as progress:
        result = validate(flown, options, threads=threads, progress=progress)
    document = validation_document(result)

    def show(console: "Console") -> None:
        from syncplan.cli.terminal_tables import show_validation

        show_validation(document, console)

    if deliver(document.as_json(), output, format_, show) is Format.json:
        say_notes(document.notes)
    return verdict_status(flown.observable, require_observable)


@runs.command(
    name="sweep",
    epilog="Example: syncplan sweep scenario.yaml --angular-rate 0.2,0.4,0.6,0.8,1.0 --connected",
)
def _sweep(
    scenario: ScenarioFile,
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
    trials: Trials = DEFAULTS.trials,
    seed: Seed = DEFAULTS.seed,
    duration: Duration = None,
    threads: Threads = None,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Vary one key: plan and validate each value, tables like the paper's Tables 1 and 2."""
    from syncplan.planning.sweeps import sweep
    from syncplan.reports.validation_report import sweep_document, validation_document
    from syncplan.scenario.loading import load_scenario
    from syncplan.scenario.models import MAX_VEHICLES

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
    values = numbers(text, f"--{name.replace('_', '-')}")
    options = FilterOptions(trials=trials, seed=seed, duration=duration)
    refuse_overwriting(scenario, output)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    _announce_compilation(options, loaded.size)
    with progress_bar("trials", trials * (len(values) + connected)) as progress:
        rows = sweep(
            loaded,
            name,
            values,
            options,
            connected=connected,
            threads=threads,
            progress=progress,
        )
    reports = [validation_document(row.validation) for row in rows]

    def show(console: "Console") -> None:
        from syncplan.cli.terminal_tables import show_sweep

        show_sweep(name.replace("_", " "), [row.label for row in rows], reports, console)

    deliver(sweep_document(name, rows, reports).as_json(), output, format_, show)
    return 0


@runs.command(
    name="replay",
    epilog="Example: syncplan replay mrclam6 --landmarks 7,15 --series -o report.json",
)
def _replay(
    log_dir: Annotated[
        Path,
        typer.Argument(
            metavar="LOG_DIR", help="Folder of a recording in the format of the MRCLAM data sets"
        ),
    ],
    output: Output = None,
    format_: Shown = Format.auto,
    landmarks: Annotated[
        str,
        typer.Option(help="Landmarks whose bearings count: numbers such as 7,15, or all, or none"),
    ] = "all",
    meetings: Annotated[bool, typer.Option(help="Whether bearings between robots count")] = True,
    bearing_sigma_rad: Annotated[
        float, typer.Option(help="Sigma of a bearing that the filter assumes")
    ] = 0.08,
    speed_sigma_mps: Annotated[
        float, typer.Option(help="Assumed sigma of the speed, per sample")
    ] = 0.15,
    turn_rate_sigma_rad_s: Annotated[
        float, typer.Option(help="Assumed sigma of the turn rate, per sample")
    ] = 0.5,
    sample_time_s: Annotated[float, typer.Option(help="Time between the filter's samples")] = 0.05,
    gate: Annotated[
        float, typer.Option(help="Probability of the innovation gate; 1 accepts every bearing")
    ] = 0.999,
    series: Annotated[
        bool, typer.Option("--series", help="Add errors and sigmas over time to the report")
    ] = False,
) -> int:
    """Run the filter on recorded odometry and bearings, and compare it with the recorded truth.

    The filter starts at the truth and uses bearings, not ranges.
    """
    from dataclasses import replace

    from syncplan.estimation.mrclam import load_log
    from syncplan.estimation.replays import GROUND_ROBOTS, OPTIONS, replay
    from syncplan.reports.replay_report import replay_document

    chosen = _landmark_numbers(landmarks)
    log = load_log(log_dir)
    for recorded in log_dir.glob("*.dat"):
        refuse_overwriting(str(recorded), output)
    _announce_compilation(OPTIONS, len(log.robots))
    replayed = replay(
        log,
        landmarks=chosen,
        meetings=meetings,
        bearing_sigma=bearing_sigma_rad,
        noise=replace(
            GROUND_ROBOTS, speed_sigma=speed_sigma_mps, turn_rate_sigma=turn_rate_sigma_rad_s
        ),
        sample_time=sample_time_s,
        gate_probability=gate,
        with_series=series,
    )
    document = replay_document(replayed)

    def show(console: "Console") -> None:
        from syncplan.cli.terminal_tables import show_replay

        show_replay(document, console)

    if deliver(document.as_json(), output, format_, show) is Format.json:
        say_notes(document.notes)
    return 0


def _landmark_numbers(text: str) -> list[int] | None:
    """The landmarks of an option, None for all; raises InputError where they are no numbers."""
    if text == "all":
        return None
    if text == "none":
        return []
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{text!r}: must be all, none or numbers with commas between, such as 7,15",
            key="landmarks",
        ) from None


def _announce_compilation(options: FilterOptions, count: int) -> None:
    if not options.filter_model.lane_filter.is_compiled(count):
        say("compiling the filter's kernels, once; this takes some seconds ...")
