"""Dragging on the timeline: scrub, move a layer in time, change its speed, mute it."""

from __future__ import annotations

from typing import Any

from enliven.document import Switch
from enliven.modeling.edits import change_layers, stretch_clip
from enliven_viewer.studio.editor import Edit, Editor
from enliven_viewer.studio.timeline.layout import (
    SNAP,
    Lane,
    LaneHandle,
    TimelineLayout,
)
from enliven_viewer.studio.timeline.puppet_drag import DRAGGED, PuppetRows

_NOTHING = LaneHandle("nothing")


class TimelineInput:
    """Turns the pointer over the timeline into edits; pixels are counted from the timeline's top left.

    Attributes:
        rows: what the pointer does on the rows under a puppet's bars.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.width, self.scrolled = 1000.0, 0.0
        self.rows = PuppetRows(editor)
        self._handle = _NOTHING
        self._from, self._held_layout = 0.0, self.layout
        self._switches: tuple[Switch, ...] = ()

    @property
    def layout(self) -> TimelineLayout:
        """The layout at this moment."""
        editor = self.editor
        return TimelineLayout(editor.project, editor.length, self.width, self.scrolled, self.rows.details)

    @property
    def busy(self) -> bool:
        """Whether something is held."""
        return self._handle.kind != "nothing"

    def press(self, x: float, y: float) -> None:
        """The left button went down."""
        layout = self.layout
        handle = layout.handle_at(x, y)
        self.rows.marked = None
        if handle.layers:
            self.editor.select(character=handle.character, layer=handle.number)
        if handle.kind == "ruler":
            self.editor.scrub(layout.time(x))
        elif handle.kind == "mute":
            muted = not self.editor.project.characters[handle.character].playing[handle.number].muted
            self.editor.edit("mute" if muted else "unmute", _changing(handle, muted=muted))
        elif handle.layers and handle.kind not in ("bar", "edge", "label"):
            if handle.kind == "switch":
                self._switches = tuple(self.rows.details.switches(handle.number))
            self.rows.press(handle, layout, x)
        self._handle, self._from, self._held_layout = handle, x, layout

    def drag(self, x: float) -> None:
        """The pointer moved."""
        if self._handle.kind == "ruler":
            self.editor.scrub(self._held_layout.time(x))
        elif self._dragged is not None and x != self._from:
            if self.editor.puppets.posing:
                self.editor.puppets.accept()
            self.editor.sketch(self._change(x))

    def release(self, x: float) -> None:
        """The button went up: a drag becomes one edit; a click on a key pose opens it."""
        word, handle = self._dragged, self._handle
        if word is not None and self.editor.draft is not None:
            self.editor.edit(word, self._change(x))
        elif handle.kind == "pose":
            self.rows.edit_pose(handle.item)
        self._handle = _NOTHING

    def double(self, x: float, y: float) -> bool:
        """The second click of two; whether it meant something."""
        return self.rows.double(self.layout.handle_at(x, y))

    @property
    def _dragged(self) -> str | None:
        """What dragging the held part is called; None for what is not dragged."""
        return {"bar": "move layer", "edge": "change speed", **DRAGGED}.get(self._handle.kind)

    def _change(self, x: float) -> Edit:
        """The edit that dragging to ``x`` makes."""
        layout, handle = self._held_layout, self._handle
        lane = next(
            one
            for one in layout.lanes()
            if (one.character.id, one.layers) == (handle.character, handle.layers)
        )
        if handle.kind in DRAGGED:
            return self.rows.dragged(handle, layout.second(lane, x), self._switches)
        moved = layout.time(x) - layout.time(self._from)
        if handle.kind == "bar":
            return _changing(handle, offset=self._snapped(layout, lane, lane.layer.offset + moved))
        ends = layout.time(lane.right) + moved
        return lambda project: stretch_clip(project, handle.character, handle.layers, 0, end=ends)

    def _snapped(self, layout: TimelineLayout, lane: Lane, offset: float) -> float:
        """An offset that sticks to what is near: zero, the playhead, the ends of other bars."""
        places = [0.0, self.editor.time]
        for other in layout.bars():
            if (other.character, other.layers) != (lane.character, lane.layers):
                places += [other.layer.offset, layout.time(other.right)]
        nearest = min(places, key=lambda place: abs(place - offset))
        near = abs(layout.x(nearest) - layout.x(offset)) <= SNAP
        return nearest if near else offset


def _changing(handle: LaneHandle, **changes: Any) -> Edit:
    """The edit that changes attributes of a lane's layers."""
    return lambda project: change_layers(project, handle.character, handle.layers, **changes)
