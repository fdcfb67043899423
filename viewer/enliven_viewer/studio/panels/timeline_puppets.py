"""The lanes of puppets, drawn: bars, key poses over how far the take is from them, contacts, constraints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.document import Position, Velocity
from enliven_viewer.studio.panels.examples import constraint_text
from enliven_viewer.studio.panels.style import CLOSED_EYE, EYE, packed, small
from enliven_viewer.studio.timeline import LABELS, LaneRow, PuppetLanes
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, CHAIN, DARK, GOOD, INK, QUIET, RAISED, Colour, point_colour

_CONTACT: Colour = (0.46, 0.70, 0.50, 1.0)
"""The time on the floor: green."""
_FLIGHT: Colour = (0.46, 0.58, 0.86, 1.0)
"""The time in the air: blue."""
_LABELS = {"poses": "key poses", "band": "on the floor", "held": "held hard"}
_FAR = 1.15
"""How far the coverage line shows, where 1 is as far as without any example."""


def draw_puppet_lanes(
    workspace: Workspace,
    lanes: PuppetLanes,
    origin: ImVec2,
    size: ImVec2,
    colour_of: Callable[[str], Colour],
) -> None:
    """Every row."""
    for row in lanes.rows():
        if row.kind == "bar":
            _bar(workspace, lanes, row, origin, size, colour_of(lanes.layer(row).take))
            continue
        draw = imgui.get_window_draw_list()
        top, right = origin.y + row.top, origin.x + size.x
        draw.add_rect_filled(
            ImVec2(origin.x, top), ImVec2(right, top + row.height), packed(RAISED, 0.35), 3.0
        )
        with small():
            at = ImVec2(origin.x + 28, top + row.height / 2 - 7)
            draw.add_text(at, packed(QUIET), _label(lanes, row))
        if row.kind == "poses":
            _poses(workspace, lanes, row, origin)
        elif row.kind == "band":
            _bands(workspace, lanes, row, origin)
        else:
            _held(workspace, lanes, row, origin)
    _tooltip(workspace, lanes, origin)


def _label(lanes: PuppetLanes, row: LaneRow) -> str:
    if row.kind == "band" and lanes.layer(row).switches is not None:
        return "on the floor   \uf0e2 find again"
    return _LABELS[row.kind]


def _bar(
    workspace: Workspace, lanes: PuppetLanes, row: LaneRow, origin: ImVec2, size: ImVec2, tint: Colour
) -> None:
    draw, layer = imgui.get_window_draw_list(), lanes.layer(row)
    chosen = (
        workspace.editor.selection.puppet == row.puppet
        and workspace.editor.selection.puppet_layer == row.layer
    )
    top, right, low = origin.y + row.top, origin.x + size.x, origin.y + row.top + row.height
    draw.add_rect_filled(
        ImVec2(origin.x, top), ImVec2(right, low), packed(RAISED, 0.95 if chosen else 0.5), 4.0
    )
    faded = 0.3 if layer.muted else 1.0
    icon = CLOSED_EYE if layer.muted else EYE
    draw.add_text(ImVec2(origin.x + 5, top + 4), packed(QUIET if layer.muted else INK, 0.9), icon)
    draw.push_clip_rect(ImVec2(origin.x, top), ImVec2(origin.x + LABELS - 14, low), True)
    draw.add_text(ImVec2(origin.x + 28, top + 4), packed(ACCENT if chosen else INK, faded), row.puppet)
    draw.pop_clip_rect()
    start, end = (origin.x + x for x in lanes.span(row))
    if layer.loop:
        last = origin.x + lanes.layout.x(lanes.layout.length)
        draw.add_rect_filled(ImVec2(end, top + 3), ImVec2(last, low - 3), packed(tint, 0.25 * faded), 4.0)
    draw.add_rect_filled(ImVec2(start, top + 2), ImVec2(end, low - 2), packed(tint, 0.8 * faded), 4.0)
    if chosen:
        draw.add_rect(ImVec2(start, top + 2), ImVec2(end, low - 2), packed(INK, 0.8), 4.0, 1.2)
    words = layer.take if layer.speed == 1 else f"{layer.take}  {layer.speed:.2g}x"
    draw.push_clip_rect(ImVec2(start, top), ImVec2(end, low), True)
    with small():
        draw.add_text(ImVec2(start + 8, top + 5), packed(DARK), words)
    draw.pop_clip_rect()


def _poses(workspace: Workspace, lanes: PuppetLanes, row: LaneRow, origin: ImVec2) -> None:
    """Draw the distance of each moment from the examples, a tick for each missing one, a diamond for each."""
    draw, top = imgui.get_window_draw_list(), origin.y + row.top
    coverage = lanes.coverage(lanes.layer(row).take)
    puppet = lanes.project.puppets[row.puppet]
    if coverage is not None and puppet.poses:
        start, end = (origin.x + x for x in lanes.span(row))
        count = int(np.clip((end - start) / 5, 2, 400))
        away = np.interp(
            np.linspace(0, len(coverage.away) - 1, count), np.arange(len(coverage.away)), coverage.away
        )
        away = away if lanes.layer(row).speed > 0 else away[::-1]
        xs = np.linspace(start, end, count)
        ys = top + row.height - 3 - (row.height - 8) * np.clip(away / _FAR, 0.0, 1.0)
        for k in range(count - 1):
            tint = _between(GOOD, BAD, float(np.clip((away[k] - 0.45) / 0.4, 0.0, 1.0)))
            corners = (
                ImVec2(xs[k], ys[k]),
                ImVec2(xs[k + 1], ys[k + 1]),
                ImVec2(xs[k + 1], top + row.height - 1),
                ImVec2(xs[k], top + row.height - 1),
            )
            draw.add_quad_filled(*corners, packed(tint, 0.26))
            draw.add_line(corners[0], corners[1], packed(tint, 0.85), 1.3)
    for _, x in lanes.suggested(row):
        _diamond(draw, origin.x + x, top + row.height / 2, 5.5, packed(CHAIN, 0.9), filled=False)
    for number, x in lanes.poses(row):
        chosen = workspace.editor.puppets.number == number and workspace.editor.selection.puppet == row.puppet
        mark = packed(ACCENT if chosen else INK)
        _diamond(draw, origin.x + x, top + row.height / 2, 7.0 if chosen else 6.0, mark, filled=True)


def _bands(workspace: Workspace, lanes: PuppetLanes, row: LaneRow, origin: ImVec2) -> None:
    """Draw contact and flight, with a handle at each switch."""
    draw, top = imgui.get_window_draw_list(), origin.y + row.top
    handle = workspace.timeline.puppets.chosen
    for number, (switch, left, right) in enumerate(lanes.bands(row)):
        tint = _CONTACT if switch.kind == "contact" else _FLIGHT
        low, high = ImVec2(origin.x + left, top + 2), ImVec2(origin.x + right, top + row.height - 2)
        draw.add_rect_filled(low, high, packed(tint, 0.75), 2.0)
        if right - left > 52:
            with small():
                word = "contact" if switch.kind == "contact" else "flight"
                draw.add_text(ImVec2(origin.x + left + 7, top), packed(DARK), word)
        if number:
            held = (
                handle is not None
                and handle.kind == "switch"
                and (handle.layer, handle.item) == (row.layer, number)
            )
            x, tint = origin.x + left, ACCENT if held else INK
            draw.add_rect_filled(ImVec2(x - 2, top), ImVec2(x + 2, top + row.height), packed(tint), 1.0)


def _held(workspace: Workspace, lanes: PuppetLanes, row: LaneRow, origin: ImVec2) -> None:
    """Draw a mark for every hard constraint: a pin, a bar for standing still, two dots for level."""
    draw, middle = imgui.get_window_draw_list(), origin.y + row.top + row.height / 2
    puppet = lanes.project.puppets[row.puppet]
    for _, held, x in lanes.held(row):
        red, green, blue = point_colour(puppet.index(held.point))
        tint, x = packed((red / 255, green / 255, blue / 255, 1.0)), origin.x + x
        if isinstance(held, Position):
            draw.add_circle_filled(ImVec2(x, middle), 4.5, tint)
        elif isinstance(held, Velocity):
            draw.add_rect_filled(ImVec2(x - 2, middle - 5), ImVec2(x + 2, middle + 5), tint, 1.0)
        else:
            draw.add_line(ImVec2(x - 6, middle), ImVec2(x + 6, middle), tint, 1.5)
            draw.add_circle_filled(ImVec2(x - 5, middle), 3.0, tint)
            draw.add_circle_filled(ImVec2(x + 5, middle), 3.0, tint)


def _tooltip(workspace: Workspace, lanes: PuppetLanes, origin: ImVec2) -> None:
    """Show what is under the pointer, in words."""
    if not imgui.is_item_hovered() or workspace.timeline.busy:
        return
    at = imgui.get_mouse_pos()
    handle = lanes.handle_at(at.x - origin.x, at.y - origin.y)
    if handle is None:
        return
    said = {
        "pose": "Click: edit this key pose. Drag: another moment for it.",
        "suggested": "No example is like this moment. Click: pose the puppet for it.",
        "switch": "Drag: when the puppet leaves or touches the floor. Delete takes it away.",
        "band": "Double click: a switch here. Green: on the floor, blue: in flight.",
        "found": "Contacts and flights; click to find them again after editing.",
    }.get(handle.kind, "")
    if handle.kind == "held":
        row = next(r for r in lanes.rows() if (r.kind, r.layer) == ("held", handle.layer))
        held = lanes.held(row)[handle.item][1]
        said = constraint_text(held, lanes.project.takes[lanes.layer(row).take].step) + ". Delete lets go."
    if said:
        imgui.set_tooltip(said)


def _diamond(draw: imgui.ImDrawList, x: float, y: float, reach: float, tint: int, *, filled: bool) -> None:
    corners = (ImVec2(x, y - reach), ImVec2(x + reach, y), ImVec2(x, y + reach), ImVec2(x - reach, y))
    if filled:
        draw.add_quad_filled(*corners, tint)
        draw.add_quad(*corners, packed((0.0, 0.0, 0.0, 0.65)), 1.2)
    else:
        draw.add_quad_filled(*corners, packed(DARK, 0.6))
        draw.add_quad(*corners, tint, 1.6)


def _between(one: Colour, other: Colour, share: float) -> Colour:
    mixed = [(1 - share) * a + share * b for a, b in zip(one, other, strict=True)]
    return mixed[0], mixed[1], mixed[2], mixed[3]
