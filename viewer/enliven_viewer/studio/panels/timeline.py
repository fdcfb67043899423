"""The timeline along the bottom: transport, ruler, a lane a layer, the playhead; all from a draw list."""

from __future__ import annotations

import zlib

from imgui_bundle import ImVec2, imgui

from enliven_viewer.live import time_text
from enliven_viewer.studio.panels.fields import told
from enliven_viewer.studio.panels.growing import draw_growing
from enliven_viewer.studio.panels.style import CLOSED_EYE, EYE, packed, panel, quiet, small
from enliven_viewer.studio.panels.timeline_puppets import draw_details, tell_details
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.timeline import LABELS, LANE, RULER, Lane, TimelineLayout
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, DARK, INK, LANES, LINE, QUIET, RAISED, Colour

_START, _PLAY, _PAUSE, _LOOP = "\uf048", "\uf04b", "\uf04c", "\uf01e"
"""Icons of Font Awesome 4, on the buttons of the transport."""
_NO_MOTION = "No motion yet. Take the Map tool (M), choose a chain of a take, then a chain of your shape."
_NO_TAKE = "The puppet plays no take yet. Choose one in the performer's view."


def draw_timeline(workspace: Workspace, area: Area) -> None:
    """Draw the bottom panel."""
    with panel("timeline", area, imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse):
        _transport(workspace)
        origin = imgui.get_cursor_screen_pos()
        size = imgui.get_content_region_avail()
        workspace.timeline.width = size.x
        imgui.invisible_button("##track", ImVec2(max(size.x, 1), max(size.y, 1)))
        workspace.remember("timeline")
        _listen(workspace, origin, size)
        draw = imgui.get_window_draw_list()
        draw.push_clip_rect(origin, ImVec2(origin.x + size.x, origin.y + size.y), True)
        _lanes(workspace, origin, size)
        _ruler(workspace, origin, size)
        _playhead(workspace, origin, size)
        draw.pop_clip_rect()


def _transport(workspace: Workspace) -> None:
    editor = workspace.editor
    if imgui.button(_START + "##start", ImVec2(34, 0)):
        editor.scrub(0.0)
    imgui.same_line()
    if imgui.button((_PAUSE if editor.playing else _PLAY) + "##play", ImVec2(44, 0)):
        editor.playing = not editor.playing
    workspace.remember("play")
    imgui.same_line()
    if editor.loop:
        imgui.push_style_color(imgui.Col_.text, packed(ACCENT))
    looping = editor.loop
    if imgui.button(_LOOP + "##loop", ImVec2(34, 0)):
        editor.loop = not editor.loop
    if looping:
        imgui.pop_style_color()
    told("Begin again at the end")
    imgui.same_line(0.0, 18.0)
    imgui.align_text_to_frame_padding()
    imgui.text(f"{time_text(editor.time)}  /  {time_text(editor.length)}")
    imgui.same_line(0.0, 18.0)
    imgui.set_next_item_width(76)
    changed, speed = imgui.drag_float("##speed", editor.speed, 0.01, 0.1, 4.0, "%.2f x")
    if changed:
        editor.speed = speed
    told("Drag: how fast it plays here; nothing is changed by it")


def _listen(workspace: Workspace, origin: ImVec2, size: ImVec2) -> None:
    """Pass the pointer's clicks, drags and wheel to the timeline."""
    at, timeline = imgui.get_mouse_pos(), workspace.timeline
    x, y = at.x - origin.x, at.y - origin.y
    if imgui.is_item_hovered():
        if imgui.is_mouse_double_clicked(0) and timeline.double(x, y):
            pass
        elif imgui.is_mouse_clicked(0):
            timeline.press(x, y)
        low = max(timeline.layout.height - size.y, 0.0)
        timeline.scrolled = min(max(timeline.scrolled - 24 * imgui.get_io().mouse_wheel, 0.0), low)
        _cursor(timeline.layout.handle_at(x, y).kind)
    elif imgui.is_mouse_clicked(0):
        timeline.rows.marked = None
    if timeline.busy and imgui.is_mouse_down(0):
        timeline.drag(x)
    elif timeline.busy:
        timeline.release(x)


def _cursor(kind: str) -> None:
    if kind in ("edge", "switch"):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
    elif kind in ("bar", "mute", "pose", "suggested", "held", "found"):
        imgui.set_mouse_cursor(imgui.MouseCursor_.hand)


def _ruler(workspace: Workspace, origin: ImVec2, size: ImVec2) -> None:
    draw, layout = imgui.get_window_draw_list(), workspace.timeline.layout
    draw.add_rect_filled(origin, ImVec2(origin.x + size.x, origin.y + RULER), packed(DARK))
    with small():
        for time, numbered in layout.ticks():
            x = origin.x + layout.x(time)
            top = origin.y + (RULER - 9 if numbered else RULER - 4)
            draw.add_line(ImVec2(x, top), ImVec2(x, origin.y + RULER), packed(QUIET, 0.6))
            if numbered:
                draw.add_text(ImVec2(x + 4, origin.y + 5), packed(QUIET), f"{time:g} s")


def _lanes(workspace: Workspace, origin: ImVec2, size: ImVec2) -> None:
    layout = workspace.timeline.layout
    lanes = layout.lanes()
    for lane in lanes:
        if lane.kind == "bar":
            _lane(workspace, layout, lane, origin, size)
        else:
            draw_details(workspace, layout, lane, origin, size)
    tell_details(workspace, layout, origin)
    if not draw_growing(workspace, layout, origin) and not lanes:
        imgui.set_cursor_screen_pos(ImVec2(origin.x + LABELS + 8, origin.y + RULER + 12))
        quiet(_NO_TAKE if workspace.editor.puppets.puppet is not None else _NO_MOTION)


def _lane(workspace: Workspace, layout: TimelineLayout, lane: Lane, origin: ImVec2, size: ImVec2) -> None:
    draw, layer = imgui.get_window_draw_list(), lane.layer
    top, right = origin.y + lane.top, origin.x + size.x
    selection = workspace.editor.selection
    chosen = selection.character == lane.character.id and selection.layer in lane.layers
    draw.add_rect_filled(
        ImVec2(origin.x, top), ImVec2(right, top + LANE), packed(RAISED, 0.95 if chosen else 0.5), 4.0
    )
    tint, faded = colour_of(layer.take), 0.3 if layer.muted else 1.0
    icon = CLOSED_EYE if layer.muted else EYE
    draw.add_text(ImVec2(origin.x + 5, top + 4), packed(QUIET if layer.muted else INK, 0.9), icon)
    name_right = origin.x + LABELS - 14
    draw.push_clip_rect(ImVec2(origin.x, top), ImVec2(name_right, top + LANE), True)
    draw.add_text(ImVec2(origin.x + 28, top + 4), packed(ACCENT if chosen else INK, faded), lane.label)
    draw.pop_clip_rect()
    left, end = origin.x + lane.left, origin.x + lane.right
    if layer.loop:
        last = origin.x + layout.x(layout.length)
        draw.add_rect_filled(
            ImVec2(end, top + 3), ImVec2(last, top + LANE - 3), packed(tint, 0.25 * faded), 4.0
        )
    draw.add_rect_filled(ImVec2(left, top + 2), ImVec2(end, top + LANE - 2), packed(tint, 0.8 * faded), 4.0)
    if chosen:
        draw.add_rect(ImVec2(left, top + 2), ImVec2(end, top + LANE - 2), packed(INK), 4.0, 1.5)
    draw.push_clip_rect(ImVec2(left, top), ImVec2(end, top + LANE), True)
    words = layer.take if layer.speed == 1 else f"{layer.take}  {layer.speed:.2g}x"
    with small():
        draw.add_text(ImVec2(left + 8, top + 5), packed(DARK, 1.0), words)
    draw.pop_clip_rect()


def _playhead(workspace: Workspace, origin: ImVec2, size: ImVec2) -> None:
    draw = imgui.get_window_draw_list()
    x = origin.x + workspace.timeline.layout.x(workspace.editor.time)
    draw.add_line(ImVec2(x, origin.y), ImVec2(x, origin.y + size.y), packed(ACCENT), 1.5)
    y = origin.y + RULER - 1
    draw.add_triangle_filled(ImVec2(x - 6, y - 9), ImVec2(x + 6, y - 9), ImVec2(x, y), packed(ACCENT))
    edge = origin.x + LABELS - 12
    draw.add_line(ImVec2(edge, origin.y), ImVec2(edge, origin.y + size.y), packed(LINE))


def colour_of(take: str) -> Colour:
    """The colour of a take's bars."""
    return LANES[zlib.crc32(take.encode()) % len(LANES)]
