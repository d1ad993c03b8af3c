"""Plans, placements, landmark sites and losses as tables for a terminal."""

import math
from collections.abc import Sequence

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from syncplan.cli.fitted_tables import MOST_ROWS, FittedTable, cell
from syncplan.orbits.lost_parts import phrase_of
from syncplan.phrases import Places, listed, metres, percent
from syncplan.placement.centers import Placement
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.plan_records import FlownPlan
from syncplan.reports.loss_report import RemainingTeam, WhatIfDocument
from syncplan.reports.plan_report import (
    LandmarkLink,
    Link,
    PlanDocument,
    PredictedStateError,
    places_of,
)
from syncplan.reports.refinement_report import RefinementResult
from syncplan.reports.sites_report import SitesDocument
from syncplan.scenario.objectives import ROWS
from syncplan.terms import TERMS

MOST_NAMED = 12
"""Most names in a line."""

COLOURS = {"stop": "red", "warning": "yellow", "note": "cyan"}
"""Colours of the levels of findings."""


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


def flown_line(flight: FlownPlan) -> str:
    """Return the result of flying a plan, in one line."""
    flights = "1 flight" if flight.trials == 1 else f"{flight.trials} flights"
    found = [f"guidance {flight.guidance}"]
    if flight.vehicles:
        squares = sum(one.tracking_rms_m**2 for one in flight.vehicles) / len(flight.vehicles)
        worst = max(flight.vehicles, key=lambda one: one.phase_rms_s)
        found.append(f"{math.sqrt(squares):.3g} m off the plan (RMS)")
        found.append(f"phase at most {worst.phase_rms_s:.3g} s off (RMS, {worst.name})")
    if flight.meetings_kept:
        least = min(flight.meetings_kept, key=lambda one: one.kept_share)
        share, pair = percent(least.kept_share), "-".join(least.between)
        found.append(f"each pair keeps at least {share} of its meetings ({pair})")
    if flight.least_separation_m is not None:
        found.append(f"closest two vehicles {metres(flight.least_separation_m[1], 3)} m")
    if flight.error:
        found.append(f"error {flight.error} m (RMS, 95 % interval)")
    lost = percent(flight.filter_lost_share, flight.filter_lost_interval)
    found.append(f"filter {flight.filter} lost in {lost}")
    return f"flown, {flights} of {flight.duration_s:g} s: {', '.join(found)}"


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
    places = Places([site.position_m for site in document.candidates])
    for site in order[:MOST_ROWS]:
        chosen = "[green]yes[/]" if site.chosen else ""
        sites.add_row(
            escape(site.name),
            places.words(site.position_m),
            f"{site.share:.3f}",
            str(site.seen_by),
            chosen,
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


def show_losses(document: WhatIfDocument, console: Console) -> None:
    """Print the losses that end observability, then the effects of all, the most harmful first."""
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
            cell(one.worst_predicted_rms_m),
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
    """Undetectable motions of the team and changes of estimated errors, in words."""
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
            f"least separation {metres(nearest.min_m)} m, {escape('-'.join(nearest.between))}"
        )
    origin, ground = document.scenario.geo_origin, document.ground
    if origin is not None and ground is not None:
        console.print(
            f"[0, 0] at {origin.lat_deg:.7f}, {origin.lon_deg:.7f}; distances on the flat map and "
            f"on the ground differ by up to {max(ground.map_departure_m, 1e-3):.2g} m"
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
            named = escape(listed(held, MOST_NAMED))
            console.print(f"limits reached (box: how far a centre may move): {named}")
    for term in _terms_in(document):
        console.print(f"[dim]{term}: {TERMS[term].meaning}[/]")
    if document.verdict is not None:
        show_findings(document.verdict, console)


def _terms_in(document: PlanDocument) -> list[str]:
    """Terms of the field in the text of a plan that are not words of everyday engineering."""
    shown = {
        "polish": "polish" in document.synchronisation.method,
        "unlisted": bool(document.incidental_links),
        "window bound": document.refinement is not None,
    }
    return [term for term in shown if shown[term]]


def _print_errors(document: PlanDocument, console: Console) -> None:
    """Print the other states of the filter, and the cost of errors that it does not estimate."""
    if (expected := expected_line(document)) is not None:
        console.print(f"[yellow]{escape(expected)}[/]")
    if (states := further_states_table(document)) is not None:
        console.print(states)


def show_placement(placed: Placement, console: Console) -> None:
    """Print a placement: centres and the gaps between their circles."""
    names = placed.scenario.vehicle_names
    table = FittedTable("centres found", ("vehicle", "centre m"))
    centers = placed.centers.tolist()
    places = Places(centers)
    for name, center in list(zip(names, centers, strict=True))[:MOST_ROWS]:
        table.add_row(escape(name), places.words(center))
    table.count_hidden(len(names) - MOST_ROWS)
    console.print(table)
    if len(placed.gaps):
        console.print(
            f"linked circles are {placed.gaps.min():.4g} to {placed.gaps.max():.4g} m apart"
        )
    if np.isfinite(placed.smallest_gap):
        console.print(f"no two circles are nearer than {placed.smallest_gap:.4g} m")


def _synchronisation(document: PlanDocument) -> str:
    record = document.synchronisation
    if record.smallest_margin_m is None:
        return f"phases: {record.method}"
    bound = "" if record.bound_m is None else f", bound {record.bound_m:.4g} m"
    shares = [one.contact_share for one in document.links if one.contact_share is not None]
    seen = f"; {100.0 * min(shares):.3g} % or more of attainable contact" if shares else ""
    margin = f"smallest margin {metres(record.smallest_margin_m)} m{bound}"
    return f"phases: {record.method}{seen}; {margin}"


def _vehicle_table(document: PlanDocument) -> FittedTable:
    flight = document.flight
    flown = () if flight is None else ("flown m",)
    table = FittedTable(
        f"vehicles at time 0, with the predicted {'and the flown ' if flown else ''}RMS error",
        (
            *("vehicle", "centre m", "R m", "sense", "phase", "speed m/s"),
            *("position m", "heading", "error m", *flown),
        ),
        goes=("heading", "position m", "sense", "R m", "speed m/s", "phase", "centre m"),
    )
    errors = document.predicted_rms_m.vehicles
    places = places_of(document.vehicles)
    for vehicle in document.vehicles[:MOST_ROWS]:
        table.add_row(
            escape(vehicle.name),
            places.words(vehicle.center_m),
            f"{vehicle.radius_m:g}",
            vehicle.direction,
            f"{vehicle.phase_rad:.4f}",
            f"{vehicle.speed_mps:.4g}",
            places.words(vehicle.position_m),
            f"{vehicle.heading_rad:.4f}",
            cell(errors[vehicle.name]),
            *(() if flight is None else (flight.error_of(vehicle.name),)),
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
    for k, (link, rule) in enumerate(rows):
        name = escape(f"{link.a}-{link.b}")
        if k < MOST_ROWS:
            _add_meeting(table, name, rule, link, f"{link.phase_tolerance_rad:.3f}")
        short.setdefault(link.reason, []).append(name)
    for k, seen in enumerate(document.landmark_links):
        name = escape(f"{seen.vehicle}-{seen.landmark}")
        if k < MOST_ROWS:
            _add_meeting(table, name, "landmark", seen, "-")
        short.setdefault(seen.reason, []).append(name)
    hidden = [max(len(one) - MOST_ROWS, 0) for one in (rows, document.landmark_links)]
    table.count_hidden(sum(hidden))
    if table.row_count:
        console.print(table)
    for reason, names in short.items():
        if reason:
            # all that the table can show
            shown = listed(names, 2 * MOST_ROWS)
            console.print(f"[yellow]not certified[/]: {shown}: {reason}")


def _refinement_table(result: RefinementResult) -> FittedTable:
    before, after = result.before, result.after
    table = FittedTable(
        f"refined for {result.objective}, {len(result.starts)} starts", ("", "before", "after")
    )
    for row in ROWS:
        values = (getattr(figures, row.key) for figures in (before, after))
        table.add_row(row.heading, *(_figure(value, row.unit) for value in values))
    return table


def _figure(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "holds" if value else "does not hold"
    return metres(value) if unit == "m" else f"{value:.4g}"


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


def determined_line(document: PlanDocument) -> str | None:
    """Return a line on the rank with errors as states; None if there are no such states."""
    found, states = document.observability.extended, document.observability.states
    if found is None or states is None:
        return None
    lacking = [one.state for one in states if not one.determined]
    rest = f"; without priors not determined: {', '.join(lacking)}" if lacking else ""
    return f"with errors as states: rank {found.rank} of {found.state_dim}{rest}"


def expected_line(document: PlanDocument) -> str | None:
    """Return a line on the error to expect if the filter leaves errors out; None if it does not."""
    expected = document.expected_rms_m
    if expected is None or expected.overall is None:
        return None
    own = document.predicted_rms_m.overall
    beside = "" if own is None else f" where the filter predicts {own:.3g} m"
    return (
        f"expected RMS error {expected.overall:.3g} m over all vehicles{beside}: some errors are "
        "not estimated"
    )


def merits_line(document: PlanDocument) -> str | None:
    """Return a line on states that a refinement's figures leave out; None if there are none."""
    if document.refinement is None or document.observability.extended is None:
        return None
    return (
        "rank, window bound, determinant, eigenvalue and trace are of the poses, as if all else "
        "were known; predicted errors are of all states"
    )


def further_states_table(document: PlanDocument) -> FittedTable | None:
    """Return the table of predicted errors of states beside the poses; None if there are none."""
    states = document.predicted_errors
    if not states:
        return None
    table = FittedTable(
        f"errors that the filter estimates, with the predicted RMS error{_supposed(states)}",
        ("state", "unit", "sigma at start", "error"),
    )
    for one in states[:MOST_ROWS]:
        table.add_row(escape(one.state), one.unit, f"{one.sigma:.4g}", f"{one.predicted_rms:.3g}")
    table.count_hidden(len(states) - MOST_ROWS)
    return table


def _supposed(states: Sequence[PredictedStateError]) -> str:
    """Assumption of the predictions if wind is a state: in wind, it is known less well."""
    windy = any(one.state.startswith("wind ") for one in states)
    return "; predictions suppose still air" if windy else ""
