"""The command that judges losses: what-if."""

from typing import Annotated

import typer

from syncplan.cli.arguments import MaxVehicles, Output, Shown, SubjectFile, Threads
from syncplan.cli.console import Format, check_output, deliver_document, progress_bar
from syncplan.cli.plan_commands import Bound

losses = typer.Typer()


@losses.command(
    name="what-if",
    epilog="Example: syncplan what-if plan.json --lose v3,L1",
)
def _what_if(
    subject: SubjectFile,
    output: Output = None,
    format_: Shown = Format.auto,
    lose: Annotated[
        str | None,
        typer.Option(
            help="Judge just this loss: vehicles, landmarks and sensors that are lost together, "
            "such as v3,L1 or sensor:v3, and compass:v3 or distance:v3 where v3 has one",
            show_default=False,
        ),
    ] = None,
    most: Annotated[
        int, typer.Option("--losses", min=1, max=2, help="Judge every loss of one, or of up to two")
    ] = 1,
    bound: Annotated[
        Bound, typer.Option(help="Predict errors: auto leaves very large teams out")
    ] = Bound.auto,
    threads: Threads = None,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Judge a plan without a vehicle, a sensor or a landmark, orbits unchanged: every single loss,
    the most harmful first. A vehicle whose sensor is lost flies on and is seen by others."""
    from syncplan.planning.loss_study import what_if
    from syncplan.planning.lost_parts import lost_together, possible_losses
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.reports.loss_report import what_if_document
    from syncplan.scenario.models import MAX_VEHICLES

    check_output(output, subject)
    loaded = load(subject, max_vehicles=max_vehicles or MAX_VEHICLES)
    known = {*loaded.scenario.vehicle_names, *loaded.scenario.landmark_names}
    names = [] if lose is None else [lose] if lose in known else _separated(lose)
    if names:
        lost_together(names, loaded.scenario)
    planned = plan_of(loaded, bound=bound.value)
    number = 1 if names else len(possible_losses(planned.team, most))
    with progress_bar("losses", number) as progress:
        found = what_if(
            planned,
            names,
            losses=2 if most == 2 else 1,
            bound=bound.value,
            threads=threads,
            progress=progress,
        )
    deliver_document("what-if", what_if_document(found), output, format_)
    return 0


def _separated(lose: str) -> list[str]:
    return [name.strip() for name in lose.split(",")]
