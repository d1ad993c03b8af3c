"""Names on maps, placed clear of links and rims, in a size that fits the circles."""

import html
from dataclasses import dataclass, field, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import unit
from syncplan.plotting.canvas import Spec, mark_trace, numbers
from syncplan.plotting.figure_style import INK
from syncplan.plotting.links import link_ends
from syncplan.plotting.maps import Mapped, MapView

NAME_PX = 13.0
LEAST_NAME_PX = 7.0
"""Size of names, and the smallest that can be read; hover texts give the others."""

MOST_OUTSIDE = 40
"""Largest team in which names that do not fit into their circles stand beside them."""

_EM = 0.62
_LINE = 1.0
"""Width of a character and height of a name's box, in units of the font's size."""

_FILLED = 0.96
_INSIDE = 0.48
_STAR_PX = 13.0

_LINK_WEIGHT, _RIM_WEIGHT = 10_000, 100
"""Penalties of a link and of a rim through a name, relative to an arrow's."""

_PLACES = (
    ("top center", 0.0, 1.0),
    ("bottom center", 0.0, -1.0),
    ("middle right", 1.0, 0.0),
    ("middle left", -1.0, 0.0),
    ("top right", 1.0, 1.0),
    ("top left", -1.0, 1.0),
    ("bottom right", 1.0, -1.0),
    ("bottom left", -1.0, -1.0),
)
"""Plotly's text positions about a mark, with their directions."""


@dataclass(frozen=True, slots=True, eq=False)
class Obstructions:
    """Obstructions of names: lines (k, 2, 2) m, rims and, less important, the lines `less`."""

    lines: Array
    centers: Array
    radii: Array
    less: Array = field(default_factory=lambda: np.empty((0, 2, 2)))


def obstructions(plan: Mapped, pairs: Index, arrows: Array | None = None) -> Obstructions:
    """Return obstructions on a map: links between `pairs` (k, 2), circles, `arrows` (p, 2, 2) m."""
    lines = np.stack(link_ends(plan.orbits, plan.landmarks, pairs), axis=1)
    about = Obstructions(lines, plan.orbits.centers, plan.orbits.radii)
    return about if arrows is None else replace(about, less=arrows)


def name_trace(plan: Mapped, view: MapView, names: list[str], about: Obstructions) -> Spec:
    """Return the names of vehicles in their circles or beside them; one text for each centre.

    In teams above MOST_OUTSIDE, names too small to read in their circles are left empty, and in
    those above MANY_VEHICLES all names are left out; the vehicles' hover texts have them.
    """
    trace = {"type": "scatter", "uid": "names", "mode": "text"}
    if view.many:
        return {**trace, "x": [], "y": [], "text": [], "showlegend": False}
    shared: dict[tuple[float, float], list[int]] = {}
    for k, center in enumerate(np.round(plan.orbits.centers, view.places).tolist()):
        shared.setdefault((center[0], center[1]), []).append(k)
    texts = [", ".join(names[k] for k in who) for who in shared.values()]
    radii = np.array([plan.orbits.radii[who].min() for who in shared.values()])
    lengths = np.array([len(html.unescape(text)) for text in texts])
    full = NAME_PX * view.font_scale
    # the box about a name has its corners within the circle
    corner = 0.5 * np.hypot(_EM * lengths, _LINE)
    fitting = np.minimum(full, _FILLED * radii * view.scale / corner)
    outside = fitting < LEAST_NAME_PX
    # one size for all that fit, so that none looks more important
    size = np.where(outside, full, np.min(fitting[~outside], initial=full))
    hidden = outside & (plan.orbits.count > MOST_OUTSIDE)
    half = 0.5 * np.column_stack([_EM * size * lengths, _LINE * size]) / view.scale
    where = _free(np.array(list(shared)), _steps(radii, half, outside), half, about)
    return {
        **trace,
        "x": numbers(where[:, 0], view.places),
        "y": numbers(where[:, 1], view.places),
        "text": ["" if hide else text for text, hide in zip(texts, hidden, strict=True)],
        "textfont": {"size": numbers(size, 1), "color": INK},
        "showlegend": False,
        "hoverinfo": "skip",
    }


def landmark_trace(
    plan: Mapped, view: MapView, names: list[str], about: Obstructions
) -> list[Spec]:
    """Return the landmarks with their names, if there are any."""
    if not len(plan.landmarks):
        return []
    shown = names[plan.orbits.count :]
    star = max(view.mark_px(_STAR_PX), 8.0)
    size = min(NAME_PX, 0.9 * star + 2.0) * view.font_scale
    lengths = np.array([len(html.unescape(text)) for text in shown])
    half = 0.5 * np.column_stack([_EM * size * lengths, np.full(len(shown), _LINE * size)])
    away = np.array([(east, north) for _, east, north in _PLACES])
    steps = away * (half[:, None] + 0.5 * star) / view.scale
    chosen = _chosen(plan.landmarks, steps, half / view.scale, about)
    return [
        mark_trace(
            "landmarks",
            "landmark",
            numbers(plan.landmarks[:, 0], view.places),
            numbers(plan.landmarks[:, 1], view.places),
            {"symbol": "star", "size": star, "color": INK},
            "%{text}<br>%{x} m, %{y} m<extra></extra>",
            mode="markers+text",
            text=shown,
            textposition=[_PLACES[k][0] for k in chosen],
            textfont={"size": round(size, 1), "color": INK},
        )
    ]


def crossed(where: Array, half: Array, about: Obstructions) -> Index:
    """Return the penalty (k,) of boxes about `where`, half sizes `half`, both (k, 2); 0 if free."""
    off = np.abs(about.centers[None] - where[:, None])
    nearest = np.hypot(*np.moveaxis(np.maximum(off - half[:, None], 0.0), 2, 0))
    farthest = np.hypot(*np.moveaxis(off + half[:, None], 2, 0))
    rims = ((nearest < about.radii) & (about.radii < farthest)).sum(axis=1)
    worst = _LINK_WEIGHT * _lines_through(where, half, about.lines)
    return np.asarray(worst + _RIM_WEIGHT * rims + _lines_through(where, half, about.less))


def _lines_through(where: Array, half: Array, lines: Array) -> Index:
    """Number of lines p + s d, s in [0, 1], that pass between all four sides of each box."""
    if not len(lines):
        return np.zeros(len(where), dtype=np.int64)
    along = (lines[:, 1] - lines[:, 0])[None]
    off = lines[None, :, 0] - where[:, None]
    still = np.abs(along) < 1e-12
    step = np.where(still, 1.0, along)
    sides = [(sign * half[:, None] - off) / step for sign in (-1.0, 1.0)]
    always = np.abs(off) < half[:, None]
    enter = np.where(still, np.where(always, -np.inf, np.inf), np.minimum(*sides))
    leave = np.where(still, np.where(always, np.inf, -np.inf), np.maximum(*sides))
    first = np.maximum(enter.max(axis=2), 0.0)
    return np.asarray((first < np.minimum(leave.min(axis=2), 1.0)).sum(axis=1))


def _steps(radii: Array, half: Array, outside: Flags) -> Array:
    """Offsets (k, 17, 2) in m from the centre: at it, within the circle, and beside it."""
    round_about = unit(np.pi / 4.0 * np.array([2, 6, 0, 4, 1, 3, 5, 7]))
    within = _INSIDE * radii[:, None, None] * round_about
    beside = (radii[:, None, None] + half[:, None]) * round_about
    steps = np.concatenate([np.zeros((len(radii), 1, 2)), within, beside], axis=1)
    steps[outside, :9] = beside[outside, :1]
    return np.asarray(steps)


def _free(places: Array, steps: Array, half: Array, about: Obstructions) -> Array:
    chosen = _chosen(places, steps, half, about)
    return np.asarray(places + steps[np.arange(len(places)), chosen])


def _chosen(places: Array, steps: Array, half: Array, about: Obstructions) -> Index:
    """Index (k,) of the first step at which nothing crosses a box, otherwise of the least bad."""
    best = np.zeros(len(places), dtype=int)
    fewest = np.full(len(places), np.iinfo(np.int64).max)
    for k in range(steps.shape[1]):
        left = np.flatnonzero(fewest > 0)
        if not len(left):
            break
        found = crossed(places[left] + steps[left, k], half[left], about)
        better = found < fewest[left]
        best[left[better]], fewest[left[better]] = k, found[better]
    return best
