"""Going to a key pose, or to the moment of a new one: playhead, tool and second view together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enliven_viewer.studio.examples.times import layer_of, time_of

if TYPE_CHECKING:
    from enliven_viewer.studio.desk import Desk


def go_to(desk: Desk, take: str, seconds: float) -> None:
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


def edit_pose(desk: Desk, number: int) -> None:
    """Edit a key pose at its moment."""
    puppet = desk.editor.puppets.puppet
    if puppet is not None and 0 <= number < len(puppet.poses):
        _take_in_hand(desk)
        go_to(desk, puppet.poses[number].take, puppet.poses[number].time)
        desk.editor.puppets.edit_pose(number)


def begin_pose(desk: Desk, take: str, seconds: float) -> None:
    """Make a key pose for a second of a take, and edit it."""
    clip = desk.editor.project.takes[take]
    frame = min(max(round(seconds / clip.step), 0), len(clip.turns) - 1)
    _take_in_hand(desk)
    go_to(desk, take, frame * clip.step)
    desk.editor.puppets.begin_pose(take, frame * clip.step)


def _take_in_hand(desk: Desk) -> None:
    if desk.hand.tool.name != "puppet":
        desk.hand.take("puppet")
