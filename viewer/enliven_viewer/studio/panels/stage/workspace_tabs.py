"""The workspace tabs in the menu bar. A workspace changes the visible panels, never the loaded data."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.panels.fields import tooltip
from enliven_viewer.studio.panels.style import packed
from enliven_viewer.studio.perform import ROOMS
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, INK

_TAB_TIPS = {
    "Perform": "Step into characters and record what you do",
    "Animate": "Give motion to characters, and shift, mix and repair it",
    "Model": "Sketch, cut and merge characters, with more room for the picture",
    "Play": "Only the picture",
}
_TAB_WIDTH = 84.0
"""Width of a tab in pixels: the longest name with margins."""
_NARROW_TAB_WIDTH = 64.0
"""Width in pixels of a tab in a narrow window: the longest name, and the dot of a recording."""
_MIN_GAP = 12.0
"""Minimum gap in pixels between the menus and the first tab."""


def tabs_width(*, narrow: bool = False) -> float:
    """Returns the width in pixels of all tabs, including the gap before them."""
    return _MIN_GAP + (_NARROW_TAB_WIDTH if narrow else _TAB_WIDTH) * len(ROOMS)


def draw_workspace_tabs(workspace: Workspace) -> None:
    """Draws one tab per workspace in the middle of the menu bar.

    The Perform tab has a dot during a recording.
    """
    if not imgui.begin_main_menu_bar():
        return
    perform = workspace.perform
    begin, wide = imgui.get_cursor_pos_x() + _MIN_GAP, imgui.get_window_width()
    tab = min(max((wide - begin) / len(ROOMS), _NARROW_TAB_WIDTH), _TAB_WIDTH)
    left = min(max((wide - tab * len(ROOMS)) / 2, begin), wide - tab * len(ROOMS))
    draw, high = imgui.get_window_draw_list(), imgui.get_window_height()
    for number, room in enumerate(ROOMS):
        x = left + number * tab
        if perform.active_workspace == room:
            draw.add_rect_filled(ImVec2(x, 1), ImVec2(x + tab, high), packed(ACCENT, 0.22), 6.0)
        imgui.set_cursor_pos_x(x)
        imgui.set_cursor_pos_y(0)
        if imgui.invisible_button(f"##room {room}", ImVec2(tab, high)):
            perform.active_workspace = room
        tooltip(tr("{0}  (Ctrl+{1})", tr(_TAB_TIPS[room]), number + 1))
        lit = perform.active_workspace == room or imgui.is_item_hovered()
        workspace.remember(f"room {room}")
        letters = imgui.calc_text_size(tr(room)).x
        at = ImVec2(x + (tab - letters) / 2, (high - imgui.get_text_line_height()) / 2)
        draw.add_text(at, packed(ACCENT if lit else INK), tr(room))
        if room == "Perform" and perform.recording.phase == "recording":
            draw.add_circle_filled(ImVec2(at.x - 9, high / 2), 4.0, packed(BAD))
    imgui.end_main_menu_bar()
