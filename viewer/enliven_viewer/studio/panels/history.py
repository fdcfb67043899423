"""The list of all history steps; a click goes to a step."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.panels.style import tinted
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import FAINT, INK

_SIZE = 250.0, 300.0
"""Size in pixels: a dozen steps."""
_FROM_RIGHT = 300.0
"""Initial distance in pixels from the right of the window: next to the side panel."""
_FROM_TOP = 36.0
"""Distance in pixels from the top: below the menu."""


def draw_history(workspace: Workspace) -> None:
    """Draws the list in a separate window; undone steps are faint."""
    editor, wide = workspace.editor, imgui.get_main_viewport().size.x
    imgui.set_next_window_size(ImVec2(_SIZE[0], _SIZE[1]), imgui.Cond_.appearing)
    corner = ImVec2(wide - _FROM_RIGHT, _FROM_TOP)
    imgui.set_next_window_pos(corner, imgui.Cond_.appearing, ImVec2(1.0, 0.0))
    shown, stays = imgui.begin(labelled(tr("History"), "History"), True, imgui.WindowFlags_.no_saved_settings)
    workspace.history_shown = bool(stays)
    if shown:
        steps, at = editor.history.steps, editor.history.at
        for number, name in enumerate(steps):
            with tinted(FAINT if number > at else INK, imgui.Col_.text):
                translated = tr(name)
                label = translated[:1].upper() + translated[1:] if name else tr("At the start")
                if imgui.selectable(f"{label}###step {number}", number == at)[0]:
                    editor.go_to(number)
            workspace.remember(f"step {number}")
        if workspace.history_seen != (len(steps), at):
            workspace.history_seen = (len(steps), at)
            imgui.set_scroll_y(24 * at)
    imgui.end()
