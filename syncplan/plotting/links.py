"""Links in figures: their worth in colour, dash, pattern and words, and their ends on maps.

A map draws a link from rim to rim, and never through a name:

( v1 )-------( v2 )        apart: along the line of centres
( v1 (=) v2 )              overlapping a little: the same, within the lens
( v1 X v2 )                overlapping so far that this would cross a centre: where the rims meet
( v1 ( v2 )-)              one inside the other: where the rims are nearest
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.circles import Orbits, perpendicular
from syncplan.phrases import metres
from syncplan.planning.plans import Plan
from syncplan.plotting.canvas import escaped
from syncplan.plotting.figure_style import GREEN, MUTED, SKY, VERMILLION


@dataclass(frozen=True, slots=True)
class Standing:
    """Worth of a link for observability, in words and in the style of figures.

    Colour and dash show the rank, width and mark the kind of link.

    Attributes
    ----------
    key : short name that stays the same between figures
    text : the legend's words
    color, dash, width : style of a line
    pattern : Plotly's name of a bar's pattern; empty for a plain bar
    mark : Plotly's name of the mark in the middle of a line; empty for none
    """

    key: str
    text: str
    color: str
    dash: str
    width: float
    pattern: str
    mark: str = ""


DROPPED = Standing("dropped", "dropped link", MUTED, "dot", 1.5, "", "x")

_KINDS = {"link": (3.0, ""), "incidental": (1.3, "circle-open"), "landmark": (1.8, "")}
"""Width and mark of a line."""

_PATTERNS = {"link": ("", "."), "incidental": ("-", "+"), "landmark": ("|", "+")}
"""Patterns of full rank: certified, and too weak."""

_SHORT = (("dash", "/"), ("dot", "\\"), ("longdash", "x"))
"""Dash and pattern of ranks that are one, two and three short."""

_WORDS = {"link": "link", "incidental": "incidental link", "landmark": "landmark link"}


def standing_of(plan: Plan, meeting: LinkVerdict, *, incidental: bool = False) -> Standing:
    """Return the worth of a meeting for observability: certified, too weak, or short of rank."""
    to_landmark = meeting.b >= plan.orbits.count
    kind = "landmark" if to_landmark else "incidental" if incidental else "link"
    full = 2 if to_landmark else 3
    words, (width, mark) = _WORDS[kind], _KINDS[kind]
    certified, weak = _PATTERNS[kind]
    if meeting.certified:
        text = f"{words}, rank {full}, certified"
        return Standing(f"{kind}-certified", text, GREEN, "solid", width, certified, mark)
    if meeting.rank >= full:
        text = f"{words}, rank {full}, too weak"
        return Standing(f"{kind}-weak", text, SKY, "dashdot", width, weak, mark)
    text = f"{words}, rank {meeting.rank} of {full}"
    dash, pattern = _SHORT[full - meeting.rank - 1]
    return Standing(f"{kind}-rank-{meeting.rank}", text, VERMILLION, dash, width, pattern, mark)


def grouped(plan: Plan) -> dict[Standing, list[LinkVerdict]]:
    """Return all meetings by standing: links, incidental links, landmark links."""
    found: dict[Standing, list[LinkVerdict]] = {}
    for meetings, incidental in (
        (plan.links, False),
        (plan.incidental_links, True),
        (plan.landmark_links, False),
    ):
        for meeting in meetings:
            found.setdefault(standing_of(plan, meeting, incidental=incidental), []).append(meeting)
    return found


def body_names(plan: Plan) -> list[str]:
    """Return the escaped names of vehicles, then of landmarks."""
    return [escaped(n) for n in plan.scenario.vehicle_names + plan.scenario.landmark_names]


def hover(meeting: LinkVerdict, names: list[str], shown: Standing) -> str:
    """Return the hover text of a meeting; `names` are escaped."""
    least = metres(meeting.min_distance)
    lines = [
        f"{names[meeting.a]}-{names[meeting.b]}, {shown.text}",
        f"least distance {least} m, in contact {meeting.contact:.4g} s a period",
    ]
    if meeting.reason:
        lines.append(escaped(meeting.reason))
    return "<br>".join(lines)


# --- where a link is drawn ----------------------------------------------------------------------


_LENS = 1.25
"""Least distance of centres, in radii of the larger circle, at which a line fits into the lens."""


def link_pairs(plan: Plan) -> Index:
    """Return the pairs of bodies (k, 2) that links join: listed, incidental, landmark, dropped."""
    met = [*plan.links, *plan.incidental_links, *plan.landmark_links]
    joined = [(item.a, item.b) for item in met]
    joined += [(item.a, item.b) for item in plan.dropped_links]
    return np.array(joined, dtype=np.int64).reshape(-1, 2)


def link_ends(orbits: Orbits, landmarks: Array, pairs: Index) -> tuple[Array, Array]:
    """Return both ends (k, 2) m of the lines of links between bodies (k, 2), on their rims.

    A landmark is a rim of radius 0. Where rims meet, both ends may be one point.
    """
    bodies = np.concatenate([orbits.centers, landmarks.reshape(-1, 2)])
    reach = np.concatenate([orbits.radii, np.zeros(len(bodies) - orbits.count)])
    a, b = pairs[:, 0], pairs[:, 1]
    away = bodies[b] - bodies[a]
    apart = np.hypot(away[:, 0], away[:, 1])
    one = apart > 1e-9 * np.maximum(np.maximum(reach[a], reach[b]), 1e-300)
    ahead = np.where(one[:, None], away / np.where(one, apart, 1.0)[:, None], [1.0, 0.0])
    start = bodies[a] + reach[a, None] * ahead
    end = bodies[b] - reach[b, None] * ahead
    larger = np.maximum(reach[a], reach[b])
    within = apart <= np.abs(reach[a] - reach[b])
    # one inside the other: both ends where the rims are nearest
    side = np.where(reach[a] >= reach[b], 1.0, -1.0)[:, None] * ahead
    start = np.where(within[:, None], bodies[a] + reach[a, None] * side, start)
    end = np.where(within[:, None], bodies[b] + reach[b, None] * side, end)
    crossing = ~within & (apart < np.minimum(_LENS * larger, reach[a] + reach[b]))
    meeting = bodies[a] + _rims_meet(apart, reach[a], reach[b], ahead)
    start = np.where(crossing[:, None], meeting, start)
    end = np.where(crossing[:, None], meeting, end)
    return start, end


def _rims_meet(apart: Array, own: Array, other: Array, ahead: Array) -> Array:
    """Crossing of two circles relative to the first's centre, left of the line to the second's."""
    far = np.where(apart > 0.0, apart, 1.0)
    along = (far**2 + own**2 - other**2) / (2.0 * far)
    across = np.sqrt(np.maximum(own**2 - along**2, 0.0))
    return np.asarray(along[:, None] * ahead + across[:, None] * perpendicular(ahead))
