"""Tables for people at a terminal."""

import numpy as np
from rich.console import Console
from rich.markup import escape

from syncplan.cli.fitted_tables import FittedTable
from syncplan.cli.flown_lines import flown_line
from syncplan.cli.state_tables import (
    determined_line,
    expected_line,
    found_states_table,
    further_states_table,
    merits_line,
)
from syncplan.cli.stress_tables import stress_table
from syncplan.cli.verdict_lines import show_findings, show_verdict
from syncplan.estimation.filters import FORMER_NAMES
from syncplan.phrases import listed
from syncplan.placement.centers import Placement
from syncplan.reports.plan_report import LandmarkLink, Link, PlanDocument
from syncplan.reports.refinement_report import RefinementResult
from syncplan.reports.run_figures import (
    ErrorFigures,
    FilterRecord,
    Spread,
    interval_words,
    verdict_words,
)
from syncplan.reports.validation_report import SweepReport, ValidationDocument
from syncplan.scenario.dotted_keys import swept_key
from syncplan.scenario.objectives import ROWS

MOST_ROWS = 40
MOST_NAMED = 12


def show_plan(document: PlanDocument, console: Console) -> None:
    """Print a plan: verdict, poses, meetings, findings."""
    if document.verdict is not None:
        show_verdict(document.verdict, console)
    verdict = document.observability
    state = "[green]observable[/]" if verdict.observable else "[red]NOT observable[/]"
    console.print(
        f"[bold]{escape(document.scenario.name or 'plan')}[/]: {state}, rank {verdict.rank} of "
        f"{verdict.state_dim}; period {document.period_s:.4g} s"
    )
    if (determined := determined_line(document)) is not None:
        console.print(escape(determined))
    holds = "holds" if verdict.certificate.holds else "does not hold"
    console.print(f"certificate {holds}: {escape(verdict.certificate.reason)}")
    if document.connectivity_period_s is not None:
        console.print(
            f"any {document.connectivity_period_s:.4g} s of sightings certify the team "
            "(connectivity period)"
        )
    nearest = document.separation
    if nearest.min_m is not None and nearest.between is not None:
        console.print(
            f"least separation {nearest.min_m:.4g} m, {escape('-'.join(nearest.between))}"
        )
    if document.flight is not None:
        console.print(escape(flown_line(document.flight)))
    console.print(_synchronisation(document))
    console.print(_vehicle_table(document))
    _print_errors(document, console)
    _print_links(document, console)
    if document.refinement is not None:
        console.print(_refinement_table(document.refinement))
        if (merits := merits_line(document)) is not None:
            console.print(merits)
        held = document.refinement.active_constraints
        if held:
            console.print(f"held by: {escape(listed(held, MOST_NAMED))}")
    if document.verdict is not None:
        show_findings(document.verdict, console)


def _print_errors(document: PlanDocument, console: Console) -> None:
    """What else the filter estimates, and what the errors cost that it does not."""
    if (expected := expected_line(document)) is not None:
        console.print(f"[yellow]{escape(expected)}[/]")
    if (states := further_states_table(document)) is not None:
        console.print(states)


def _filter_line(record: FilterRecord) -> str:
    """Which filter ran, and why."""
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
    table.add_section()
    table.add_row("overall", *_figures(report.overall))
    console.print(table)
    further = found_states_table(report)
    if further is not None:
        console.print(further)
    worlds = stress_table(report)
    if worlds is not None:
        console.print(worlds)
    far, lost = report.overall.share_over_3_predicted, report.overall.share_over_10_predicted
    if far is not None and lost is not None:
        console.print(
            f"trials with a vehicle off by over 3 times the bound {100.0 * far:.3g} %, "
            f"over 10 times {100.0 * lost:.3g} %"
        )
    console.print(f"ANEES {spread_words(report.anees)}")
    console.print(f"NIS   {spread_words(report.nis)}")
    if report.verdict is not None:
        show_findings(report.verdict, console)
    for note in report.notes:
        console.print(f"[yellow]note[/]: {escape(note)}")


def show_placement(placed: Placement, console: Console) -> None:
    """Print a placement: centres and what they attain."""
    names = placed.scenario.vehicle_names
    table = FittedTable("centres found", ("vehicle", "centre m"))
    for name, center in list(zip(names, placed.centers.tolist(), strict=True))[:MOST_ROWS]:
        table.add_row(escape(name), _point((center[0], center[1])))
    table.count_hidden(len(names) - MOST_ROWS)
    console.print(table)
    if len(placed.gaps):
        console.print(
            f"linked circles are {placed.gaps.min():.4g} to {placed.gaps.max():.4g} m apart"
        )
    if np.isfinite(placed.smallest_gap):
        console.print(f"no two circles are nearer than {placed.smallest_gap:.4g} m")


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
    console.print(each)
    means = FittedTable(
        "means over the vehicles, m",
        (name, "p_n", "p_e", "2nd half", "bound", "ANEES", "rank"),
        goes=("rank", "p_n", "p_e", "ANEES"),
    )
    for label, one in zip(labels, reports, strict=True):
        bound = one.overall.predicted_rms_m
        means.add_row(
            label,
            f"{np.mean([v.rms_y_m for v in one.vehicles]):.2f}",
            f"{np.mean([v.rms_x_m for v in one.vehicles]):.2f}",
            f"{one.overall.rms_second_half_m:.2f}",
            "-" if bound is None else f"{bound:.2f}",
            "-" if one.anees.value is None else f"{one.anees.value:.2f}",
            "full" if one.observable else "short",
        )
    console.print(means)


def _synchronisation(document: PlanDocument) -> str:
    record = document.synchronisation
    if record.smallest_margin_m is None:
        return f"phases: {record.method}"
    bound = "" if record.bound_m is None else f", bound {record.bound_m:.4g} m"
    shares = [one.contact_share for one in document.links if one.contact_share is not None]
    seen = f"; {100.0 * min(shares):.3g} % or more of attainable contact" if shares else ""
    return f"phases: {record.method}{seen}; smallest margin {record.smallest_margin_m:.4g} m{bound}"


def _vehicle_table(document: PlanDocument) -> FittedTable:
    table = FittedTable(
        "vehicles at time 0, with the predicted RMS error",
        (
            *("vehicle", "centre m", "R m", "sense", "phase", "speed m/s"),
            *("position m", "heading", "error m"),
        ),
        goes=("heading", "position m", "sense", "R m", "speed m/s", "phase", "centre m"),
    )
    errors = document.predicted_rms_m.vehicles
    for vehicle in document.vehicles[:MOST_ROWS]:
        error = errors[vehicle.name]
        table.add_row(
            escape(vehicle.name),
            _point(vehicle.center_m),
            f"{vehicle.radius_m:g}",
            vehicle.direction,
            f"{vehicle.phase_rad:.4f}",
            f"{vehicle.speed_mps:.4g}",
            _point(vehicle.position_m),
            f"{vehicle.heading_rad:.4f}",
            "-" if error is None else f"{error:.3g}",
        )
    table.count_hidden(len(document.vehicles) - MOST_ROWS)
    return table


def _print_links(document: PlanDocument, console: Console) -> None:
    table = FittedTable(
        "meetings, once a period",
        ("link", "rule", "closest m", "contact s", "from s", "tolerance rad", "rank"),
        goes=("from s", "tolerance rad", "rule", "contact s", "closest m"),
        texts=("rule",),
    )
    short: dict[str, list[str]] = {}
    rows: list[tuple[Link, str]] = [(link, link.rule) for link in document.links]
    rows += [(link, f"{link.rule}, unlisted") for link in document.incidental_links]
    for link, rule in rows[:MOST_ROWS]:
        name = escape(f"{link.a}-{link.b}")
        _add_meeting(table, name, rule, link, f"{link.phase_tolerance_rad:.3f}")
        short.setdefault(link.reason, []).append(name)
    for seen in document.landmark_links[:MOST_ROWS]:
        name = escape(f"{seen.vehicle}-{seen.landmark}")
        _add_meeting(table, name, "landmark", seen, "-")
        short.setdefault(seen.reason, []).append(name)
    table.count_hidden(len(rows) - MOST_ROWS)
    if table.row_count:
        console.print(table)
    for reason, names in short.items():
        if reason:
            console.print(f"[yellow]not certified[/]: {', '.join(names)}: {reason}")


def _refinement_table(result: RefinementResult) -> FittedTable:
    before, after = result.before, result.after
    table = FittedTable(
        f"refined for {result.objective}, {len(result.starts)} starts", ("", "before", "after")
    )
    for row in ROWS:
        table.add_row(row.heading, *(_figure(getattr(one, row.key)) for one in (before, after)))
    return table


def _figure(value: float | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "holds" if value else "does not hold"
    return f"{value:.4g}"


def _add_meeting(
    table: FittedTable, name: str, rule: str, meeting: Link | LandmarkLink, slip: str
) -> None:
    table.add_row(
        name,
        rule,
        f"{meeting.min_distance_m:.2f}",
        f"{meeting.contact_s:.2f}",
        f"{meeting.windows_s[0][0]:.2f}" if meeting.windows_s else "-",
        slip,
        str(meeting.rank),
    )


def _figures(figures: ErrorFigures) -> list[str]:
    predicted, ratio = figures.predicted_rms_m, figures.rms_over_predicted
    median = figures.median_rms_second_half_m
    return [
        f"{figures.rms_x_m:.3g}",
        f"{figures.rms_y_m:.3g}",
        f"{figures.rms_m:.3g}",
        f"{figures.rms_second_half_m:.3g}",
        "-" if median is None else f"{median:.3g}",
        "-" if predicted is None else f"{predicted:.3g}",
        "-" if ratio is None else f"{ratio:.2f}",
        f"{100.0 * figures.coverage_3sigma:.1f} %",
    ]


def spread_words(spread: Spread) -> str:
    """Return a consistency figure with its verdict in colour."""
    colours = {"consistent": "green", "unknown": "yellow"}
    colour = colours.get(spread.verdict, "red")
    return f"{interval_words(spread)}: [{colour}]{verdict_words(spread)}[/]"


def _point(point: tuple[float, float]) -> str:
    # zero where rounding errors are all there is, and never "-0"
    x, y = (round(value, 9) + 0.0 for value in point)
    return f"{x:.5g}, {y:.5g}"
