"""Draws marks over an image: lines, discs, filled shapes and labels."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec2Like, imgui

from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.viewport.overlay import Disc, Fill, Label, Line
from enliven_viewer.theme import GLASS


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
