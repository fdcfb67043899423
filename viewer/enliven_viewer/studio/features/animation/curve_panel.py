"""Draws the curve editor's panel above the timeline, on the same time axis."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, ImVec2Like, imgui

from enliven.document import EASES
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    draw_note,
    open_panel,
    pack_colour,
    push_colours,
    use_small_text,
)
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH
from enliven_viewer.studio.features.animation.channels import LAYER_KEY_ATTRIBUTES, CurveDot, CurveGroup
from enliven_viewer.studio.features.animation.curve_input import CurveInput
from enliven_viewer.studio.features.animation.curve_scale import Scale
from enliven_viewer.studio.features.animation.key_edits import KEY_ATTRIBUTES
from enliven_viewer.theme import ACCENT, AXIS_COLOURS, DARK, INK, LINE, QUIET, Colour

_GROUP_LABELS = {
    "keys": later("Rotation keys"),
    "moves": later("Position keys"),
    "turn": later("Turn"),
    "place": later("Place"),
    "weight": later("Weight"),
    "speed": later("Speed"),
}
"""Labels of the groups of channels."""
_EASE_LABELS = {"smooth": later("Smooth"), "linear": later("Linear"), "step": later("Step")}
"""Labels of the interpolation modes."""
_EMPTY_TEXT = later("Choose a shape, a node, a control point or a clip to see its curves here.")
_MENU_ID = "key menu"
_DIAMOND_RADIUS = 5.5
"""Distance in pixels from the centre of a key to its corners."""
_PAN_PER_NOTCH = 40.0
"""Pixels that the time axis pans per notch of the wheel with Shift."""


def draw_curves(app: App, curves: CurveInput, area: Area) -> None:
    """Draws the panel of the curves."""
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    with open_panel("curves", area, flags):
        curves.refresh()
        groups, group = curves.groups(), curves.find_shown_group()
        if group is None:
            draw_note(_EMPTY_TEXT)
            return
        origin, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        curves.height = max(size.y, 20.0)
        scale = curves.scale(group)
        left = ImVec2(origin.x + LABEL_WIDTH - 12, origin.y)
        imgui.set_cursor_screen_pos(left)
        imgui.invisible_button("##curves", ImVec2(max(origin.x + size.x - left.x, 1), max(size.y, 1)))
        app.remember("curves")
        _handle_pointer(curves, origin, group)
        _draw_plot(curves, group, scale, origin, size)
        imgui.set_cursor_screen_pos(origin)
        _draw_names(app, curves, groups, group)
        _draw_key_menu(curves)


def _draw_names(app: App, curves: CurveInput, groups: dict[str, CurveGroup], shown: CurveGroup) -> None:
    """Draws the list of groups, and the channels of the shown group with their current values."""
    imgui.begin_child("##groups", ImVec2(LABEL_WIDTH - 22, 0))
    for name in groups:
        if imgui.selectable(
            f"{tr(_GROUP_LABELS[name])}###group {name}", name == shown.name, 0, ImVec2(LABEL_WIDTH - 70, 0)
        )[0]:
            curves.group = name
        app.remember(f"curves {name}")
        if name == shown.name:
            imgui.same_line()
            if imgui.small_button(labelled(tr("Fit"), "Fit")):
                curves.fit_value_scale()
            app.remember("fit curves")
            draw_tooltip("Show all values. The wheel zooms, the middle button pans.")
            _draw_values(curves, shown)
    imgui.end_child()


def _draw_values(curves: CurveInput, shown: CurveGroup) -> None:
    times, now = curves.sample_times(), curves.editor.time
    with use_small_text():
        for number, name in enumerate(shown.channels):
            values = shown.values[:, number]
            value = float(np.interp(now, times, values)) if np.isfinite(values).all() else float("nan")
            with push_colours(_find_channel_colour(shown, number), imgui.Col_.text):
                imgui.text_unformatted(f"   {name}   {_format_value(value, shown.unit)}")


def _draw_plot(curves: CurveInput, group: CurveGroup, scale: Scale, origin: ImVec2, size: ImVec2) -> None:
    draw_list, axis = imgui.get_window_draw_list(), curves.axis.scale
    left, right = origin.x + LABEL_WIDTH - 12, origin.x + size.x
    draw_list.push_clip_rect(ImVec2(left, origin.y), ImVec2(right, origin.y + size.y), True)
    draw_list.add_rect_filled(
        ImVec2(left, origin.y), ImVec2(right, origin.y + size.y), pack_colour(DARK), 4.0
    )
    with use_small_text():
        for value in scale.ticks():
            y = origin.y + scale.y(value)
            strong = abs(value) < 1e-9
            draw_list.add_line(ImVec2(left, y), ImVec2(right, y), pack_colour(LINE, 2.4 if strong else 0.8))
            draw_list.add_text(
                ImVec2(left + 5, y - 13), pack_colour(QUIET, 0.8), _format_value(value, group.unit)
            )
        for time, numbered in axis.ticks():
            if numbered:
                x = origin.x + axis.x(time)
                draw_list.add_line(ImVec2(x, origin.y), ImVec2(x, origin.y + size.y), pack_colour(LINE, 0.8))
    for number in range(len(group.channels)):
        _draw_channel(curves, group, number, scale, origin)
    for dot in group.dots:
        position = ImVec2(origin.x + axis.x(dot.time), origin.y + scale.y(dot.value))
        _draw_diamond(
            draw_list,
            position,
            _find_channel_colour(group, dot.axis),
            chosen=dot.number == curves.selected_key,
        )
    x = origin.x + axis.x(curves.editor.time)
    draw_list.add_line(ImVec2(x, origin.y), ImVec2(x, origin.y + size.y), pack_colour(ACCENT), 1.5)
    if group.name in LAYER_KEY_ATTRIBUTES and not group.dots:
        advice = tr("Double-click: add a key, so that the value changes over time.")
        draw_list.add_text(ImVec2(left + 60, origin.y + size.y - 22), pack_colour(QUIET), advice)
    if group.name in KEY_ATTRIBUTES and not group.dots:
        advice = tr(
            "Double-click: add a key. Or switch on “Keys while posing” (Shift+K), then pose (R) or move "
            "(G) the shape."
        )
        draw_list.add_text(ImVec2(left + 60, origin.y + size.y - 22), pack_colour(QUIET), advice)
    draw_list.pop_clip_rect()


def _draw_channel(curves: CurveInput, group: CurveGroup, number: int, scale: Scale, origin: ImVec2) -> None:
    """Draws a channel, with gaps where its values are not finite."""
    draw_list, axis, tint = (
        imgui.get_window_draw_list(),
        curves.axis.scale,
        pack_colour(_find_channel_colour(group, number)),
    )
    values, xs = (
        group.values[:, number],
        axis.x(0.0) + axis.track_width * curves.sample_times() / axis.visible_s,
    )
    ys = scale.height * (scale.high - values) / (scale.high - scale.low)
    points: list[ImVec2Like] = []
    for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
        if np.isfinite(y):
            points.append(ImVec2(origin.x + x, origin.y + y))
            continue
        draw_list.add_polyline(points, tint, 1.8, 0)
        points = []
    draw_list.add_polyline(points, tint, 1.8, 0)


def _handle_pointer(curves: CurveInput, origin: ImVec2, group: CurveGroup) -> None:
    """Passes pointer input over the curves to the curve editor."""
    io, pointer = imgui.get_io(), imgui.get_mouse_pos()
    x, y, axis = pointer.x - origin.x, pointer.y - origin.y, curves.axis
    if imgui.is_item_hovered():
        dot = curves.find_dot(x, y)
        if dot is not None:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
            if not curves.busy:
                imgui.set_tooltip(_make_hover_text(dot, group))
        if imgui.is_mouse_double_clicked(0):
            curves.double_click(x, y)
        elif imgui.is_mouse_clicked(0):
            curves.press(x, y)
        elif imgui.is_mouse_clicked(1) and dot is not None:
            curves.selected_key = dot.number
            imgui.open_popup(_MENU_ID)
        if imgui.is_mouse_dragging(2, 0.0):
            curves.pan(io.mouse_delta.y)
            axis.pan(-io.mouse_delta.x)
        if io.key_ctrl and io.mouse_wheel:
            axis.zoom(io.mouse_wheel, x)
        elif io.mouse_wheel_h or (io.key_shift and io.mouse_wheel):
            axis.pan(-_PAN_PER_NOTCH * (io.mouse_wheel_h or io.mouse_wheel))
        elif io.mouse_wheel:
            curves.zoom(io.mouse_wheel, y)
    if curves.busy and imgui.is_mouse_down(0):
        curves.drag(x, y)
    elif curves.busy:
        curves.release(x, y)


def _draw_key_menu(curves: CurveInput) -> None:
    """Draws the context menu of a key."""
    if not imgui.begin_popup(_MENU_ID):
        return
    group = curves.find_shown_group()
    dot = next(
        (candidate for candidate in (group.dots if group else ()) if candidate.number == curves.selected_key),
        None,
    )
    if dot is not None and dot.ease:
        for ease in EASES:
            if imgui.menu_item(f"{tr(_EASE_LABELS[ease])}###ease {ease}", "", dot.ease == ease)[0]:
                curves.set_interpolation(ease)
        imgui.separator()
    if imgui.menu_item(labelled(tr("Remove"), "remove key"), "", False)[0]:
        curves.remove()
    imgui.end_popup()


def _make_hover_text(dot: CurveDot, group: CurveGroup) -> str:
    value_text = tr(
        "{0}   {1}   at {2:.2f} s", group.channels[dot.axis], _format_value(dot.value, group.unit), dot.time
    )
    advice = tr(
        "Drag: change the value or time of the key. Right button: change its interpolation, or remove "
        "the key."
    )
    return f"{value_text}\n{advice}"


def _draw_diamond(draw_list: imgui.ImDrawList, centre: ImVec2, tint: Colour, *, chosen: bool) -> None:
    reach = _DIAMOND_RADIUS + 1.5 * chosen
    corners = (
        ImVec2(centre.x, centre.y - reach),
        ImVec2(centre.x + reach, centre.y),
        ImVec2(centre.x, centre.y + reach),
        ImVec2(centre.x - reach, centre.y),
    )
    draw_list.add_quad_filled(*corners, pack_colour(ACCENT if chosen else tint))
    draw_list.add_quad(*corners, pack_colour(INK if chosen else DARK), 1.4)


def _find_channel_colour(group: CurveGroup, number: int) -> Colour:
    """Returns the colour of a channel: the colour of its axis, or the accent colour for a single channel."""
    if len(group.channels) == 1:
        return ACCENT
    red, green, blue = AXIS_COLOURS[number]
    return red / 255, green / 255, blue / 255, 1.0


def _format_value(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "-"
    places = 0 if unit == "\u00b0" else 2
    shown = round(value, places) + 0.0  # Adding 0 turns -0 into 0, which avoids the text "-0".
    return f"{shown:.{places}f}{' m' if unit == 'm' else unit}"
