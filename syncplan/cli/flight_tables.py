"""Flights at a terminal."""

from rich.console import Console
from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.cli.state_tables import found_states_table
from syncplan.cli.terminal_tables import MOST_ROWS, spread_words
from syncplan.cli.verdict_lines import show_findings, show_verdict
from syncplan.phrases import listed, percent
from syncplan.reports.flight_report import FlightDocument, FlightEvent, FlownLink, FlownVehicle

MOST_MISSED = 6
"""Pairs that are named."""


def show_flight(document: FlightDocument, console: Console) -> None:
    """Print a flight: the plan's verdict, errors and phases by vehicle, what happened."""
    show_verdict(document.verdict, console)
    console.print(
        f"[bold]{escape(document.name) or 'flight'}[/]: {document.run}, guidance "
        f"{document.guidance}, filter {document.filter.kind}"
    )
    console.print(_vehicle_table(document))
    states = found_states_table(document)
    if states is not None:
        console.print(states)
    console.print(
        f"filter lost in {percent(document.filter_lost_share)} of the trials, out of contact in "
        f"{percent(document.out_of_contact_share)}; commands at a limit "
        f"{percent(document.saturated_share)} of the time"
    )
    close = document.least_separation_m
    if close is not None:
        console.print(
            f"closest two vehicles: {close.median:.3g} m in the median trial, {close.worst:.3g} m "
            f"in the worst ({escape('-'.join(close.between))} at {close.time_s:.4g} s); the plan "
            f"has {close.planned:.3g} m"
        )
    if document.wind_error_mps is not None:
        console.print(f"wind known to {document.wind_error_mps:.3g} m/s")
    for one in document.events:
        console.print(f"{escape(one.what)}{_settled(one)}")
    _print_missed(document.links, console)
    if document.filter.gate_probability is not None:
        sightings = document.filter.used + document.filter.gated
        console.print(
            f"gate at {document.filter.gate_probability:g}: {document.filter.gated} of {sightings} "
            "sightings rejected"
        )
    console.print(f"ANEES {spread_words(document.anees)}; NIS {spread_words(document.nis)}")
    show_findings(document.verdict, console)
    for note in document.notes:
        console.print(f"[cyan]note[/]: {escape(note)}")


def _settled(event: FlightEvent) -> str:
    """When a vehicle that was held has its phase again, in the median trial."""
    if event.kind != "hold":
        return ""
    if event.settled_s is None:
        return "; not seen in phase for a period after it"
    return f"; in phase again {event.settled_s:.3g} s after"


def _vehicle_table(document: FlightDocument) -> FittedTable:
    table = FittedTable(
        "second half: error of estimates, distance from the plan, phase",
        (
            *("vehicle", "error m", "bound m", "ratio", "off plan m", "phase rms s", "worst s"),
            *("meetings kept", "unseen s"),
        ),
        goes=("unseen s", "worst s", "bound m", "meetings kept"),
    )
    for one in document.vehicles[:MOST_ROWS]:
        table.add_row(escape(one.name), *_cells(one))
    table.count_hidden(len(document.vehicles) - MOST_ROWS)
    return table


def _cells(one: FlownVehicle) -> list[str]:
    kept = "-" if one.meetings_kept is None else percent(one.meetings_kept)
    unseen = f"{one.longest_without_sighting_s:.4g}"
    if one.errors is None or one.phase_error_s is None:
        return ["lost", *["-"] * 5, kept, unseen]
    ratio = one.errors.rms_over_bound
    return [
        f"{one.errors.rms_second_half_m:.3g}",
        f"{one.errors.bound_rms_m:.3g}",
        "-" if ratio is None else f"{ratio:.2f}",
        f"{one.errors.tracking_rms_m:.3g}",
        f"{one.phase_error_s.rms:.3g}",
        f"{one.phase_error_s.worst:.3g}",
        kept,
        unseen,
    ]


def _print_missed(links: list[FlownLink], console: Console) -> None:
    """The pairs that missed some of their meetings, the worst first."""
    missed = sorted((one for one in links if one.kept_share < 1.0), key=lambda one: one.kept_share)
    if missed:
        texts = [f"{'-'.join(one.between)} {percent(one.kept_share)}" for one in missed]
        rest = "; of all others all" if len(missed) < len(links) else ""
        console.print(f"meetings kept: {escape(listed(texts, MOST_MISSED))}{rest}")
