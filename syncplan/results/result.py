"""Results, which convert to a file, a data frame or a table in a notebook.

A result's report lies in a package above it. syncplan.reports.presentations makes it, and is loaded
on demand.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from syncplan.runtime.files import as_text, write_text

if TYPE_CHECKING:
    from pandas import DataFrame
else:
    DataFrame = Any

_PRESENTATIONS = "syncplan.reports.presentations"


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

    def _repr_html_(self) -> str:
        """Return the lines and tables of the document as HTML, for notebooks."""
        return str(import_module(_PRESENTATIONS).notebook_html(self))
