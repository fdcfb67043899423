"""Drags of timeline clips: move, slip, trim, stretch and blend, and the snapping of all drags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from enliven.document import Segment
from enliven.modeling.edits import (
    blend_clips,
    move_clip,
    slip_clip,
    stretch_clip,
    trim_clip,
)
from enliven_viewer.language import later
from enliven_viewer.studio.editor.editor import Edit
from enliven_viewer.studio.features.timeline.layout import Lane, LaneHandle, TimelineLayout

SNAP_DISTANCE_PX = 6.0
"""Snapping distance in pixels."""


def snap_times(layout: TimelineLayout, playhead: float, held: LaneHandle) -> list[float]:
    """Returns the times that a drag snaps to.

    These are 0, the playhead, markers, and the ends of all clips except the dragged clip.
    """
    places = [0.0, playhead, *(marker.seconds for marker, _ in layout.markers() if marker.id != held.name)]
    for lane in layout.bars():
        is_dragged_lane = (lane.character.id, lane.layers) == (held.character, held.layers)
        for number, clip in enumerate(lane.clips):
            if not (is_dragged_lane and number == held.item):
                places += [clip.begin, clip.end]
    return places


def snap_offset(
    layout: TimelineLayout, times: Sequence[float], places: Sequence[float], frame: float
) -> tuple[float, float | None]:
    """Returns the offset that snaps one of ``times`` to a snap position, or the first of them to a whole
    frame.

    Args:
        times: times of the dragged object in seconds, such as both ends of a clip.
        frame: duration of a frame in seconds.

    Returns:
        The seconds to add to all times, and the snap position; None if it is only a frame.
    """
    moves = [(abs(place - time), place - time, place) for time in times for place in places]
    nearest = min(moves, default=None)
    if nearest is not None and nearest[0] * layout.track_width / layout.visible_s <= SNAP_DISTANCE_PX:
        return nearest[1], nearest[2]
    return round(times[0] / frame) * frame - times[0], None


_EDIT_TITLES = {
    "bar": later("move clip"),
    "slip": later("slip clip"),
    "begin": later("trim clip"),
    "edge": later("trim clip"),
    "blend": later("blend clips"),
    "stretch": later("change speed"),
    "stretch begin": later("change speed"),
}
"""The name of each kind of drag in the history."""


@dataclass(frozen=True)
class ClipDrag:
    """A drag of one clip, with the state at its start.

    Attributes:
        handle: the grabbed part of the timeline.
        edit_kind: "bar", "slip", "begin", "edge", "stretch", "stretch begin" or "blend".
        lane, layout: the lane and the layout at the start of the drag.
        playhead: position of the playhead in seconds.
        frame: duration of a frame in seconds; 0 disables snapping.
    """

    handle: LaneHandle
    edit_kind: str
    lane: Lane
    layout: TimelineLayout
    playhead: float
    frame: float

    @staticmethod
    def from_handle(
        layout: TimelineLayout, handle: LaneHandle, playhead: float, frame: float, *, alt: bool, ctrl: bool
    ) -> ClipDrag | None:
        """Returns the drag that starts at a handle, or None if the handle is not part of a clip."""
        changed = {"bar": "slip"} if alt else {}
        changed |= {"edge": "stretch", "begin": "stretch begin"} if ctrl else {}
        kind = changed.get(handle.kind, handle.kind)
        lanes = (bar for bar in layout.bars() if bar.character.id == handle.character)
        lane = next((bar for bar in lanes if bar.layers == handle.layers), None)
        is_clip_handle = kind in _EDIT_TITLES and lane is not None
        return (
            ClipDrag(handle, kind, lane, layout, playhead, frame)
            if is_clip_handle and lane is not None
            else None
        )

    @property
    def edit_title(self) -> str:
        """Returns the name of the edit in the history."""
        return _EDIT_TITLES[self.edit_kind]

    @property
    def clip(self) -> Segment:
        """Returns the clip at the start of the drag."""
        return self.lane.clips[self.handle.item]

    def edit(self, moved: float) -> tuple[Edit, float | None]:
        """Returns the edit for a pointer movement of some seconds, and the time that it snaps to."""
        name, numbers, item, clip = self.handle.character, self.handle.layers, self.handle.item, self.clip
        if self.edit_kind == "slip":
            return lambda p: slip_clip(p, name, numbers, item, -moved * clip.speed), None
        if self.edit_kind == "blend":
            overlap = clip.end - self.lane.clips[item + 1].begin
            return lambda p: blend_clips(p, name, numbers, item, max(overlap + 2.0 * moved, 0.0)), None
        if self.edit_kind == "bar":
            snap_offset_s, stuck = self._find_snap_times(clip.begin + moved, clip.end + moved)
            delay = moved + snap_offset_s
            return lambda p: move_clip(p, name, numbers, item, delay), stuck
        dragged_end = clip.begin if self.edit_kind in ("begin", "stretch begin") else clip.end
        snap_offset_s, stuck = self._find_snap_times(dragged_end + moved)
        dragged_end += moved + snap_offset_s
        end = {"begin" if self.edit_kind in ("begin", "stretch begin") else "end": dragged_end}
        change = stretch_clip if self.edit_kind.startswith("stretch") else trim_clip
        return lambda p: change(p, name, numbers, item, **end), stuck

    def _find_snap_times(self, *times: float) -> tuple[float, float | None]:
        if self.frame <= 0.0:
            return 0.0, None
        places = snap_times(self.layout, self.playhead, self.handle)
        return snap_offset(self.layout, times, places, self.frame)
