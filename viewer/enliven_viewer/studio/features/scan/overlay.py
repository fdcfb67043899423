"""Draws over a running scan: the camera, the path to the next recommended view, and the instructions."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.arrays import Float
from enliven.wire import ScanMessage
from enliven_viewer.language import tr
from enliven_viewer.studio.app.marks import draw_mark
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.features.scan.advice import ADVICE_BOTTOM, Mood, choose_advice
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.viewport.overlay import Fill, Line, Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import ACCENT, BAD, GLASS, GOOD, INK, WAIT, Colour

_ADVICE_TEXT_SIZE = 34.0
"""Text size in pixels of the instructions. It is readable from three metres."""
_MOOD_COLOURS: dict[Mood, Colour] = {"good": GOOD, "wait": WAIT, "bad": BAD}
Mark = Line | Fill
_IMAGE_DISTANCE_M = 0.16
"""Distance in metres from a drawn camera's centre to its image plane."""
_IMAGE_HALF_SIZE_M = (0.11, 0.08)
"""Half width and half height, in metres, of a drawn camera's image."""
_ARROW_HEAD_M = 0.09
"""Length of the arrow's head in metres."""
_ARROW_POINTS = 28
"""Number of points along the arrow's path."""
_CAMERA_OPACITY = 0.75
"""Opacity of the recommended camera."""


def make_scan_marks(message: ScanMessage, lens: Lens) -> tuple[Mark, ...]:
    """Returns the marks of a running scan in the viewport's pixels."""
    if message.phase not in ("scanning", "paused", "failed") or not message.stage_from_camera:
        return ()
    advice = choose_advice(message)
    pose = np.array(message.stage_from_camera).reshape(3, 4)
    marks = _make_camera_marks(pose[:, :3], pose[:, 3], lens, _MOOD_COLOURS[advice.mood])
    if advice.arrow and message.view:
        eye, target = np.array(message.view[:3]), np.array(message.view[3:])
        camera_colour: Colour = (*ACCENT[:3], _CAMERA_OPACITY)
        marks += _make_arrow_marks(pose[:, 3], eye, target, lens)
        marks += _make_camera_marks(_make_camera_axes(eye, target), eye, lens, camera_colour)
    return tuple(marks)


def _make_camera_marks(axes: Float, eye: Float, lens: Lens, colour: Colour) -> list[Mark]:
    """Returns a camera as a pyramid of lines with the image as its base. ``axes`` (3, 3) contains the
    directions right, down and ahead as columns.
    """
    right, down, ahead = axes.T
    across, up = _IMAGE_HALF_SIZE_M
    corners = [
        eye + _IMAGE_DISTANCE_M * ahead + x * across * right + y * up * down for x, y in _IMAGE_CORNERS
    ]
    lines: list[Mark] = []
    for chain, closed in ((corners, True), *(((eye, corner), False) for corner in corners)):
        points = _find_pixels(np.array(chain), lens)
        if points:
            lines.append(Line(points, colour, 2.5, closed))
    return lines


_IMAGE_CORNERS = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
"""The corners of an image, in units of half its sides."""


def _make_arrow_marks(start: Float, end: Float, target: Float, lens: Lens) -> list[Mark]:
    """Returns an arrow from one camera position to another, around a target."""
    start_way, end_way = start - target, end - target
    first, last = np.arctan2(start_way[0], start_way[2]), np.arctan2(end_way[0], end_way[2])
    turn = (last - first + np.pi) % (2 * np.pi) - np.pi
    fraction = np.linspace(0.08, 0.9, _ARROW_POINTS)
    angle = first + fraction * turn
    reach = (
        np.hypot(start_way[0], start_way[2]) * (1 - fraction) + np.hypot(end_way[0], end_way[2]) * fraction
    )
    height = start_way[1] * (1 - fraction) + end_way[1] * fraction
    path = target + np.stack([reach * np.sin(angle), height, reach * np.cos(angle)], 1)
    points = _find_pixels(path, lens)
    direction = path[-1] - path[-3]
    length = float(np.linalg.norm(direction))
    if not points or length < 1e-6:
        return []
    direction /= length
    side = np.cross(direction, [0.0, 1.0, 0.0])
    tip, back = path[-1] + _ARROW_HEAD_M * direction, path[-1] - 0.3 * _ARROW_HEAD_M * direction
    head = _find_pixels(
        np.array([tip, back + 0.6 * _ARROW_HEAD_M * side, back - 0.6 * _ARROW_HEAD_M * side]), lens
    )
    marks: list[Mark] = [Line(points, ACCENT, 5.0)]
    return [*marks, Fill(head, ACCENT)] if head else marks


def _find_pixels(points: Float, lens: Lens) -> tuple[Point, ...]:
    """Returns the pixels of points (N, 3), or an empty result if one of them is behind the camera."""
    pixels = lens.project_visible(points)
    return tuple(pixels) if len(pixels) == len(points) else ()


def _make_camera_axes(eye: Float, target: Float) -> Float:
    """Returns the (3, 3) axes of an upright camera that looks at a target: right, down and
    ahead as columns.
    """
    ahead = target - eye
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right = right / max(float(np.linalg.norm(right)), 1e-9)
    return np.stack([right, np.cross(ahead, right), ahead], 1)


def draw_scan_overlay(lens: Lens, scan: ScanSession, area: Area) -> None:
    """Draws the camera, the arrow, the crop box and the instructions over the view."""
    if not scan.active:
        return
    draw_list = imgui.get_background_draw_list()
    draw_list.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height))
    box = scan.box.marks(lens) if scan.has_crop_box else ()
    for mark in (*make_scan_marks(scan.message, lens), *box):
        draw_mark(draw_list, area, mark)
    advice = choose_advice(scan.message)
    if advice.text:
        _draw_instruction(draw_list, area, tr(advice.text), _MOOD_COLOURS[advice.mood])
    draw_list.pop_clip_rect()


def _draw_instruction(draw_list: imgui.ImDrawList, area: Area, text: str, tint: Colour) -> None:
    """Draws one line of large text, centred at the top."""
    grown = imgui.calc_text_size(text).x / imgui.get_font_size()
    size = min(_ADVICE_TEXT_SIZE, (area.width - 120.0) / max(grown, 1e-3))
    width = grown * size
    x, y = area.x + (area.width - width) / 2, area.y + ADVICE_BOTTOM - _ADVICE_TEXT_SIZE - 12
    low, high = ImVec2(x - 48, y - 12), ImVec2(x + width + 24, y + size + 12)
    draw_list.add_rect_filled(low, high, pack_colour((*GLASS[:3], 0.85)), 12.0)
    draw_list.add_circle_filled(ImVec2(x - 24, y + size / 2), 9.0, pack_colour(tint))
    draw_list.add_text(imgui.get_font(), size, ImVec2(x, y), pack_colour(INK), text)
