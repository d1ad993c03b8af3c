"""Validations, sweeps, flights and replays as tables for a terminal."""

import numpy as np
from rich.console import Console
from rich.markup import escape

from syncplan.cli.fitted_tables import MOST_ROWS, FittedTable, cell
from syncplan.cli.plan_tables import show_findings, show_verdict
from syncplan.phrases import listed, percent
from syncplan.planning.plan_records import Interval
from syncplan.reports import run_figures
from syncplan.reports.flight_report import (
    FlightDocument,
    FlightEvent,
    FlownLink,
    FlownStateError,
    FlownVehicle,
)
from syncplan.reports.replay_report import ReplayDocument
from syncplan.reports.validation_report import SweepReport, ValidationDocument
from syncplan.scenario.dotted_keys import swept_key
from syncplan.scenario.filters import FORMER_NAMES


def _filter_line(record: run_figures.FilterRecord) -> str:
    """The filter that ran, and why it was chosen."""
    name = record.kind or FORMER_NAMES[record.model]
    why = f" ({record.chosen_because})" if record.chosen_because else ""
    return escape(f"filter {name}{why}")


def show_validation(report: ValidationDocument, console: Console) -> None:
    """Print a Monte Carlo report: verdict, errors, consistency, findings."""
    if report.verdict is not None:
        show_verdict(report.verdict, console)
    console.print(
        f"[bold]{escape(report.name or 'plan')}[/]: {report.run}, {_filter_line(report.filter)}"
    )
    table = FittedTable(
        "RMS error in m over the run and over its second half, and its median trial",
        ("vehicle", "x", "y", "total", "2nd half", "median", "bound", "ratio", "3 sigma"),
        goes=("x", "y", "3 sigma", "total", "ratio", "median"),
    )
    for vehicle in report.vehicles[:MOST_ROWS]:
        table.add_row(escape(vehicle.name), *_figures(vehicle))
    table.count_hidden(len(report.vehicles) - MOST_ROWS)
    table.add_section()
    table.add_row("overall", *_figures(report.overall))
    console.print(table)
    overall = report.overall
    _print_overall(
        overall, overall.rms_over_predicted, overall.rms_over_predicted_interval, console
    )
    further = found_states_table(report)
    if further is not None:
        console.print(further)
    worlds = stress_table(report)
    if worlds is not None:
        console.print(worlds)
    far, lost = overall.share_over_3_predicted, overall.share_over_10_predicted
    if far is not None and lost is not None:
        console.print(
            "trials with a vehicle off by over 3 times the bound "
            f"{percent(far, overall.share_over_3_predicted_interval)}, over 10 times "
            f"{percent(lost, overall.share_over_10_predicted_interval)}"
        )
    console.print(f"ANEES {spread_words(report.anees)}")
    console.print(f"NIS   {spread_words(report.nis)}")
    if report.verdict is not None:
        show_findings(report.verdict, console)
    for note in report.notes:
        console.print(f"[yellow]note[/]: {escape(note)}")


def show_sweep(report: SweepReport, console: Console) -> None:
    """Print a sweep: errors in x (p_e) and y (p_n) of each vehicle, then means over vehicles."""
    name = swept_key(report.swept).heading
    labels, reports = [row.label for row in report.rows], [row.validation for row in report.rows]
    each = FittedTable(
        f"RMS error over the run, p_n/p_e in m, by {name}",
        ("vehicle", *(label.partition(",")[0] for label in labels)),
    )
    longest = max((one.vehicles for one in reports), key=len)
    for k, vehicle in enumerate(longest[:MOST_ROWS]):
        cells = (one.vehicles[k] if k < len(one.vehicles) else None for one in reports)
        texts = ("-" if f is None else f"{f.rms_y_m:.2f}/{f.rms_x_m:.2f}" for f in cells)
        each.add_row(escape(vehicle.name), *texts)
    each.count_hidden(len(longest) - MOST_ROWS)
    console.print(each)
    means = FittedTable(
        "means over the vehicles, m",
        (name, "p_n", "p_e", "2nd half", "95 %", "bound", "ANEES", "rank"),
        goes=("rank", "p_n", "p_e", "ANEES"),
    )
    for label, one in zip(labels, reports, strict=True):
        means.add_row(
            label,
            f"{np.mean([v.rms_y_m for v in one.vehicles]):.2f}",
            f"{np.mean([v.rms_x_m for v in one.vehicles]):.2f}",
            f"{one.overall.rms_second_half_m:.2f}",
            _ends(one.overall.rms_second_half_interval_m, ".2f"),
            cell(one.overall.predicted_rms_m, ".2f"),
            cell(one.anees.value, ".2f"),
            "full" if one.observable else "short",
        )
    console.print(means)


def _print_overall(
    errors: run_figures.Errors, ratio: float | None, interval: Interval | None, console: Console
) -> None:
    """Print the RMS error over all vehicles, second half, and its ratio, if they have intervals."""
    if errors.rms_second_half_interval_m is None:
        return
    text = (
        f"all vehicles: {errors.rms_second_half_m:.3g} m (95 % interval "
        f"{_ends(errors.rms_second_half_interval_m)})"
    )
    if ratio is not None and interval is not None:
        text += f", ratio {ratio:.3g} ({_ends(interval)})"
    console.print(text)


def _ends(interval: Interval | None, form: str = ".3g") -> str:
    """Ends of an interval, a dash if there is none."""
    return "-" if interval is None else " to ".join(format(end, form) for end in interval)


def _figures(figures: run_figures.ErrorFigures) -> list[str]:
    return [
        f"{figures.rms_x_m:.3g}",
        f"{figures.rms_y_m:.3g}",
        f"{figures.rms_m:.3g}",
        f"{figures.rms_second_half_m:.3g}",
        cell(figures.median_rms_second_half_m),
        cell(figures.predicted_rms_m),
        cell(figures.rms_over_predicted, ".2f"),
        f"{100.0 * figures.coverage_3sigma:.1f} %",
    ]


def spread_words(spread: run_figures.Spread) -> str:
    """Return a consistency figure with its verdict in colour."""
    colours = {"consistent": "green", "unknown": "yellow"}
    colour = colours.get(spread.verdict, "red")
    return f"{run_figures.interval_words(spread)}: [{colour}]{run_figures.verdict_words(spread)}[/]"


def stress_table(report: ValidationDocument) -> FittedTable | None:
    """Return the table of worlds worse than stated, the most harmful first; None without any."""
    if not report.stress:
        return None
    table = FittedTable(
        "RMS error in m over the second half in worse worlds",
        ("world", "2nd half", "harm", "expected", "ANEES"),
        goes=("expected", "ANEES"),
    )
    for one in report.stress:
        table.add_row(
            escape(one.world),
            f"{one.rms_second_half_m:.3g}",
            f"{one.harm:.2f}",
            cell(one.expected_rms_m),
            cell(one.anees.value, ".2f"),
        )
    return table


MOST_MISSED = 6
"""Most pairs named."""


def show_flight(document: FlightDocument, console: Console) -> None:
    """Print a flight: the plan's verdict, errors and phases by vehicle, events."""
    show_verdict(document.verdict, console)
    console.print(
        f"[bold]{escape(document.name) or 'flight'}[/]: {document.run}, guidance "
        f"{document.guidance}, filter {document.filter.kind}"
    )
    console.print(_vehicle_table(document))
    overall = document.overall
    _print_overall(overall, overall.rms_over_bound, overall.rms_over_bound_interval, console)
    states = found_states_table(document)
    if states is not None:
        console.print(states)
    console.print(
        "filter lost in "
        f"{percent(document.filter_lost_share, document.filter_lost_interval)} of the trials, out "
        "of contact in "
        f"{percent(document.out_of_contact_share, document.out_of_contact_interval)}; commands at "
        "a limit "
        f"{percent(document.saturated_share)} of the time"
    )
    close = document.least_separation_m
    if close is not None:
        below = (
            ""
            if close.below_asked_share is None
            else "; nearer than asked in "
            f"{percent(close.below_asked_share, close.below_asked_interval)} of the trials"
        )
        console.print(
            f"closest two vehicles: {close.median:.3g} m in the median trial, {close.worst:.3g} m "
            f"in the worst ({escape('-'.join(close.between))} at {close.time_s:.4g} s); the plan "
            f"has {close.planned:.3g} m{below}"
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
    """Time until a held vehicle is in phase again in the median trial, in words."""
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
    return [
        f"{one.errors.rms_second_half_m:.3g}",
        f"{one.errors.bound_rms_m:.3g}",
        cell(one.errors.rms_over_bound, ".2f"),
        f"{one.errors.tracking_rms_m:.3g}",
        f"{one.phase_error_s.rms:.3g}",
        f"{one.phase_error_s.worst:.3g}",
        kept,
        unseen,
    ]


def _print_missed(links: list[FlownLink], console: Console) -> None:
    """Print the pairs that missed some of their meetings, the worst first."""
    missed = sorted((one for one in links if one.kept_share < 1.0), key=lambda one: one.kept_share)
    if missed:
        texts = [f"{'-'.join(one.between)} {percent(one.kept_share)}" for one in missed]
        rest = "; of all others all" if len(missed) < len(links) else ""
        console.print(f"meetings kept: {escape(listed(texts, MOST_MISSED))}{rest}")


def show_replay(report: ReplayDocument, console: Console) -> None:
    """Print the report of a replay."""
    found = "no truth, so errors are not known"
    if report.has_errors:
        found = (
            f"position {report.position_rmse_m:.3f} m, heading {report.heading_rmse_rad:.3f} rad "
            "RMS over all robots"
        )
    console.print(f"[bold]{escape(report.name)}[/]: {report.run}; {found}")
    for name, counts in (("bearings", report.readings), ("distances", report.distances)):
        if counts is not None:
            console.print(
                f"{name}: {counts.used} used, {counts.rejected} rejected by the gate, "
                f"{counts.unknown} of unknown targets, {counts.not_asked_for} not asked for, "
                f"{counts.outside} outside the run"
            )
    table = _errors(report) if report.has_errors else _estimates(report)
    table.count_hidden(len(report.robots) - MOST_ROWS)
    console.print(table)
    if (seen := report.observability) is not None:
        console.print(
            f"observable over the last {seen.window_s:g} s during {seen.observable_s:.1f} of "
            f"{seen.judged_s:.1f} s, certified during {seen.certified_s:.1f} s; longest gap "
            f"{seen.longest_gap_s:.1f} s"
        )
    _print_tuning(report, console)
    _print_lasting_errors(report, console)
    if report.anees is not None:
        console.print(f"ANEES {spread_words(report.anees)}")
    console.print(f"NIS   {spread_words(report.nis)}")
    for note in report.notes:
        console.print(f"[yellow]note[/]: {escape(note)}")


def _errors(report: ReplayDocument) -> FittedTable:
    table = FittedTable(
        "RMS error in m over the run, and over its second half",
        ("robot", "x", "y", "position", "2nd half", "heading rad", "3 sigma"),
        goes=("x", "y", "3 sigma", "2nd half"),
    )
    for robot in report.robots[:MOST_ROWS]:
        values = (robot.rms_x_m, robot.rms_y_m, robot.rms_m, robot.rms_second_half_m)
        table.add_row(
            escape(robot.name),
            *(cell(value, ".3f") for value in (*values, robot.rms_heading_rad)),
            cell(robot.coverage_3sigma, ".4f"),
        )
    table.count_hidden(len(report.robots) - MOST_ROWS)
    return table


def _estimates(report: ReplayDocument) -> FittedTable:
    table = FittedTable(
        "estimate at the end in m, and the filter's own sigmas",
        ("robot", "x", "y", "heading rad", "sigma", "sigma rad", "RMS sigma over the run"),
        goes=("sigma rad", "RMS sigma over the run", "heading rad"),
    )
    for robot in report.robots[:MOST_ROWS]:
        pose = (robot.final_x_m, robot.final_y_m, robot.final_heading_rad)
        sigmas = (robot.final_sigma_m, robot.final_sigma_heading_rad, robot.rms_sigma_m)
        table.add_row(escape(robot.name), *(f"{value:.3f}" for value in (*pose, *sigmas)))
    table.count_hidden(len(report.robots) - MOST_ROWS)
    return table


def _print_tuning(report: ReplayDocument, console: Console) -> None:
    if report.tuning is None:
        return
    before, after = report.tuning.before.as_json(), report.tuning.after.as_json()
    refused = "" if report.tuning.accepted is not False else ", and refused"
    table = FittedTable(
        f"fitted to the first {report.tuning.fitted_s:.1f} s{refused}",
        ("assumed", "before", "after"),
    )
    for key in after | before:
        values = (before.get(key), after.get(key))
        table.add_row(key, *("" if one is None else f"{one:.4g}" for one in values))
    console.print(table)


def _print_lasting_errors(report: ReplayDocument, console: Console) -> None:
    found = report.lasting_errors or []
    names = list(dict.fromkeys(one.name for one in found))
    if not names:
        return
    units = {one.name: "" if one.unit == "1" else f" {one.unit}" for one in found}
    heads = [f"{name.replace('_', ' ')}{units[name]}" for name in names]
    table = FittedTable("lasting errors at the end, with their sigmas", ("robot", *heads))
    for robot in report.robots[:MOST_ROWS]:
        own = [one for one in found if one.robot == robot.name]
        table.add_row(escape(robot.name), *(f"{one.value:.4f} ± {one.sigma:.4f}" for one in own))
    table.count_hidden(len(report.robots) - MOST_ROWS)
    console.print(table)


def found_states_table(report: FlightDocument | ValidationDocument) -> FittedTable | None:
    """Return the table of the trials' errors of states beside the poses; None if there are none."""
    if not report.errors:
        return None
    table = FittedTable(
        "RMS error of what else the filter estimates, over the run and over its second half",
        ("state", "unit", "total", "2nd half", "bound", "ratio", "3 sigma"),
        goes=("3 sigma", "total", "ratio"),
    )
    for one in report.errors[:MOST_ROWS]:
        table.add_row(
            escape(one.state),
            one.unit,
            f"{one.rms:.3g}",
            f"{one.rms_second_half:.3g}",
            cell(one.bound_rms if isinstance(one, FlownStateError) else one.predicted_rms),
            cell(one.ratio, ".2f"),
            f"{100.0 * one.coverage:.1f} %",
        )
    table.count_hidden(len(report.errors) - MOST_ROWS)
    return table
