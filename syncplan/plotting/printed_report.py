"""A plan as one printed sheet: map, verdict, vehicles and assumptions on a page of HTML.

The page holds no script and fetches nothing. Its one style never changes, so that a strict content
security policy can allow it by STYLE_DIGEST.
"""

import base64
import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, date, datetime
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any, get_args

from syncplan import __version__
from syncplan.observability.sliding_windows import SEARCHED_PERIODS
from syncplan.phrases import in_words, listed, metres
from syncplan.planning.judged_team import Level
from syncplan.planning.plans import Plan
from syncplan.plotting.figure_style import DARK, FigureStyle
from syncplan.plotting.formation_figures import formation_spec
from syncplan.plotting.static_map import legend_entries, map_svg
from syncplan.reports.plan_report import PlanDocument, VehicleOrbit, places_of, plan_document
from syncplan.scenario.dotted_keys import numeric_keys
from syncplan.scenario.specification import Scenario

MOST_LISTED = 50
"""Most vehicles whose rows fit on a sheet; larger teams are described in a sentence."""

_ROWS = 18
"""Most rows of each part of the table; the parts stand side by side."""

_MOST_FINDINGS = 5
_FINDING_ROWS = 3
"""Findings that are stated, and the rows that one takes the room of."""

_MOST_LANDMARKS = 6
_MAP_PX = 460

_SUPPOSED = {
    "sensor": "Sensor",
    "heading": "Compass",
    "motion": "Motion readings",
    "wind.": "Wind",
    "initial_sigma": "Start",
    "duration_s": "Horizon",
    "window_s": "Horizon",
}
"""Beginnings of the keys that the figures rest on, and what they are about."""

_ASIDE = re.compile(r";|, (?:in|a multiple of|one value)")
"""Begins what a default, a unit or an alternative would be: that is for the scenario's author."""


def report_page(plan: Plan, *, identifier: str = "", made_on: date | None = None) -> str:
    """Return a plan's report as HTML that prints on one sheet of A4 or Letter paper.

    `identifier` names the plan, as the service or its file does; `made_on` is the date on the
    report, today's in UTC if not given. The same arguments give the same text.
    """
    document = plan_document(plan)
    scenario, verdict = plan.scenario, plan.verdict
    day = made_on or datetime.now(UTC).date()
    title = escape(scenario.name or "Plan")
    named = [f"{day:%-d %B %Y}", f"syncplan {__version__}", *([identifier] if identifier else [])]
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}: report</title>
<style>{style()}</style>
</head>
<body{' class="dense"' if _is_long(plan) else ""}>
<header><h1>{title}</h1><p>{escape(" · ".join(named))}</p></header>
<main>
<p class="verdict{" go" if verdict.go else ""}">{escape(_verdict_sentence(document))}</p>
{_findings(plan)}{_map(plan)}
<section aria-labelledby="facts"><h2 id="facts">Facts</h2><dl class="facts">
{_pairs(_facts(document))}</dl></section>
{_vehicles(document)}
<section aria-labelledby="assumptions"><h2 id="assumptions">Assumptions of these figures</h2>
<p>{escape(_premise(plan))}</p>
<ul class="terms">
{_terms(scenario)}</ul></section>
</main>
</body>
</html>
"""


def _is_long(plan: Plan) -> bool:
    """Whether the report fills the sheet in smaller print only."""
    findings = min(len(plan.verdict.findings), _MOST_FINDINGS)
    return plan.orbits.count + _FINDING_ROWS * findings > _ROWS


@cache
def style() -> str:
    """Return the style of every report; on a dark screen, its map has the colours of DARK."""
    swapped = "".join(
        f'  [{part}="{light}"] {{ {part}: {dark}; }}\n'
        for light, dark in DARK.items()
        for part in ("stroke", "fill")
    )
    text = files(__package__).joinpath("printed_report.css").read_text("utf-8")
    return f"\n{text}{swapped}}}\n"


STYLE_DIGEST = f"'sha256-{base64.b64encode(hashlib.sha256(style().encode()).digest()).decode()}'"
"""Digest of the style, as content security policies name it."""

POLICY = f"default-src 'none'; style-src {STYLE_DIGEST}"
"""Content security policy of a report: nothing but its own style."""


def _verdict_sentence(document: PlanDocument) -> str:
    """The verdict, with the worst predicted error or the reason against the flight."""
    verdict, seen = document.verdict, document.observability
    assert verdict is not None
    known = [one for one in document.predicted_rms_m.vehicles.values() if one is not None]
    count = len(document.vehicles)
    if not verdict.go:
        why = "" if seen.observable else "; not every position and heading can be known"
        return f"✗ {verdict.headline}{why}"
    team = "1 vehicle knows where it is" if count == 1 else f"{count} vehicles know where they are"
    return f"✓ {verdict.headline}; {team}" + (f" to {max(known):.2g} m" if known else "")


def _findings(plan: Plan) -> str:
    """The findings, the gravest first, each with its cure; those beyond a few are counted."""
    order = get_args(Level)
    found = sorted(plan.verdict.findings, key=lambda one: order.index(one.level))
    items = [
        f"<li><strong>{one.level.capitalize()}:</strong> {escape(one.message)}"
        + (f" <strong>Cure:</strong> {escape(one.cure.text)}" if one.cure else "")
        + "</li>\n"
        for one in found[:_MOST_FINDINGS]
    ]
    if len(found) > _MOST_FINDINGS:
        items.append(f"<li>{len(found) - _MOST_FINDINGS} more: the plan lists them</li>\n")
    return f'<ul class="findings">\n{"".join(items)}</ul>\n' if items else ""


def _map(plan: Plan) -> str:
    spec = formation_spec(plan, FigureStyle(width=_MAP_PX))
    width = FigureStyle(width=_MAP_PX).plot_px
    count, marks = plan.orbits.count, len(plan.landmarks)
    label = f"Map of {count} circles, {len(plan.links)} links and {marks} landmarks"
    legend = "".join(f"<li>{swatch}{words}</li>\n" for swatch, words in legend_entries(spec))
    return (
        f'<div class="room">{map_svg(spec, width, label)}</div>\n'
        f'<ul class="legend" aria-label="Legend">\n{legend}</ul>'
    )


# --- facts ----------------------------------------------------------------------------------------


def _pairs(facts: Iterable[tuple[str, str, str]]) -> str:
    return "".join(
        f"<div><dt>{name}:</dt><dd><strong>{escape(value)}</strong>"
        + (f'<span class="soft">, {escape(remark)}</span>' if remark else "")
        + "</dd></div>\n"
        for name, value, remark in facts
    )


def _not_connected(document: PlanDocument) -> str:
    """Reason in words why there is no connectivity period."""
    short = document.scenario.duration_s < SEARCHED_PERIODS * document.period_s
    return "none within the run" if short else "never connected"


def _facts(document: PlanDocument) -> Iterator[tuple[str, str, str]]:
    """Yield each fact: its name, its value and a remark."""
    seen, nearest, predicted = (
        document.observability,
        document.separation,
        document.predicted_rms_m,
    )
    yield (
        "Rank",
        f"{seen.rank} of {seen.state_dim}",
        f"{'observable' if seen.observable else 'not observable'}, over {seen.window_s:.4g} s",
    )
    holds = "holds" if seen.certificate.holds else "does not hold"
    yield "Certificate", holds, seen.certificate.reason
    yield "Period", f"{document.period_s:.4g} s", f"phases {document.synchronisation.method}"
    connected = document.connectivity_period_s
    yield (
        "Connectivity period",
        _not_connected(document) if connected is None else f"{connected:.4g} s",
        "sightings of so long certify the team" if connected is not None else "",
    )
    yield "Predicted RMS error, all vehicles", _metres(predicted.overall, 3), predicted.note
    known = {name: value for name, value in predicted.vehicles.items() if value is not None}
    if known:
        worst = max(known, key=lambda name: known[name])
        yield "Worst vehicle", f"{_metres(known[worst], 3)}, {worst}", ""
    flight = document.flight
    if flight is not None and flight.error:
        flown = f"95 % interval, {flight.trials} flights, filter {flight.filter}"
        yield "Flown RMS error, all vehicles", f"{flight.error} m", flown
    if document.expected_rms_m is not None:
        yield (
            "Expected RMS error",
            _metres(document.expected_rms_m.overall, 3),
            "with errors that the filter does not estimate",
        )
    if nearest.between is not None:
        required = f"required {nearest.required_m:g} m" if nearest.required_m else ""
        least = f"{_metres(nearest.min_m, 4)}, {'-'.join(nearest.between)}"
        yield "Least separation", least, required
    if document.scenario.landmarks:
        words = places_of(document.vehicles).words
        places = [
            f"{name} ({words(place)})"
            for name, place in zip(
                document.scenario.landmark_names, document.scenario.landmarks, strict=True
            )
        ]
        yield "Landmarks, m", listed(places, _MOST_LANDMARKS), ""
    origin = document.scenario.geo_origin
    if origin is not None:
        place = f"{origin.lat_deg:.7g}°, {origin.lon_deg:.7g}°, {origin.alt_m:g} m"
        yield "Place of 0, 0: latitude, longitude, altitude", place, ""
    if document.scenario.start_time is not None:
        yield "Time 0", str(document.scenario.start_time), ""


def _metres(value: float | None, digits: int) -> str:
    return "unknown" if value is None else f"{metres(value, digits)} m"


# --- vehicles -------------------------------------------------------------------------------------


_COLUMNS = ("vehicle", "centre m", "radius m", "sense", "phase rad", "error m")


def _vehicles(document: PlanDocument) -> str:
    """The table of vehicles, in two parts if it is long, or a sentence on a large team."""
    rows, errors = document.vehicles, document.predicted_rms_m.vehicles
    heading = '<h2 id="vehicles">Vehicles at time 0, with the predicted RMS error</h2>'
    if len(rows) > MOST_LISTED:
        return (
            f'<section aria-labelledby="vehicles">{heading}\n'
            f"<p>{_summary(rows, errors)}</p></section>"
        )
    parts = -(-len(rows) // _ROWS)
    size = -(-len(rows) // parts)
    tables = "\n".join(
        _table(rows[first : first + size], errors) for first in range(0, len(rows), size)
    )
    return (
        f'<section aria-labelledby="vehicles">{heading}\n<div class="tables">\n{tables}</div>'
        "</section>"
    )


def _summary(rows: Sequence[VehicleOrbit], errors: dict[str, float | None]) -> str:
    turning = sum(one.direction == "ccw" for one in rows)
    known = [value for value in errors.values() if value is not None]
    found = f", predicted errors {_span(known)} m" if known else ""
    return (
        f"{len(rows)} vehicles, {turning} of them counter-clockwise: radii "
        f"{_span([one.radius_m for one in rows])} m{found}. The plan lists each."
    )


def _span(values: Sequence[float]) -> str:
    least, most = (f"{one:.3g}" for one in (min(values), max(values)))
    return least if least == most else f"{least} to {most}"


def _table(rows: Sequence[VehicleOrbit], errors: dict[str, float | None]) -> str:
    head = "".join(f'<th scope="col">{one}</th>' for one in _COLUMNS)
    body, places = "", places_of(rows)
    for one in rows:
        error = errors.get(one.name)
        cells = (
            places.words(one.center_m),
            f"{one.radius_m:.5g}",
            one.direction,
            f"{one.phase_rad:.4f}",
            "-" if error is None else f"{error:.3g}",
        )
        filled = "".join(f"<td>{cell}</td>" for cell in cells)
        body += f'<tr><th scope="row">{escape(one.name)}</th>{filled}</tr>\n'
    return f"<table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table>"


# --- assumptions ----------------------------------------------------------------------------------


def _premise(plan: Plan) -> str:
    """The conditions under which the predicted errors hold, in words."""
    scenario = plan.scenario
    half = "over the second half of the run"
    said = [
        f"Predicted errors are the least that any unbiased filter can reach, RMS {half}, for "
        "circles flown exactly, landmarks known exactly and zero-mean errors of the sizes below."
    ]
    if scenario.estimated:
        said.append(f"The filter estimates {in_words(scenario.estimated)} beside the poses.")
    left_out = [name for name in scenario.error_sigmas if name not in scenario.estimated]
    if left_out:
        said.append(f"It does not estimate {in_words(left_out)}.")
    if scenario.obstacles_m:
        said.append(f"Obstacles to sight: {len(scenario.obstacles_m)}.")
    if scenario.truth is not None:
        said.append("The simulated world's own values (truth) do not enter these figures.")
    return " ".join(said)


def _terms(scenario: Scenario) -> str:
    """Each number that the figures rest on, with its meaning as in the scenario's reference."""
    values = scenario.resolved().model_dump(exclude_none=True)
    said: dict[str, list[str]] = defaultdict(list)
    for one in numeric_keys().values():
        about = next((words for key, words in _SUPPOSED.items() if one.key.startswith(key)), None)
        given = list(_values(values, one.key.split(".")))
        if about and given:
            meaning = _ASIDE.split(one.meaning)[0]
            value = f"{_span(given)}{'' if one.unit == '°' else ' '}{one.unit}".strip()
            term = f"{meaning[0].lower()}{meaning[1:]} "
            said[about].append(f"{escape(term)}<strong>{value}</strong>")
    return "".join(f"<li>{about}: {'; '.join(terms)}</li>\n" for about, terms in said.items())


def _values(part: Any, path: Sequence[str]) -> Iterator[float]:
    """Yield the numbers at a path of keys, in a section or in each of a list of them."""
    if isinstance(part, list):
        for one in part:
            yield from _values(one, path)
    elif not path and isinstance(part, int | float):
        yield float(part)
    elif path and isinstance(part, dict) and path[0] in part:
        yield from _values(part[path[0]], path[1:])
