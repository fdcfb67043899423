"""Draws the limb that is about to be held as seen on screen from the side, in a corner of the picture."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.panels.style import caption, packed
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import INK, LINE, UNTINTED

_SHARE = 0.3
"""Share of the picture's height."""
_LEAST = 104.0
"""Pixels of its height at least: a limb is told from others."""
_MOST = 400.0
"""Pixels of its height at most: more shows no more."""
_WIDE = 1.2
"""Width over height, as of the performers in the other corner."""
_MARGIN = 14.0
"""Pixels to the border of the picture."""
_TEXT = 13.0
"""Pixels of its name."""


def place_of_side_view(workspace: Workspace, area: Area) -> Area:
    """Returns where it is in the window: at the top right, or below the performers where they are there."""
    tall = min(max(_SHARE * area.height, _LEAST), _MOST, max(area.height / 2 - _MARGIN, 1.0))
    wide, top = _WIDE * tall, area.y + _MARGIN
    left = area.x + area.width - wide - _MARGIN
    taken = workspace.widgets.get("performer inset")
    if taken is not None and taken[2] > left and taken[1] < top + tall:
        top = taken[3] + _MARGIN
    return Area(left, top, wide, tall)


def draw_side_view(workspace: Workspace, area: Area, texture: int) -> None:
    """Draws the picture that the window made of it."""
    draw, place = imgui.get_background_draw_list(), place_of_side_view(workspace, area)
    low, high = ImVec2(place.x, place.y), ImVec2(place.x + place.width, place.y + place.height)
    white = packed(UNTINTED)
    draw.add_image_rounded(imgui.ImTextureRef(texture), low, high, ImVec2(0, 1), ImVec2(1, 0), white, 8.0)
    draw.add_rect(low, high, packed(LINE), 8.0, 1.5)
    caption(draw, ImVec2(place.x + 9, place.y + 6), tr("From the side"), INK, _TEXT)
    workspace.widgets["side view"] = (low.x, low.y, high.x, high.y)
