"""Dragging on the timeline: scrub, move a layer in time, change its speed, mute it."""

from __future__ import annotations

from typing import Any

from enliven.modeling.edits import change_layers
from enliven_viewer.studio.editor import Edit, Editor
from enliven_viewer.studio.timeline.layout import (
    FASTEST,
    RULER,
    SLOWEST,
    SNAP,
    Bar,
    LaneHandle,
    TimelineLayout,
)
from enliven_viewer.studio.timeline.puppet_drag import PuppetTimelineInput


class TimelineInput:
    """Turns the pointer over the timeline into edits; pixels are counted from the timeline's top left."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.width, self.scrolled = 1000.0, 0.0
        self.puppets = PuppetTimelineInput(editor)
        self._handle = LaneHandle("nothing")
        self._from, self._held_layout = 0.0, self.layout

    @property
    def layout(self) -> TimelineLayout:
        """The layout at this moment."""
        editor = self.editor
        return TimelineLayout(editor.project, editor.length, self.width, self.scrolled)

    @property
    def busy(self) -> bool:
        """Whether something is held."""
        return self._handle.kind != "nothing" or self.puppets.busy

    @property
    def height(self) -> float:
        """Pixels that ruler and lanes take, with those of puppets."""
        return self.layout.height + self.puppets.lanes(self.layout).height

    def press(self, x: float, y: float) -> None:
        """The left button went down."""
        layout = self.layout
        if y >= RULER and self.puppets.press(x, y, layout):
            return
        self._handle, self._from, self._held_layout = layout.handle_at(x, y), x, layout
        handle = self._handle
        if handle.layers:
            self.editor.select(layer=(handle.character, handle.layers[0]))
        if self._handle.kind == "ruler":
            self.editor.scrub(layout.time(x))
        elif self._handle.kind == "mute":
            muted = not self.editor.project.characters[handle.character].playing[handle.layers[0]].muted
            self.editor.edit("mute" if muted else "unmute", _changing(handle, muted=muted))
            self._handle = LaneHandle("nothing")

    def drag(self, x: float) -> None:
        """The pointer moved."""
        if self.puppets.busy:
            self.puppets.drag(x)
        elif self._handle.kind == "ruler":
            self.editor.scrub(self._held_layout.time(x))
        elif self._handle.kind in ("bar", "edge") and x != self._from:
            self.editor.sketch(self._change(x))

    def release(self, x: float) -> None:
        """The button went up."""
        if self.puppets.busy:
            self.puppets.release(x)
        elif self._handle.kind in ("bar", "edge") and self.editor.draft is not None:
            word = "move layer" if self._handle.kind == "bar" else "change speed"
            self.editor.edit(word, self._change(x))
        self._handle = LaneHandle("nothing")

    def double(self, x: float, y: float) -> bool:
        """The second click of two; whether it meant something."""
        return y >= RULER and self.puppets.double(x, y, self.layout)

    def type(self, key: str) -> bool:
        """A key was pressed; returns whether it applied to something on the timeline."""
        return self.puppets.type(key)

    def _change(self, x: float) -> Edit:
        """The edit that dragging to ``x`` makes."""
        layout, handle = self._held_layout, self._handle
        bar = next(b for b in layout.bars() if (b.character, b.layers) == (handle.character, handle.layers))
        moved = layout.time(x) - layout.time(self._from)
        if handle.kind == "bar":
            return _changing(handle, offset=self._snapped(layout, bar, bar.layer.offset + moved))
        ends, length = layout.time(bar.right) + moved, layout.project.length_of(bar.layer)
        return _changing(handle, speed=bar.layer.ending(ends, length, SLOWEST, FASTEST).speed)

    def _snapped(self, layout: TimelineLayout, bar: Bar, offset: float) -> float:
        """An offset that sticks to what is near: zero, the playhead, the ends of other bars."""
        places = [0.0, self.editor.time]
        for other in layout.bars():
            if (other.character, other.layers) != (bar.character, bar.layers):
                places += [other.layer.offset, layout.time(other.right)]
        nearest = min(places, key=lambda place: abs(place - offset))
        near = abs(layout.x(nearest) - layout.x(offset)) <= SNAP
        return nearest if near else offset


def _changing(handle: LaneHandle, **changes: Any) -> Edit:
    """The edit that changes attributes of a lane's layers."""
    return lambda project: change_layers(project, handle.character, handle.layers, **changes)
