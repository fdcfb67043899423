"""The workspace tabs in the menu bar. A workspace changes the visible panels, never the loaded data."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.perform.session import WORKSPACES
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, INK

_TAB_TIPS = {
    "Perform": "Step into characters and record what you do",
    "Animate": "Give motion to characters, and shift, mix and repair it",
    "Model": "Sketch, cut and merge characters, with more room for the picture",
    "Play": "Only the picture",
}
_TAB_WIDTH = 84.0
"""Width of a tab in pixels. It fits the longest name with margins."""
_NARROW_TAB_WIDTH = 64.0
"""Width in pixels of a tab in a narrow window. It fits the longest name and the recording dot."""
_MIN_GAP = 12.0
"""Minimum gap in pixels between the menus and the first tab."""


def measure_tabs(*, narrow: bool = False) -> float:
    """Returns the width in pixels of all tabs, including the gap before them."""
    return _MIN_GAP + (_NARROW_TAB_WIDTH if narrow else _TAB_WIDTH) * len(WORKSPACES)


def draw_workspace_tabs(workspace: Workspace) -> None:
    """Draws one tab per workspace in the middle of the menu bar.

    The Perform tab has a dot during a recording.
    """
    if not imgui.begin_main_menu_bar():
        return
    perform = workspace.perform
    begin, width = imgui.get_cursor_pos_x() + _MIN_GAP, imgui.get_window_width()
    tab = min(max((width - begin) / len(WORKSPACES), _NARROW_TAB_WIDTH), _TAB_WIDTH)
    left = min(max((width - tab * len(WORKSPACES)) / 2, begin), width - tab * len(WORKSPACES))
    draw_list, height = imgui.get_window_draw_list(), imgui.get_window_height()
    for number, workspace_name in enumerate(WORKSPACES):
        x = left + number * tab
        if perform.active_workspace == workspace_name:
            draw_list.add_rect_filled(ImVec2(x, 1), ImVec2(x + tab, height), pack_colour(ACCENT, 0.22), 6.0)
        imgui.set_cursor_pos_x(x)
        imgui.set_cursor_pos_y(0)
        if imgui.invisible_button(f"##room {workspace_name}", ImVec2(tab, height)):
            perform.active_workspace = workspace_name
        draw_tooltip(tr("{0}  (Ctrl+{1})", tr(_TAB_TIPS[workspace_name]), number + 1))
        is_bright = perform.active_workspace == workspace_name or imgui.is_item_hovered()
        workspace.remember(f"room {workspace_name}")
        letters = imgui.calc_text_size(tr(workspace_name)).x
        text_offset = ImVec2(x + (tab - letters) / 2, (height - imgui.get_text_line_height()) / 2)
        draw_list.add_text(text_offset, pack_colour(ACCENT if is_bright else INK), tr(workspace_name))
        if workspace_name == "Perform" and perform.recording.phase == "recording":
            draw_list.add_circle_filled(ImVec2(text_offset.x - 9, height / 2), 4.0, pack_colour(BAD))
    imgui.end_main_menu_bar()
