"""What a link is worth, and how figures show it: colour, dash, pattern and words agree."""

from dataclasses import dataclass

from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.planning.planner import Plan
from syncplan.plotting.canvas import escaped
from syncplan.plotting.palette import GREEN, MUTED, SKY, VERMILLION


@dataclass(frozen=True, slots=True)
class Standing:
    """How a link counts, in words and in the marks of a figure.

    Attributes
    ----------
    key : short name, fixed, for what must not change between figures
    text : the legend's words
    color, dash, width : of a line
    pattern : of a bar, Plotly's name; empty for a plain one
    """

    key: str
    text: str
    color: str
    dash: str
    width: float
    pattern: str


DROPPED = Standing("dropped", "dropped link", MUTED, "dot", 1.5, "")

_KINDS = {"link": 3.0, "incidental": 1.3, "landmark": 1.8}
_PATTERNS = {"link": ("", ".", "/"), "incidental": ("-", ".", "/"), "landmark": ("x", "+", "\\")}
_WORDS = {"link": "link", "incidental": "incidental link", "landmark": "landmark link"}


def standing_of(plan: Plan, meeting: LinkVerdict, *, incidental: bool = False) -> Standing:
    """Return what a meeting is worth for observability: certified, too weak, or short of rank."""
    to_landmark = meeting.b >= plan.orbits.count
    kind = "landmark" if to_landmark else "incidental" if incidental else "link"
    full = 2 if to_landmark else 3
    words, width = _WORDS[kind], _KINDS[kind]
    certified, weak, short = _PATTERNS[kind]
    if meeting.certified:
        text = f"{words}, rank {full}, certified"
        return Standing(f"{kind}-certified", text, GREEN, "solid", width, certified)
    if meeting.rank >= full:
        text = f"{words}, rank {full}, too weak"
        return Standing(f"{kind}-weak", text, SKY, "dashdot", width, weak)
    text = f"{words}, rank {meeting.rank} of {full}"
    return Standing(f"{kind}-rank-{meeting.rank}", text, VERMILLION, "dash", width, short)


def grouped(plan: Plan) -> dict[Standing, list[LinkVerdict]]:
    """Return all meetings by what they are worth: links, incidental ones, those with landmarks."""
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
    """Return what a meeting says when pointed at; `names` escaped."""
    lines = [
        f"{names[meeting.a]}-{names[meeting.b]}, {shown.text}",
        f"least distance {meeting.min_distance:.4g} m, in contact {meeting.contact:.4g} s a period",
    ]
    if meeting.reason:
        lines.append(escaped(meeting.reason))
    return "<br>".join(lines)
