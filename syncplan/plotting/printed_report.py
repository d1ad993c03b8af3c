"""A plan as printed sheets: what it is on the first, what is signed on the second; a page of HTML.

The first sheet has map, verdict, facts and vehicles. The second has what a flight needs beside
them, the assumptions, and room for two signatures.

The page holds no script and fetches nothing. Its one style never changes, so that a strict content
security policy can allow it by STYLE_DIGEST.
"""

import base64
import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, date, datetime
from functools import cache
from html import escape
from importlib.resources import files
from itertools import accumulate
from types import MappingProxyType
from typing import Any, get_args

from syncplan import __version__
from syncplan.documents import Point
from syncplan.observability.sliding_windows import SEARCHED_PERIODS
from syncplan.phrases import in_words, listed, metres
from syncplan.planning.judged_team import Level
from syncplan.planning.plans import Plan
from syncplan.plotting.figure_style import (
    BLUE,
    GREEN,
    GRID,
    INK,
    MUTED,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    FigureStyle,
)
from syncplan.plotting.formation_figures import formation_spec
from syncplan.plotting.maps import KEEP_OUT_FILL, OBSTACLE_FILL
from syncplan.plotting.static_map import legend_entries, map_svg
from syncplan.reports.plan_report import PlanDocument, VehicleOrbit, places_of, plan_document
from syncplan.scenario.dotted_keys import numeric_keys
from syncplan.scenario.lat_lon_keys import in_lat_lon
from syncplan.scenario.specification import Scenario

MOST_LISTED = 50
"""Most vehicles whose rows fit on a sheet; larger teams are described in a sentence."""

MOST_CORNERS = 120
"""Most corners of the area and keep-outs together that are listed."""

_ROWS, _SIGNED_ROWS = 18, 25
"""Most rows of each part of a table on the first and second sheet; the parts stand side by side."""

_MOST_FINDINGS = _MOST_NAMED = 5
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

_PAINTS: Mapping[str, str] = MappingProxyType(
    {
        INK: "ink",
        MUTED: "soft",
        GRID: "line",
        BLUE: "circle",
        ORANGE: "circle",
        GREEN: "strong",
        SKY: "strong",
        VERMILLION: "weak",
        PURPLE: "motion",
    }
)
"""Colours of the map's figure, and the variables of the style that stand for them.

The variables are those of the web page, where one colour means one thing: circles of either sense,
links of full rank, of less rank, motions. Dashes distinguish the rest.
"""

_SIGNED = ("Name", "Role", "Date", "Signature")
_NOT_STATED = "not stated"

_ASIDE = re.compile(r";|, (?:in|a multiple of|one value)")
"""Begins what a default, a unit or an alternative would be: that is for the scenario's author."""


def report_page(plan: Plan, *, identifier: str = "", made_on: date | None = None) -> str:
    """Return a plan's report as HTML that prints on two sheets of A4 or Letter paper.

    A third follows where many vehicles and many corners come together.

    `identifier` names the plan, as the service or its file does; `made_on` is the date on the
    report, today's in UTC if not given. The same arguments give the same text.
    """
    document = plan_document(plan)
    scenario, verdict = plan.scenario, plan.verdict
    day = made_on or datetime.now(UTC).date()
    title = escape(scenario.name or "Plan")
    named = [f"{day:%-d %B %Y}", f"syncplan {__version__}", *([identifier] if identifier else [])]
    about = escape(" · ".join(named))
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
<main>
<div class="sheet">
<header><h1>{title}</h1><p>{about}</p></header>
<p class="verdict{" go" if verdict.go else ""}">{escape(_verdict_sentence(document))}</p>
{_findings(plan)}{_map(plan)}
<section aria-labelledby="facts"><h2 id="facts">Facts</h2><dl class="facts">
{_pairs(_facts(document))}</dl></section>
{_vehicles(document)}
</div>
<div class="sheet signed">
<p class="soft"><strong>{title}</strong> · {about} · to be signed</p>
<section aria-labelledby="flight"><h2 id="flight">Flight</h2><dl class="facts">
{_pairs(_conditions(document))}</dl></section>
{_circles(document)}
{_corners(document)}
<section aria-labelledby="assumptions"><h2 id="assumptions">Assumptions of these figures</h2>
<p>{escape(_premise(plan))}</p>
<ul class="terms">
{_terms(scenario)}</ul></section>
<div class="signatures">
{_signatures()}</div>
</div>
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
    """Return the style of every report; its map has the colours of the web page's."""
    painted = "".join(
        f'[{part}="{color}"] {{ {part}: var(--{name}); }}\n'
        for color, name in _PAINTS.items()
        for part in ("stroke", "fill")
    )
    areas = "".join(
        f'[fill="{fill}"] {{ fill: var(--{name}); fill-opacity: 0.25; stroke: var(--{name}); }}\n'
        for fill, name in ((KEEP_OUT_FILL, "kept-out"), (OBSTACLE_FILL, "obstacle"))
    )
    text = files(__package__).joinpath("printed_report.css").read_text("utf-8")
    return f"\n{text}{painted}{areas}"


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
    return f"✓ {verdict.headline}; {team}" + (
        f" to {max(known):.2g} m (worst RMS, predicted)" if known else ""
    )


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
        stated = document.scenario.min_separation_m
        required = "none stated" if stated is None else f"{stated:g} m"
        least = f"{_metres(nearest.min_m, 4)}, {'-'.join(nearest.between)}"
        yield "Least separation", least, f"as planned; required: {required}"
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
        assumed = "" if origin.alt_m else " (assumed where none is stated)"
        ground = f"ground {origin.alt_m:g} m above sea level{assumed}"
        yield (
            "Place of 0, 0: latitude, longitude",
            _lat_lon_words(origin.lat_deg, origin.lon_deg),
            ground,
        )
    if document.scenario.start_time is not None:
        yield "Time 0", str(document.scenario.start_time), ""


def _conditions(document: PlanDocument) -> Iterator[tuple[str, str, str]]:
    """Yield what to know of the flight beside the facts: name, value and remark."""
    verdict, flight, wind = document.verdict, document.flight, document.scenario.wind
    assert verdict is not None
    basis = "geometry, rank and prediction, and no simulated flights"
    if verdict.flown and flight is not None:
        basis = (
            f"{flight.trials} simulated flights of {flight.duration_s:g} s, guidance "
            f"{flight.guidance}, filter {flight.filter}, seed {flight.seed}"
        )
    yield "Basis of the verdict", verdict.headline, basis
    if wind is None or wind.sigma_mps == wind.gust_sigma_mps == 0.0:
        yield "Wind", "still air assumed", ""
    else:
        speeds = f"constant {wind.sigma_mps:g} m/s, gusts {wind.gust_sigma_mps:g} m/s"
        yield "Wind", speeds, "standard deviations of each component"
    yield "Take-off and landing", "not part of the plan", "nor is the way to and from the circles"
    yield "Altitudes", "above the ground at 0, 0", "ranges and separations are horizontal"


def _lat_lon_words(latitude: float, longitude: float) -> str:
    return f"{latitude:.7f}°, {longitude:.7f}°"


def _metres(value: float | None, digits: int) -> str:
    return "unknown" if value is None else f"{metres(value, digits)} m"


# --- vehicles -------------------------------------------------------------------------------------


def _vehicles(document: PlanDocument) -> str:
    """The section of the circles, or of a sentence on a large team."""
    team, errors = document.vehicles, document.predicted_rms_m.vehicles
    heading = "Vehicles at time 0, with the predicted RMS error"
    if len(team) > MOST_LISTED:
        return _section("vehicles", heading, f"<p>{_summary(team, errors)}</p>")
    words = places_of(team).words
    known = [errors.get(each.name) for each in team]
    columns: dict[str, Sequence[str]] = {
        "vehicle": [each.name for each in team],
        "centre m": [words(each.center_m) for each in team],
        "radius m": [f"{each.radius_m:.5g}" for each in team],
        "sense": [each.direction for each in team],
        "phase rad": [f"{each.phase_rad:.4f}" for each in team],
        "error m": ["-" if error is None else f"{error:.3g}" for error in known],
    }
    return _section("vehicles", heading, _tables(columns, _ROWS))


def _circles(document: PlanDocument) -> str:
    """The section of speeds, altitudes and places, or of a sentence on a large team."""
    team, altitudes = document.vehicles, document.scenario.altitudes
    heading = "Speeds, altitudes and places of the circles"
    if len(team) > MOST_LISTED:
        speeds = _span([each.speed_mps for each in team])
        heights = f"{_span(altitudes, 'g')} m" if altitudes else _NOT_STATED
        words = f"Speeds {speeds} m/s; altitudes {heights}. The plan lists each circle."
        return _section("circles", heading, f"<p>{words}</p>")
    columns = {
        "vehicle": [each.name for each in team],
        "speed m/s": [f"{each.speed_mps:.4g}" for each in team],
        # as Copter's CIRCLE_RATE
        "turn rate deg/s, clockwise +": [
            f"{360.0 / document.period_s * (1 if each.direction == 'cw' else -1):.4g}"
            for each in team
        ],
        "altitude m": [f"{height:g}" for height in altitudes] or [_NOT_STATED] * len(team),
    }
    if places := _on_ground(document, [each.center_m for each in team]):
        columns["latitude, longitude of the centre"] = places
    return _section("circles", heading, _tables(columns, _SIGNED_ROWS))


def _summary(rows: Sequence[VehicleOrbit], errors: dict[str, float | None]) -> str:
    turning = sum(one.direction == "ccw" for one in rows)
    known = [value for value in errors.values() if value is not None]
    found = f", predicted errors {_span(known)} m" if known else ""
    return (
        f"{len(rows)} vehicles, {turning} of them counter-clockwise: radii "
        f"{_span([one.radius_m for one in rows])} m{found}. The plan lists each."
    )


def _span(values: Sequence[float], form: str = ".3g") -> str:
    least, most = (f"{value:{form}}" for value in (min(values), max(values)))
    return least if least == most else f"{least} to {most}"


def _section(name: str, heading: str, body: str) -> str:
    return f'<section aria-labelledby="{name}"><h2 id="{name}">{heading}</h2>\n{body}</section>'


def _tables(columns: Mapping[str, Sequence[str]], most: int) -> str:
    """Tables side by side, each of at most so many rows; the first column names the row."""
    head = "".join(f'<th scope="col">{column}</th>' for column in columns)
    rows = [
        f'<tr><th scope="row">{escape(name)}</th>'
        f"{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>\n"
        for name, *cells in zip(*columns.values(), strict=True)
    ]
    # of about the same length
    size = -(-len(rows) // -(-len(rows) // most))
    parts = [rows[first : first + size] for first in range(0, len(rows), size)]
    tables = "\n".join(
        f"<table><thead><tr>{head}</tr></thead>\n<tbody>\n{''.join(part)}</tbody></table>"
        for part in parts
    )
    return f'<div class="tables">\n{tables}</div>'


# --- what is signed -------------------------------------------------------------------------------


def _corners(document: PlanDocument) -> str:
    """The section of the corners of the area and of keep-outs."""
    ground = "" if document.ground is None else ", latitude and longitude"
    heading = f"Corners of the area and of keep-outs: (x, y) in m{ground}"
    items = "".join(f"<li>{words}</li>\n" for words in _polygons(document))
    return _section("corners", heading, f'<ul class="terms">\n{items}</ul>')


def _polygons(document: PlanDocument) -> Iterator[str]:
    """Yield the corners of the area and of each keep-out; of those with too many, the number."""
    scenario, words = document.scenario, places_of(document.vehicles).words
    keep_outs = enumerate(scenario.keep_out_m or [], start=1)
    polygons = {"Area": scenario.area_m or []}
    polygons |= {f"Keep-out {k}": polygon for k, polygon in keep_outs} or {"Keep-outs": []}
    totals = accumulate(map(len, polygons.values()))
    left = [name for name, total in zip(polygons, totals, strict=True) if total > MOST_CORNERS]
    for name, polygon in polygons.items():
        if name not in left:
            places = _on_ground(document, polygon) or [""] * len(polygon)
            each = [
                f"<span>({words(corner)}) {place}</span> "
                for corner, place in zip(polygon, places, strict=True)
            ]
            yield f"{name}: {''.join(each) or 'none stated'}"
    if left:
        count = sum(len(polygons[name]) for name in left)
        yield f"{listed(left, _MOST_NAMED)}: {count} corners, which the plan lists"


def _on_ground(document: PlanDocument, points: Sequence[Point]) -> list[str]:
    """Latitude and longitude in degrees of points in m; empty where they are not known."""
    origin = document.scenario.geo_origin
    if origin is None or document.ground is None:
        return []
    return [_lat_lon_words(*place) for place in in_lat_lon(origin, points)]


def _signatures() -> str:
    lines = "".join(f"<div><dt>{name}</dt><dd></dd></div>\n" for name in _SIGNED)
    return "".join(
        f'<section aria-labelledby="{name}"><h2 id="{name}">{name.capitalize()} by</h2>\n'
        f"<dl>{lines}</dl></section>\n"
        for name in ("planned", "released")
    )


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
