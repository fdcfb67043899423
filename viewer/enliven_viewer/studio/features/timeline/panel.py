"""Draws the timeline: play buttons, ruler, one row (lane) per layer, and the playhead."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import later
from enliven_viewer.live.hud import format_time
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_action_tooltip, draw_tooltip
from enliven_viewer.studio.app.panel_layout import MIN_TIMELINE_HEIGHT, Area
from enliven_viewer.studio.app.style import (
    draw_note,
    open_panel,
    pack_colour,
    push_colours,
    use_small_text,
)
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.timeline.lane_painter import LanePainter, draw_recorded_clip
from enliven_viewer.studio.features.timeline.puppet_painter import draw_details, draw_details_tooltip
from enliven_viewer.studio.features.timeline.ruler_marks import draw_markers, draw_span
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.theme import ACCENT, CHAIN, DARK, LINE, QUIET

_START_ICON, _PLAY_ICON, _PAUSE_ICON, _LOOP_ICON = "\uf048", "\uf04b", "\uf04c", "\uf01e"
"""Font Awesome 4 icons of the transport buttons."""
_SPLIT_ICON, _FLAG_ICON, _MAGNET_ICON, _ALL_ICON = "\uf0c4", "\uf024", "\uf076", "\uf07e"
"""Font Awesome 4 icons: split, marker, snapping, and show the whole project."""
_CLICKABLE_PARTS = (
    *("bar", "mute", "lock", "fold", "solo", "name", "marker", "marked", "takes"),
    *("pose", "suggested", "held", "found"),
)
"""Kinds of timeline parts over which the mouse cursor is a hand."""
_GRIP_HEIGHT = 7.0
"""Height in pixels of the timeline's upper border, which can be dragged to resize the timeline."""
_MIN_WIDTH_WITH_MARKS = 760.0
"""Minimum window width in pixels at which the in and out buttons are shown."""
_PAN_PER_NOTCH = 40.0
"""Pixels that the timeline pans per notch of the wheel with Shift."""
_PAINTER = LanePainter()
_NO_MOTION = later(
    "No motion yet. Choose the tool Map motion (M), then a chain of a take, then a chain of your shape."
)
_NO_RECORDING = later("No motion yet. Press Record: the recorded motion appears here.")
_NO_TAKE = later("The puppet plays no take yet. Choose a take in the performer's view.")


def draw_timeline(app: App, timeline: TimelineInput, area: Area) -> None:
    """Draws the bottom panel."""
    with open_panel(
        "timeline", area, imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    ):
        perform = app.state(PerformSession)
        _handle_resizing(app, area)
        _draw_transport(app, timeline)
        origin = imgui.get_cursor_screen_pos()
        size = imgui.get_content_region_avail()
        app.time_axis.width = size.x
        imgui.invisible_button("##track", ImVec2(max(size.x, 1), max(size.y, 1)))
        app.remember("timeline")
        timeline.scroll_to_recording(size.y, perform.recording.take_last_character())
        _handle_pointer(timeline, origin, size)
        draw_list = imgui.get_window_draw_list()
        draw_list.push_clip_rect(origin, ImVec2(origin.x + size.x, origin.y + size.y), True)
        _draw_lanes(timeline, perform, origin, size)
        _draw_ruler(app, origin, size)
        draw_span(timeline, origin, size, records=perform.active_workspace == "Perform")
        draw_markers(app, timeline, origin, size)
        _draw_playhead(timeline, origin, size)
        draw_list.pop_clip_rect()


def _handle_resizing(app: App, area: Area) -> None:
    """Draws the upper border. A drag changes the timeline's height, and a double click resets it."""
    preferences, place = app.preferences, imgui.get_cursor_pos()
    imgui.set_cursor_pos(ImVec2(0, 0))
    imgui.invisible_button("##height", ImVec2(area.width, _GRIP_HEIGHT))
    app.remember("timeline height")
    held, hovered = imgui.is_item_active(), imgui.is_item_hovered()
    if hovered or held:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ns)
        draw_list, top = imgui.get_window_draw_list(), area.y + 1
        draw_list.add_line(
            ImVec2(area.x, top), ImVec2(area.x + area.width, top), pack_colour(ACCENT, 0.8), 2.0
        )
    if hovered and imgui.is_mouse_double_clicked(0):
        preferences.timeline_height = 0.0
        preferences.save()
    elif held and imgui.get_io().mouse_delta.y:
        preferences.timeline_height = max(
            imgui.get_io().display_size.y - imgui.get_mouse_pos().y, MIN_TIMELINE_HEIGHT
        )
    if imgui.is_item_deactivated():
        preferences.save()
    imgui.set_cursor_pos(place)


def _draw_transport(app: App, timeline: TimelineInput) -> None:
    editor = app.editor
    if imgui.button(_START_ICON + "##start", ImVec2(34, 0)):
        editor.scrub(0.0)
    imgui.same_line()
    if imgui.button((_PAUSE_ICON if editor.playing else _PLAY_ICON) + "###play", ImVec2(44, 0)):
        editor.playing = not editor.playing
    app.remember("play")
    imgui.same_line()
    if editor.loop:
        imgui.push_style_color(imgui.Col_.text, pack_colour(ACCENT))
    looping = editor.loop
    if imgui.button(_LOOP_ICON + "##loop", ImVec2(34, 0)):
        editor.loop = not editor.loop
    if looping:
        imgui.pop_style_color()
    draw_tooltip("Loop: playback starts again at the end, or at the out point")
    _draw_loop_points(app)
    imgui.same_line(0.0, 18.0)
    imgui.align_text_to_frame_padding()
    imgui.text(f"{format_time(editor.time)}  /  {format_time(editor.length)}")
    imgui.same_line(0.0, 18.0)
    imgui.set_next_item_width(76)
    changed, speed = imgui.drag_float("##speed", editor.speed, 0.01, 0.1, 4.0, "%.2f x")
    if changed:
        editor.speed = speed
    draw_tooltip("Drag to change the playback speed in this window. The project does not change")
    for draw_section in app.transport_sections:
        draw_section()
    _draw_buttons(app, timeline)


def _draw_loop_points(app: App) -> None:
    """Draws the buttons of the loop's in and out points. A narrow window has them only in the menu."""
    if imgui.get_window_width() < _MIN_WIDTH_WITH_MARKS:
        return
    chosen = app.editor.marked_range is not None
    for label, action in (("[", "view.in_point"), ("]", "view.out_point")):
        imgui.same_line()
        with push_colours(ACCENT if chosen else QUIET, imgui.Col_.text):
            if imgui.button(f"{label}##{action}", ImVec2(26, 0)):
                app.actions.do(action)
        app.remember(action)
        draw_action_tooltip(app, action)


def _draw_buttons(app: App, timeline: TimelineInput) -> None:
    """Draws the clip buttons at the right."""
    imgui.same_line(imgui.get_window_width() - 4 * 42 - 12)
    if imgui.button(_SPLIT_ICON + "##split", ImVec2(34, 0)):
        app.actions.do("clip.split")
    app.remember("split")
    draw_tooltip("Splits the clip under the playhead  (Shift+S)")
    imgui.same_line()
    if imgui.button(_FLAG_ICON + "##marker", ImVec2(34, 0)):
        app.actions.do("clip.mark")
    app.remember("add marker")
    draw_tooltip("Adds a marker at the playhead  (Shift+M). Double-click a marker to name it")
    imgui.same_line()
    with push_colours(ACCENT if timeline.snapping else QUIET, imgui.Col_.text):
        if imgui.button(_MAGNET_ICON + "##snap", ImVec2(34, 0)):
            timeline.snapping = not timeline.snapping
    app.remember("snapping")
    draw_tooltip("Dragged items snap to clips, markers, the playhead and frames")
    imgui.same_line()
    if imgui.button(_ALL_ICON + "##all", ImVec2(34, 0)):
        app.time_axis.show_all()
    app.remember("show all")
    draw_tooltip("Shows the whole project. Ctrl+wheel zooms, Shift+wheel scrolls")


def _handle_pointer(timeline: TimelineInput, origin: ImVec2, size: ImVec2) -> None:
    """Passes the pointer's clicks, drags and wheel to the timeline."""
    pointer = imgui.get_mouse_pos()
    x, y = pointer.x - origin.x, pointer.y - origin.y
    if imgui.is_item_hovered():
        if imgui.is_mouse_double_clicked(0) and timeline.double_click(x, y):
            pass
        elif imgui.is_mouse_clicked(0):
            io = imgui.get_io()
            timeline.press(x, y, alt=io.key_alt, ctrl=io.key_ctrl)
        _handle_wheel(timeline, x, size)
        if imgui.is_mouse_dragging(2, 0.0):
            timeline.axis.pan(-imgui.get_io().mouse_delta.x)
        _set_cursor(timeline.layout.handle_at(x, y).kind)
    elif imgui.is_mouse_clicked(0):
        timeline.rows.marked = None
    if timeline.busy and imgui.is_mouse_down(0):
        timeline.drag(x)
    elif timeline.busy:
        timeline.release(x)


def _handle_wheel(timeline: TimelineInput, x: float, size: ImVec2) -> None:
    """Handles the wheel: scrolls the lanes, pans with Shift, zooms with Ctrl."""
    io = imgui.get_io()
    if io.key_ctrl and io.mouse_wheel:
        timeline.axis.zoom(io.mouse_wheel, x)
    elif io.mouse_wheel_h or (io.key_shift and io.mouse_wheel):
        timeline.axis.pan(-_PAN_PER_NOTCH * (io.mouse_wheel_h or io.mouse_wheel))
    elif io.mouse_wheel:
        low = max(timeline.layout.height - size.y, 0.0)
        timeline.scrolled = min(max(timeline.scrolled - 24 * io.mouse_wheel, 0.0), low)


def _set_cursor(kind: str) -> None:
    if kind in ("edge", "begin", "blend", "switch", "from", "to"):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
    elif kind in _CLICKABLE_PARTS:
        imgui.set_mouse_cursor(imgui.MouseCursor_.hand)


def _draw_ruler(app: App, origin: ImVec2, size: ImVec2) -> None:
    draw_list, axis = imgui.get_window_draw_list(), app.time_axis.scale
    draw_list.add_rect_filled(origin, ImVec2(origin.x + size.x, origin.y + RULER_HEIGHT), pack_colour(DARK))
    for draw_layer in app.ruler_layers:
        draw_layer(origin.x, origin.y)
    with use_small_text():
        for time, numbered in axis.ticks():
            x = origin.x + axis.x(time)
            if x < origin.x + LABEL_WIDTH - 1:
                continue
            top = origin.y + (RULER_HEIGHT - 9 if numbered else RULER_HEIGHT - 4)
            draw_list.add_line(ImVec2(x, top), ImVec2(x, origin.y + RULER_HEIGHT), pack_colour(QUIET, 0.6))
            label = f"{time:g} s"
            if numbered and x + 4 + imgui.calc_text_size(label).x <= origin.x + size.x:
                draw_list.add_text(ImVec2(x + 4, origin.y + 5), pack_colour(QUIET), label)


def _draw_lanes(timeline: TimelineInput, perform: PerformSession, origin: ImVec2, size: ImVec2) -> None:
    layout = timeline.layout
    lanes = layout.lanes()
    for lane in lanes:
        if lane.kind == "bar":
            _PAINTER.lane(timeline, layout, lane, origin, size)
        elif lane.kind == "head":
            _PAINTER.head(timeline, lane, origin, size)
        else:
            draw_details(timeline, layout, lane, origin, size)
    draw_details_tooltip(timeline, layout, origin)
    if perform.recording.clip is not None:
        draw_recorded_clip(perform.recording.clip, layout, origin, size.y)
    elif not lanes:
        imgui.set_cursor_screen_pos(ImVec2(origin.x + LABEL_WIDTH + 8, origin.y + RULER_HEIGHT + 12))
        empty_text = _NO_RECORDING if perform.active_workspace == "Perform" else _NO_MOTION
        draw_note(_NO_TAKE if get_puppet_editor(timeline.editor).puppet is not None else empty_text)


def _draw_playhead(timeline: TimelineInput, origin: ImVec2, size: ImVec2) -> None:
    draw_list = imgui.get_window_draw_list()
    axis, stuck = timeline.axis.scale, timeline.snapped_time
    if stuck is not None:
        snap_x = origin.x + axis.x(stuck)
        draw_list.add_line(
            ImVec2(snap_x, origin.y + RULER_HEIGHT),
            ImVec2(snap_x, origin.y + size.y),
            pack_colour(CHAIN, 0.9),
            1.0,
        )
    edge = origin.x + LABEL_WIDTH - 12
    draw_list.add_line(ImVec2(edge, origin.y), ImVec2(edge, origin.y + size.y), pack_colour(LINE))
    x = origin.x + axis.x(timeline.editor.time)
    if x < edge:
        return
    draw_list.add_line(ImVec2(x, origin.y), ImVec2(x, origin.y + size.y), pack_colour(ACCENT), 1.5)
    y = origin.y + RULER_HEIGHT - 1
    draw_list.add_triangle_filled(
        ImVec2(x - 6, y - 9), ImVec2(x + 6, y - 9), ImVec2(x, y), pack_colour(ACCENT)
    )
