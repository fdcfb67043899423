"""The lanes of the timeline: characters' names, clips with thumbnails, blends, and a clip being recorded."""

from __future__ import annotations

import zlib
from itertools import pairwise
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.document import Clip, PoseStream, Segment
from enliven_viewer.language import tr
from enliven_viewer.render.gl.context import get_window_context
from enliven_viewer.studio.app.style import CLOSED_EYE_ICON, EYE_ICON, pack_colour, use_small_text
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT
from enliven_viewer.studio.features.timeline.clip_pictures import POSE_COUNT, SHEET_COLUMNS
from enliven_viewer.studio.features.timeline.layout import (
    HEAD_HEIGHT,
    LANE_GAP,
    LANE_HEIGHT,
    TAKES_BUTTON_WIDTH,
    Lane,
    TimelineLayout,
)
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.theme import (
    ACCENT,
    BAD,
    DARK,
    INK,
    LANE_COLOURS,
    LINE,
    ON_COLOUR,
    ON_FILL,
    QUIET,
    RAISED,
    Colour,
)

_LOCK_ICON, _UNLOCK_ICON, _SOLO_ICON, _OPEN_ICON, _FOLDED_ICON = (
    "\uf023",
    "\uf09c",
    "\uf025",
    "\uf0d7",
    "\uf0da",
)
"""Font Awesome 4 icons: a closed lock, an open lock, headphones, a triangle down, and a triangle to the
right.
"""
_THUMBNAIL_SPACING = 26.0
"""Distance in pixels between two thumbnails."""
_TITLE_HEIGHT = 14.0
"""Height in pixels of a clip's title; the thumbnails are below and behind it."""


class LanePainter:
    """A painter of the rows of lanes, which owns the textures of their thumbnails."""

    def __init__(self) -> None:
        self._textures: WeakKeyDictionary[Clip | PoseStream, moderngl.Texture] = WeakKeyDictionary()
        self._ctx: moderngl.Context | None = None

    def head(self, timeline: TimelineInput, lane: Lane, origin: ImVec2, size: ImVec2) -> None:
        """Draws the row with a character's name. If the character is folded, also draws thin bars for its
        clips.
        """
        draw_list = imgui.get_window_draw_list()
        top, name = origin.y + lane.top, lane.character.id
        chosen = timeline.editor.selection.character == name
        draw_list.add_rect_filled(
            ImVec2(origin.x, top),
            ImVec2(origin.x + size.x, top + HEAD_HEIGHT),
            pack_colour(RAISED, 0.75),
            3.0,
        )
        folded = name in timeline.folded
        with use_small_text():
            draw_list.add_text(
                ImVec2(origin.x + 8, top + 3), pack_colour(INK), _FOLDED_ICON if folded else _OPEN_ICON
            )
            draw_list.add_text(ImVec2(origin.x + 24, top + 3), pack_colour(ACCENT if chosen else INK), name)
            heard = [layer for layer in lane.character.playing if not layer.muted]
            tint = pack_colour(QUIET if heard else LINE)
            draw_list.add_text(ImVec2(origin.x + LABEL_WIDTH - 29, top + 3), tint, _SOLO_ICON)
        if folded:
            layout = timeline.layout
            for layer in lane.character.playing:
                for clip in layer.clips(layout.project.length_of(layer)):
                    low = ImVec2(origin.x + max(layout.x(clip.begin), LABEL_WIDTH), top + 6)
                    high = ImVec2(origin.x + max(layout.x(clip.end), LABEL_WIDTH), top + HEAD_HEIGHT - 6)
                    draw_list.add_rect_filled(low, high, pack_colour(find_take_colour(layer.take), 0.6), 3.0)

    def lane(
        self, timeline: TimelineInput, layout: TimelineLayout, lane: Lane, origin: ImVec2, size: ImVec2
    ) -> None:
        """Draws a bar with its clips."""
        draw_list, layer = imgui.get_window_draw_list(), lane.layer
        top, right = origin.y + lane.top, origin.x + size.x
        selection = timeline.editor.selection
        chosen = selection.character == lane.character.id and selection.layer in lane.layers
        draw_list.add_rect_filled(
            ImVec2(origin.x, top),
            ImVec2(right, top + LANE_HEIGHT),
            pack_colour(RAISED, 0.95 if chosen else 0.5),
            4.0,
        )
        faded = 0.3 if layer.muted else 1.0
        locked = (lane.character.id, lane.layers[0]) in timeline.locked
        icon, middle = CLOSED_EYE_ICON if layer.muted else EYE_ICON, top + LANE_HEIGHT / 2 - 8
        draw_list.add_text(
            ImVec2(origin.x + 5, middle), pack_colour(QUIET if layer.muted else INK, 0.9), icon
        )
        with use_small_text():
            tint = pack_colour(INK if locked else QUIET, 0.9 if locked else 0.45)
            draw_list.add_text(
                ImVec2(origin.x + 28, middle + 2), tint, _LOCK_ICON if locked else _UNLOCK_ICON
            )
        take_number, takes = layout.takes(lane)
        label_width = LABEL_WIDTH - 14 - (TAKES_BUTTON_WIDTH if takes > 1 else 0.0)
        draw_list.push_clip_rect(
            ImVec2(origin.x, top), ImVec2(origin.x + label_width, top + LANE_HEIGHT), True
        )
        draw_list.add_text(
            ImVec2(origin.x + 46, middle), pack_colour(ACCENT if chosen else INK, faded), lane.label
        )
        draw_list.pop_clip_rect()
        if takes > 1:
            opened = layer.alternatives in timeline.opened
            with use_small_text():
                take_text = f"{take_number}/{takes} {_OPEN_ICON if opened else _FOLDED_ICON}"
                draw_list.add_text(
                    ImVec2(origin.x + label_width + 3, middle + 2), pack_colour(INK, 0.9), take_text
                )
        draw_list.push_clip_rect(
            ImVec2(origin.x + LABEL_WIDTH - 10, top), ImVec2(right, top + LANE_HEIGHT), True
        )
        if layer.loop:
            low = ImVec2(origin.x + lane.right, top + 4)
            high = ImVec2(max(right, low.x), top + LANE_HEIGHT - 4)
            draw_list.add_rect_filled(low, high, pack_colour(find_take_colour(layer.take), 0.22 * faded), 4.0)
        for number, clip in enumerate(lane.clips):
            is_held = chosen and timeline.clip == number
            self._draw_clip(timeline, layout, lane, clip, origin, faded, is_held)
        for clip_left, clip_right in pairwise(lane.clips):
            if clip_left.end > clip_right.begin:
                _draw_blend(layout, clip_left, clip_right, origin, top, faded)
        draw_list.pop_clip_rect()

    def _draw_clip(
        self,
        timeline: TimelineInput,
        layout: TimelineLayout,
        lane: Lane,
        clip: Segment,
        origin: ImVec2,
        faded: float,
        held: bool,
    ) -> None:
        draw_list, layer, tint = imgui.get_window_draw_list(), lane.layer, find_take_colour(lane.layer.take)
        low = ImVec2(origin.x + layout.x(clip.begin), origin.y + lane.top + 1)
        high = ImVec2(max(origin.x + layout.x(clip.end), low.x + 2), origin.y + lane.top + LANE_HEIGHT - 1)
        draw_list.add_rect_filled(low, high, pack_colour(tint, 0.78 * faded), 4.0)
        draw_list.push_clip_rect(low, high, True)
        self._draw_figures(timeline, layout, layer.take, lane, clip, low, high, faded)
        label = layer.take if clip.speed == 1.0 else f"{layer.take}  {clip.speed:.2g}x"
        with use_small_text():
            width = imgui.calc_text_size(label).x
            corner = ImVec2(min(low.x + width + 12, high.x), low.y + _TITLE_HEIGHT)
            draw_list.add_rect_filled(low, corner, pack_colour(tint, 0.9), 4.0)
            draw_list.add_text(ImVec2(low.x + 6, low.y), pack_colour(ON_COLOUR), label)
        draw_list.pop_clip_rect()
        draw_list.add_rect(
            low, high, pack_colour(INK if held else DARK, 1.0 if held else 0.5), 4.0, 1.5 if held else 1.0
        )

    def _draw_figures(
        self,
        timeline: TimelineInput,
        layout: TimelineLayout,
        name: str,
        lane: Lane,
        clip: Segment,
        low: ImVec2,
        high: ImVec2,
        faded: float,
    ) -> None:
        """Draws a clip's thumbnails at regular distances."""
        takes = layout.project.streams if lane.layer.source == "streams" else layout.project.takes
        take = takes[name]
        texture = self._get_texture(timeline, take)
        if texture is None:
            return
        draw_list, side = imgui.get_window_draw_list(), high.y - low.y - 2
        ink, picture = pack_colour(DARK, 0.75 * faded), imgui.ImTextureRef(texture.glo)
        left, right = (
            imgui.get_window_pos().x + LABEL_WIDTH,
            imgui.get_window_pos().x + imgui.get_window_width(),
        )
        first = max(int((left - low.x) / _THUMBNAIL_SPACING), 0)
        count = int((min(high.x, right) - low.x) / _THUMBNAIL_SPACING) + 1
        origin = low.x - layout.x(clip.begin)
        for k in range(first, count):
            x = low.x + k * _THUMBNAIL_SPACING
            second = clip.compute_take_time(layout.time(x + side / 2 - origin))
            fraction = min(max(second / max(take.duration, take.step), 0.0), 1.0)
            pose = round(fraction * (POSE_COUNT - 1))
            across, down = (
                (pose % SHEET_COLUMNS) / SHEET_COLUMNS,
                (pose // SHEET_COLUMNS) / (POSE_COUNT // SHEET_COLUMNS),
            )
            low_uv, high_uv = (
                ImVec2(across, down),
                ImVec2(across + 1 / SHEET_COLUMNS, down + SHEET_COLUMNS / POSE_COUNT),
            )
            draw_list.add_image(
                picture, ImVec2(x, low.y + 1), ImVec2(x + side, high.y - 1), low_uv, high_uv, ink
            )

    def _get_texture(self, timeline: TimelineInput, take: Clip | PoseStream) -> moderngl.Texture | None:
        if take not in self._textures:
            sheet = timeline.pictures.sheet(timeline.editor.project, take)
            if sheet is None:
                return None
            self._ctx = self._ctx or get_window_context()
            texture = self._ctx.texture(sheet.shape[1::-1], 4, np.ascontiguousarray(sheet).tobytes())
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._textures[take] = texture
        return self._textures[take]


def _draw_blend(
    layout: TimelineLayout, before: Segment, after: Segment, origin: ImVec2, top: float, faded: float
) -> None:
    """Draws the blend between two clips as a falling and a rising line."""
    draw_list = imgui.get_window_draw_list()
    left, right = origin.x + layout.x(after.begin), origin.x + layout.x(before.end)
    low, high = top + 2, top + LANE_HEIGHT - 2
    draw_list.add_rect_filled(ImVec2(left, low), ImVec2(right, high), pack_colour(DARK, 0.35 * faded))
    draw_list.add_line(ImVec2(left, low), ImVec2(right, high), pack_colour(INK, 0.9 * faded), 1.5)
    draw_list.add_line(ImVec2(left, high), ImVec2(right, low), pack_colour(INK, 0.9 * faded), 1.5)


def find_take_colour(take: str) -> Colour:
    """Returns the colour of a take's clips."""
    return LANE_COLOURS[zlib.crc32(take.encode()) % len(LANE_COLOURS)]


def draw_recorded_clip(
    clip: tuple[float, float], layout: TimelineLayout, origin: ImVec2, height: float
) -> None:
    """Draws the growing clip below the last lane, or at the bottom of the timeline if the last lane is out of
    view.

    Args:
        clip: begin and end of the recording in seconds.
        layout: the layout of the timeline.
        origin: top left corner of the timeline in pixels.
        height: height of the timeline in pixels.
    """
    lanes, draw = layout.lanes(), imgui.get_window_draw_list()
    below = lanes[-1].top + lanes[-1].height if lanes else RULER_HEIGHT
    top = origin.y + min(below + LANE_GAP, height - LANE_HEIGHT)
    low, high = ImVec2(origin.x, top), ImVec2(origin.x + layout.width, top + LANE_HEIGHT)
    draw.add_rect_filled(low, high, pack_colour(DARK))
    left, right = (origin.x + layout.x(second) for second in clip)
    right = max(right, left + 2.0)
    draw.add_rect_filled(ImVec2(left, top + 2), ImVec2(right, top + LANE_HEIGHT - 2), pack_colour(BAD), 4.0)
    draw.add_text(ImVec2(origin.x + 28, top + 4), pack_colour(INK), tr("Recording"))
    with use_small_text():
        draw.push_clip_rect(ImVec2(left, top), ImVec2(right, top + LANE_HEIGHT), True)
        draw.add_text(ImVec2(left + 8, top + 5), pack_colour(ON_FILL), f"{clip[1] - clip[0]:.1f} s")
        draw.pop_clip_rect()
