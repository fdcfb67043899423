"""The pointer over the timeline: scrub, drag clips and markers, zoom, mute, lock, fold."""

from __future__ import annotations

from typing import Any

from enliven.document import Playing, Project, Switch
from enliven.modeling.edits import change_layers, choose_take, move_marker
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor import Edit, Editor
from enliven_viewer.studio.timeline.clip_drag import ClipDrag
from enliven_viewer.studio.timeline.clip_pictures import ClipPictures
from enliven_viewer.studio.timeline.layout import GAP, RULER, Lane, LaneHandle, TimelineLayout
from enliven_viewer.studio.timeline.puppet_drag import DRAGGED, PuppetRows
from enliven_viewer.studio.timeline.snapping import places_of, snapped

_NOTHING = LaneHandle("nothing")
_CLOSEST = 0.25
"""Seconds that the track shows at least: some frames."""
_BEYOND = 1.25
"""Times the project's length that the track shows at most: room to drag the last clip's end."""
_ZOOM = 0.85
"""Share of the seconds that are shown after one notch of the wheel."""
_SHORTEST = 0.1
"""Seconds of the marked span at least: there is time to begin and to end."""
_SPAN = ("from", "to", "marked")
_CLIP = ("bar", "begin", "edge", "blend")


class TimelineInput:
    """Turns the pointer over the timeline into edits; pixels are counted from the timeline's top left.

    Attributes:
        rows: what the pointer does on the rows under a puppet's bars.
        width, scrolled: pixels of the area, and by which the lanes are moved up.
        start, span: seconds of the project at the track's left, and that it shows; a span of 0 shows all.
        folded: characters with one row for all of their lanes.
        opened: alternatives of which every take has a lane.
        locked: lanes that no drag changes: the character and the first layer of each.
        snapping: whether what is dragged sticks to clips, markers, the playhead and frames.
        stuck: the second that the drag sticks to now, or None.
        clip: which clip of the chosen layer is chosen.
        marker: the marker that is named again, or empty.
        pictures: of what the takes do.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.width, self.scrolled, self.start, self.span = 1000.0, 0.0, 0.0, 0.0
        self._followed = ""
        self.folded, self.locked = frozenset[str](), frozenset[tuple[str, int]]()
        self.opened = frozenset[str]()
        self.snapping, self.clip, self.marker = True, 0, ""
        self.stuck: float | None = None
        self.rows, self.pictures = PuppetRows(editor), ClipPictures()
        self._handle = _NOTHING
        self._drag: ClipDrag | None = None
        self._from, self._held_layout = 0.0, self.layout
        self._switches: tuple[Switch, ...] = ()

    @property
    def layout(self) -> TimelineLayout:
        """Returns the layout at this moment."""
        editor = self.editor
        how = (self.scrolled, self.rows.details, self.start, self.span, self.folded, self.opened)
        return TimelineLayout(editor.project, editor.length, self.width, *how, editor.marked)

    def follow(self, tall: float, recorded: str = "") -> None:
        """Moves the lanes up or down to those of what was recorded, or chosen, since the picture before.

        Args:
            tall: pixels that ruler and lanes have.
            recorded: the character that was recorded last; empty for none.
        """
        chosen = self.editor.selection.character or ""
        wanted, self._followed = recorded or (chosen if chosen != self._followed else ""), chosen
        mine = [lane for lane in self.layout.lanes() if lane.character.id == wanted]
        if not mine or self.busy:
            return
        low = mine[-1].top + mine[-1].height + GAP - tall
        self.scrolled += max(low, 0.0)
        self.scrolled += min(mine[0].top - max(low, 0.0) - RULER, 0.0)

    @property
    def busy(self) -> bool:
        """Returns True if something is held."""
        return self._handle.kind != "nothing"

    @property
    def held(self) -> LaneHandle:
        """What is held."""
        return self._handle

    def press(self, x: float, y: float, *, alt: bool = False, ctrl: bool = False) -> None:
        """The left button went down; with Alt a clip is slipped, with Ctrl its speed is changed."""
        layout = self.layout
        handle = layout.handle_at(x, y)
        self.rows.marked = None
        self._handle, self._from, self._held_layout, self._drag = handle, x, layout, None
        if handle.kind == "ruler":
            self.editor.scrub(layout.time(x))
        elif handle.kind in ("fold", "solo", "name"):
            self._press_head(handle)
        elif handle.layers:
            self.editor.select(character=handle.character, layer=handle.number)
            self._press_lane(handle, layout, x, alt=alt, ctrl=ctrl)

    def _press_lane(
        self, handle: LaneHandle, layout: TimelineLayout, x: float, *, alt: bool, ctrl: bool
    ) -> None:
        locked = (handle.character, handle.number) in self.locked
        if handle.kind == "lock":
            self.locked = self.locked ^ {(handle.character, handle.number)}
        elif handle.kind == "takes":
            self.opened = self.opened ^ {self._layer(handle).alternatives}
        elif handle.kind == "mute" and self._layer(handle).muted and layout.takes(self._bar(handle))[1] > 1:
            layer = self._layer(handle)
            of, name = layer.alternatives, layer.recorded
            self.editor.edit(later("hear {0}", name), lambda project: choose_take(project, of, name))
        elif handle.kind == "mute":
            muted = not self.editor.project.characters[handle.character].playing[handle.number].muted
            self.editor.edit("mute" if muted else "unmute", _changing(handle, muted=muted))
        elif handle.kind in _CLIP:
            self.clip = handle.item
            frame = self.editor.settings.frame_step if self.snapping else 0.0
            if locked:
                self.editor.toasts.say(tr("This lane is locked"), tr("Click its lock first."))
            else:
                self._drag = ClipDrag.of(layout, handle, self.editor.time, frame, alt=alt, ctrl=ctrl)
        elif handle.kind != "label":
            if handle.kind == "switch":
                self._switches = tuple(self.rows.details.switches(handle.number))
            self.rows.press(handle, layout, x)

    def _layer(self, handle: LaneHandle) -> Playing:
        """Returns the first layer of the lane that is pressed."""
        return self.editor.project.characters[handle.character].playing[handle.number]

    def _bar(self, handle: LaneHandle) -> Lane:
        """Returns the lane that is pressed."""
        here = (handle.character, handle.layers)
        return next(one for one in self.layout.bars() if (one.character.id, one.layers) == here)

    def _press_head(self, handle: LaneHandle) -> None:
        """Folds a character's lanes, choose it, or lets it play alone and again with the others."""
        if handle.kind == "fold":
            self.folded = self.folded ^ {handle.character}
        elif handle.kind == "solo":
            self.editor.edit("solo", lambda project: _alone(project, handle.character))
        self.editor.choose(handle.character)

    def drag(self, x: float) -> None:
        """The pointer moved."""
        if self._handle.kind == "ruler":
            self.editor.scrubbing = True
            self.editor.scrub(self._held_layout.time(x))
        elif self._handle.kind in _SPAN:
            self.editor.marked = self._span_to(x)
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
        elif handle.kind == "marker":
            self.editor.scrub(self.editor.project.markers[handle.name].seconds)
        self.editor.finish_scrubbing()
        self._handle, self._drag, self.stuck = _NOTHING, None, None

    def double(self, x: float, y: float) -> bool:
        """Returns the second click of two; whether it meant something."""
        handle = self.layout.handle_at(x, y)
        if handle.kind == "marker":
            self.marker = handle.name
            return True
        return self.rows.double(handle)

    def zoom(self, notches: float, x: float) -> None:
        """Shows less time around a pixel, or more."""
        layout = self.layout
        at, most = layout.time(x), _BEYOND * layout.length
        span = min(max(layout.shown * _ZOOM**notches, _CLOSEST), most)
        share = (at - layout.start) / layout.shown
        self.span = 0.0 if span >= layout.length and notches < 0 else span
        self._start_at(at - share * span)

    def pan(self, pixels: float) -> None:
        """Shows what is to the right of it by some pixels."""
        layout = self.layout
        self._start_at(layout.start + pixels * layout.shown / layout.track)

    def show_all(self) -> None:
        """Shows the whole project."""
        self.start = self.span = 0.0

    def _start_at(self, start: float) -> None:
        room = max(_BEYOND * self.editor.length - self.span, 0.0) if self.span else 0.0
        self.start = min(max(start, 0.0), room)

    @property
    def _dragged(self) -> str | None:
        """What dragging the held part is called; None for what is not dragged."""
        if self._drag is not None:
            return self._drag.word
        return {"marker": later("move marker"), **DRAGGED}.get(self._handle.kind)

    def _change(self, x: float) -> Edit:
        """Returns the edit that dragging to ``x`` makes."""
        layout, handle = self._held_layout, self._handle
        moved = layout.time(x) - layout.time(self._from)
        if self._drag is not None:
            change, self.stuck = self._drag.edit(moved)
            return change
        if handle.kind == "marker":
            return self._marker_moved(handle, moved)
        lane = next(
            one
            for one in layout.lanes()
            if (one.character.id, one.layers) == (handle.character, handle.layers) and one.kind != "head"
        )
        return self.rows.dragged(handle, layout.second(lane, x), self._switches)

    def _span_to(self, x: float) -> tuple[float, float] | None:
        """Returns the marked span with an end, or all of it, dragged to a pixel; as it was where none is
        left.
        """
        layout, kind = self._held_layout, self._handle.kind
        span = layout.marked
        if span is None:
            return None
        moved = layout.time(x) - layout.time(self._from)
        ends = {"from": (span[0],), "to": (span[1],)}.get(kind, span)
        if self.snapping:
            places = places_of(layout, self.editor.time, self._handle)
            times = [end + moved for end in ends]
            more, self.stuck = snapped(layout, times, places, self.editor.settings.frame_step)
            moved += more
        if kind == "marked":
            moved = max(moved, -span[0])
            return span[0] + moved, span[1] + moved
        if kind == "from":
            return min(max(span[0] + moved, 0.0), span[1] - _SHORTEST), span[1]
        return span[0], max(span[1] + moved, span[0] + _SHORTEST)

    def _marker_moved(self, handle: LaneHandle, moved: float) -> Edit:
        layout = self._held_layout
        seconds = layout.project.markers[handle.name].seconds + moved
        if self.snapping:
            places = places_of(layout, self.editor.time, handle)
            more, self.stuck = snapped(layout, [seconds], places, self.editor.settings.frame_step)
            seconds += more
        return lambda project: move_marker(project, handle.name, seconds)


def _changing(handle: LaneHandle, **changes: Any) -> Edit:
    """Returns the edit that changes attributes of a lane's layers."""
    return lambda project: change_layers(project, handle.character, handle.layers, **changes)


def _alone(project: Project, name: str) -> Project:
    """Returns the project in which a character plays alone; or all, where the others are silent already."""
    playing = {key: one for key, one in project.characters.items() if one.playing}
    others = [one for key, one in playing.items() if key != name]
    silent = bool(others) and all(layer.muted for one in others for layer in one.playing)
    for key, one in playing.items():
        muted = not silent and key != name
        project = change_layers(project, key, range(len(one.playing)), muted=muted)
    return project
