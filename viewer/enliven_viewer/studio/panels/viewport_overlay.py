"""Draws over the viewport: the tool's marks, its hint, messages, and the progress of long-running work."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, ImVec2Like, imgui

from enliven.document import ExampleCharacter
from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.actions.keys import format_key
from enliven_viewer.studio.app.marks import draw_mark, make_axes_marks
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import SMALL_TEXT_SIZE, pack_colour
from enliven_viewer.studio.panels.start_page import draw_start
from enliven_viewer.studio.toasts import Toast
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, DARK, GLASS, GOOD, INK, QUIET

_BRACKET_GAP = 8.0
"""Gap in pixels between a selected character and its corner brackets."""
_BRACKET_LENGTH = 10.0
"""Length in pixels of a bracket's arms."""
_MIN_HINT_TEXT_SIZE = 9.0
"""Minimum text size in pixels of a long hint in the strip below a narrow view."""
_MAX_MESSAGE_WIDTH = 380.0
"""Maximum width in pixels of a message line: about sixty letters."""


def draw_overlay(workspace: Workspace, area: Area, *, tool: bool = True, hint: Area | None = None) -> None:
    """Draws marks and the hint if tools are available, then messages. Panels are drawn over them.

    Args:
        hint: the strip for the hint; None to draw the hint over the view.
    """
    draw_list = imgui.get_background_draw_list()
    if tool and hint is not None:
        _draw_hint_strip(workspace, draw_list, hint)
    draw_list.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height))
    if tool:
        _draw_tool(workspace, draw_list, area, over=hint is None)
    _draw_toasts(workspace, draw_list, area)
    if tool:
        draw_start(workspace, area)
    if workspace.caption:
        _draw_session_caption(workspace, draw_list, area)
    draw_list.pop_clip_rect()


def _draw_tool(workspace: Workspace, draw_list: imgui.ImDrawList, area: Area, *, over: bool) -> None:
    """Draws the marks of the tool, the axes of a puppet, and the hint."""
    _draw_brackets(workspace, draw_list, area)
    for mark in workspace.input.tool.overlay().marks:
        draw_mark(draw_list, area, mark)
    if workspace.editor.find_selected(ExampleCharacter) is not None:
        for mark in make_axes_marks(workspace.editor.lens, (area.width - 46, area.height - 42)):
            draw_mark(draw_list, area, mark)
    if over:
        _draw_hint(workspace, draw_list, area)
    elif workspace.input.tool.warning:
        _draw_warning(workspace.input.tool.warning, draw_list, area.x + 14, area.y + 14)


def _draw_brackets(workspace: Workspace, draw_list: imgui.ImDrawList, area: Area) -> None:
    """Draws corner brackets around each of several selected characters.

    Those of the active character are brighter.
    """
    editor = workspace.editor
    if not editor.selection.has_several:
        return
    for character in editor.visible_characters:
        pixels = editor.lens.project_visible(
            np.asarray(character.extent, float)[:: max(len(character.extent) // 300, 1)]
        )
        if character.id not in editor.selection.characters or not pixels:
            continue
        colour = pack_colour(ACCENT if character.id == editor.selection.character else INK, 0.9)
        (left, top), (right, bottom) = (
            np.min(pixels, axis=0) - _BRACKET_GAP,
            np.max(pixels, axis=0) + _BRACKET_GAP,
        )
        for x, inward in ((left, _BRACKET_LENGTH), (right, -_BRACKET_LENGTH)):
            for y, down in ((top, _BRACKET_LENGTH), (bottom, -_BRACKET_LENGTH)):
                corner = ImVec2(area.x + x, area.y + y)
                ends: list[ImVec2Like] = [
                    ImVec2(corner.x + inward, corner.y),
                    corner,
                    ImVec2(corner.x, corner.y + down),
                ]
                draw_list.add_polyline(ends, colour, 2.0, 0)


def _draw_hint(workspace: Workspace, draw_list: imgui.ImDrawList, area: Area) -> None:
    """Draws the tool's name and hint, with its warning below."""
    tool = workspace.input.tool
    shift = imgui.calc_text_size(f"{tr(tool.label)}   ").x
    max_width = max(area.width - shift - 54, 80.0)
    extent = imgui.calc_text_size(tr(tool.hint), wrap_width=max_width)
    width, height = shift + extent.x + 28, extent.y + 17
    x, y = area.x + 14, area.y + 14
    draw_list.add_rect_filled(ImVec2(x, y), ImVec2(x + width, y + height), pack_colour(GLASS), 9.0)
    workspace.widgets["hint"] = (x, y, x + width, y + height)
    draw_list.add_text(ImVec2(x + 13, y + 8), pack_colour(ACCENT), tr(tool.label))
    _draw_wrapped_text(draw_list, ImVec2(x + 13 + shift, y + 8), pack_colour(INK), tr(tool.hint), max_width)
    if tool.warning:
        _draw_warning(tool.warning, draw_list, x, y + height + 6)


def _draw_hint_strip(workspace: Workspace, draw_list: imgui.ImDrawList, area: Area) -> None:
    """Draws the tool's name and hint in a strip below the view, in small letters."""
    tool, font, max_width = workspace.input.tool, imgui.get_font(), area.width - 28
    draw_list.add_rect_filled(
        ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height), pack_colour(DARK)
    )
    size = SMALL_TEXT_SIZE
    hint_text = f"{tr(tool.label)}   {tr(tool.hint)}"
    grown = size / imgui.get_font_size()
    height = imgui.calc_text_size(hint_text, wrap_width=max_width / grown).y * grown
    while height > area.height - 6 and size > _MIN_HINT_TEXT_SIZE:
        size -= 0.5
        grown = size / imgui.get_font_size()
        height = imgui.calc_text_size(hint_text, wrap_width=max_width / grown).y * grown
    top = area.y + (area.height - height) / 2
    draw_list.add_text(font, size, ImVec2(area.x + 14, top), pack_colour(INK), hint_text, max_width)
    draw_list.add_text(font, size, ImVec2(area.x + 14, top), pack_colour(ACCENT), tr(tool.label))
    workspace.widgets["hint"] = (area.x, area.y, area.x + area.width, area.y + area.height)


def _draw_warning(warning: str, draw_list: imgui.ImDrawList, x: float, y: float) -> None:
    text = f"\uf071  {warning}"
    width = imgui.calc_text_size(text).x + 26
    draw_list.add_rect_filled(ImVec2(x, y), ImVec2(x + width, y + 30), pack_colour((*GLASS[:3], 0.92)), 9.0)
    draw_list.add_text(ImVec2(x + 13, y + 7), pack_colour(BAD), text)


def _draw_session_caption(workspace: Workspace, draw_list: imgui.ImDrawList, area: Area) -> None:
    """Draws the caption of a scripted session at the top, with the key that the session presses."""
    font, size = imgui.get_font(), 19.0
    grown = size / imgui.get_font_size()
    width = imgui.calc_text_size(workspace.caption).x * grown
    below = 38 if workspace.input.tool.warning else 0
    x, y = area.x + (area.width - width) / 2, area.y + 66 + below
    draw_list.add_rect_filled(
        ImVec2(x - 18, y - 9), ImVec2(x + width + 18, y + 31), pack_colour((*GLASS[:3], 0.85)), 10.0
    )
    draw_list.add_text(font, size, ImVec2(x, y), pack_colour(INK), workspace.caption)
    if workspace.pressed:
        key = format_key(workspace.pressed)
        left = x + width + 34
        right = left + imgui.calc_text_size(key).x + 22
        draw_list.add_rect_filled(ImVec2(left, y - 6), ImVec2(right, y + 28), pack_colour(INK), 7.0)
        draw_list.add_text(ImVec2(left + 11, y + 3), pack_colour((*GLASS[:3], 1.0)), key)


def _draw_toasts(workspace: Workspace, draw_list: imgui.ImDrawList, area: Area) -> None:
    lines_height = sum(overlay.find_lines_height() for overlay in workspace.overlays)
    bottom = area.y + area.height - 14 - lines_height
    for toast in reversed(workspace.editor.toasts.shown):
        bottom = _draw_toast(draw_list, area, toast, bottom) - 8


def _draw_toast(draw_list: imgui.ImDrawList, area: Area, toast: Toast, bottom: float) -> float:
    """Draws one message above ``bottom``. Returns its top."""

    texts = [(text, colour) for text, colour in ((toast.text, INK), (toast.remedy, QUIET)) if text]
    extents = [imgui.calc_text_size(text, wrap_width=_MAX_MESSAGE_WIDTH) for text, _ in texts]
    width = max(extent.x for extent in extents) + 34
    left, top = area.x + 14, bottom - sum(extent.y for extent in extents) - 16
    seen = min(toast.remaining_s / 0.6, 1.0)
    draw_list.add_rect_filled(
        ImVec2(left, top), ImVec2(left + width, bottom), pack_colour((*GLASS[:3], 0.85), seen), 9.0
    )
    tint = pack_colour(BAD if toast.is_error else GOOD, seen)
    draw_list.add_rect_filled(ImVec2(left + 7, top + 9), ImVec2(left + 10, bottom - 9), tint, 2.0)
    line = top + 8
    for (text, colour), extent in zip(texts, extents, strict=True):
        _draw_wrapped_text(
            draw_list, ImVec2(left + 20, line), pack_colour(colour, seen), text, _MAX_MESSAGE_WIDTH
        )
        line += extent.y
    return top


def _draw_wrapped_text(
    draw_list: imgui.ImDrawList, position: ImVec2, colour: int, text: str, width: float
) -> None:
    """Draws text wrapped to a maximum width."""
    draw_list.add_text(imgui.get_font(), imgui.get_font_size(), position, colour, text, width)


_BOX_WIDTH = 300.0
"""Width of the box in pixels. It fits the name of a file and the button."""
_EDGE_MARGIN = 14.0
"""Distance in pixels between the box and the border of the view."""
_TOP_MARGIN = 76.0
"""Distance in pixels from the top of the view, so that the tool's hint of up to two lines fits above."""
_WINDOW_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.always_auto_resize
)


def draw_progress_box(workspace: Workspace, area: Area) -> None:
    """Draws cancellable work at the upper right of the view."""
    background_task = workspace.editor.background
    progress = background_task.progress
    if progress is None:
        return
    progress.seconds += imgui.get_io().delta_time
    width = min(_BOX_WIDTH, area.width - 2 * _EDGE_MARGIN)
    corner = ImVec2(area.x + area.width - _EDGE_MARGIN, area.y + _TOP_MARGIN)
    imgui.set_next_window_pos(corner, 0, ImVec2(1.0, 0.0))
    imgui.set_next_window_size(ImVec2(width, 0))
    imgui.begin(labelled(tr("Working"), "Working"), None, _WINDOW_FLAGS)
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(background_task.message)
    imgui.pop_text_wrap_pos()
    if progress.share is None:
        imgui.progress_bar(-imgui.get_time(), ImVec2(width - 120, 0), f"{progress.seconds:.0f} s")
    else:
        imgui.progress_bar(progress.share, ImVec2(width - 120, 0), f"{100 * progress.share:.0f} %")
    workspace.remember("work progress")
    imgui.same_line()
    if imgui.button(labelled(tr("Cancel"), "cancel work"), ImVec2(-1, 0)):
        background_task.cancel()
    workspace.remember("cancel work")
    imgui.end()
