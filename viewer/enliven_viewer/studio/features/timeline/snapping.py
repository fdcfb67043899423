"""Snapping of timeline drags to clips, markers, the playhead, and frames."""

from __future__ import annotations

from collections.abc import Sequence

from enliven_viewer.studio.features.timeline.layout import LaneHandle, TimelineLayout

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
