"""Draws over the viewport: the tool's marks, its hint, and messages."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, ImVec2Like, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions import key_label
from enliven_viewer.studio.panel_layout import HOLDER, Area
from enliven_viewer.studio.panels.start import draw_start
from enliven_viewer.studio.panels.style import SMALL, packed
from enliven_viewer.studio.toasts import Toast
from enliven_viewer.studio.viewport import Disc, Fill, Label, Line, axes_marks
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, DARK, GLASS, GOOD, INK, QUIET

_BRACKET_GAP = 8.0
"""Gap in pixels between a selected character and its corner brackets."""
_BRACKET_LENGTH = 10.0
"""Length in pixels of a bracket's arms."""
_MIN_HINT_TEXT_SIZE = 9.0
"""Minimum text size in pixels of a long hint in the strip below a narrow view."""
_MAX_MESSAGE_WIDTH = 380.0
"""Maximum width in pixels of a message line: about sixty letters, easy to read."""


def draw_overlay(workspace: Workspace, area: Area, *, tool: bool = True, hint: Area | None = None) -> None:
    """Draws marks and the hint, if tools are available, then messages; below every panel.

    Args:
        hint: the strip for the hint, if it is not over the view.
    """
    draw = imgui.get_background_draw_list()
    if tool and hint is not None:
        _hint_strip(workspace, draw, hint)
    draw.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height))
    if tool:
        _tool(workspace, draw, area, over=hint is None)
    _toasts(workspace, draw, area)
    if tool:
        draw_start(workspace, area)
    if workspace.caption:
        _caption(workspace, draw, area)
    draw.pop_clip_rect()


def _tool(workspace: Workspace, draw: imgui.ImDrawList, area: Area, *, over: bool) -> None:
    """Draws the marks of the tool, the axes of a puppet, and the hint."""
    _brackets(workspace, draw, area)
    for mark in workspace.input.tool.overlay().marks:
        draw_mark(draw, area, mark)
    if workspace.puppets.puppet is not None:
        for mark in axes_marks(workspace.editor.lens, (area.width - 46, area.height - 42)):
            draw_mark(draw, area, mark)
    if over:
        _hint(workspace, draw, area)
    elif workspace.input.tool.warning:
        _warning(workspace.input.tool.warning, draw, area.x + 14, area.y + 14)


def _brackets(workspace: Workspace, draw: imgui.ImDrawList, area: Area) -> None:
    """Draws corner brackets around each of several selected characters.

    Those of the active character are brighter.
    """
    editor = workspace.editor
    if not editor.selection.several:
        return
    for character in editor.visible_characters:
        pixels = editor.lens.pixels_of(
            np.asarray(character.extent, float)[:: max(len(character.extent) // 300, 1)]
        )
        if character.id not in editor.selection.characters or not pixels:
            continue
        colour = packed(ACCENT if character.id == editor.selection.character else INK, 0.9)
        (left, top), (right, bottom) = (
            np.min(pixels, axis=0) - _BRACKET_GAP,
            np.max(pixels, axis=0) + _BRACKET_GAP,
        )
        for x, inward in ((left, _BRACKET_LENGTH), (right, -_BRACKET_LENGTH)):
            for y, down in ((top, _BRACKET_LENGTH), (bottom, -_BRACKET_LENGTH)):
                at = ImVec2(area.x + x, area.y + y)
                ends: list[ImVec2Like] = [ImVec2(at.x + inward, at.y), at, ImVec2(at.x, at.y + down)]
                draw.add_polyline(ends, colour, 2.0, 0)


def _points(mark: Line | Fill, area: Area) -> list[ImVec2Like]:
    """Returns a mark's points in pixels of the window."""
    return [ImVec2(area.x + x, area.y + y) for x, y in mark.points]


def draw_mark(draw: imgui.ImDrawList, area: Area, mark: Disc | Fill | Line | Label) -> None:
    """Draws one mark; its pixels count from the area's top left corner."""
    if isinstance(mark, Line):
        points = _points(mark, area)
        closed = imgui.ImDrawFlags_.closed if mark.closed else 0
        draw.add_polyline(points, packed(mark.colour), mark.width, closed)
    elif isinstance(mark, Disc):
        at = ImVec2(area.x + mark.at[0], area.y + mark.at[1])
        if mark.width > 0:
            draw.add_circle(at, mark.radius, packed(mark.colour), 0, mark.width)
        else:
            draw.add_circle_filled(at, mark.radius, packed(mark.colour))
    elif isinstance(mark, Fill):
        points = _points(mark, area)
        draw.add_convex_poly_filled(points, packed(mark.colour))
    else:
        at = ImVec2(area.x + mark.at[0], area.y + mark.at[1] - 8)
        written = imgui.calc_text_size(mark.text)
        low, high = ImVec2(at.x - 4, at.y - 1), ImVec2(at.x + written.x + 4, at.y + written.y + 1)
        draw.add_rect_filled(low, high, packed(GLASS, mark.colour[3]), 4.0)
        draw.add_text(at, packed(mark.colour), mark.text)


def _hint(workspace: Workspace, draw: imgui.ImDrawList, area: Area) -> None:
    """Draws the tool's name and hint, with its warning below."""
    tool = workspace.input.tool
    shift = imgui.calc_text_size(f"{tr(tool.label)}   ").x
    room = max(area.width - shift - 54, 80.0)
    extent = imgui.calc_text_size(tr(tool.hint), wrap_width=room)
    wide, high = shift + extent.x + 28, extent.y + 17
    x, y = area.x + 14, area.y + 14
    draw.add_rect_filled(ImVec2(x, y), ImVec2(x + wide, y + high), packed(GLASS), 9.0)
    workspace.widgets["hint"] = (x, y, x + wide, y + high)
    draw.add_text(ImVec2(x + 13, y + 8), packed(ACCENT), tr(tool.label))
    _draw_wrapped_text(draw, ImVec2(x + 13 + shift, y + 8), packed(INK), tr(tool.hint), room)
    if tool.warning:
        _warning(tool.warning, draw, x, y + high + 6)


def _hint_strip(workspace: Workspace, draw: imgui.ImDrawList, area: Area) -> None:
    """Draws the tool's name and hint in a strip below the view, in small letters."""
    tool, font, room = workspace.input.tool, imgui.get_font(), area.width - 28
    draw.add_rect_filled(
        ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height), packed(DARK)
    )
    size = SMALL
    words = f"{tr(tool.label)}   {tr(tool.hint)}"
    grown = size / imgui.get_font_size()
    high = imgui.calc_text_size(words, wrap_width=room / grown).y * grown
    while high > area.height - 6 and size > _MIN_HINT_TEXT_SIZE:
        size -= 0.5
        grown = size / imgui.get_font_size()
        high = imgui.calc_text_size(words, wrap_width=room / grown).y * grown
    top = area.y + (area.height - high) / 2
    draw.add_text(font, size, ImVec2(area.x + 14, top), packed(INK), words, room)
    draw.add_text(font, size, ImVec2(area.x + 14, top), packed(ACCENT), tr(tool.label))
    workspace.widgets["hint"] = (area.x, area.y, area.x + area.width, area.y + area.height)


def _warning(warning: str, draw: imgui.ImDrawList, x: float, y: float) -> None:
    text = f"\uf071  {warning}"
    wide = imgui.calc_text_size(text).x + 26
    draw.add_rect_filled(ImVec2(x, y), ImVec2(x + wide, y + 30), packed((*GLASS[:3], 0.92)), 9.0)
    draw.add_text(ImVec2(x + 13, y + 7), packed(BAD), text)


def _caption(workspace: Workspace, draw: imgui.ImDrawList, area: Area) -> None:
    """Draws the caption of a scripted session at the top, with the key that it presses."""
    font, size = imgui.get_font(), 19.0
    grown = size / imgui.get_font_size()
    wide = imgui.calc_text_size(workspace.caption).x * grown
    below = 38 if workspace.input.tool.warning else 0
    x, y = area.x + (area.width - wide) / 2, area.y + 66 + below
    draw.add_rect_filled(
        ImVec2(x - 18, y - 9), ImVec2(x + wide + 18, y + 31), packed((*GLASS[:3], 0.85)), 10.0
    )
    draw.add_text(font, size, ImVec2(x, y), packed(INK), workspace.caption)
    if workspace.pressed:
        key = key_label(workspace.pressed)
        left = x + wide + 34
        right = left + imgui.calc_text_size(key).x + 22
        draw.add_rect_filled(ImVec2(left, y - 6), ImVec2(right, y + 28), packed(INK), 7.0)
        draw.add_text(ImVec2(left + 11, y + 3), packed((*GLASS[:3], 1.0)), key)


def _toasts(workspace: Workspace, draw: imgui.ImDrawList, area: Area) -> None:
    perform = workspace.perform
    live = perform.active_workspace == "Play" and perform.live is not None
    bottom = area.y + area.height - (70 if live else 14)  # Leave room for the live timeline.
    if perform.active_workspace in ("Perform", "Play"):
        # Also leave room for the lines about performers, and for the line that shows what a press of Possess
        # waits for.
        bottom -= HOLDER * (len(perform.holders) + perform.possession_requests.waits)
    for toast in reversed(workspace.editor.toasts.shown):
        bottom = _toast(draw, area, toast, bottom) - 8


def _toast(draw: imgui.ImDrawList, area: Area, toast: Toast, bottom: float) -> float:
    """Draws one message above ``bottom``. Returns its top."""

    texts = [(text, colour) for text, colour in ((toast.text, INK), (toast.mend, QUIET)) if text]
    extents = [imgui.calc_text_size(text, wrap_width=_MAX_MESSAGE_WIDTH) for text, _ in texts]
    wide = max(extent.x for extent in extents) + 34
    left, top = area.x + 14, bottom - sum(extent.y for extent in extents) - 16
    seen = min(toast.remaining_s / 0.6, 1.0)
    draw.add_rect_filled(
        ImVec2(left, top), ImVec2(left + wide, bottom), packed((*GLASS[:3], 0.85), seen), 9.0
    )
    tint = packed(BAD if toast.is_error else GOOD, seen)
    draw.add_rect_filled(ImVec2(left + 7, top + 9), ImVec2(left + 10, bottom - 9), tint, 2.0)
    line = top + 8
    for (text, colour), extent in zip(texts, extents, strict=True):
        _draw_wrapped_text(draw, ImVec2(left + 20, line), packed(colour, seen), text, _MAX_MESSAGE_WIDTH)
        line += extent.y
    return top


def _draw_wrapped_text(draw: imgui.ImDrawList, at: ImVec2, colour: int, text: str, width: float) -> None:
    """Draws text wrapped to a maximum width."""
    draw.add_text(imgui.get_font(), imgui.get_font_size(), at, colour, text, width)
