"""Maps of circles, landmarks and areas: their extent, scale and layers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, heading, position, unit
from syncplan.planning.plans import Plan
from syncplan.plotting import canvas
from syncplan.plotting.figure_style import BLUE, INK, MUTED, ORANGE, FigureStyle, translucent

Corners = Sequence[tuple[float, float]]


class Zones(Protocol):
    """Areas on a map, in m; corners in order, not closed."""

    @property
    def area_m(self) -> Corners | None:
        """The area that paths stay in."""

    @property
    def keep_out_m(self) -> Sequence[Corners] | None:
        """Zones that paths stay out of."""

    @property
    def obstacles_m(self) -> Sequence[Corners] | None:
        """Obstacles to sight."""


class Mapped(Protocol):
    """Subject of a map."""

    @property
    def orbits(self) -> Orbits:
        """The circles."""

    @property
    def landmarks(self) -> Array:
        """Positions of landmarks (m, 2) in m."""

    @property
    def scenario(self) -> Zones:
        """Scenario or other holder of the areas."""


# --- the view -----------------------------------------------------------------------------------


_ROOM = 0.06
_ROOM_PX = 28
"""Space around the formation as a share of its extent, and at least, for landmarks' names."""

_HEIGHTS_PX = (150, 640)
_STOUT_PX = 36.0
"""Smallest radius in px of a circle at which lines have their full width."""

_NO_POINTS = np.empty((0, 2))

MANY_VEHICLES = 500
"""Largest team whose map shows names, senses and marks of short links; hover texts have the rest
of a larger one's."""

_LINKS_EACH = 3.0
"""Largest number of links per vehicle at which links have their full width."""


@dataclass(frozen=True, slots=True, eq=False)
class MapView:
    """Extent of a map, both axes to one scale.

    Attributes
    ----------
    low, high : (2,) m, the corners of what must be seen; the plot may show more
    scale : px per m
    height_px : height of the map
    least_radius : m, radius of the smallest circle
    crowding : links per vehicle
    font_scale : scale of names
    many : whether there are too many vehicles for details of each
    """

    low: Array
    high: Array
    scale: float
    height_px: int
    least_radius: float
    crowding: float
    font_scale: float
    many: bool

    @property
    def places(self) -> int:
        """Number of decimals that shows a hundred-thousandth of the extent, one less for many."""
        return canvas.decimals(float(np.max(self.high - self.low))) - self.many

    def mark_px(self, largest: float) -> float:
        """Return the size in px of a mark that suits the circles, at most `largest`."""
        least = 2.0 if self.many else 4.0
        return round(float(np.clip(0.45 * self._radius_px, least, largest)), 1)

    def line_px(self, widest: float) -> float:
        """Return the width in px of a line that leaves small circles visible."""
        least = 0.2 if self.many else 0.45
        return round(widest * float(np.clip(self._radius_px / _STOUT_PX, least, 1.0)), 2)

    def link_px(self, widest: float) -> float:
        """Return the width in px of a link's line, thinner where there are many."""
        room = np.clip(np.sqrt(_LINKS_EACH / max(self.crowding, _LINKS_EACH)), 0.35, 1.0)
        return round(self.line_px(widest) * float(room), 2)

    @property
    def _radius_px(self) -> float:
        return self.scale * self.least_radius

    def axes(self) -> canvas.Spec:
        """Return both axes, at one scale; the plot shows more where it has room."""
        across, up = (
            {"range": canvas.numbers(ends, 6), "constrain": "range", "exponentformat": "none"}
            for ends in zip(self.low, self.high, strict=True)
        )
        return {
            "xaxis": canvas.axis("x (east), m", **across),
            "yaxis": canvas.axis("y (north), m", **up, scaleanchor="x", scaleratio=1),
        }


def view_of(style: FigureStyle, *plans: Plan) -> MapView:
    """Return the view that holds all the plans, as wide as the figure."""
    return view_about(style, plans, max(_links(plan) / plan.orbits.count for plan in plans))


def view_about(
    style: FigureStyle,
    mapped: Sequence[Mapped],
    crowding: float = 0.0,
    points: Array = _NO_POINTS,
) -> MapView:
    """Return the view that holds circles, landmarks, areas and points (k, 2) m.

    `crowding` is the number of links per vehicle.
    """
    boxes = [_view_box(one) for one in mapped]
    low = np.min([*(box[0] for box in boxes), *points], axis=0)
    high = np.max([*(box[1] for box in boxes), *points], axis=0)
    width = style.plot_px
    extent = float(np.max(high - low))
    room = max(_ROOM * extent, style.px(_ROOM_PX) * float(high[0] - low[0]) / width)
    low, high = low - room, high + room
    wide, tall = (high - low).tolist()
    height = float(np.clip(width * tall / wide, *_HEIGHTS_PX))
    scale = min(width / wide, height / tall)
    least = min(float(one.orbits.radii.min()) for one in mapped)
    many = max(one.orbits.count for one in mapped) > MANY_VEHICLES
    return MapView(low, high, scale, round(height), least, crowding, style.font_scale, many)


def _links(plan: Plan) -> int:
    return len(plan.links) + len(plan.incidental_links) + len(plan.landmark_links)


def _view_box(mapped: Mapped) -> tuple[Array, Array]:
    """Return the corners (2,), (2,) in m of the box about circles, landmarks and the area."""
    orbits, scenario = mapped.orbits, mapped.scenario
    points = [
        orbits.centers - orbits.radii[:, None],
        orbits.centers + orbits.radii[:, None],
        mapped.landmarks.reshape(-1, 2),
        *(np.array(one, dtype=float) for one in [scenario.area_m] if one is not None),
    ]
    everything = np.concatenate(points)
    return everything.min(axis=0), everything.max(axis=0)


# --- layers -------------------------------------------------------------------------------------


CIRCLE_POINTS = (12, 72)
"""Fewest and most points of a circle; with the most, chords lie up to a thousandth of the radius
inside it."""

KEEP_OUT_FILL, OBSTACLE_FILL = translucent(MUTED, 0.25), translucent(MUTED, 0.6)

VEHICLE_PX = 15.0
HEAD_PX = 10.0

_SENSE_STYLES = (
    (1.0, "ccw", "counter-clockwise circle", BLUE, "solid"),
    (-1.0, "cw", "clockwise circle", ORANGE, "dash"),
)


def circle_points(plan: Mapped) -> Array:
    """Return (n, p + 1, 2) m: each circle from phase 0, closed, in fewer points p if n is large."""
    orbits = plan.orbits
    points = int(np.clip(CIRCLE_POINTS[1] * MANY_VEHICLES // orbits.count, *CIRCLE_POINTS))
    turn = unit(np.linspace(0.0, 2.0 * np.pi, points + 1))
    return np.asarray(orbits.centers[:, None] + orbits.radii[:, None, None] * turn)


def circle_traces(plan: Mapped, view: MapView, *, arrows: bool) -> list[canvas.Spec]:
    """Return the circles, one trace per sense; `arrows` adds heads to show it, unless too many."""
    points = circle_points(plan)
    traces: list[canvas.Spec] = []
    for sense, key, name, color, dash in _SENSE_STYLES:
        chosen = plan.orbits.senses == sense
        if not chosen.any():
            continue
        x, y = canvas.gapped(points[chosen], view.places)
        line = {"color": color, "dash": dash, "width": view.line_px(1.8), "simplify": False}
        traces.append(canvas.line_trace(f"circles-{key}", name, x, y, line, legendgroup=key))
        if arrows and not view.many:
            heads = sense_heads(plan, view, color, chosen)
            traces.append({**heads, "uid": f"heads-{key}", "legendgroup": key})
    return traces


def area_traces(plan: Mapped, view: MapView) -> list[canvas.Spec]:
    """Return the area, the keep-out zones and the obstacles, where the scenario has any."""
    scenario = plan.scenario
    traces = []
    if scenario.area_m is not None:
        x, y = canvas.gapped(_closed(scenario.area_m), view.places)
        line = {"color": MUTED, "dash": "dot", "width": 1.5}
        traces.append(canvas.line_trace("area", "area", x, y, line))
    # a polygon that blocks both paths and sight is drawn as both, the obstacle on top
    for uid, name, polygons, fill, color, width in (
        ("keep-out", "keep-out zone", scenario.keep_out_m, KEEP_OUT_FILL, MUTED, 1),
        ("obstacle", "obstacle to sight", scenario.obstacles_m, OBSTACLE_FILL, INK, 2),
    ):
        drawn = [canvas.gapped(_closed(polygon), view.places) for polygon in polygons or []]
        if drawn:
            x = [value for one, _ in drawn for value in one]
            y = [value for _, one in drawn for value in one]
            line, filled = {"color": color, "width": width}, {"fill": "toself", "fillcolor": fill}
            traces.append(canvas.line_trace(uid, name, x, y, line, **filled))
    return traces


def vehicle_marks(plan: Mapped, view: MapView, time: float, places: int) -> canvas.Spec:
    """Return the vehicles' arrows at a time in s, coordinates rounded to `places` decimals."""
    where = position(plan.orbits, time)
    return {
        "x": canvas.numbers(where[:, 0], places),
        "y": canvas.numbers(where[:, 1], places),
        "marker": pointer(view, VEHICLE_PX, canvas.compass(heading(plan.orbits, time)), INK),
    }


def pointer(view: MapView, largest: float, angles: Any, color: str) -> canvas.Spec:
    """Return a marker: an arrow whose tip is the point, turned by Plotly's `angles`."""
    return {"symbol": "arrow", "size": view.mark_px(largest), "angle": angles, "color": color}


def pointer_entry(group: str, name: str, size: float) -> canvas.Spec:
    """Return the legend entry of a trace of pointers, upright and in line with its words."""
    marker = {"symbol": "triangle-up", "size": 0.8 * size, "color": INK}
    return canvas.mark_trace(f"{group}-entry", name, [None], [None], marker, legendgroup=group)


def sense_heads(plan: Mapped, view: MapView, color: str, chosen: Array) -> canvas.Spec:
    """Return an arrowhead on each chosen circle, opposite the vehicle, in the sense of flight."""
    orbits = plan.orbits
    across = orbits.phases + np.pi
    where = (orbits.centers + orbits.radii[:, None] * unit(across))[chosen]
    ahead = (across + orbits.senses * np.pi / 2.0)[chosen]
    return {
        "type": "scatter",
        "mode": "markers",
        "x": canvas.numbers(where[:, 0], view.places),
        "y": canvas.numbers(where[:, 1], view.places),
        "marker": pointer(view, HEAD_PX, canvas.compass(ahead), color),
        "showlegend": False,
        "hoverinfo": "skip",
    }


def _closed(polygon: Sequence[tuple[float, float]]) -> Array:
    return np.array([[*polygon, polygon[0]]], dtype=float)
