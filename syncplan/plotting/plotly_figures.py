"""Figures of plans and reports, as plotly.graph_objects.Figure.

    from syncplan import figures
    figures.formation(plan).show()
    for name, figure in figures.figures_of(report).items(): ...

The command line, the web page and these functions draw the same values: syncplan.plotting makes
them, one module a figure. All take `theme`, "light" or "dark"; backgrounds are clear.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from syncplan.errors import InputError
from syncplan.planning.judged_plan import Plan
from syncplan.plotting.canvas import Spec
from syncplan.plotting.catalogue import Run, Subject, report_of, specs_of
from syncplan.plotting.errors_figure import errors_spec
from syncplan.plotting.palette import Theme, themed
from syncplan.reports.run_schemas import SweepReport

if TYPE_CHECKING:
    from plotly.graph_objects import Figure
else:
    Figure = Any

__all__ = [
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


def formation(plan: Plan, *, theme: Theme = "light") -> Figure:
    """Return circles, senses, links by rank and certificate, unobservable motions as arrows."""
    return _one(plan, "formation", theme)


def animation(plan: Plan, *, theme: Theme = "light") -> Figure:
    """Return one period in 60 frames, with the sightings of each moment."""
    return _one(plan, "animation", theme)


def timeline(plan: Plan, *, theme: Theme = "light") -> Figure:
    """Return a bar for each directed sighting over a period, in s, and their union below."""
    return _one(plan, "timeline", theme)


def spectrum(plan: Plan, *, theme: Theme = "light") -> Figure:
    """Return the singular values of the windowed matrix and the gap the rank rests on."""
    return _one(plan, "spectrum", theme)


def prediction(plan: Plan, *, theme: Theme = "light") -> Figure:
    """Return the bound's RMS position error of each vehicle, in m."""
    return _one(plan, "prediction", theme)


def refinement(plan: Plan, *, theme: Theme = "light") -> Figure:
    """Return the figures of merit before and after; raises InputError if never refined."""
    return _one(plan, "refinement", theme)


def comparison(before: Plan, after: Plan, *, theme: Theme = "light") -> Figure:
    """Return circles and predicted errors of two plans; raises InputError if vehicles differ."""
    return _figure(specs_of(before, ["comparison"], theme=theme, after=after)["comparison"])


def accuracy(report: Run, *, theme: Theme = "light") -> Figure:
    """Return the RMS position errors found, beside the predicted ones if known, in m."""
    return _one(report, "accuracy", theme)


def error_bands(
    report: Run, vehicles: Sequence[str] | None = None, *, theme: Theme = "light"
) -> Figure:
    """Return errors over time in the filter's own 3-sigma band, for the vehicles named.

    If none are: for all, or of a large team those with the largest errors. Raises InputError for
    a report without series, or an unknown vehicle.
    """
    return _figure(themed(errors_spec(report_of(report), vehicles), theme))


def consistency(report: Run, *, theme: Theme = "light") -> Figure:
    """Return ANEES and NIS with their intervals, and the coverage of each vehicle."""
    return _one(report, "consistency", theme)


def sweep_curves(report: SweepReport, *, theme: Theme = "light") -> Figure:
    """Return the errors over the value that was swept, in m."""
    return _one(report, "sweep", theme)


def figures_of(subject: Subject, *, theme: Theme = "light") -> dict[str, Figure]:
    """Return all figures of a plan, a validation, a sweep or a replay, by name."""
    return {name: _figure(spec) for name, spec in specs_of(subject, theme=theme).items()}


def _one(subject: Subject, name: str, theme: Theme) -> Figure:
    return _figure(specs_of(subject, [name], theme=theme)[name])


def _figure(spec: Spec) -> Figure:
    try:
        from plotly.graph_objects import Figure as PlotlyFigure
    except ImportError:
        raise InputError(
            "needs plotly: pip install 'syncplan[plot]'", source="the figure"
        ) from None
    return PlotlyFigure(spec)
