"""Dragging on the timeline: scrub, move a layer in time, change its speed, mute it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from enliven.document import Layer, Project
from enliven_viewer.studio.editor import Edit, Editor
from enliven_viewer.studio.timeline.layout import FASTEST, RULER, SLOWEST, SNAP, LaneHandle, TimelineLayout
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
        if self._handle.layers:
            self.editor.select(layer=self._handle.layers[0])
        if self._handle.kind == "ruler":
            self.editor.scrub(layout.time(x))
        elif self._handle.kind == "mute":
            names = self._handle.layers
            muted = not self.editor.project.layers[names[0]].muted
            self.editor.edit("mute" if muted else "unmute", _changing(names, muted=muted))
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
        layout, names = self._held_layout, self._handle.layers
        bar = next(bar for bar in layout.bars() if bar.ids == names)
        moved = layout.time(x) - layout.time(self._from)
        if self._handle.kind == "bar":
            return _changing(names, offset=self._snapped(layout, bar.layer, bar.layer.offset + moved))
        take = layout.project.takes[bar.layer.take]
        ends = layout.time(bar.right) + moved
        return _changing(names, speed=bar.layer.ending(ends, take.duration, SLOWEST, FASTEST).speed)

    def _snapped(self, layout: TimelineLayout, layer: Layer, offset: float) -> float:
        """An offset that sticks to what is near: zero, the playhead, the ends of other bars."""
        places = [0.0, self.editor.time]
        for bar in layout.bars():
            if layer.id not in bar.ids:
                places += [bar.layer.offset, layout.time(bar.right)]
        nearest = min(places, key=lambda place: abs(place - offset))
        near = abs(layout.x(nearest) - layout.x(offset)) <= SNAP
        return nearest if near else offset


def _changing(layers: tuple[str, ...], **changes: Any) -> Edit:
    """The edit that changes attributes of layers."""

    def change(project: Project) -> Project:
        return project.with_layers(*(replace(project.layers[name], **changes) for name in layers))

    return change
