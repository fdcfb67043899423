"""What a drag on the timeline sticks to: clips, markers, the playhead, and frames."""

from __future__ import annotations

from collections.abc import Sequence

from enliven_viewer.studio.timeline.layout import LaneHandle, TimelineLayout

SNAP = 6.0
"""Pixels within which what is dragged sticks to something."""


def places_of(layout: TimelineLayout, playhead: float, held: LaneHandle) -> list[float]:
    """Returns the seconds that a drag sticks to: 0, the playhead, markers, and the ends of all clips but the
    held.
    """
    places = [0.0, playhead, *(one.seconds for one, _ in layout.markers() if one.id != held.name)]
    for lane in layout.bars():
        mine = (lane.character.id, lane.layers) == (held.character, held.layers)
        for number, clip in enumerate(lane.clips):
            if not (mine and number == held.item):
                places += [clip.begin, clip.end]
    return places


def snapped(
    layout: TimelineLayout, times: Sequence[float], places: Sequence[float], frame: float
) -> tuple[float, float | None]:
    """Returns how far to move so that one of ``times`` is at a place, or else the first at a whole frame.

    Args:
        times: seconds of what is dragged, such as both ends of a clip.
        frame: seconds of a frame.

    Returns:
        Seconds to add to all of them, and the place that one sticks to, None for frames.
    """
    moves = [(abs(place - time), place - time, place) for time in times for place in places]
    nearest = min(moves, default=None)
    if nearest is not None and nearest[0] * layout.track / layout.shown <= SNAP:
        return nearest[1], nearest[2]
    return round(times[0] / frame) * frame - times[0], None
