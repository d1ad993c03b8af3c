"""The verdict at a terminal: GO or NO-GO first, then each finding with its cure."""

from rich.console import Console
from rich.markup import escape

from syncplan.reports.verdict_schemas import PlanVerdict

COLOURS = {"stop": "red", "warning": "yellow", "note": "cyan"}
"""Of the levels of findings."""


def show_verdict(verdict: PlanVerdict, console: Console) -> None:
    """Print GO, or NO-GO with the number of reasons."""
    word, colon, reasons = verdict.headline.partition(":")
    console.print(f"[bold {'green' if verdict.go else 'red'}]{word}[/]{colon}{reasons}")


def show_findings(verdict: PlanVerdict, console: Console) -> None:
    """Print each finding with its cure."""
    for one in verdict.findings:
        level = f"[{COLOURS[one.level]}]{one.level}[/]"
        console.print(f"{level}: {one.code}: {escape(one.message)}")
        if one.cure is not None:
            console.print(f"   cure: {escape(one.cure.text)}")
