"""Tables of what losses do to a plan."""

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from syncplan.phrases import listed
from syncplan.planning.lost_parts import phrase_of
from syncplan.reports.loss_report import RemainingTeam, WhatIfDocument

MOST_ROWS = 40
MOST_NAMED = 12


def show_losses(document: WhatIfDocument, console: Console) -> None:
    """Print what losses do: those that end observability, then all, the most harmful first."""
    console.print(
        f"[bold]{escape(document.name or 'plan')}[/]: {_state(document.baseline)}; "
        f"{_critical(document)}"
    )
    title = "each loss, the most harmful first; orbits unchanged, errors from initial_sigma on"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False)
    table.add_column("lost")
    table.add_column("rank", justify="right", no_wrap=True)
    table.add_column("worst error m", justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    table.add_column("cannot be detected any more", overflow="fold")
    for one in [document.baseline, *document.losses[:MOST_ROWS]]:
        table.add_row(
            escape(_lost(one.lost)),
            f"{one.rank} of {one.state_dim}",
            _metres(one.worst_predicted_rms_m),
            "[green]GO[/]" if one.verdict.go else "[red]NO-GO[/]",
            escape("; ".join(_undetected(one))),
        )
        if one is document.baseline:
            table.add_section()
    if len(document.losses) > MOST_ROWS:
        table.add_row(f"... and {len(document.losses) - MOST_ROWS} more (see the JSON)")
    console.print(table)
    if note := document.baseline.predicted_rms_m.note:
        console.print(f"[yellow]note[/]: {escape(note)}")


def _lost(names: list[str]) -> str:
    return " and ".join(phrase_of(name) for name in names) or "nothing"


def _undetected(one: RemainingTeam) -> list[str]:
    """Motions of the team, and changes of errors that the filter estimates, in words."""
    found = [mode.description for mode in one.unobservable]
    return found + [
        mode.description for mode in (one.extended.undetermined if one.extended else [])
    ]


def _state(baseline: RemainingTeam) -> str:
    state = "[green]observable[/]" if baseline.observable else "[red]NOT observable[/]"
    return f"{state}, rank {baseline.rank} of {baseline.state_dim}"


def _critical(document: WhatIfDocument) -> str:
    judged = len(document.losses)
    if not document.baseline.observable:
        return f"{judged} losses judged"
    if not document.critical:
        return f"none of {judged} losses ends observability"
    named = listed([_lost(names) for names in document.critical], MOST_NAMED)
    return f"[red]{len(document.critical)} critical[/] of {judged}: {escape(named)}"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
