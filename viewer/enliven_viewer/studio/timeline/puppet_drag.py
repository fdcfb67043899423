"""Dragging on the lanes of puppets: layers in time, key poses to other moments, switches of contact."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from enliven.document import Switch
from enliven.errors import EnlivenError
from enliven.examples import motion_of
from enliven.modeling.puppet import change_layer
from enliven_viewer.studio.editor import Edit, Editor
from enliven_viewer.studio.examples import (
    CoverageCache,
    TakeCoverage,
    added_switch,
    constraints_of,
    moved_switch,
    removed_switch,
    retimed,
    without_constraint,
)
from enliven_viewer.studio.timeline.layout import FASTEST, SLOWEST, SNAP, TimelineLayout
from enliven_viewer.studio.timeline.puppet_lanes import PuppetLaneHandle, PuppetLanes

_DRAGGED = ("bar", "edge", "pose", "switch")


class PuppetTimelineInput:
    """Turns the pointer over the lanes of puppets into edits; pixels are the timeline's.

    Attributes:
        chosen: the switch or the constraint that Delete takes away, or None.
        edit_pose: called with the number of a key pose that was clicked.
        begin_pose: called with a take and a second of it where a suggestion was clicked.
    """

    def __init__(self, editor: Editor, coverages: CoverageCache | None = None) -> None:
        self.editor, self.coverages = editor, coverages or CoverageCache()
        self.chosen: PuppetLaneHandle | None = None
        self.edit_pose: Callable[[int], object] = editor.puppets.edit_pose
        self.begin_pose: Callable[[str, float], object] = editor.puppets.begin_pose
        self._handle: PuppetLaneHandle | None = None
        self._from, self._lanes = 0.0, self.lanes(TimelineLayout(editor.project, 1.0, 1000.0))
        self._known: tuple[object, dict[int, tuple[Switch, ...]]] = (None, {})

    def lanes(self, layout: TimelineLayout) -> PuppetLanes:
        """The lanes as they are now."""
        return PuppetLanes(layout, self.editor.selection.puppet, self._coverage, self._switches)

    @property
    def busy(self) -> bool:
        """Whether something is held."""
        return self._handle is not None

    def press(self, x: float, y: float, layout: TimelineLayout) -> bool:
        """The left button went down; whether a lane of a puppet was there."""
        lanes = self.lanes(layout)
        handle = lanes.handle_at(x, y)
        self.chosen = handle if handle is not None and handle.kind in ("switch", "held") else None
        if handle is None:
            return False
        if self.editor.selection.puppet != handle.puppet:
            self.editor.puppets.choose(handle.puppet)
        self.editor.select(puppet_layer=handle.layer)
        layer = lanes.layer(handle)
        if handle.kind == "mute":
            word = "unmute" if layer.muted else "mute"
            self._edit(word, handle, muted=not layer.muted)
        elif handle.kind == "suggested":
            self.begin_pose(layer.take, lanes.suggested(_row(lanes, handle, "poses"))[handle.item][0])
        elif handle.kind == "found" and layer.switches is not None:
            self._edit("find contacts again", handle, switches=None)
        elif handle.kind == "held":
            frame = constraints_of(self.editor.project, handle.puppet, handle.layer)[handle.item].frame
            take = self.editor.project.takes[layer.take]
            self.editor.scrub(layer.time_of(frame * take.step, take.duration))
        elif handle.kind == "band":
            self.editor.scrub(layout.time(x))
        self._handle, self._from, self._lanes = handle, x, lanes
        return True

    def drag(self, x: float) -> None:
        """The pointer moved."""
        if self._handle is not None and self._handle.kind in _DRAGGED and x != self._from:
            if self.editor.puppets.posing:
                self.editor.puppets.accept()
            self.editor.sketch(self._change(x))

    def release(self, x: float) -> None:
        """The button went up: a drag becomes one edit; a click on a key pose opens it."""
        handle, self._handle = self._handle, None
        if handle is None:
            return
        if handle.kind in _DRAGGED and self.editor.draft is not None:
            words = {"bar": "move layer", "edge": "change speed", "pose": "retime a key pose"}
            self._handle = handle
            change, self._handle = self._change(x), None
            self.editor.edit(words.get(handle.kind, "move a switch"), change)
        elif handle.kind == "pose":
            self.edit_pose(handle.item)

    def double(self, x: float, y: float, layout: TimelineLayout) -> bool:
        """The second click of two: on contacts and flights it adds a switch there."""
        lanes = self.lanes(layout)
        handle = lanes.handle_at(x, y)
        if handle is None or handle.kind != "band":
            return False
        take = self.editor.project.takes[lanes.layer(handle).take]
        frame = round(handle.seconds / take.step)
        switches = added_switch(self._switches(handle.layer), frame, len(take.turns))
        self._edit("add a switch", handle, switches=switches)
        return True

    def type(self, key: str) -> bool:
        """Delete takes away the switch or constraint that was clicked last."""
        handle, self.chosen = self.chosen, None
        if handle is None or key not in ("delete", "backspace"):
            return False
        project = self.editor.project
        if handle.puppet not in project.puppets or handle.layer >= len(project.puppets[handle.puppet].layers):
            return False
        if handle.kind == "switch":
            self._edit(
                "remove a switch", handle, switches=removed_switch(self._switches(handle.layer), handle.item)
            )
            return True
        held = constraints_of(project, handle.puppet, handle.layer)
        if handle.item < len(held):
            one = held[handle.item]
            self.editor.edit("let go", lambda p: without_constraint(p, handle.puppet, handle.layer, one))
        return True

    def _change(self, x: float) -> Edit:
        """The edit that dragging to ``x`` makes."""
        handle, lanes = self._handle, self._lanes
        assert handle is not None
        layer, layout = lanes.layer(handle), lanes.layout
        take = lanes.project.takes[layer.take]
        if handle.kind == "pose":
            seconds = lanes.seconds(handle, x)
            return lambda project: retimed(project, handle.puppet, handle.item, seconds)
        if handle.kind == "switch":
            frame = round(lanes.seconds(handle, x) / take.step)
            moved = moved_switch(lanes.switches(handle.layer), handle.item, frame, len(take.turns))
            return self._changing(handle, switches=moved)
        way = layout.time(x) - layout.time(self._from)
        if handle.kind == "bar":
            return self._changing(handle, offset=self._snapped(layout, layer.offset + way))
        ends = layer.end(take.duration) + way
        return self._changing(handle, speed=layer.ending(ends, take.duration, SLOWEST, FASTEST).speed)

    def _snapped(self, layout: TimelineLayout, offset: float) -> float:
        nearest = min((0.0, self.editor.time), key=lambda place: abs(place - offset))
        return nearest if abs(layout.x(nearest) - layout.x(offset)) <= SNAP else offset

    def _edit(self, word: str, handle: PuppetLaneHandle, **changes: Any) -> None:
        self.editor.edit(word, self._changing(handle, **changes))

    def _changing(self, handle: PuppetLaneHandle, **changes: Any) -> Edit:
        return lambda project: change_layer(project, handle.puppet, handle.layer, **changes)

    def _coverage(self, take: str) -> TakeCoverage | None:
        puppet = self.editor.puppets.puppet
        return self.coverages.of(self.editor.project, puppet, take) if puppet is not None else None

    def _switches(self, layer: int) -> tuple[Switch, ...]:
        """As edited, or as they were found when the motion was solved last; none before."""
        editor, puppet = self.editor, self.editor.puppets.puppet
        if puppet is None or layer >= len(puppet.layers):
            return ()
        edited = puppet.layers[layer].switches
        if edited is not None:
            return edited
        project, shown = editor.solving.shown(editor.project, puppet.id)
        if layer >= len(shown.layers) or shown.layers[layer].take != puppet.layers[layer].take:
            return ()
        if self._known[0] is not shown:
            self._known = (shown, {})
        found = self._known[1]
        if layer not in found:
            try:
                found[layer] = motion_of(project, shown, layer).switches
            except EnlivenError:
                found[layer] = ()
        return found[layer]


def _row(lanes: PuppetLanes, handle: PuppetLaneHandle, kind: str):  # type: ignore[no-untyped-def]
    """The row of one kind of a handle's layer."""
    return next(r for r in lanes.rows() if (r.kind, r.puppet, r.layer) == (kind, handle.puppet, handle.layer))
