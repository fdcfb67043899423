"""The tools at the left: a button each, with its letter."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.actions import Action
from enliven_viewer.studio.panels.modal import action_tip
from enliven_viewer.studio.panels.style import packed, panel
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, INK, QUIET

_WIDE = 72.0
"""Pixels of a button: the longest name."""
_HIGH = (30.0, 50.0)
"""Pixels, the lowest and the highest button: in a low window they are lower, so that all are in sight."""
_NAMED = 40.0
"""Pixels: a lower button has no room for its name, which is on its tooltip."""
_APART = 4.0
"""Pixels between two buttons."""


def draw_toolbar(workspace: Workspace, area: Area) -> None:
    """Draw the buttons; that of the active tool is amber."""
    actions = workspace.actions.menus["Tools"]
    with panel("tools", area):
        room = imgui.get_content_region_avail().y / len(actions) - _APART
        size = ImVec2(_WIDE, min(max(room, _HIGH[0]), _HIGH[1]))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, _APART))
        for action in actions:
            name, chosen = action.id.removeprefix("tool."), action.on is not None and action.on()
            at = imgui.get_cursor_screen_pos()
            if imgui.invisible_button(f"##{name}", size):
                workspace.actions.do(action.id)
            hovered = imgui.is_item_hovered()
            workspace.remember(f"tool {name}")
            action_tip(workspace, action.id)
            _face(at, size, action, chosen, hovered)
        imgui.pop_style_var()


def _face(at: ImVec2, size: ImVec2, action: Action, chosen: bool, hovered: bool) -> None:
    draw, font = imgui.get_window_draw_list(), imgui.get_font()
    if chosen or hovered:
        tint = packed(ACCENT, 0.22 if chosen else 0.08)
        draw.add_rect_filled(at, ImVec2(at.x + size.x, at.y + size.y), tint, 7.0)
    named = size.y >= _NAMED
    top = (size.y - (36 if named else 18)) / 2
    texts = ((action.icon, 18.0, top, INK), (action.label, 12.0, top + 24, QUIET))
    for text, high, below, colour in texts[: 1 + named]:
        wide = imgui.calc_text_size(text).x * high / imgui.get_font_size()
        place = ImVec2(at.x + (size.x - wide) / 2, at.y + below)
        draw.add_text(font, high, place, packed(ACCENT if chosen else colour), text)
