"""Draws the list of all history steps. A click goes to a step."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.app.style import push_colours
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import FAINT, INK

_LIST_SIZE = 250.0, 300.0
"""Size in pixels. It fits a dozen steps."""
_INITIAL_RIGHT_DISTANCE = 300.0
"""Initial distance in pixels from the right of the window: next to the side panel."""
_TOP_DISTANCE = 36.0
"""Distance in pixels from the top: below the menu."""


def draw_history(workspace: Workspace) -> None:
    """Draws the list in an ImGui window. Undone steps are faint."""
    editor, width = workspace.editor, imgui.get_main_viewport().size.x
    imgui.set_next_window_size(ImVec2(_LIST_SIZE[0], _LIST_SIZE[1]), imgui.Cond_.appearing)
    corner = ImVec2(width - _INITIAL_RIGHT_DISTANCE, _TOP_DISTANCE)
    imgui.set_next_window_pos(corner, imgui.Cond_.appearing, ImVec2(1.0, 0.0))
    shown, is_open = imgui.begin(
        labelled(tr("History"), "History"), True, imgui.WindowFlags_.no_saved_settings
    )
    workspace.history_shown = bool(is_open)
    if shown:
        steps, current_step = editor.history.steps, editor.history.current_step
        for number, name in enumerate(steps):
            with push_colours(FAINT if number > current_step else INK, imgui.Col_.text):
                translated = tr(name)
                label = translated[:1].upper() + translated[1:] if name else tr("At the start")
                if imgui.selectable(f"{label}###step {number}", number == current_step)[0]:
                    editor.go_to(number)
            workspace.remember(f"step {number}")
        if workspace.history_seen != (len(steps), current_step):
            workspace.history_seen = (len(steps), current_step)
            imgui.set_scroll_y(24 * current_step)
    imgui.end()
