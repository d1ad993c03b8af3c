"""The command that designs a team from a brief."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli import arguments, console
from syncplan.cli.arguments import optional
from syncplan.errors import NoSolutionError
from syncplan.studies.study_table import STUDIES

if TYPE_CHECKING:
    from syncplan.designs.ladder import DesignState

designs = typer.Typer()


@designs.command(
    name="design",
    epilog="\b\nExample: syncplan design brief.yaml -o design.json --plan-out plan.json",
    help=f"{STUDIES['design'].sentence}\n\nThe winner is predicted, validated and flown. If none "
    "is found, say what is missing and what would help, and exit with 4. Ctrl-C ends the search "
    "with the best formation so far.",
)
def _design(
    brief: Annotated[
        str,
        typer.Argument(
            help="Brief in YAML or JSON, - for standard input; see syncplan schema brief",
            show_default=False,
        ),
    ],
    output: arguments.Output = None,
    plan_out: Annotated[
        Path | None,
        optional(help="File to write the plan of the winner to, or of the best formation found"),
    ] = None,
    format_: arguments.Shown = console.Format.auto,
    purchases: Annotated[
        bool, optional(help="State what changes of the brief would bring also where it is met")
    ] = False,
    processes: Annotated[
        int | None, optional(min=1, help="Processes; all cores if not given")
    ] = None,
) -> int:
    from syncplan.runtime.task_crew import interruption

    # until all is written, Ctrl-C ends searches alone
    with interruption():
        from syncplan.designs.designer import design
        from syncplan.reports.design_report import design_document
        from syncplan.runtime.files import as_text, write_text
        from syncplan.scenario.brief import brief_of

        console.check_output(output, brief)
        console.check_output(plan_out, brief)
        given = brief_of(brief)
        given = given.model_copy(update={"purchases": purchases or given.purchases})
        with console.progress_bar("searching", 0) as bar:
            result = design(
                given,
                workers=processes,
                progress=bar and (lambda state: bar(state.done, state.total, _words(state))),
            )
        document = design_document(result)
        if plan_out is not None and document.plan is not None:
            write_text(plan_out, as_text(document.plan.as_json()))
            console.say(f"wrote {plan_out}")
        console.deliver_report(document, output, format_)
    return 0 if result.status == "met" else NoSolutionError.exit_code


def _words(state: "DesignState") -> str:
    """What a design does, and the least error so far."""
    fitting = [team for team in state.front if team.fits]
    if not fitting:
        return state.doing
    best = min(fitting, key=lambda best: best.value)
    return f"{state.doing}; best {best.value:.3g} m with {best.cell}"
