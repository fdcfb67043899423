"""Draws the toolbar at the left, with one button per tool."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.fields import draw_action_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import open_panel, pack_colour
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import ACCENT, INK, QUIET, Colour

_BUTTON_WIDTH = 72.0
"""Width of a button in pixels. It fits the longest name."""
_BUTTON_HEIGHTS = (13.0, 50.0)
"""Minimum and maximum height of a button in pixels. Buttons are lower in a low window, so that all are
visible.
"""
_MIN_STACKED_HEIGHT = 34.0
"""A button lower than this, in pixels, shows the name next to the icon instead of below it."""
_BUTTON_GAP = 4.0
"""Gap in pixels between two buttons. It is halved in a low window."""
_LOW_PADDING = 3.0
"""Margin in pixels above the first and below the last button in a low window."""
_ICON_SIZE = 18.0
"""Size in pixels of an icon above its name."""
_NAME_TEXT_SIZE = 12.0
"""Text size in pixels of a name below its icon. The longest name fits the button."""
_LOW_ICON_SIZE = 13.0
"""Size in pixels of an icon next to its name. It is as tall as the letters."""
_LOW_NAME_TEXT_SIZE = 11.0
"""Text size in pixels of a name next to its icon. Smaller text is not readable."""
_ICON_WIDTH = 19.0
"""Width in pixels of the space for the icon in a low button, left of the name."""


def draw_toolbar(workspace: Workspace, area: Area) -> None:
    """Draws the buttons. The active tool's button is amber."""
    actions = workspace.actions.menus["Tools"]
    with open_panel("tools", area, imgui.WindowFlags_.no_scrollbar):
        button_height = imgui.get_content_region_avail().y / len(actions)
        is_low = button_height - _BUTTON_GAP < _MIN_STACKED_HEIGHT
        gap = _BUTTON_GAP / 2 if is_low else _BUTTON_GAP
        if is_low:  # The window is low, so use smaller margins to keep every tool visible.
            imgui.set_cursor_pos_y(_LOW_PADDING)
            button_height = (area.height - 2 * _LOW_PADDING) / len(actions)
        size = ImVec2(_BUTTON_WIDTH, min(max(button_height - gap, _BUTTON_HEIGHTS[0]), _BUTTON_HEIGHTS[1]))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, gap))
        for action in actions:
            name, chosen = action.id.removeprefix("tool."), action.is_on is not None and action.is_on()
            position = imgui.get_cursor_screen_pos()
            if imgui.invisible_button(f"##{name}", size):
                workspace.actions.do(action.id)
            hovered = imgui.is_item_hovered()
            workspace.remember(f"tool {name}")
            draw_action_tooltip(workspace, action.id)
            _draw_button_face(position, size, action, chosen, hovered)
        imgui.pop_style_var()


def _draw_button_face(position: ImVec2, size: ImVec2, action: Action, chosen: bool, hovered: bool) -> None:
    """Draws the icon above the name, or next to the name in a low button."""
    draw_list = imgui.get_window_draw_list()
    if chosen or hovered:
        tint = pack_colour(ACCENT, 0.22 if chosen else 0.08)
        draw_list.add_rect_filled(position, ImVec2(position.x + size.x, position.y + size.y), tint, 7.0)
    label = tr(action.label)
    colours = (ACCENT, ACCENT) if chosen else (INK, QUIET)
    if size.y >= _MIN_STACKED_HEIGHT:
        top = position.y + max((size.y - _ICON_SIZE - _NAME_TEXT_SIZE - 6.0) / 2, 0.0)
        name_top = min(top + _ICON_SIZE + 6.0, position.y + size.y - _NAME_TEXT_SIZE - 2.0)
        _draw_centred(action.icon, _ICON_SIZE, position.x, size.x, top, colours[0])
        _draw_centred(label, _NAME_TEXT_SIZE, position.x, size.x, name_top, colours[1])
        return
    icon, letters = min(_LOW_ICON_SIZE, size.y - 1.0), min(_LOW_NAME_TEXT_SIZE, size.y - 2.0)
    _draw_centred(
        action.icon, icon, position.x, _ICON_WIDTH, position.y + (size.y - icon) / 2 - 1.0, colours[0]
    )
    grown = letters / imgui.get_font_size()
    max_width = min(imgui.calc_text_size(label).x * grown, size.x - _ICON_WIDTH)
    _draw_centred(
        label,
        letters,
        position.x + _ICON_WIDTH,
        max_width,
        position.y + (size.y - letters) / 2 - 1.0,
        colours[1],
    )


def _draw_centred(
    text: str, height: float, left: float, max_width: float, top: float, colour: Colour
) -> None:
    """Draws a centred line of text. Uses a smaller text size if the line is wider than ``max_width``."""
    width = imgui.calc_text_size(text).x * height / imgui.get_font_size()
    height *= min(max_width / max(width, 1e-3), 1.0)
    place = ImVec2(left + max(max_width - width, 0.0) / 2, top)
    imgui.get_window_draw_list().add_text(imgui.get_font(), height, place, pack_colour(colour), text)
