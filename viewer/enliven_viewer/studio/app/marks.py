"""Draws marks over an image: lines, discs, filled shapes, labels, and the world axes."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, ImVec2Like, imgui

from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.viewport.overlay import Disc, Fill, Label, Line, Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import AXIS_COLOURS, GLASS, Colour

_AXIS_LENGTH_PX = 24.0
"""Length of an axis in pixels."""


def make_axes_marks(lens: Lens, at: Point) -> tuple[Line | Disc | Label, ...]:
    """Returns marks of the world axes as seen in a view, centred at a pixel. Axes that point
    away come first.
    """
    seen = lens.view.camera_from_world[:3, :3]
    marks: list[Line | Disc | Label] = []
    for axis in sorted(range(3), key=lambda k: seen[2, k]):
        right, up, nearer = (float(value) for value in seen[:, axis])
        red, green, blue = AXIS_COLOURS[axis]
        tint: Colour = (red / 255, green / 255, blue / 255, 0.55 if nearer < -0.15 else 1.0)
        end = (at[0] + _AXIS_LENGTH_PX * right, at[1] - _AXIS_LENGTH_PX * up)
        marks.append(Line((at, end), tint, 2.4))
        if np.hypot(right, up) > 0.3:
            marks.append(Label((end[0] + 7 * right - 3, end[1] - 8 * up), "xyz"[axis], tint))
        else:
            marks.append(Disc(end, 2.5, tint))
    return tuple(marks)


def _find_window_points(mark: Line | Fill, area: Area) -> list[ImVec2Like]:
    """Returns a mark's points in window pixels."""
    return [ImVec2(area.x + x, area.y + y) for x, y in mark.points]


def draw_mark(draw_list: imgui.ImDrawList, area: Area, mark: Disc | Fill | Line | Label) -> None:
    """Draws one mark. Its coordinates are pixels from the area's top left corner."""
    if isinstance(mark, Line):
        points = _find_window_points(mark, area)
        closed = imgui.ImDrawFlags_.closed if mark.closed else 0
        draw_list.add_polyline(points, pack_colour(mark.colour), mark.width, closed)
    elif isinstance(mark, Disc):
        position = ImVec2(area.x + mark.at[0], area.y + mark.at[1])
        if mark.width > 0:
            draw_list.add_circle(position, mark.radius, pack_colour(mark.colour), 0, mark.width)
        else:
            draw_list.add_circle_filled(position, mark.radius, pack_colour(mark.colour))
    elif isinstance(mark, Fill):
        points = _find_window_points(mark, area)
        draw_list.add_convex_poly_filled(points, pack_colour(mark.colour))
    else:
        position = ImVec2(area.x + mark.at[0], area.y + mark.at[1] - 8)
        written = imgui.calc_text_size(mark.text)
        low, high = (
            ImVec2(position.x - 4, position.y - 1),
            ImVec2(position.x + written.x + 4, position.y + written.y + 1),
        )
        draw_list.add_rect_filled(low, high, pack_colour(GLASS, mark.colour[3]), 4.0)
        draw_list.add_text(position, pack_colour(mark.colour), mark.text)
