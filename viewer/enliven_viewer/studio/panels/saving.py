"""The dialogues that prevent data loss: unsaved work, and a file that another window has saved."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.live.hud import format_time
from enliven_viewer.studio.app.style import draw_note, push_colours
from enliven_viewer.studio.panels.modal import draw_button, draw_choice, open_modal
from enliven_viewer.studio.workspace.project_comparison import Difference
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
        imgui.text_wrapped(tr("{0} has unsaved changes. The changes are lost unless you save them.", name))
        imgui.dummy(ImVec2(0, 6))
        if draw_choice(workspace, "Save", "Cancel"):
            workspace.continue_waiting_command(discard=False)
        imgui.same_line(0.0, 40)
        if draw_button(workspace, "Discard"):
            workspace.continue_waiting_command(discard=True)


def _draw_recording(workspace: Workspace) -> None:
    """Draws a notice about a running recording: its length, and the effect of each button."""
    seconds = format_time(workspace.recording.seconds)
    with push_colours(BAD, imgui.Col_.text):
        imgui.text_unformatted(tr("A recording is running: {0}", seconds))
    imgui.text_wrapped(
        tr(
            "Save ends and keeps the recording. Discard deletes the recording. Cancel continues the "
            "recording."
        )
    )
    imgui.dummy(ImVec2(0, 6))


_LIST_HEIGHT = 150.0
"""Height in pixels of the list of differences: seven rows; more scroll."""
_SIDE_TITLES = {
    "only here": "Only in this window",
    "only in the file": "Only in the file",
    "different": "Different in this window and in the file",
}
"""The heading of each kind of difference."""


def draw_changed_file(workspace: Workspace) -> None:
    """Draws the dialogue."""
    if workspace.store.path is None:
        workspace.cancel()
        return
    name = workspace.store.path.name
    with open_modal("The file has changed", 500) as shown:
        if not shown:
            return
        imgui.text_wrapped(
            tr(
                "{0} was saved by another window or program since you opened it here. If you overwrite "
                "the file, that work is lost.",
                name,
            )
        )
        imgui.dummy(ImVec2(0, 6))
        if workspace.compared is not None:
            _draw_differences(workspace, workspace.compared)
        if draw_button(workspace, "Save as..."):
            workspace.ask_for_name()
        imgui.same_line()
        if draw_button(workspace, "Compare"):
            workspace.compare()
        imgui.same_line()
        if draw_button(workspace, "Overwrite"):
            workspace.run_and_report(lambda: workspace.save(over=True))
        imgui.same_line()
        if draw_button(workspace, "Cancel") or imgui.is_key_pressed(imgui.Key.escape):
            workspace.cancel()


def _draw_differences(workspace: Workspace, differences: tuple[Difference, ...]) -> None:
    """Draws the differences by kind, and a button that adds the items that only the file contains."""
    imgui.begin_child("##differences", ImVec2(0, _LIST_HEIGHT), imgui.ChildFlags_.frame_style)
    if not differences:
        draw_note("Both versions are the same.")
    for side, heading in _SIDE_TITLES.items():
        items = [difference.item for difference in differences if difference.side == side]
        if items:
            draw_note(heading)
        for item in items:
            imgui.text_wrapped(f"  {item}")
    imgui.end_child()
    if any(difference.side == "only in the file" for difference in differences):
        if imgui.button(
            labelled(
                tr("Add the items that are only in the file"),
                "Add the items that are only in the file",
            ),
            ImVec2(-1, 0),
        ):
            workspace.add_saved_items()
        workspace.remember("dialog Add the items that are only in the file")
    imgui.dummy(ImVec2(0, 6))
