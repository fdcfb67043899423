"""Draws long-running work over the view: its name, its progress, and a cancel button."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.workspace.workspace import Workspace

_BOX_WIDTH = 300.0
"""Width of the box in pixels. It fits the name of a file and the button."""
_EDGE_MARGIN = 14.0
"""Distance in pixels between the box and the border of the view."""
_TOP_MARGIN = 76.0
"""Distance in pixels from the top of the view, so that the tool's hint of up to two lines fits above."""
_WINDOW_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.always_auto_resize
)


def draw_progress_box(workspace: Workspace, area: Area) -> None:
    """Draws cancellable work at the upper right of the view."""
    background_task = workspace.editor.background
    progress = background_task.progress
    if progress is None:
        return
    progress.seconds += imgui.get_io().delta_time
    width = min(_BOX_WIDTH, area.width - 2 * _EDGE_MARGIN)
    corner = ImVec2(area.x + area.width - _EDGE_MARGIN, area.y + _TOP_MARGIN)
    imgui.set_next_window_pos(corner, 0, ImVec2(1.0, 0.0))
    imgui.set_next_window_size(ImVec2(width, 0))
    imgui.begin(labelled(tr("Working"), "Working"), None, _WINDOW_FLAGS)
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(background_task.message)
    imgui.pop_text_wrap_pos()
    if progress.share is None:
        imgui.progress_bar(-imgui.get_time(), ImVec2(width - 120, 0), f"{progress.seconds:.0f} s")
    else:
        imgui.progress_bar(progress.share, ImVec2(width - 120, 0), f"{100 * progress.share:.0f} %")
    workspace.remember("work progress")
    imgui.same_line()
    if imgui.button(labelled(tr("Cancel"), "cancel work"), ImVec2(-1, 0)):
        background_task.cancel()
    workspace.remember("cancel work")
    imgui.end()
