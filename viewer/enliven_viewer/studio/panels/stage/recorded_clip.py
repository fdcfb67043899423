"""The growing clip on the timeline during a recording."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.panels.style import packed, small
from enliven_viewer.studio.timeline import GAP, LANE, RULER, TimelineLayout
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import BAD, DARK, INK, ON_FILL


def draw_recorded_clip(workspace: Workspace, layout: TimelineLayout, origin: ImVec2, tall: float) -> bool:
    """Draws the growing clip below the last lane, or at the bottom of the timeline if that is out of view.

    Args:
        workspace: the workspace with the recording.
        layout: the layout of the timeline.
        origin: top left corner of the timeline in pixels.
        tall: height of the timeline in pixels.

    Returns:
        True if a recording is running.
    """
    clip = workspace.perform.recording.clip
    if clip is None:
        return False
    lanes, draw = layout.lanes(), imgui.get_window_draw_list()
    below = lanes[-1].top + lanes[-1].height if lanes else RULER
    top = origin.y + min(below + GAP, tall - LANE)
    low, high = ImVec2(origin.x, top), ImVec2(origin.x + layout.width, top + LANE)
    draw.add_rect_filled(low, high, packed(DARK))
    left, right = (origin.x + layout.x(second) for second in clip)
    right = max(right, left + 2.0)
    draw.add_rect_filled(ImVec2(left, top + 2), ImVec2(right, top + LANE - 2), packed(BAD), 4.0)
    draw.add_text(ImVec2(origin.x + 28, top + 4), packed(INK), tr("Recording"))
    with small():
        draw.push_clip_rect(ImVec2(left, top), ImVec2(right, top + LANE), True)
        draw.add_text(ImVec2(left + 8, top + 5), packed(ON_FILL), f"{clip[1] - clip[0]:.1f} s")
        draw.pop_clip_rect()
    return True
