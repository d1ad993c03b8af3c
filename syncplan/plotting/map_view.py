"""The part of the plane that a map shows, how large it is drawn, and the size of its marks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.planning.planner import Plan
from syncplan.plotting.canvas import Spec, axis, decimals, numbers
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.map_subject import Mapped

_ROOM = 0.06
_ROOM_PX = 28
"""Space left around the formation: of its larger extent, and at least, for names of landmarks."""

_HEIGHTS_PX = (150, 640)
_STOUT_PX = 36.0
"""Radius in px of a circle whose lines are drawn at their full width."""

_NO_POINTS = np.empty((0, 2))

_LINKS_EACH = 3.0
"""Links for each vehicle up to which they are drawn at their full width."""


@dataclass(frozen=True, slots=True, eq=False)
class MapView:
    """What a map shows, both axes to one scale.

    Attributes
    ----------
    low, high : (2,) m, the corners of what must be seen; the plot may show more
    scale : px for each m
    height_px : of the map
    least_radius : m, of the smallest circle
    crowding : links for each vehicle
    font_scale : of names
    """

    low: Array
    high: Array
    scale: float
    height_px: int
    least_radius: float
    crowding: float
    font_scale: float

    @property
    def places(self) -> int:
        """Decimals that show a hundred-thousandth of what is shown."""
        return decimals(float(np.max(self.high - self.low)))

    def mark_px(self, largest: float) -> float:
        """Return the size in px of a mark that suits the circles, at most `largest`."""
        return round(float(np.clip(0.45 * self._radius_px, 4.0, largest)), 1)

    def line_px(self, widest: float) -> float:
        """Return the width in px of a line that leaves small circles visible."""
        return round(widest * float(np.clip(self._radius_px / _STOUT_PX, 0.45, 1.0)), 2)

    def link_px(self, widest: float) -> float:
        """Return the width in px of a link's line, thinner where there are many."""
        room = np.clip(np.sqrt(_LINKS_EACH / max(self.crowding, _LINKS_EACH)), 0.35, 1.0)
        return round(self.line_px(widest) * float(room), 2)

    @property
    def _radius_px(self) -> float:
        return self.scale * self.least_radius

    def axes(self) -> Spec:
        """Return the two axes, to one scale; what is left over of the plot shows more."""
        low, high = self.low, self.high
        across = {"range": numbers([low[0], high[0]], 6), "constrain": "range"}
        up = {"range": numbers([low[1], high[1]], 6), "constrain": "range"}
        return {
            "xaxis": axis("x (east), m", **across),
            "yaxis": axis("y (north), m", **up, scaleanchor="x", scaleratio=1),
        }


def view_of(style: FigureStyle, *plans: Plan) -> MapView:
    """Return the view that holds all of some plans, as wide as the figure."""
    return view_about(style, plans, max(_links(plan) / plan.orbits.count for plan in plans))


def view_about(
    style: FigureStyle,
    mapped: Sequence[Mapped],
    crowding: float = 0.0,
    points: Array = _NO_POINTS,
) -> MapView:
    """Return the view that holds circles, landmarks, areas and points (k, 2) m.

    `crowding` is of links for each vehicle.
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
    return MapView(low, high, scale, round(height), least, crowding, style.font_scale)


def _links(plan: Plan) -> int:
    return len(plan.links) + len(plan.incidental_links) + len(plan.landmark_links)


def _view_box(mapped: Mapped) -> tuple[Array, Array]:
    """Return the corners (2,), (2,) in m of what a map needs: circles, landmarks, areas."""
    orbits, scenario = mapped.orbits, mapped.scenario
    points = [
        orbits.centers - orbits.radii[:, None],
        orbits.centers + orbits.radii[:, None],
        mapped.landmarks.reshape(-1, 2),
        *(np.array(one, dtype=float) for one in [scenario.area_m] if one is not None),
    ]
    everything = np.concatenate(points)
    return everything.min(axis=0), everything.max(axis=0)
