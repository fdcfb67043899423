"""Pointer input of the timeline: scrub, drag clips and markers, zoom, mute, lock, fold."""

from __future__ import annotations

from typing import Any

from enliven.document import LayerBase, Project, Switch
from enliven.modeling.edits import change_layers, choose_take, move_marker
from enliven_viewer.language import later, tr
from enliven_viewer.studio.app.time_axis import RULER_HEIGHT, TimeAxis
from enliven_viewer.studio.editor.editor import Edit, Editor
from enliven_viewer.studio.features.timeline.clip_drag import ClipDrag, snap_offset, snap_times
from enliven_viewer.studio.features.timeline.clip_pictures import ClipPictures
from enliven_viewer.studio.features.timeline.layout import LANE_GAP, Lane, LaneHandle, TimelineLayout
from enliven_viewer.studio.features.timeline.puppet_input import DRAG_TITLES, PuppetRows
from enliven_viewer.studio.puppets.coverage import CoverageCache
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor

_NO_HANDLE = LaneHandle("nothing")
_MIN_SPAN_S = 0.1
"""Minimum length of the marked span in seconds. A recording cannot be shorter."""
_SPAN_HANDLES = ("from", "to", "marked")
_CLIP_HANDLES = ("bar", "begin", "edge", "blend")


class TimelineInput:
    """Converts pointer input on the timeline to edits. Coordinates are pixels from the timeline's top left
    corner.

    Attributes:
        rows: pointer input on the rows below a puppet's bars.
        axis: the time axis.
        scrolled: vertical scroll offset of the lanes, in pixels.
        folded: characters with all lanes collapsed into one row.
        opened: groups of alternative takes that show a lane for every take.
        locked: lanes that cannot be dragged, each as (character, number of its first layer).
        snapping: whether drags snap to clips, markers, the playhead and frames.
        snapped_time: the time that the drag currently snaps to, or None.
        clip: number of the selected clip in the selected layer.
        marker: the marker being renamed, or empty.
        pictures: thumbnails of the takes.
        shown_layer: the layer of the options that were drawn last, as (character, layer number, frame
            number).
    """

    def __init__(self, editor: Editor, axis: TimeAxis, coverages: CoverageCache) -> None:
        self.editor, self.axis, self.scrolled = editor, axis, 0.0
        self._last_shown_character = ""
        self.folded, self.locked = frozenset[str](), frozenset[tuple[str, int]]()
        self.opened = frozenset[str]()
        self.snapping, self.clip, self.marker = True, 0, ""
        self.shown_layer = ("", 0, 0)
        self.snapped_time: float | None = None
        self.rows, self.pictures = PuppetRows(editor, coverages), ClipPictures()
        self._held_handle = _NO_HANDLE
        self._drag: ClipDrag | None = None
        self._drag_start_x, self._held_layout = 0.0, self.layout
        self._held_switches: tuple[Switch, ...] = ()

    @property
    def layout(self) -> TimelineLayout:
        """Returns the current layout."""
        scale = self.axis.scale
        return TimelineLayout(
            scale.length,
            scale.width,
            scale.start,
            scale.span,
            project=self.editor.project,
            scrolled=self.scrolled,
            details=self.rows.details,
            folded=self.folded,
            opened=self.opened,
            marked=self.editor.marked_range,
        )

    def scroll_to_recording(self, height: float, recorded: str = "") -> None:
        """Scrolls vertically to the lanes of a newly recorded or newly selected character.

        Args:
            height: height of ruler and lanes in pixels.
            recorded: the character that was just recorded; empty for none.
        """
        chosen = self.editor.selection.character or ""
        followed_character, self._last_shown_character = (
            recorded or (chosen if chosen != self._last_shown_character else ""),
            chosen,
        )
        lanes_of_character = [lane for lane in self.layout.lanes() if lane.character.id == followed_character]
        if not lanes_of_character or self.busy:
            return
        low = lanes_of_character[-1].top + lanes_of_character[-1].height + LANE_GAP - height
        self.scrolled += max(low, 0.0)
        self.scrolled += min(lanes_of_character[0].top - max(low, 0.0) - RULER_HEIGHT, 0.0)

    @property
    def busy(self) -> bool:
        """Returns True if a part of the timeline is being dragged."""
        return self._held_handle.kind != "nothing"

    @property
    def held(self) -> LaneHandle:
        """Returns the part that is being dragged."""
        return self._held_handle

    def press(self, x: float, y: float, *, alt: bool = False, ctrl: bool = False) -> None:
        """Handles a press of the left button. Alt slips a clip, and Ctrl changes its speed."""
        layout = self.layout
        handle = layout.handle_at(x, y)
        self.rows.marked = None
        self._held_handle, self._drag_start_x, self._held_layout, self._drag = handle, x, layout, None
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
            self.opened = self.opened ^ {self._get_layer(handle).alternatives}
        elif (
            handle.kind == "mute"
            and self._get_layer(handle).muted
            and layout.takes(self._get_bar(handle))[1] > 1
        ):
            layer = self._get_layer(handle)
            alternatives, name = layer.alternatives, layer.recorded
            self.editor.edit(
                later("hear {0}", name), lambda project: choose_take(project, alternatives, name)
            )
        elif handle.kind == "mute":
            muted = not self.editor.project.characters[handle.character].playing[handle.number].muted
            self.editor.edit("mute" if muted else "unmute", _make_edit(handle, muted=muted))
        elif handle.kind in _CLIP_HANDLES:
            self.clip = handle.item
            frame = self.editor.settings.frame_step if self.snapping else 0.0
            if locked:
                self.editor.toasts.show_message(
                    tr("This lane is locked"), tr("Click the lock of the lane first.")
                )
            else:
                self._drag = ClipDrag.from_handle(layout, handle, self.editor.time, frame, alt=alt, ctrl=ctrl)
        elif handle.kind != "label":
            if handle.kind == "switch":
                self._held_switches = tuple(self.rows.details.switches(handle.number))
            self.rows.press(handle, layout, x)

    def _get_layer(self, handle: LaneHandle) -> LayerBase:
        """Returns the first layer of the pressed lane."""
        return self.editor.project.characters[handle.character].playing[handle.number]

    def _get_bar(self, handle: LaneHandle) -> Lane:
        """Returns the pressed lane."""
        key = (handle.character, handle.layers)
        return next(bar for bar in self.layout.bars() if (bar.character.id, bar.layers) == key)

    def _press_head(self, handle: LaneHandle) -> None:
        """Folds or unfolds a character's lanes, toggles solo, or selects the character."""
        if handle.kind == "fold":
            self.folded = self.folded ^ {handle.character}
        elif handle.kind == "solo":
            self.editor.edit("solo", lambda project: _toggle_solo(project, handle.character))
        self.editor.select_only(handle.character)

    def drag(self, x: float) -> None:
        """Handles pointer movement during a drag."""
        if self._held_handle.kind == "ruler":
            self.editor.scrubbing = True
            self.editor.scrub(self._held_layout.time(x))
        elif self._held_handle.kind in _SPAN_HANDLES:
            self.editor.marked_range = self._drag_span(x)
        elif self._drag_title is not None and x != self._drag_start_x:
            if get_puppet_editor(self.editor).is_posing:
                get_puppet_editor(self.editor).accept()
            self.editor.preview_edit(self._make_drag_edit(x))

    def release(self, x: float) -> None:
        """Handles the release of the button. A drag becomes one edit, and a click on a key pose opens it."""
        edit_name, handle = self._drag_title, self._held_handle
        if edit_name is not None and self.editor.draft is not None:
            self.editor.edit(edit_name, self._make_drag_edit(x))
        elif handle.kind == "pose":
            self.rows.edit_pose(handle.item)
        elif handle.kind == "marker":
            self.editor.scrub(self.editor.project.markers[handle.name].seconds)
        self.editor.finish_scrubbing()
        self._held_handle, self._drag, self.snapped_time = _NO_HANDLE, None, None

    def double_click(self, x: float, y: float) -> bool:
        """Handles a double click. Returns True if it had an effect."""
        handle = self.layout.handle_at(x, y)
        if handle.kind == "marker":
            self.marker = handle.name
            return True
        return self.rows.double_click(handle)

    @property
    def _drag_title(self) -> str | None:
        """Returns the name of the edit for the current drag, or None if the pressed part cannot
        be dragged.
        """
        if self._drag is not None:
            return self._drag.edit_title
        return {"marker": later("move marker"), **DRAG_TITLES}.get(self._held_handle.kind)

    def _make_drag_edit(self, x: float) -> Edit:
        """Returns the edit for a drag to ``x``."""
        layout, handle = self._held_layout, self._held_handle
        time_offset = layout.time(x) - layout.time(self._drag_start_x)
        if self._drag is not None:
            change, self.snapped_time = self._drag.edit(time_offset)
            return change
        if handle.kind == "marker":
            return self._make_marker_edit(handle, time_offset)
        lane = next(
            candidate
            for candidate in layout.lanes()
            if (candidate.character.id, candidate.layers) == (handle.character, handle.layers)
            and candidate.kind != "head"
        )
        return self.rows.make_drag_edit(handle, layout.find_take_time(lane, x), self._held_switches)

    def _drag_span(self, x: float) -> tuple[float, float] | None:
        """Returns the marked span after dragging one end, or the whole span, to a pixel.

        Returns None without a marked span.
        """
        layout, kind = self._held_layout, self._held_handle.kind
        span = layout.marked
        if span is None:
            return None
        time_offset = layout.time(x) - layout.time(self._drag_start_x)
        ends = {"from": (span[0],), "to": (span[1],)}.get(kind, span)
        if self.snapping:
            places = snap_times(layout, self.editor.time, self._held_handle)
            times = [end + time_offset for end in ends]
            snap_shift, self.snapped_time = snap_offset(
                layout, times, places, self.editor.settings.frame_step
            )
            time_offset += snap_shift
        if kind == "marked":
            time_offset = max(time_offset, -span[0])
            return span[0] + time_offset, span[1] + time_offset
        if kind == "from":
            return min(max(span[0] + time_offset, 0.0), span[1] - _MIN_SPAN_S), span[1]
        return span[0], max(span[1] + time_offset, span[0] + _MIN_SPAN_S)

    def _make_marker_edit(self, handle: LaneHandle, moved: float) -> Edit:
        layout = self._held_layout
        seconds = layout.project.markers[handle.name].seconds + moved
        if self.snapping:
            places = snap_times(layout, self.editor.time, handle)
            snap_shift, self.snapped_time = snap_offset(
                layout, [seconds], places, self.editor.settings.frame_step
            )
            seconds += snap_shift
        return lambda project: move_marker(project, handle.name, seconds)


def _make_edit(handle: LaneHandle, **changes: Any) -> Edit:
    """Returns the edit that changes attributes of a lane's layers."""
    return lambda project: change_layers(project, handle.character, handle.layers, **changes)


def _toggle_solo(project: Project, name: str) -> Project:
    """Returns the project with all other characters muted (solo). If they are already muted, unmutes all
    characters.
    """
    playing = {key: character for key, character in project.characters.items() if character.playing}
    others = [character for key, character in playing.items() if key != name]
    silent = bool(others) and all(layer.muted for character in others for layer in character.playing)
    for key, character in playing.items():
        muted = not silent and key != name
        project = change_layers(project, key, range(len(character.playing)), muted=muted)
    return project
