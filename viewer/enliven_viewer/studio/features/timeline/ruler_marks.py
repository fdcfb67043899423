"""The timeline's ruler: the marked span, markers, and the field that renames a marker."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven.modeling.edits import remove_marker, rename_marker
from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_name_field
from enliven_viewer.studio.app.style import pack_colour, use_small_text
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT
from enliven_viewer.studio.features.timeline.layout import SPAN_BAND_HEIGHT
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.theme import ACCENT, BAD, CHAIN, DARK, INK

_POPUP_ID = "marker name"


def draw_markers(app: App, timeline: TimelineInput, origin: ImVec2, size: ImVec2) -> None:
    """Draws a flag and a thin line at each marker."""
    draw_list = imgui.get_window_draw_list()
    for marker, x in timeline.layout.markers():
        if x < LABEL_WIDTH - 1:
            continue
        marker_x, top = origin.x + x, origin.y
        draw_list.add_line(
            ImVec2(marker_x, top + 6), ImVec2(marker_x, origin.y + size.y), pack_colour(CHAIN, 0.45), 1.0
        )
        flag = (ImVec2(marker_x, top + 2), ImVec2(marker_x + 9, top + 6), ImVec2(marker_x, top + 10))
        draw_list.add_triangle_filled(*flag, pack_colour(CHAIN))
        with use_small_text():
            width = imgui.calc_text_size(marker.id).x
            draw_list.add_rect_filled(
                ImVec2(marker_x + 1, top + 9),
                ImVec2(marker_x + width + 8, top + RULER_HEIGHT),
                pack_colour(DARK, 0.9),
                3.0,
            )
            draw_list.add_text(ImVec2(marker_x + 5, top + 10), pack_colour(INK, 0.95), marker.id)
    if timeline.marker and not imgui.is_popup_open(_POPUP_ID):
        imgui.open_popup(_POPUP_ID)
    _draw_marker_popup(app, timeline)


def draw_span(timeline: TimelineInput, origin: ImVec2, size: ImVec2, *, records: bool) -> None:
    """Draws the marked span on the ruler and the lanes. It is red if ``records`` is set."""
    draw_list, layout = imgui.get_window_draw_list(), timeline.layout
    if layout.marked is None:
        return
    tint = BAD if records else ACCENT
    low, high = (origin.x + max(layout.x(end), LABEL_WIDTH - 1) for end in layout.marked)
    top, bottom = origin.y + RULER_HEIGHT - SPAN_BAND_HEIGHT, origin.y + RULER_HEIGHT
    draw_list.add_rect_filled(ImVec2(low, bottom), ImVec2(high, origin.y + size.y), pack_colour(tint, 0.07))
    draw_list.add_rect_filled(ImVec2(low, top), ImVec2(high, bottom), pack_colour(tint, 0.75), 2.0)
    for end_x, direction in ((low, 1.0), (high, -1.0)):
        draw_list.add_line(
            ImVec2(end_x, origin.y + 2), ImVec2(end_x, origin.y + size.y), pack_colour(tint, 0.9), 1.5
        )
        grip = (
            ImVec2(end_x, origin.y + 2),
            ImVec2(end_x + 7 * direction, origin.y + 2),
            ImVec2(end_x, origin.y + 10),
        )
        draw_list.add_triangle_filled(*grip, pack_colour(tint))


def _draw_marker_popup(app: App, timeline: TimelineInput) -> None:
    """Draws the popup that renames or removes a marker."""
    editor, name = app.editor, timeline.marker
    if not imgui.begin_popup(_POPUP_ID):
        return
    imgui.text(tr("Marker"))
    imgui.set_next_item_width(160)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()

    def rename(wanted: str) -> None:
        editor.edit("rename marker", lambda project: rename_marker(project, name, wanted))
        timeline.marker = ""
        imgui.close_current_popup()

    draw_name_field(app, "marker", name, rename)
    if imgui.button(labelled(tr("Remove"), "Remove marker")):
        editor.edit("remove marker", lambda project: remove_marker(project, name))
        timeline.marker = ""
    imgui.same_line()
    if imgui.button(labelled(tr("Done"), "Done marker")):
        timeline.marker = ""
    if not timeline.marker:
        imgui.close_current_popup()
    imgui.end_popup()
