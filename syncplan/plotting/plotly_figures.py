"""Figures of plans and reports, as plotly.graph_objects.Figure.

    from syncplan import figures
    figures.formation(plan).show()
    for name, figure in figures.figures_of(report).items(): ...

The command line, the web page and these functions draw the same values: syncplan.plotting makes
them, one module a figure. All take `theme`, "light" or "dark", or a whole `style` in its place:

    figures.formation(plan, style=figures.FigureStyle(width=400, font_scale=1.2, theme="dark"))

Backgrounds are clear.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from syncplan.errors import InputError
from syncplan.planning.planner import Plan
from syncplan.plotting.canvas import Spec
from syncplan.plotting.catalogue import Run, Subject, report_of, specs_of
from syncplan.plotting.errors_figure import errors_spec
from syncplan.plotting.figure_style import PLAIN, FigureStyle
from syncplan.plotting.layout_fitting import fitted
from syncplan.plotting.palette import Theme, themed
from syncplan.reports.run_schemas import SweepReport

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


def formation(plan: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return circles, senses, links by rank and certificate, unobservable motions as arrows."""
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
    """Return the figures of merit before and after; raises InputError if never refined."""
    return _one(plan, "refinement", _styled(theme, style))


def comparison(
    before: Plan, after: Plan, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> Figure:
    """Return circles and predicted errors of two plans; raises InputError if vehicles differ."""
    specs = specs_of(before, ["comparison"], style=_styled(theme, style), after=after)
    return _figure(specs["comparison"])


def accuracy(report: Run, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return the RMS position errors found, beside the predicted ones if known, in m."""
    return _one(report, "accuracy", _styled(theme, style))


def error_bands(
    report: Run,
    vehicles: Sequence[str] | None = None,
    *,
    theme: Theme | None = None,
    style: FigureStyle = PLAIN,
) -> Figure:
    """Return errors over time in the filter's own 3-sigma band, for the vehicles named.

    If none are: for all, or of a large team those with the largest errors. Raises InputError for
    a report without series, or an unknown vehicle.
    """
    chosen = _styled(theme, style)
    spec = fitted(errors_spec(report_of(report), chosen, vehicles), chosen)
    return _figure(themed(spec, chosen.theme))


def consistency(report: Run, *, theme: Theme | None = None, style: FigureStyle = PLAIN) -> Figure:
    """Return ANEES and NIS with their intervals, and the coverage of each vehicle."""
    return _one(report, "consistency", _styled(theme, style))


def sweep_curves(
    report: SweepReport, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> Figure:
    """Return the errors over the value that was swept, in m."""
    return _one(report, "sweep", _styled(theme, style))


def figures_of(
    subject: Subject, *, theme: Theme | None = None, style: FigureStyle = PLAIN
) -> dict[str, Figure]:
    """Return all figures of a plan, a validation, a flight, a sweep, a what-if or a replay."""
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
