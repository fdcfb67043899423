"""Going to a key pose, or to the moment of a new one: playhead, tool and second view together."""

from __future__ import annotations

from typing import Protocol

from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.examples import layer_of, time_of
from enliven_viewer.studio.performer import PerformerView
from enliven_viewer.studio.workspace.input import ViewportInput

_ROOM = 1.35
"""How much air is left around a puppet that is brought into the picture."""


class WorkspaceViews(Protocol):
    """The editor, the tool in hand and the second view, which go to a moment together."""

    editor: Editor
    performer: PerformerView
    hand: ViewportInput


def go_to(desk: WorkspaceViews, take: str, seconds: float) -> None:
    """The playhead to a second of a take, where the puppet plays it; the second view shows that take."""
    editor, puppet = desk.editor, desk.editor.puppets.puppet
    if puppet is None:
        return
    editor.puppets.accept()
    number = layer_of(puppet, editor.selection.puppet_layer, take)
    if number is not None:
        editor.select(puppet_layer=number)
        editor.scrub(time_of(editor.project, puppet.layers[number], seconds))
    desk.performer.show(take)


def edit_pose(desk: WorkspaceViews, number: int) -> None:
    """Edit a key pose at its moment."""
    puppet = desk.editor.puppets.puppet
    if puppet is not None and 0 <= number < len(puppet.poses):
        _take_tool(desk)
        go_to(desk, puppet.poses[number].take, puppet.poses[number].time)
        desk.editor.puppets.edit_pose(number)
        bring_into_view(desk)


def begin_pose(desk: WorkspaceViews, take: str, seconds: float) -> None:
    """Make a key pose for a second of a take, and edit it."""
    clip = desk.editor.project.takes[take]
    frame = min(max(round(seconds / clip.step), 0), len(clip.turns) - 1)
    _take_tool(desk)
    go_to(desk, take, frame * clip.step)
    desk.editor.puppets.begin_pose(take, frame * clip.step)
    bring_into_view(desk)


def bring_into_view(desk: WorkspaceViews) -> None:
    """Move the camera to the chosen puppet where it is not wholly in the picture: it may have walked away."""
    editor = desk.editor
    standing = editor.puppets.stage.standing_of(editor.selection.puppet or "")
    if standing is None:
        return
    pixels = editor.lens.project(standing.vertices[:: max(len(standing.vertices) // 2000, 1)])[0]
    if not ((pixels >= 0) & (pixels <= editor.size)).all():
        low, high = standing.vertices.min(0), standing.vertices.max(0)
        editor.camera.frame((low, high), editor.size[0] / max(editor.size[1], 1.0), room=_ROOM)


def _take_tool(desk: WorkspaceViews) -> None:
    if desk.hand.tool.name != "puppet":
        desk.hand.take("puppet")
