"""The growing clip on the timeline during a recording."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.app.style import pack_colour, use_small_text
from enliven_viewer.studio.app.time_axis import RULER_HEIGHT
from enliven_viewer.studio.features.timeline.layout import LANE_GAP, LANE_HEIGHT, TimelineLayout
from enliven_viewer.theme import BAD, DARK, INK, ON_FILL


def draw_recorded_clip(
    clip: tuple[float, float], layout: TimelineLayout, origin: ImVec2, height: float
) -> None:
    """Draws the growing clip below the last lane, or at the bottom of the timeline if the last lane is out of
    view.

    Args:
        clip: begin and end of the recording in seconds.
        layout: the layout of the timeline.
        origin: top left corner of the timeline in pixels.
        height: height of the timeline in pixels.
    """
    lanes, draw = layout.lanes(), imgui.get_window_draw_list()
    below = lanes[-1].top + lanes[-1].height if lanes else RULER_HEIGHT
    top = origin.y + min(below + LANE_GAP, height - LANE_HEIGHT)
    low, high = ImVec2(origin.x, top), ImVec2(origin.x + layout.width, top + LANE_HEIGHT)
    draw.add_rect_filled(low, high, pack_colour(DARK))
    left, right = (origin.x + layout.x(second) for second in clip)
    right = max(right, left + 2.0)
    draw.add_rect_filled(ImVec2(left, top + 2), ImVec2(right, top + LANE_HEIGHT - 2), pack_colour(BAD), 4.0)
    draw.add_text(ImVec2(origin.x + 28, top + 4), pack_colour(INK), tr("Recording"))
    with use_small_text():
        draw.push_clip_rect(ImVec2(left, top), ImVec2(right, top + LANE_HEIGHT), True)
        draw.add_text(ImVec2(left + 8, top + 5), pack_colour(ON_FILL), f"{clip[1] - clip[0]:.1f} s")
        draw.pop_clip_rect()
