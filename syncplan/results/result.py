"""Results, which convert to a file, a data frame, figures and what a notebook shows.

A result's report and figures lie in packages above it, which are loaded on demand.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from syncplan.runtime.files import as_text, write_text

if TYPE_CHECKING:
    from pandas import DataFrame
    from plotly.graph_objects import Figure
else:
    DataFrame = Figure = Any

_PRESENTATIONS = "syncplan.reports.presentations"
_FIGURES, _NOTEBOOKS = "syncplan.plotting.figures", "syncplan.plotting.notebooks"


class Result:
    """Result that a function of syncplan returns or takes."""

    __slots__ = ()

    def save(self, path: str | Path) -> None:
        """Write the JSON document that the command line writes with `-o`, whole or not at all.

        Raises InputError if the path can't be written.
        """
        document = import_module(_PRESENTATIONS).document_of(self)
        write_text(Path(path), as_text(document))

    def to_dataframe(self) -> DataFrame:
        """Return a pandas.DataFrame: a row for each vehicle, candidate site, value or loss.

        Columns are named as the keys of the document; [x, y] becomes two columns. Raises
        InputError if pandas is missing.
        """
        return import_module(_PRESENTATIONS).frame_of(self)

    @property
    def figures(self) -> list[str]:
        """Names of the figures of this result, the main one first."""
        names: list[str] = import_module(_FIGURES).names_of(self)
        return names

    def figure(self, name: str = "", *, theme: str | None = None) -> Figure:
        """Return a figure, the main one by default, as a plotly.graph_objects.Figure.

        `theme` is light or dark. Raises InputError for a figure that the result lacks, or if Plotly
        is missing.
        """
        return import_module(_FIGURES).figure_of(self, name, theme)

    def _repr_html_(self) -> str:
        """Return the map of a plan, and lines and tables, as HTML."""
        return str(import_module(_NOTEBOOKS).notebook_html(self))

    def _ipython_display_(self) -> None:
        """Show the main figure in a notebook, if Plotly is there, and then the HTML."""
        import_module(_NOTEBOOKS).show(self)
