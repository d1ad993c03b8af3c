"""The commands that make plans and judge them: plan, refine, place, landmarks, what-if."""

import sys
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syncplan.cli import arguments, console
from syncplan.cli.arguments import optional
from syncplan.cli.requirements import status_of, takes_requirements
from syncplan.errors import InputError, NoSolutionError
from syncplan.scenario.objectives import OBJECTIVES, listed
from syncplan.studies.study_table import STUDIES

if TYPE_CHECKING:
    from syncplan.planning.plans import Plan
    from syncplan.scenario.specification import Scenario


VARIABLES = ("phases", "centers", "radii")
"""Variables that a refinement can change, see RefineOptions.vary."""

LARGE_TEAM = 500
"""Teams above this size take several seconds to judge, so a message says so."""

Paper = Annotated[
    bool, typer.Option("--paper", help="Leave out the flights: the verdict rests on paper")
]

plans = typer.Typer()


class Bound(StrEnum):
    """Choice of when to compute the posterior bound."""

    auto = "auto"
    always = "always"
    never = "never"


@plans.command(
    name="plan", epilog="\b\nExample: syncplan plan scenario.yaml -o plan.json --require-observable"
)
@takes_requirements("observable", "go", "flown")
def _plan(
    subject: arguments.SubjectFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    refine_: Annotated[
        bool, typer.Option("--refine", help="Refine the plan as the scenario's refine section says")
    ] = False,
    bound: Annotated[
        Bound, typer.Option(help="Compute the posterior bound: auto leaves very large teams out")
    ] = Bound.auto,
    steady: Annotated[
        bool, typer.Option("--steady", help="Add the error once it has become periodic")
    ] = False,
    fly_: Annotated[
        int | None,
        optional(
            "--fly",
            min=1,
            help="Most flights by which the plan is judged (default 96); they end as soon as they "
            "show whether it flies well. syncplan fly has all options",
        ),
    ] = None,
    paper: Paper = False,
    required: tuple[str, ...] = (),
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    """Find phases for a scenario and judge the plan: meetings, observability, predicted error.

    A plan without faults on paper is flown in closed loop, 31 times if no flight fails. A plan file
    is judged again with its own orbits; it keeps its flights where they fit.
    """
    from syncplan.planning.plan_files import plan_of
    from syncplan.reports.plan_report import plan_document

    loaded = arguments.loaded_file(subject, output, max_vehicles)
    if not loaded.scenario.formation.placed and sys.stderr.isatty():
        console.say("looking for centres ...")
    if loaded.scenario.size > LARGE_TEAM and sys.stderr.isatty():
        console.say(f"judging the rank of {3 * loaded.scenario.size} states takes some time ...")
    if paper and fly_ is not None:
        raise InputError("can't be combined with --paper; leave one of them out", key="--fly")
    made = plan_of(loaded, bound=bound.value, steady=steady)
    if refine_:
        return _refined(made, {}, None, output, format_, required, bound, paper=paper, flights=fly_)
    if not paper:
        made = _flown(replace(made, flight=None) if fly_ else made, fly_)
        if fly_ is not None and made.flight is None:
            console.say("not flown: the plan is stopped on paper")
    console.deliver_report(plan_document(made), output, format_)
    return status_of(made, required)


def _flown(made: "Plan", most_flights: int | None = None, *, interruptible: bool = False) -> "Plan":
    """Return a plan with the record of its pilot flight.

    Ctrl-C leaves an `interruptible` plan, which took long to find, on paper.
    """
    from syncplan.planning.pilot_flight import piloted
    from syncplan.planning.pilot_options import PilotOptions
    from syncplan.planning.share_test import FEWEST_FLIGHTS, MOST_FLIGHTS

    try:
        with console.progress_bar("flights", FEWEST_FLIGHTS) as progress:
            options = PilotOptions(
                most_flights or MOST_FLIGHTS,
                progress=progress,
                compile_kernels=console.compile_flight,
                limited=most_flights is None,
            )
            return piloted(made, options)
    except KeyboardInterrupt:
        if not interruptible:
            raise
        return replace(made, unflown="the flights were interrupted")


# --- refine ---------------------------------------------------------------------------------------

_Vary = Annotated[
    str | None,
    optional(
        help=f"What may change: {','.join(VARIABLES)}",
        autocompletion=arguments.beginning_with(VARIABLES, listed=True),
    ),
]
_CenterBox = Annotated[
    float | None, optional(help="How far a centre may move each way (default 5)")
]
_RadiusLimits = Annotated[str | None, optional(help="Least and largest radius, such as 15,25")]
_Objective = Annotated[
    str | None,
    optional(
        help=f"Figure of merit to improve: {listed()}",
        autocompletion=arguments.beginning_with(OBJECTIVES),
    ),
]
_Margin = Annotated[
    float | None,
    optional(help="Margin by which meetings stay within range (default 2 % of the range)"),
]
_TimeLimit = Annotated[float | None, optional(help="Wall time (default 60)")]
_Starts = Annotated[int | None, optional(help="Starting points (default 4)")]
_Seed = Annotated[int | None, optional(help="Seed of the starting points")]
_Processes = Annotated[int | None, optional(min=1, help="Processes; all cores if not given")]


@plans.command(
    name="refine",
    epilog="\b\n"
    "Example: syncplan refine plan.json -o better.json --objective logdet --center-box-m 5",
    help=f"{STUDIES['refinement'].sentence} Options override the scenario's refine section. If "
    "nothing better is found, write nothing and exit with 4.",
)
@takes_requirements("observable", "go", "flown")
def _refine(
    subject: arguments.SubjectFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    vary: _Vary = None,
    center_box_m: _CenterBox = None,
    radius_m: _RadiusLimits = None,
    objective: _Objective = None,
    margin_m: _Margin = None,
    time_limit_s: _TimeLimit = None,
    starts: _Starts = None,
    seed: _Seed = None,
    processes: _Processes = None,
    paper: Paper = False,
    required: tuple[str, ...] = (),
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    console.say_begun(subject, "the search")
    from syncplan.planning.plan_files import plan_of
    from syncplan.refinement.refiner import options_for

    loaded = arguments.loaded_file(subject, output, max_vehicles)
    changes: dict[str, Any] = {
        "vary": None if vary is None else [one.strip() for one in vary.split(",")],
        "center_box_m": center_box_m,
        "radius_m": None if radius_m is None else arguments.numbers(radius_m, "--radius-m"),
        "objective": objective,
        "margin_m": margin_m,
        "time_limit_s": time_limit_s,
        "starts": starts,
        "seed": seed,
    }
    options_for(loaded.scenario, None, changes)
    given = plan_of(loaded)
    return _refined(given, changes, processes, output, format_, required, paper=paper)


@plans.command(name="place", epilog="\b\nExample: syncplan place links.yaml -o placed.json")
def _place(
    scenario: arguments.ScenarioFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    margin_m: Annotated[
        float | None,
        optional(help="Margin by which links stay within range (default 2 % of the range)"),
    ] = None,
    starts: Annotated[int, typer.Option(help="Layouts to start from")] = 8,
    seed: Annotated[int, typer.Option(help="Seed of the layouts")] = 0,
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    """Find centres for a formation given by links alone, or by a shape and a gap.

    The result is the scenario with its centres, ready for plan and refine.
    """
    from syncplan.placement.centers import place
    from syncplan.scenario.loading import load_scenario
    from syncplan.scenario.models import MAX_VEHICLES

    console.check_output(output, scenario)
    loaded = load_scenario(scenario, max_vehicles=max_vehicles or MAX_VEHICLES)
    placed = place(loaded, margin=margin_m, starts=starts, seed=seed)

    console.deliver_report(placed, output, format_)
    return 0


@plans.command(
    name="landmarks",
    epilog="\b\nExample: syncplan landmarks scenario.yaml --candidates sites.yaml --choose 3 "
    "--scenario-out chosen.yaml",
)
def _landmarks(
    subject: arguments.SubjectFile,
    candidates: Annotated[
        str, typer.Option(help="File of candidate sites: a list of \\[x, y] or a mapping of names")
    ],
    choose: Annotated[int, typer.Option(help="How many sites to choose")],
    output: arguments.Output = None,
    scenario_out: Annotated[
        Path | None,
        optional(
            help="File to write the scenario with the chosen landmarks to, .yaml or .json; "
            "comments of YAML are kept"
        ),
    ] = None,
    format_: arguments.Shown = console.Format.auto,
    seed: Annotated[int, typer.Option(help="Seed of the search")] = 0,
    paper: Paper = False,
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    """Choose landmark sites among candidates so that the worst vehicle's bound is least.

    Plan and the other commands take the file that --scenario-out writes as it is.
    """
    from syncplan.landmarks.site_choice import choose_landmarks, load_candidates, new_sites
    from syncplan.planning.plan_files import loaded_from, plan_of
    from syncplan.reports.sites_report import sites_document
    from syncplan.scenario.loading import parse_document, read_text
    from syncplan.scenario.models import MAX_VEHICLES

    console.check_output(output, subject, candidates)
    console.check_output(scenario_out, subject, candidates)
    source, text = read_text(subject)
    values = parse_document(text, source)
    loaded = loaded_from(values, source=source, max_vehicles=max_vehicles or MAX_VEHICLES)
    sites = load_candidates(candidates, loaded.scenario.geo_origin)
    new_sites(loaded.scenario, sites, source=candidates)
    before = plan_of(loaded)
    choice = choose_landmarks(before, sites, choose, seed=seed, pilot=False)
    if not paper:
        choice = replace(choice, plan=_flown(choice.plan, interruptible=True))
    if scenario_out is not None:
        kept = text if loaded.scenario.formation.placed else ""
        _write_scenario(kept, source, choice.plan.scenario, scenario_out)
    console.deliver_report(sites_document(choice), output, format_)
    return 0


def _write_scenario(text: str, source: str, chosen: "Scenario", target: "Path") -> None:
    """Write the scenario file with the landmarks of the chosen scenario.

    If `text` is empty, because the centres were found, write the chosen scenario as a whole.
    """
    from syncplan.runtime.files import as_text, write_text
    from syncplan.scenario.loading import with_landmarks

    landmarks = dict(zip(chosen.landmark_names, chosen.landmarks, strict=True))
    as_json = target.suffix.lower() == ".json"
    given = text or as_text(chosen.model_dump(mode="json", exclude_none=True))
    write_text(target, with_landmarks(given, source, landmarks, as_json=as_json))
    console.say(f"wrote {target}")


def _refined(
    given: "Plan",
    changes: dict[str, Any],
    processes: int | None,
    output: "Path | None",
    format_: console.Format,
    required: tuple[str, ...],
    bound: Bound = Bound.auto,
    *,
    paper: bool,
    flights: int | None = None,
) -> int:
    """Refine and deliver a plan; one that could not be improved is shown, but never written."""
    from syncplan.refinement.refiner import refine
    from syncplan.reports.plan_report import plan_document

    with console.search_progress() as progress:
        better = refine(
            given,
            workers=processes,
            bound=bound.value,
            pilot=False,
            progress=progress,
            **changes,
        )
    if not paper:
        better = _flown(better, flights, interruptible=True)
    record = better.refinement
    if record is None or record.improved:
        console.deliver_report(plan_document(better), output, format_)
        return status_of(better, required)
    if output is None or str(output) == "-":
        console.deliver_report(plan_document(better), output, format_)
        return NoSolutionError.exit_code
    raise NoSolutionError(f"not refined: {record.reason}; {output} was not written")


losses = typer.Typer()


@losses.command(
    name="what-if",
    epilog="\b\nExample: syncplan what-if plan.json --lose v3,L1",
)
def _what_if(
    subject: arguments.SubjectFile,
    output: arguments.Output = None,
    format_: arguments.Shown = console.Format.auto,
    lose: Annotated[
        str | None,
        optional(
            help="Judge just this loss: vehicles, landmarks and sensors that are lost together, "
            "such as v3,L1 or sensor:v3, and compass:v3 or distance:v3 where v3 has one"
        ),
    ] = None,
    most: Annotated[
        int,
        typer.Option(
            "--losses", min=1, max=2, help="Judge every loss of one part, or of up to two parts"
        ),
    ] = 1,
    bound: Annotated[
        Bound, typer.Option(help="Predict errors: auto leaves very large teams out")
    ] = Bound.auto,
    threads: arguments.Threads = None,
    max_vehicles: arguments.MaxVehicles = None,
) -> int:
    """Judge a plan without a vehicle, a sensor or a landmark, orbits unchanged: every single loss,
    the most harmful first. A vehicle whose sensor is lost flies on and is seen by others."""
    from syncplan.orbits.lost_parts import lost_together, possible_losses
    from syncplan.planning.loss_study import what_if
    from syncplan.planning.plan_files import plan_of

    loaded = arguments.loaded_file(subject, output, max_vehicles)
    known = {*loaded.scenario.vehicle_names, *loaded.scenario.landmark_names}
    names = [] if lose is None else [lose] if lose in known else _separated(lose)
    if names:
        lost_together(names, loaded.scenario)
    planned = plan_of(loaded, bound=bound.value)
    number = 1 if names else len(possible_losses(planned.team, most))
    with console.progress_bar("losses", number) as progress:
        found = what_if(
            planned,
            names,
            losses=2 if most == 2 else 1,
            bound=bound.value,
            threads=threads,
            progress=progress,
        )
    console.deliver_report(found, output, format_)
    return 0


def _separated(lose: str) -> list[str]:
    return [name.strip() for name in lose.split(",")]
