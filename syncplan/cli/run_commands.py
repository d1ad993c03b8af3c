"""The commands that run the filter on plans: validate, sweep."""

from collections.abc import Callable
from enum import StrEnum
from inspect import Parameter, signature
from typing import Annotated, Any

import typer

from syncplan.cli.arguments import (
    Duration,
    MaxVehicles,
    Output,
    ScenarioFile,
    Seed,
    Series,
    Shown,
    SubjectFile,
    Threads,
    Trials,
    numbers,
)
from syncplan.cli.console import (
    Format,
    announce_compilation,
    deliver_document,
    progress_bar,
    refuse_overwriting,
)
from syncplan.cli.required_verdicts import RequireGo, RequireObservable, verdict_status
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filters import FILTERS
from syncplan.planning.swept_keys import SWEPT_KEYS, SweptKey

__all__ = ["runs"]

runs = typer.Typer()


DEFAULTS = FilterOptions()
Model = StrEnum("Model", {name: name for name in FILTERS})  # type: ignore[misc]
DEFAULT_MODEL = Model(DEFAULTS.model)
ModelOption = Annotated[Model, typer.Option(help="How the filter integrates its readings")]
Substeps = Annotated[int, typer.Option(help="Euler sub-steps per sample")]
Gate = Annotated[
    float | None,
    typer.Option(help="Probability of the innovation gate, such as 0.999", show_default=False),
]
Connected = Annotated[
    bool,
    typer.Option(
        "--connected", help="Add a row with a range that connects the team at every instant"
    ),
]


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
    model: ModelOption = DEFAULT_MODEL,
    substeps: Substeps = DEFAULTS.substeps,
    gate: Gate = None,
    series: Series = False,
    threads: Threads = None,
    require_observable: RequireObservable = False,
    require_go: RequireGo = False,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Run the filter on a plan: Monte Carlo errors beside the bound, and consistency."""
    from syncplan.estimation.trial_readings import needs_augmented
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
    flown = plan_of(load(subject, max_vehicles=max_vehicles or MAX_VEHICLES), pilot=False)
    announce_compilation(options, flown.team.count, augmented=needs_augmented(flown.team))
    with progress_bar("trials", trials) as progress:
        result = validate(flown, options, threads=threads, progress=progress)
    deliver_document("validation", validation_document(result), output, format_)
    return verdict_status(result.plan, observable=require_observable, go=require_go)


def _with_options_of_swept_keys(command: Callable[..., int]) -> Callable[..., int]:
    """The command with an option for each key that a sweep may vary, in its keyword arguments."""
    own = signature(command)
    options = [
        Parameter(
            one.name,
            Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[
                str | None, typer.Option(one.option, help=_help_of(one), show_default=False)
            ],
        )
        for one in SWEPT_KEYS.values()
    ]
    known = [one for one in own.parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
    later = [one for one in known if one.kind is Parameter.KEYWORD_ONLY]
    parameters = [*(one for one in known if one not in later), *options, *later]
    setattr(command, "__signature__", own.replace(parameters=parameters))  # noqa: B010
    return command


def _help_of(key: SweptKey) -> str:
    text = f"{key.many} in {key.unit}"
    return f"{text}, such as {','.join(map(str, key.example))}" if key.example else text


@runs.command(
    name="sweep",
    epilog="Example: syncplan sweep scenario.yaml --angular-rate 0.2,0.4,0.6,0.8,1.0 --connected",
)
@_with_options_of_swept_keys
def _sweep(
    scenario: ScenarioFile,
    output: Output = None,
    format_: Shown = Format.auto,
    *,
    connected: Connected = False,
    trials: Trials = DEFAULTS.trials,
    seed: Seed = DEFAULTS.seed,
    duration: Duration = None,
    threads: Threads = None,
    max_vehicles: MaxVehicles = None,
    **swept: Any,
) -> int:
    """Vary one key: plan and validate each value, tables like the paper's Tables 1 and 2."""
    from syncplan.planning.sweeps import sweep
    from syncplan.reports.validation_report import sweep_document, validation_document
    from syncplan.scenario.loading import load_scenario
    from syncplan.scenario.models import MAX_VEHICLES

    key, values = _swept(swept)
    options = FilterOptions(trials=trials, seed=seed, duration=duration)
    refuse_overwriting(scenario, output)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    announce_compilation(options, loaded.size)
    with progress_bar("trials", trials * (len(values) + connected)) as progress:
        rows = sweep(
            loaded,
            key.name,
            values,
            options,
            connected=connected,
            threads=threads,
            progress=progress,
        )
    reports = [validation_document(row.validation) for row in rows]
    deliver_document("sweep", sweep_document(key.name, rows, reports), output, format_)
    return 0


def _swept(given: dict[str, str | None]) -> tuple[SweptKey, list[float]]:
    """The one key that is given, and its values."""
    chosen = [(SWEPT_KEYS[name], text) for name, text in given.items() if text is not None]
    if len(chosen) != 1:
        options = ", ".join(one.option for one in SWEPT_KEYS.values())
        raise InputError(f"give exactly one of {options}", key="sweep")
    key, text = chosen[0]
    return key, numbers(text, key.option)
