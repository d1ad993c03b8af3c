"""The command that draws: plot."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.arguments import MaxVehicles, beginning_with
from syncplan.cli.console import refuse_overwriting, say
from syncplan.cli.document_table import checked, read_report
from syncplan.cli.required_verdicts import say_verdict
from syncplan.errors import InputError
from syncplan.plotting.figure_table import FIGURES, IMAGE_FORMATS, SUBJECTS

if TYPE_CHECKING:
    from syncplan.plotting.canvas import Spec
    from syncplan.plotting.catalogue import Subject
    from syncplan.reports.refinement_schemas import RefinementResult
    from syncplan.reports.verdict_schemas import PlanVerdict

__all__ = ["plots"]


@dataclass(frozen=True, slots=True)
class JudgedFigures:
    """Figures by name, their title, and verdicts on the plans that they show.

    A single verdict has an empty name; of two, one is before and the other after.
    """

    specs: "dict[str, Spec]"
    title: str
    verdicts: "dict[str, PlanVerdict]"


ENDINGS = (".html", *(f".{image}" for image in IMAGE_FORMATS))

plots = typer.Typer()

_OF = "; ".join(
    f"of {words}: {', '.join(name for name, one in FIGURES.items() if one.of == of)}"
    for of, words in SUBJECTS.items()
)

DrawnFile = Annotated[
    str,
    typer.Argument(
        metavar="FILE",
        help="Plan, scenario, or report of validate, sweep or replay; - is standard input",
    ),
]
Drawn = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help="File to write: .html holds all figures and works offline; .png, .svg and .pdf "
        "hold one",
        show_default=False,
    ),
]
Figures = Annotated[
    list[str] | None,
    typer.Option(
        help=f"Figure to draw, may be repeated; {_OF}. All if not given; the first in an image",
        show_default=False,
        autocompletion=beginning_with(FIGURES),
    ),
]
Compare = Annotated[
    str | None,
    typer.Option(
        metavar="PLAN|SCENARIO",
        help="A second plan: FILE is before, this is after",
        show_default=False,
    ),
]


@plots.command(
    name="plot",
    epilog="Example: syncplan plot plan.json -o plan.html\n\n"
    "Example: syncplan plot report.json --figure errors -o errors.svg",
)
def _plot(
    file: DrawnFile,
    output: Drawn = None,
    figure: Figures = None,
    compare: Compare = None,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Draw a plan or a report: a page that works offline, or an image.

    The verdict on the plan is said first, and stands at the top of a page.
    """
    ending = _ending(output)
    names = list(dict.fromkeys(figure or []))
    if ending != ".html" and len(names) > 1:
        raise InputError(
            f"{', '.join(names)}: an image holds one; give one, or write a .html page",
            key="figure",
        )
    for given in (file, compare):
        if given is not None:
            refuse_overwriting(given, output)
    drawn = _drawn(file, names, compare, max_vehicles, only_first=ending != ".html")
    content = _content(drawn, ending)
    for which, verdict in drawn.verdicts.items():
        say_verdict(verdict, which)
    _write(content, output)
    return 0


def _ending(output: Path | None) -> str:
    """What kind of file is wanted; raises InputError where nothing says so."""
    if output is None and sys.stdout.isatty():
        raise InputError("give the file to write, such as -o figures.html", key="output")
    if output is None or str(output) == "-":
        return ".html"
    ending = output.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(
            f"{str(output)!r}: its name must end in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}",
            key="output",
        )
    return ending


def _drawn(
    file: str,
    names: list[str],
    compare: str | None,
    max_vehicles: int | None,
    *,
    only_first: bool,
) -> "JudgedFigures":
    from syncplan.planning.judged_plan import Plan
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.plotting.catalogue import first_figure, specs_of
    from syncplan.reports.verdict_schemas import plan_verdict
    from syncplan.scenario.models import MAX_VEHICLES

    most = max_vehicles or MAX_VEHICLES
    subject, refined, title = _read(file, most)
    after = None
    if compare is not None:
        if file == "-" == compare:
            raise InputError("standard input can't be both plans; give a file", key="compare")
        after = plan_of(load(compare, max_vehicles=most))
    if only_first and not names:
        names = [first_figure(subject, refined=refined, after=after)]
    specs = specs_of(subject, names, refined=refined, after=after)
    if isinstance(subject, Plan):
        plans = {"": subject} if after is None else {"before": subject, "after": after}
        return JudgedFigures(
            specs, title, {k: plan_verdict(one.verdict) for k, one in plans.items()}
        )
    verdict = getattr(subject, "verdict", None)
    return JudgedFigures(specs, title, {} if verdict is None else {"": verdict})


def _read(file: str, most: int) -> "tuple[Subject, RefinementResult | None, str]":
    """What a file holds, the record of its refinement, and its title."""
    from syncplan.planning.plan_files import loaded_from, plan_of
    from syncplan.reports.refinement_schemas import RefinementResult
    from syncplan.scenario.loading import is_plan, parse_document, read_text

    source, text = read_text(file)
    values = parse_document(text, source)
    report = read_report(values, source)
    if report is not None:
        return report[0], None, report[1]
    plan = plan_of(loaded_from(values, source=source, max_vehicles=most))
    record = values.get("refinement") if is_plan(values) else None
    refined = None
    if record is not None:
        refined = checked(RefinementResult, record, f"{source}: refinement")
    return plan, refined, plan.scenario.name or "Plan"


def _content(drawn: JudgedFigures, ending: str) -> bytes:
    """The file as bytes: a page, or an image of the first figure."""
    if ending == ".html":
        from syncplan.plotting.html_page import figure_page

        return figure_page(drawn.title, drawn.specs, drawn.verdicts).encode("utf-8")
    from syncplan.plotting.images import figure_image

    return figure_image(next(iter(drawn.specs.values())), ending.removeprefix("."))


def _write(content: bytes, output: Path | None) -> None:
    from syncplan.runtime.files import write_bytes

    if output is None or str(output) == "-":
        sys.stdout.write(content.decode("utf-8"))
        return
    write_bytes(output, content)
    say(f"wrote {output}")
