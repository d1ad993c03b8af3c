"""A choice of landmark sites as tables for people at a terminal."""

from rich.console import Console
from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.cli.terminal_tables import MOST_ROWS
from syncplan.reports.sites_report import SitesDocument


def show_sites(document: SitesDocument, console: Console) -> None:
    """Print a choice of sites: the verdict, the sites by share, and each vehicle's bound."""
    console.print(
        f"[bold]{escape(document.name or 'sites')}[/]: chosen {escape(', '.join(document.chosen))}"
    )
    proof = "proven best" if document.proven_best else "not proven best"
    console.print(
        f"window bound of the worst vehicle {document.value_m:.4g} m, before "
        f"{_shown(document.before_m)}; no choice below {document.bound_m:.4g} m "
        f"(gap {100.0 * document.gap:.1f} %), {proof}"
    )
    sites = FittedTable(
        "candidates",
        ("site", "position m", "share", "seen by", "chosen"),
        goes=("share", "seen by", "position m"),
    )
    order = sorted(document.candidates, key=lambda site: (not site.chosen, -site.share))
    for site in order[:MOST_ROWS]:
        x, y = site.position_m
        chosen = "[green]yes[/]" if site.chosen else ""
        sites.add_row(
            escape(site.name), f"{x:.5g}, {y:.5g}", f"{site.share:.3f}", str(site.seen_by), chosen
        )
    sites.count_hidden(len(order) - MOST_ROWS)
    console.print(sites)
    bounds = FittedTable("window bound of each vehicle", ("vehicle", "before m", "after m"))
    for vehicle in document.window_bounds[:MOST_ROWS]:
        bounds.add_row(escape(vehicle.name), _shown(vehicle.before_m), f"{vehicle.after_m:.3g}")
    bounds.count_hidden(len(document.window_bounds) - MOST_ROWS)
    console.print(bounds)
    for note in document.notes:
        console.print(f"[yellow]note[/]: {escape(note)}")


def _shown(value: float | None) -> str:
    return "undetermined" if value is None else f"{value:.3g}"
