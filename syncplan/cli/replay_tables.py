"""Replays as tables for a terminal."""

from rich.console import Console
from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.cli.terminal_tables import MOST_ROWS, spread_words
from syncplan.reports.replay_report import ReplayDocument


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
            *(f"{value:.3f}" for value in values),
            f"{robot.rms_heading_rad:.3f}",
            f"{robot.coverage_3sigma:.4f}",
        )
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
