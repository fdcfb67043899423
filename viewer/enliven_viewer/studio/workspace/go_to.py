"""Going to a key pose, or to the moment of a new one: playhead, tool and second view together."""

from __future__ import annotations

from typing import Protocol

from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.examples import layer_of
from enliven_viewer.studio.performer import PerformerView
from enliven_viewer.studio.workspace.input import ViewportInput

_ROOM = 1.35
"""How much air is left around a puppet that is brought into the picture."""


class WorkspaceViews(Protocol):
    """The editor, the input and the second view, which go to a moment together."""

    editor: Editor
    performer: PerformerView
    input: ViewportInput


def go_to(workspace: WorkspaceViews, take: str, seconds: float) -> None:
    """The playhead to a second of a take, where the puppet plays it; the second view shows that take."""
    editor, puppet = workspace.editor, workspace.editor.puppets.puppet
    if puppet is None:
        return
    editor.puppets.accept()
    number = layer_of(puppet, editor.selection.layer, take)
    if number is not None:
        editor.select(layer=number)
        editor.scrub(puppet.layers[number].time_of(seconds, editor.project.takes[take].duration))
    workspace.performer.show(take)


def edit_pose(workspace: WorkspaceViews, number: int) -> None:
    """Edit a key pose at its moment."""
    puppet = workspace.editor.puppets.puppet
    if puppet is not None and 0 <= number < len(puppet.poses):
        _take_tool(workspace)
        go_to(workspace, puppet.poses[number].take, puppet.poses[number].time)
        workspace.editor.puppets.edit_pose(number)
        bring_into_view(workspace)


def begin_pose(workspace: WorkspaceViews, take: str, seconds: float) -> None:
    """Make a key pose for a second of a take, and edit it."""
    clip = workspace.editor.project.takes[take]
    frame = min(max(round(seconds / clip.step), 0), len(clip.turns) - 1)
    _take_tool(workspace)
    go_to(workspace, take, frame * clip.step)
    workspace.editor.puppets.begin_pose(take, frame * clip.step)
    bring_into_view(workspace)


def bring_into_view(workspace: WorkspaceViews) -> None:
    """Move the camera to the chosen puppet where it is not wholly in the picture: it may have walked away."""
    editor = workspace.editor
    standing = editor.puppets.shown
    if standing is None:
        return
    pixels = editor.lens.project(standing.vertices[:: max(len(standing.vertices) // 2000, 1)])[0]
    if not ((pixels >= 0) & (pixels <= editor.size)).all():
        low, high = standing.vertices.min(0), standing.vertices.max(0)
        editor.camera.frame((low, high), editor.size[0] / max(editor.size[1], 1.0), room=_ROOM)


def _take_tool(workspace: WorkspaceViews) -> None:
    if workspace.input.tool.name != "puppet":
        workspace.input.take("puppet")
