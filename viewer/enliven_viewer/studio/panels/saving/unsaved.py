"""Asks before unsaved edits or a running recording are lost."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.live.hud import format_time
from enliven_viewer.studio.app.style import push_colours
from enliven_viewer.studio.panels.modal import draw_button, draw_choice, open_modal
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import BAD


def draw_unsaved(workspace: Workspace) -> None:
    """Draws the dialogue that asks before work is lost."""
    with open_modal("Save your work?", 430) as shown:
        if not shown:
            return
        if workspace.store.records:
            _draw_recording(workspace)
        name = workspace.store.name
        imgui.text_wrapped(
            tr("{0} has changes that are not saved. They are lost unless you save them.", name)
        )
        imgui.dummy(ImVec2(0, 6))
        if draw_choice(workspace, "Save", "Cancel"):
            workspace.go_on(discard=False)
        imgui.same_line(0.0, 40)
        if draw_button(workspace, "Discard"):
            workspace.go_on(discard=True)


def _draw_recording(workspace: Workspace) -> None:
    """Draws a notice about a running recording: its length, and the effect of each button."""
    seconds = format_time(workspace.perform.recording.seconds)
    with push_colours(BAD, imgui.Col_.text):
        imgui.text_unformatted(tr("A recording is running: {0}", seconds))
    imgui.text_wrapped(tr("Save ends and keeps the recording. Discard deletes it. Cancel continues it."))
    imgui.dummy(ImVec2(0, 6))
