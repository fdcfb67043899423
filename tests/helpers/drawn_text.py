"""Finds cut and overlapping letters in ImGui's draw lists, by the letters' rectangles."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

_VERTEX = np.dtype([("at", "f4", 2), ("uv", "f4", 2), ("colour", "u4")])
_TRIMMED = 0.90
"""A letter narrower than this fraction of the widest drawing of the same letter was cut by its widget."""
_OVERLAP = 0.35
"""Allowed overlap of letters in one line, as a fraction of the smaller one, because of kerning and icons."""
_CORNER_PX = 7.0
"""Maximum radius of a box's round corner, pixels. ImGui stores its image in the font texture."""
_SCROLL_PX = 3.5
"""Maximum radius of a scroll bar's round end, pixels. It lies on the round corner of its window."""
_CUT_PX = 1.5
"""Allowed excess of a letter over its clip rectangle, pixels, because of antialiased edges."""


@dataclass(frozen=True)
class Letters:
    """The letters of one draw list: (N, 4) rectangles, (N, 4) texture coordinates, and (N, 4) clip
    rectangles."""

    window: str
    places: np.ndarray
    texels: np.ndarray
    clips: np.ndarray


def drawn_letters() -> list[Letters]:
    """Returns the letters drawn in the last frame, per draw list. Call it before the next frame."""
    return [
        letters for part in imgui.get_draw_data().cmd_lists if (letters := _find_letters(part)) is not None
    ]


def _find_letters(drawn) -> Letters | None:
    """Returns the letters of a draw list: pairs of triangles with non-zero width in the texture."""
    vertices, indices = drawn.vtx_buffer, drawn.idx_buffer
    if not len(vertices) or not len(indices):
        return None
    size = imgui.VERTEX_SIZE
    assert size == _VERTEX.itemsize
    corner = np.frombuffer(
        (ctypes.c_char * (len(vertices) * size)).from_address(vertices.data_address()), _VERTEX
    )
    kind = np.uint32 if imgui.INDEX_SIZE == 4 else np.uint16
    order = np.frombuffer(
        (ctypes.c_char * (len(indices) * imgui.INDEX_SIZE)).from_address(indices.data_address()), kind
    )
    columns = [[], [], []]  # type: list[list[np.ndarray]]
    letters_are_in = imgui.get_io().fonts.tex_data.get_tex_id()
    for command in drawn.cmd_buffer:
        if command.get_tex_id() != letters_are_in:
            continue  # an image
        clip = np.array([command.clip_rect.x, command.clip_rect.y, command.clip_rect.z, command.clip_rect.w])
        used = (
            order[command.idx_offset : command.idx_offset + command.elem_count].astype(int)
            + command.vtx_offset
        )
        at = 0
        while at + 6 <= len(used):
            quad = used[at : at + 6]
            four = corner[quad[[0, 1, 2, 5]]]
            wide = np.ptp(four["uv"], axis=0)
            if quad[0] == quad[3] and quad[2] == quad[4] and (wide > 1e-5).all():
                columns[0].append(np.concatenate([four["at"].min(0), four["at"].max(0)]))
                columns[1].append(np.concatenate([four["uv"].min(0), four["uv"].max(0)]))
                columns[2].append(clip)
                at += 6
            else:
                at += 3
    if not columns[0]:
        return None
    return Letters(str(drawn._owner_name), *(np.array(part, float) for part in columns))


def visible_letters(letters: Letters) -> Letters:
    """Returns the letters that are at least partly inside their clip rectangle."""
    low = np.maximum(letters.places[:, :2], letters.clips[:, :2])
    high = np.minimum(letters.places[:, 2:], letters.clips[:, 2:])
    inside = (high - low > 0.5).all(1)
    return Letters(letters.window, letters.places[inside], letters.texels[inside], letters.clips[inside])


def _texture_key(texel: np.ndarray) -> tuple[float, ...]:
    """Returns a letter's texture coordinates without its right end, which a widget may cut off."""
    return tuple(round(float(texel[k]), 5) for k in (0, 1, 3))


def cut_letters(lists: list[Letters]) -> list[tuple[str, list[float]]]:
    """Returns window and rectangle of letters that are cut at their left or right.

    A widget cuts the last letter that fits. It is then narrower than the same letter elsewhere.
    """
    widths: dict[tuple[float, ...], float] = {}
    for letters in lists:
        for texel in letters.texels:
            widths[_texture_key(texel)] = max(widths.get(_texture_key(texel), 0.0), texel[2] - texel[0])
    wrong = []
    for letters in map(visible_letters, lists):
        over = np.maximum(
            letters.clips[:, 0] - letters.places[:, 0], letters.places[:, 2] - letters.clips[:, 2]
        )
        for place, texel, beyond in zip(letters.places, letters.texels, over, strict=True):
            widest = widths[_texture_key(texel)]
            if beyond > _CUT_PX or texel[2] - texel[0] < _TRIMMED * widest:
                wrong.append((letters.window, [round(float(x), 1) for x in place]))
    return wrong


def overlapping_letters(lists: list[Letters]) -> list[tuple[str, list[float], list[float]]]:
    """Returns the window and both rectangles of overlapping letters within one draw list."""
    wrong = []
    for letters in map(visible_letters, lists):
        places = letters.places
        area = (places[:, 2] - places[:, 0]) * (places[:, 3] - places[:, 1])
        low = np.maximum(places[:, None, :2], places[None, :, :2])
        high = np.minimum(places[:, None, 2:], places[None, :, 2:])
        extent = np.clip(high - low, 0, None)
        shared = extent.prod(2) * (extent > _CUT_PX).all(2)
        overlaps = np.triu(shared > _OVERLAP * np.minimum(area[:, None], area[None]), 1)
        for first, second in np.argwhere(overlaps):
            shadow = np.allclose(letters.texels[first], letters.texels[second], atol=1e-5)
            sides = (places[[first, second], 2:] - places[[first, second], :2]).max(1)
            corners = sides.max() <= _CORNER_PX or sides.min() <= _SCROLL_PX
            if shadow or corners:
                continue
            wrong.append((letters.window, places[first].round(1).tolist(), places[second].round(1).tolist()))
    return wrong
