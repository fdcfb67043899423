"""The rows below a puppet's bars: key poses over the coverage curve, contacts, and constraints."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.document import Position, Velocity
from enliven_viewer.language import later, tr
from enliven_viewer.studio.app.style import pack_colour, use_small_text
from enliven_viewer.studio.features.timeline.layout import Lane, TimelineLayout
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.puppets.example_edits import describe_constraint, list_constraints
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.theme import (
    ACCENT,
    BAD,
    CHAIN,
    CONTACT,
    DARK,
    FLIGHT,
    GOOD,
    INK,
    ON_COLOUR,
    QUIET,
    RAISED,
    SHADOW,
    Colour,
    get_point_colour,
)

_ROW_LABELS = {"poses": later("key poses"), "band": later("on the floor"), "held": later("fixed frames")}
_MAX_COVERAGE_DISTANCE = 1.15
"""Maximum of the coverage curve's vertical scale. 1 is the largest distance without examples."""


def draw_details(
    timeline: TimelineInput, layout: TimelineLayout, lane: Lane, origin: ImVec2, size: ImVec2
) -> None:
    """Draws a row below a bar."""
    draw_list, top = imgui.get_window_draw_list(), origin.y + lane.top
    corner = ImVec2(origin.x + size.x, top + lane.height)
    draw_list.add_rect_filled(ImVec2(origin.x, top), corner, pack_colour(RAISED, 0.35), 3.0)
    details = timeline.rows.details
    edited = lane.kind == "band" and details.layer(lane.layers[0]).switches is not None
    with use_small_text():
        label = tr(_ROW_LABELS[lane.kind]) + ("   \uf0e2 " + tr("find again") if edited else "")
        draw_list.add_text(ImVec2(origin.x + 28, top + lane.height / 2 - 7), pack_colour(QUIET), label)
    {"poses": _draw_poses, "band": _draw_bands, "held": _draw_constraints}[lane.kind](
        timeline, layout, lane, origin
    )


def _draw_poses(timeline: TimelineInput, layout: TimelineLayout, lane: Lane, origin: ImVec2) -> None:
    """Draws the coverage curve, the missing key poses, and a diamond for each key pose.

    The curve shows the distance of the performer's pose from the nearest example.
    """
    draw_list, top = imgui.get_window_draw_list(), origin.y + lane.top
    details, puppets = timeline.rows.details, get_puppet_editor(timeline.editor)
    coverage, poses = details.coverage(lane.layer.take), details.poses(layout, lane)
    if coverage is not None and puppets.puppet is not None and puppets.puppet.poses:
        start, end = origin.x + lane.left, origin.x + lane.right
        count = int(np.clip((end - start) / 5, 2, 400))
        distances = np.interp(
            np.linspace(0, len(coverage.distances) - 1, count),
            np.arange(len(coverage.distances)),
            coverage.distances,
        )
        distances = distances if lane.layer.speed > 0 else distances[::-1]
        xs = np.linspace(start, end, count)
        ys = top + lane.height - 3 - (lane.height - 8) * np.clip(distances / _MAX_COVERAGE_DISTANCE, 0.0, 1.0)
        for k in range(count - 1):
            tint = _mix_colours(GOOD, BAD, float(np.clip((distances[k] - 0.45) / 0.4, 0.0, 1.0)))
            corners = (
                ImVec2(xs[k], ys[k]),
                ImVec2(xs[k + 1], ys[k + 1]),
                ImVec2(xs[k + 1], top + lane.height - 1),
                ImVec2(xs[k], top + lane.height - 1),
            )
            draw_list.add_quad_filled(*corners, pack_colour(tint, 0.26))
            draw_list.add_line(corners[0], corners[1], pack_colour(tint, 0.85), 1.3)
    for _, x in details.suggest_marks(layout, lane):
        _draw_diamond(
            draw_list, origin.x + x, top + lane.height / 2, 5.5, pack_colour(CHAIN, 0.9), filled=False
        )
    for number, x in poses:
        chosen = puppets.number == number
        mark = pack_colour(ACCENT if chosen else INK)
        _draw_diamond(
            draw_list, origin.x + x, top + lane.height / 2, 7.0 if chosen else 6.0, mark, filled=True
        )


def _draw_bands(timeline: TimelineInput, layout: TimelineLayout, lane: Lane, origin: ImVec2) -> None:
    """Draws contact and flight phases, with a handle at each switch."""
    draw_list, top = imgui.get_window_draw_list(), origin.y + lane.top
    rows = timeline.rows
    for number, (switch, left, right) in enumerate(rows.details.bands(layout, lane)):
        tint = CONTACT if switch.kind == "contact" else FLIGHT
        low, high = ImVec2(origin.x + left, top + 2), ImVec2(origin.x + right, top + lane.height - 2)
        draw_list.add_rect_filled(low, high, pack_colour(tint, 0.75), 2.0)
        if right - left > 52:
            with use_small_text():
                kind_label = tr("contact") if switch.kind == "contact" else tr("flight")
                draw_list.add_text(ImVec2(origin.x + left + 7, top), pack_colour(ON_COLOUR), kind_label)
        if number:
            marked = rows.marked
            held = marked is not None and (marked.kind, marked.layers, marked.item) == (
                "switch",
                lane.layers,
                number,
            )
            x, tint = origin.x + left, ACCENT if held else INK
            draw_list.add_rect_filled(
                ImVec2(x - 2, top), ImVec2(x + 2, top + lane.height), pack_colour(tint), 1.0
            )


def _draw_constraints(timeline: TimelineInput, layout: TimelineLayout, lane: Lane, origin: ImVec2) -> None:
    """Draws a mark for every hard constraint.

    A dot means a fixed position, a bar means no movement, and two dots mean equal height.
    """
    draw_list, middle = imgui.get_window_draw_list(), origin.y + lane.top + lane.height / 2
    for _, held, x in timeline.rows.details.constraint_marks(layout, lane):
        red, green, blue = get_point_colour(lane.character.handles.index(held.point))
        tint, x = pack_colour((red / 255, green / 255, blue / 255, 1.0)), origin.x + x
        if isinstance(held, Position):
            draw_list.add_circle_filled(ImVec2(x, middle), 4.5, tint)
        elif isinstance(held, Velocity):
            draw_list.add_rect_filled(ImVec2(x - 2, middle - 5), ImVec2(x + 2, middle + 5), tint, 1.0)
        else:
            draw_list.add_line(ImVec2(x - 6, middle), ImVec2(x + 6, middle), tint, 1.5)
            draw_list.add_circle_filled(ImVec2(x - 5, middle), 3.0, tint)
            draw_list.add_circle_filled(ImVec2(x + 5, middle), 3.0, tint)


def draw_details_tooltip(timeline: TimelineInput, layout: TimelineLayout, origin: ImVec2) -> None:
    """Shows a tooltip about the mark under the pointer."""
    if not imgui.is_item_hovered() or timeline.busy:
        return
    pointer, project = imgui.get_mouse_pos(), layout.project
    handle = layout.handle_at(pointer.x - origin.x, pointer.y - origin.y)
    tooltip = {
        "pose": tr("Click: edit this key pose. Drag: move it to another time."),
        "suggested": tr("No key pose is similar to this moment. Click: pose the puppet for this moment."),
        "switch": tr("Drag: change when the puppet leaves or touches the floor. Delete: remove this switch."),
        "band": tr(
            "Double-click: add a switch between floor and flight. Green: on the floor, blue: in flight."
        ),
        "found": tr("Foot contacts and flight phases. Click to detect them again after editing."),
    }.get(handle.kind, "")
    if handle.kind == "held":
        constraint = list_constraints(project, handle.character, handle.number)[handle.item]
        take = project.takes[project.characters[handle.character].playing[handle.number].take]
        tooltip = tr("{0}. Delete: remove this constraint.", describe_constraint(constraint, take.step))
    if tooltip:
        imgui.set_tooltip(tooltip)


def _draw_diamond(
    draw_list: imgui.ImDrawList, x: float, y: float, reach: float, tint: int, *, filled: bool
) -> None:
    corners = (ImVec2(x, y - reach), ImVec2(x + reach, y), ImVec2(x, y + reach), ImVec2(x - reach, y))
    if filled:
        draw_list.add_quad_filled(*corners, tint)
        draw_list.add_quad(*corners, pack_colour(SHADOW, 0.65), 1.2)
    else:
        draw_list.add_quad_filled(*corners, pack_colour(DARK, 0.6))
        draw_list.add_quad(*corners, tint, 1.6)


def _mix_colours(one: Colour, other: Colour, fraction: float) -> Colour:
    mixed = [(1 - fraction) * a + fraction * b for a, b in zip(one, other, strict=True)]
    return mixed[0], mixed[1], mixed[2], mixed[3]
