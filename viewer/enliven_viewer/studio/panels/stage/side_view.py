"""Draws a side view of the limb that is about to be attached, in a corner of the view."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import draw_caption, pack_colour
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import INK, LINE, UNTINTED

_HEIGHT_FRACTION = 0.3
"""Fraction of the view's height."""
_MIN_HEIGHT = 104.0
"""Minimum height in pixels, so that the limb is recognisable."""
_MAX_HEIGHT = 400.0
"""Maximum height in pixels: a larger image shows no more detail."""
_ASPECT = 1.2
"""Aspect ratio, the same as for the inset in the other corner."""
_MARGIN = 14.0
"""Distance in pixels from the border of the view."""
_TEXT_SIZE = 13.0
"""Text size of its title in pixels."""


def find_side_view_area(workspace: Workspace, area: Area) -> Area:
    """Returns the area of the side view in the window: at the top right, or below an inset there."""
    height = min(
        max(_HEIGHT_FRACTION * area.height, _MIN_HEIGHT), _MAX_HEIGHT, max(area.height / 2 - _MARGIN, 1.0)
    )
    width, top = _ASPECT * height, area.y + _MARGIN
    left = area.x + area.width - width - _MARGIN
    taken = workspace.widgets.get("performer inset")
    if taken is not None and taken[2] > left and taken[1] < top + height:
        top = taken[3] + _MARGIN
    return Area(left, top, width, height)


def draw_side_view(workspace: Workspace, area: Area, texture: int) -> None:
    """Draws the side view that the window has rendered."""
    draw_list, place = imgui.get_background_draw_list(), find_side_view_area(workspace, area)
    low, high = ImVec2(place.x, place.y), ImVec2(place.x + place.width, place.y + place.height)
    white = pack_colour(UNTINTED)
    draw_list.add_image_rounded(
        imgui.ImTextureRef(texture), low, high, ImVec2(0, 1), ImVec2(1, 0), white, 8.0
    )
    draw_list.add_rect(low, high, pack_colour(LINE), 8.0, 1.5)
    draw_caption(draw_list, ImVec2(place.x + 9, place.y + 6), tr("From the side"), INK, _TEXT_SIZE)
    workspace.widgets["side view"] = (low.x, low.y, high.x, high.y)
