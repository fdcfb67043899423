"""The lanes of the timeline: characters' names, clips with thumbnails of their poses, and blends."""

from __future__ import annotations

import zlib
from itertools import pairwise
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.document import Clip, PoseStream, Segment
from enliven_viewer.render.gl import window_context
from enliven_viewer.studio.panels.style import CLOSED_EYE, EYE, packed, small
from enliven_viewer.studio.timeline import (
    COLUMNS,
    HEAD,
    LABELS,
    LANE,
    POSES,
    TAKES,
    ClipPictures,
    Lane,
    TimelineLayout,
)
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, DARK, INK, LANES, LINE, ON_COLOUR, QUIET, RAISED, Colour

_LOCK, _UNLOCK, _SOLO, _OPEN, _FOLDED = "\uf023", "\uf09c", "\uf025", "\uf0d7", "\uf0da"
"""Icons of Font Awesome 4: a closed lock and an open one, headphones, triangles down and to the right."""
_THUMBNAIL_SPACING = 26.0
"""Distance in pixels between two thumbnails."""
_TITLE_HEIGHT = 14.0
"""Height in pixels of a clip's title; the thumbnails are below and behind it."""


class LanePainter:
    """A painter of the rows of lanes, which owns the textures of their thumbnails."""

    def __init__(self) -> None:
        self._textures: WeakKeyDictionary[Clip | PoseStream, moderngl.Texture] = WeakKeyDictionary()
        self._ctx: moderngl.Context | None = None

    def head(self, workspace: Workspace, lane: Lane, origin: ImVec2, size: ImVec2) -> None:
        """Draws the row with a character's name; if it is folded, also thin bars of its clips."""
        draw, timeline = imgui.get_window_draw_list(), workspace.timeline
        top, name = origin.y + lane.top, lane.character.id
        chosen = workspace.editor.selection.character == name
        draw.add_rect_filled(
            ImVec2(origin.x, top), ImVec2(origin.x + size.x, top + HEAD), packed(RAISED, 0.75), 3.0
        )
        folded = name in timeline.folded
        with small():
            draw.add_text(ImVec2(origin.x + 8, top + 3), packed(INK), _FOLDED if folded else _OPEN)
            draw.add_text(ImVec2(origin.x + 24, top + 3), packed(ACCENT if chosen else INK), name)
            heard = [layer for layer in lane.character.playing if not layer.muted]
            tint = packed(QUIET if heard else LINE)
            draw.add_text(ImVec2(origin.x + LABELS - 29, top + 3), tint, _SOLO)
        if folded:
            layout = timeline.layout
            for layer in lane.character.playing:
                for clip in layer.clips(layout.project.length_of(layer)):
                    low = ImVec2(origin.x + max(layout.x(clip.begin), LABELS), top + 6)
                    high = ImVec2(origin.x + max(layout.x(clip.end), LABELS), top + HEAD - 6)
                    draw.add_rect_filled(low, high, packed(colour_of(layer.take), 0.6), 3.0)

    def lane(
        self, workspace: Workspace, layout: TimelineLayout, lane: Lane, origin: ImVec2, size: ImVec2
    ) -> None:
        """Draws a bar with its clips."""
        draw, layer = imgui.get_window_draw_list(), lane.layer
        top, right = origin.y + lane.top, origin.x + size.x
        selection, timeline = workspace.editor.selection, workspace.timeline
        chosen = selection.character == lane.character.id and selection.layer in lane.layers
        draw.add_rect_filled(
            ImVec2(origin.x, top), ImVec2(right, top + LANE), packed(RAISED, 0.95 if chosen else 0.5), 4.0
        )
        faded = 0.3 if layer.muted else 1.0
        locked = (lane.character.id, lane.layers[0]) in timeline.locked
        icon, middle = CLOSED_EYE if layer.muted else EYE, top + LANE / 2 - 8
        draw.add_text(ImVec2(origin.x + 5, middle), packed(QUIET if layer.muted else INK, 0.9), icon)
        with small():
            tint = packed(INK if locked else QUIET, 0.9 if locked else 0.45)
            draw.add_text(ImVec2(origin.x + 28, middle + 2), tint, _LOCK if locked else _UNLOCK)
        take_number, takes = layout.takes(lane)
        room = LABELS - 14 - (TAKES if takes > 1 else 0.0)
        draw.push_clip_rect(ImVec2(origin.x, top), ImVec2(origin.x + room, top + LANE), True)
        draw.add_text(ImVec2(origin.x + 46, middle), packed(ACCENT if chosen else INK, faded), lane.label)
        draw.pop_clip_rect()
        if takes > 1:
            opened = layer.alternatives in timeline.opened
            with small():
                take_text = f"{take_number}/{takes} {_OPEN if opened else _FOLDED}"
                draw.add_text(ImVec2(origin.x + room + 3, middle + 2), packed(INK, 0.9), take_text)
        draw.push_clip_rect(ImVec2(origin.x + LABELS - 10, top), ImVec2(right, top + LANE), True)
        if layer.loop:
            low = ImVec2(origin.x + lane.right, top + 4)
            high = ImVec2(max(right, low.x), top + LANE - 4)
            draw.add_rect_filled(low, high, packed(colour_of(layer.take), 0.22 * faded), 4.0)
        for number, clip in enumerate(lane.clips):
            is_held = chosen and timeline.clip == number
            self._clip(workspace, layout, lane, clip, origin, faded, is_held)
        for before, after in pairwise(lane.clips):
            if before.end > after.begin:
                _blend(layout, before, after, origin, top, faded)
        draw.pop_clip_rect()

    def _clip(
        self,
        workspace: Workspace,
        layout: TimelineLayout,
        lane: Lane,
        clip: Segment,
        origin: ImVec2,
        faded: float,
        held: bool,
    ) -> None:
        draw, layer, tint = imgui.get_window_draw_list(), lane.layer, colour_of(lane.layer.take)
        low = ImVec2(origin.x + layout.x(clip.begin), origin.y + lane.top + 1)
        high = ImVec2(max(origin.x + layout.x(clip.end), low.x + 2), origin.y + lane.top + LANE - 1)
        draw.add_rect_filled(low, high, packed(tint, 0.78 * faded), 4.0)
        draw.push_clip_rect(low, high, True)
        self._figures(workspace, layout, layer.take, lane, clip, low, high, faded)
        label = layer.take if clip.speed == 1.0 else f"{layer.take}  {clip.speed:.2g}x"
        with small():
            wide = imgui.calc_text_size(label).x
            corner = ImVec2(min(low.x + wide + 12, high.x), low.y + _TITLE_HEIGHT)
            draw.add_rect_filled(low, corner, packed(tint, 0.9), 4.0)
            draw.add_text(ImVec2(low.x + 6, low.y), packed(ON_COLOUR), label)
        draw.pop_clip_rect()
        draw.add_rect(
            low, high, packed(INK if held else DARK, 1.0 if held else 0.5), 4.0, 1.5 if held else 1.0
        )

    def _figures(
        self,
        workspace: Workspace,
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
        texture = self._texture(workspace.timeline.pictures, workspace, take)
        if texture is None:
            return
        draw, side = imgui.get_window_draw_list(), high.y - low.y - 2
        ink, picture = packed(DARK, 0.75 * faded), imgui.ImTextureRef(texture.glo)
        left, right = imgui.get_window_pos().x + LABELS, imgui.get_window_pos().x + imgui.get_window_width()
        first = max(int((left - low.x) / _THUMBNAIL_SPACING), 0)
        count = int((min(high.x, right) - low.x) / _THUMBNAIL_SPACING) + 1
        origin = low.x - layout.x(clip.begin)
        for k in range(first, count):
            x = low.x + k * _THUMBNAIL_SPACING
            second = clip.second(layout.time(x + side / 2 - origin))
            share = min(max(second / max(take.duration, take.step), 0.0), 1.0)
            pose = round(share * (POSES - 1))
            across, down = (pose % COLUMNS) / COLUMNS, (pose // COLUMNS) / (POSES // COLUMNS)
            low_uv, high_uv = ImVec2(across, down), ImVec2(across + 1 / COLUMNS, down + COLUMNS / POSES)
            draw.add_image(picture, ImVec2(x, low.y + 1), ImVec2(x + side, high.y - 1), low_uv, high_uv, ink)

    def _texture(
        self, pictures: ClipPictures, workspace: Workspace, take: Clip | PoseStream
    ) -> moderngl.Texture | None:
        if take not in self._textures:
            sheet = pictures.sheet(workspace.editor.project, take)
            if sheet is None:
                return None
            self._ctx = self._ctx or window_context()
            texture = self._ctx.texture(sheet.shape[1::-1], 4, np.ascontiguousarray(sheet).tobytes())
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._textures[take] = texture
        return self._textures[take]


def _blend(
    layout: TimelineLayout, before: Segment, after: Segment, origin: ImVec2, top: float, faded: float
) -> None:
    """Draws the blend between two clips: one falling line, one rising line."""
    draw = imgui.get_window_draw_list()
    left, right = origin.x + layout.x(after.begin), origin.x + layout.x(before.end)
    low, high = top + 2, top + LANE - 2
    draw.add_rect_filled(ImVec2(left, low), ImVec2(right, high), packed(DARK, 0.35 * faded))
    draw.add_line(ImVec2(left, low), ImVec2(right, high), packed(INK, 0.9 * faded), 1.5)
    draw.add_line(ImVec2(left, high), ImVec2(right, low), packed(INK, 0.9 * faded), 1.5)


def colour_of(take: str) -> Colour:
    """Returns the colour of a take's clips."""
    return LANES[zlib.crc32(take.encode()) % len(LANES)]
