"""Figures of plans and reports, as plotly.graph_objects.Figure.

    from syncplan import figures
    figures.formation(plan).show()
    for name, figure in figures.figures_of(report).items(): ...

The command line, the web page and these functions draw the same values, those of `specs_of`. All
take `theme`, "light" or "dark", or a whole `style` in its place:

    figures.formation(plan, style=figures.FigureStyle(width=400, font_scale=1.2, theme="dark"))

Backgrounds are transparent.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from syncplan.errors import InputError
from syncplan.planning.plans import Plan
from syncplan.plotting.canvas import Spec, fitted
from syncplan.plotting.figure_style import PLAIN, FigureStyle, Theme, themed
from syncplan.plotting.figure_table import FIGURES, FigureInput
from syncplan.plotting.series_figures import errors_spec
from syncplan.reports.presentations import report_of
from syncplan.reports.refinement_report import RefinementResult, refinement_result
from syncplan.results.result import Result
from syncplan.results.stories import Report

if TYPE_CHECKING:
    from plotly.graph_objects import Figure
else:
    Figure = Any


__all__ = [
    "FigureStyle",
    "accuracy",
    "animation",
    "comparison",
    "consistency",
    "error_bands",
    "figures_of",
    "formation",
    "prediction",
    "refinement",
    "spectrum",
    "sweep_curves",
    "timeline",
]

Subject = Result | Report
"""A result, or the document of one."""


def specs_of(
    subject: Subject,
    names: Sequence[str] = (),
    *,
    style: FigureStyle = PLAIN,
    refined: RefinementResult | None = None,
    after: Plan | None = None,
) -> dict[str, Spec]:
    """Return the figures of a subject as Plotly's plain values, by name: all, or the ones named.

    `refined` is the refinement record of a plan read from a file, which Plan.refinement does not
    hold; `after` is a second plan to compare with. Needs no Plotly. Raises InputError for a figure
    that the subject lacks.
    """
    given = _given(subject, refined, after, style)
    known = _known(given)
    for name in names:
        if name not in known:
            raise InputError(f"{name!r}: {_why_not(name, given.of, known)}", key="figure")
    return {name: FIGURES[name].draw(given) for name in names or known}


def names_of(
    subject: Subject, *, refined: RefinementResult | None = None, after: Plan | None = None
) -> list[str]:
    """Return the names of a subject's figures, first the one to show where there is room for one.

    See specs_of.
    """
    known = _known(_given(subject, refined, after, PLAIN))
    return sorted(known, key=lambda name: not FIGURES[name].compares)


def figure_of(subject: Subject, name: str = "", theme: Theme | None = None) -> Figure:
    """Return a figure by its name, the main one by default; raises InputError."""
    given = subject if isinstance(subject, Plan | Report) else report_of(subject)
    return _one(given, name or next(iter(names_of(given)), ""), _styled(theme, PLAIN))


def _given(
    subject: Subject, refined: RefinementResult | None, after: Plan | None, style: FigureStyle
) -> FigureInput:
    if isinstance(subject, Plan):
        if subject.refinement is not None:
            refined = refinement_result(subject.refinement)
        return FigureInput("plan", subject, style, refined, after)
    if after is not None:
        raise InputError("only a plan can be compared with a plan", key="compare")
    document = report_of(subject) if isinstance(subject, Result) else subject
    return FigureInput(document.drawn_as, document, style)


def _known(given: FigureInput) -> list[str]:
    return [name for name, one in FIGURES.items() if one.of == given.of and one.fits(given)]


def _why_not(name: str, of: str, known: list[str]) -> str:
    choices = f"choose from {', '.join(known)}"
    if name not in FIGURES:
        return choices
    figure = FIGURES[name]
    why = figure.why_not if figure.of == of else "this file has no such figure"
    return f"{why}; {choices}"


def formation(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return circles, senses, links by rank and certificate, and arrows of unobservable motions."""
    return _one(plan, "formation", _styled(theme, style))


def animation(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return one period in 60 frames, with the sightings of each moment."""
    return _one(plan, "animation", _styled(theme, style))


def timeline(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return a bar for each directed sighting over a period, in s, and their union below."""
    return _one(plan, "timeline", _styled(theme, style))


def spectrum(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return the singular values of the windowed matrix and the gap the rank rests on."""
    return _one(plan, "spectrum", _styled(theme, style))


def prediction(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return the bound's RMS position error of each vehicle, in m."""
    return _one(plan, "prediction", _styled(theme, style))


def refinement(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return figures of merit before and after; raises InputError if the plan was not refined."""
    return _one(plan, "refinement", _styled(theme, style))


def comparison(
    before: Plan, after: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> Figure:
    """Return circles and predicted errors of two plans; raises InputError if vehicles differ."""
    specs = specs_of(before, ["comparison"], style=_styled(theme, style), after=after)
    return _figure(specs["comparison"])


def accuracy(report: Subject, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return the RMS position errors found, beside the predicted ones if known, in m."""
    return _one(report, "accuracy", _styled(theme, style))


def error_bands(
    report: Subject,
    vehicles: Sequence[str] | None = None,
    *,
    theme: Theme | None = None,
    style: FigureStyle = PLAIN,
) -> Figure:
    """Return errors over time in the filter's own 3-sigma band, for the vehicles named.

    By default, all vehicles are shown or, of a large team, those with the largest errors. Raises
    InputError for a report without series, or an unknown vehicle.
    """
    chosen = _styled(theme, style)
    spec = fitted(errors_spec(_given(report, None, None, chosen).subject, chosen, vehicles), chosen)
    return _figure(themed(spec, chosen.theme))


def consistency(
    report: Subject, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> Figure:
    """Return ANEES and NIS with their intervals, and the coverage of each vehicle."""
    return _one(report, "consistency", _styled(theme, style))


def sweep_curves(
    report: Subject, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> Figure:
    """Return the errors over the value that was swept, in m."""
    return _one(report, "sweep", _styled(theme, style))


def figures_of(
    subject: Subject, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> dict[str, Figure]:
    """Return all figures of a plan, a validation, flight, sweep, what-if, replay or design."""
    specs = specs_of(subject, style=_styled(theme, style))
    return {name: _figure(spec) for name, spec in specs.items()}


def _one(subject: Subject, name: str, style: FigureStyle) -> Figure:
    return _figure(specs_of(subject, [name], style=style)[name])


def _styled(theme: Theme | None, style: FigureStyle) -> FigureStyle:
    return style if theme is None else replace(style, theme=theme)


def _figure(spec: Spec) -> Figure:
    try:
        from plotly.graph_objects import Figure as PlotlyFigure
    except ImportError:
        raise InputError(
            "needs plotly: pip install 'syncplan[plot]'", source="the figure"
        ) from None
    return PlotlyFigure(spec)
