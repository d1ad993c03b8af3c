"""What a terminal shows of results."""

import io

from rich.console import Console

from syncplan.cli.fitted_tables import show_story
from syncplan.results.stories import Report

__all__ = ["shown"]


def shown(report: Report, width: int = 160) -> str:
    """Return what a terminal of that width shows."""
    file = io.StringIO()
    show_story(report.story(), Console(file=file, width=width, highlight=False))
    return file.getvalue()
