"""The tools at the left: a button each, with its letter."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.panels.modal import action_tip
from enliven_viewer.studio.panels.style import packed, panel
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, INK, QUIET

_SIZE = ImVec2(72, 50)


def draw_toolbar(workspace: Workspace, area: Area) -> None:
    """Draw the buttons; that of the active tool is amber."""
    with panel("tools", area):
        for action in workspace.actions.menus["Tools"]:
            name, chosen = action.id.removeprefix("tool."), action.on is not None and action.on()
            at = imgui.get_cursor_screen_pos()
            if imgui.invisible_button(f"##{name}", _SIZE):
                workspace.actions.do(action.id)
            hovered = imgui.is_item_hovered()
            workspace.remember(f"tool {name}")
            action_tip(workspace, action.id)
            _face(at, action.icon, action.label, chosen, hovered)


def _face(at: ImVec2, icon: str, label: str, chosen: bool, hovered: bool) -> None:
    draw = imgui.get_window_draw_list()
    if chosen or hovered:
        tint = packed(ACCENT, 0.22 if chosen else 0.08)
        draw.add_rect_filled(at, ImVec2(at.x + _SIZE.x, at.y + _SIZE.y), tint, 7.0)
    colour = packed(ACCENT if chosen else INK)
    wide = imgui.calc_text_size(icon).x * 18 / imgui.get_font_size()
    font = imgui.get_font()
    draw.add_text(font, 18.0, ImVec2(at.x + (_SIZE.x - wide) / 2, at.y + 7), colour, icon)
    wide = imgui.calc_text_size(label).x * 12 / imgui.get_font_size()
    quiet = packed(ACCENT if chosen else QUIET)
    draw.add_text(font, 12.0, ImVec2(at.x + (_SIZE.x - wide) / 2, at.y + 31), quiet, label)
