"""The commands that draw: plot, report."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.arguments import (
    MaxVehicles,
    SubjectFile,
    beginning_with,
    loaded_file,
    optional,
    takes_options,
)
from syncplan.cli.console import check_output, say
from syncplan.cli.document_table import checked, read_report
from syncplan.cli.requirements import say_verdict
from syncplan.errors import InputError
from syncplan.plotting.figure_style import COLUMN_PX, SHEET_PX, FigureStyle, Theme
from syncplan.plotting.figure_table import FIGURES, IMAGE_FORMATS, SUBJECTS

if TYPE_CHECKING:
    from syncplan.planning.judged_team import PlanVerdict
    from syncplan.planning.plans import Plan
    from syncplan.plotting.canvas import Spec
    from syncplan.plotting.figures import Subject
    from syncplan.reports.refinement_report import RefinementResult


@dataclass(frozen=True, slots=True)
class JudgedSubject:
    """Subject of figures, with its title and the verdicts on the plans that they show.

    A single verdict has an empty name; two are named "before" and "after".
    """

    subject: "Subject"
    refined: "RefinementResult | None"
    after: "Plan | None"
    title: str
    verdicts: "dict[str, PlanVerdict]"

    def specs(self, names: list[str], style: FigureStyle) -> "dict[str, Spec]":
        """Return its figures of these names; all if there are none."""
        from syncplan.plotting.figures import specs_of

        return specs_of(self.subject, names, style=style, refined=self.refined, after=self.after)


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
        help="Plan, scenario, or report of validate, fly, replay, sweep, what-if or design; - is "
        "standard input",
    ),
]
Drawn = Annotated[
    Path | None,
    optional(
        "-o",
        "--output",
        help="File to write: .html holds all figures and works offline; .png, .svg and .pdf "
        "hold one each, several as NAME-FIGURE.png",
    ),
]
Figures = Annotated[
    list[str] | None,
    optional(
        help=f"Figure to draw; may be repeated; {_OF}. If not given, a page holds all figures and "
        "an image holds the first",
        autocompletion=beginning_with(FIGURES),
    ),
]
Compare = Annotated[
    str | None,
    optional(metavar="PLAN|SCENARIO", help="A second plan: FILE is before, this is after"),
]


ThemeShown = Annotated[
    Theme | None,
    optional(help="Colours; if not given, light in an image and the reader's own in a page"),
]


@plots.command(
    name="plot",
    epilog="\b\nExample: syncplan plot plan.json -o plan.html\n\n\b\n"
    "Example: syncplan plot plan.json --figure formation --figure timeline --width 400 "
    "--theme dark -o plan.png",
)
@takes_options(FigureStyle, without=("theme",))
def _plot(
    file: DrawnFile,
    output: Drawn = None,
    *,
    figure: Figures = None,
    compare: Compare = None,
    options: FigureStyle,
    theme: ThemeShown = None,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Draw a plan or a report: a page that works offline, or images.

    The verdict on the plan is reported first, and appears at the top of a page.
    """
    ending = _ending(output)
    names = list(dict.fromkeys(figure or []))
    style = replace(options, theme=theme or "light")
    targets = _targets(output, ending, names)
    for target in targets:
        check_output(target, file, *([] if compare is None else [compare]))
    subject = _subject(file, compare, max_vehicles)
    if ending == ".html":
        contents = [_page(subject, names, style, theme)]
    else:
        contents = _images(subject, names, ending.removeprefix("."), style)
    for which, verdict in subject.verdicts.items():
        say_verdict(verdict, which)
    for target, content in zip(targets, contents, strict=True):
        _write(content, target)
    return 0


@plots.command(name="report", epilog="\b\nExample: syncplan report plan.json -o report.html")
def _report(
    file: SubjectFile,
    output: Annotated[
        Path | None, optional("-o", "--output", help="File to write the page to")
    ] = None,
    *,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Write a plan as a printable page, whatever the verdict.

    It prints on two sheets of A4 or Letter paper: map, verdict and vehicles on the first, and
    altitudes, coordinates, assumptions and room for two signatures on the second.
    """
    from syncplan.planning.plan_files import plan_of
    from syncplan.plotting.printed_report import report_page

    plan = plan_of(loaded_file(file, output, max_vehicles))
    page = report_page(plan, identifier="" if file == "-" else Path(file).name)
    say_verdict(plan.verdict)
    _write(page.encode("utf-8"), output)
    return 0


def _ending(output: Path | None) -> str:
    """Return the ending of the output, .html by default; raises InputError if it is not allowed."""
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


def _targets(output: Path | None, ending: str, names: list[str]) -> list[Path | None]:
    """Files to write; with several images, each name includes that of the figure."""
    if output is None or ending == ".html" or len(names) < 2:
        return [output]
    return [output.with_name(f"{output.stem}-{name}{output.suffix}") for name in names]


def _subject(file: str, compare: str | None, max_vehicles: int | None) -> JudgedSubject:
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.planning.plans import Plan
    from syncplan.scenario.models import MAX_VEHICLES

    most = max_vehicles or MAX_VEHICLES
    subject, refined, title = _read(file, most)
    after = None
    if compare is not None:
        if file == "-" == compare:
            raise InputError("standard input can't be both plans; give a file", key="compare")
        after = plan_of(load(compare, max_vehicles=most))
    if isinstance(subject, Plan):
        plans = {"": subject} if after is None else {"before": subject, "after": after}
        verdicts = {which: one.verdict for which, one in plans.items()}
    else:
        verdict = getattr(subject, "verdict", None)
        verdicts = {} if verdict is None else {"": verdict}
    return JudgedSubject(subject, refined, after, title, verdicts)


def _read(file: str, most: int) -> "tuple[Subject, RefinementResult | None, str]":
    """Return the content of a file, the record of its refinement, and its title."""
    from syncplan.planning.plan_files import loaded_from, plan_of
    from syncplan.reports.refinement_report import RefinementResult
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


def _page(given: JudgedSubject, names: list[str], style: FigureStyle, theme: Theme | None) -> bytes:
    """A page of figures, with the colours of both themes and layouts for three widths."""
    from syncplan.plotting.figure_files import figure_page

    light = replace(style, theme="light")
    specs = given.specs(names, light)
    sheets, columns = (
        given.specs(names, replace(light, width=width, height=None))
        for width in (SHEET_PX, COLUMN_PX)
    )
    page = figure_page(
        given.title, specs, given.verdicts, columns=columns, sheets=sheets, theme=theme
    )
    return page.encode("utf-8")


def _images(
    given: JudgedSubject, names: list[str], image_format: str, style: FigureStyle
) -> list[bytes]:
    """Images of the named figures, in that order; of the first figure if none is named."""
    from syncplan.plotting.figure_files import figure_images
    from syncplan.plotting.figures import names_of

    if not names:
        names = names_of(given.subject, refined=given.refined, after=given.after)[:1]
    return list(figure_images(given.specs(names, style), image_format, style).values())


def _write(content: bytes, output: Path | None) -> None:
    from syncplan.runtime.files import write_bytes

    if output is None or str(output) == "-":
        sys.stdout.write(content.decode("utf-8"))
        return
    write_bytes(output, content)
    say(f"wrote {output}")
