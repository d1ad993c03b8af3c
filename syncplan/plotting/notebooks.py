"""Results in notebooks: the map of a plan, and the lines and tables of any result, as HTML."""

from contextlib import suppress
from html import escape

from syncplan.errors import InputError
from syncplan.planning.plans import Plan
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.figures import figure_of, names_of
from syncplan.plotting.formation_figures import formation_spec
from syncplan.plotting.static_map import map_svg
from syncplan.reports.presentations import report_of
from syncplan.results.result import Result
from syncplan.results.stories import Report, html_of

_MAP_PX = 520


def notebook_html(result: Result) -> str:
    """Return a result as HTML: its summary, the map of a plan, lines and tables."""
    return _html(result, report_of(result))


def show(result: Result) -> None:
    """Show a result in a notebook: its main figure, if Plotly is there, and its HTML."""
    from IPython.display import HTML, display

    report = report_of(result)
    # a plan has its map in the HTML
    if not isinstance(result, Plan) and names_of(report):
        with suppress(InputError):
            display(figure_of(report))
    display(HTML(_html(result, report)))


def _html(result: Result, report: Report) -> str:
    summary = f"<p><b>{escape(repr(result)[1:-1])}</b></p>"
    return "\n".join([summary, *_map(result), html_of(report.story())])


def _map(result: Result) -> list[str]:
    if not isinstance(result, Plan):
        return []
    style = FigureStyle(width=_MAP_PX)
    svg = map_svg(formation_spec(result, style), style.plot_px, "Map of the plan")
    return [f'<div style="max-width: {_MAP_PX}px">{svg}</div>']
