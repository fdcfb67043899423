"""Parts of groups of pixels: those beside walls and before them, tight ones, and fragments of one person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.scene import ROOM, UNLIKELY, widened, without_walls
from enliven_edge.tracking.segment.candidate import STANDS
from enliven_edge.tracking.segment.columns import parted
from enliven_edge.tracking.segment.person_shape import LARGEST_AREA, BlobShape, shape_of
from enliven_edge.tracking.segment.segmentation import LooseGroup, Segments, groups_of

_TOUCHING = 3
"""Pixels within which a fragment touches a group."""
_GAP = 0.6
"""Metres in depth between a fragment and what it touches at most: a raised forearm begins no farther off."""
_ARM = 0.8
"""Metres from the place of touch to nine tenths of a fragment at most: the length of an arm."""
_TIGHTNESS = 0.35
"""Factor on the step in depth within which pixels join, when a person is parted from a wall beside."""
_PIECES = 6
"""Pieces of a group that are looked at, the largest first: this bounds the cost of a frame."""
Part = tuple[Bool, Bool | None]
"""(h, w) some pixels of a group, and (h, w) those of the walls behind them; None without walls."""


def beside_walls(view: FrameView, kind: UInt8, mask: Bool) -> list[Part]:
    """Parts of a group that may be people before a wall in it or beside one."""
    rest = without_walls(view, mask)
    walls = mask & ~rest
    before: list[Part] = [(part, walls) for part in _before_walls(view, kind, rest, walls)]
    return before + [(part, None) for part in _tight(view, kind, mask)]


def _before_walls(view: FrameView, kind: UInt8, rest: Bool, walls: Bool) -> list[Bool]:
    """What is left of a group without its walls: people who stand in front of them, for example."""
    if not walls.any():
        return []
    parts = [part for group in _pieces(view, kind, rest, 1.0) for part in parted(view.points, group)]
    return [part for part in parts if quantile(np.sort(view.points[..., 1][part]), 0.99) > STANDS]


def _tight(view: FrameView, kind: UInt8, mask: Bool) -> list[Bool]:
    """The parts of a group that are joined by smaller steps in depth: a person beside a wall, for example."""
    return _pieces(view, kind, mask, _TIGHTNESS)


def _pieces(view: FrameView, kind: UInt8, mask: Bool, tightness: float) -> list[Bool]:
    """The largest parts of a mask that are joined by steps in depth, scaled by ``tightness``."""
    places = pixels_of(mask & (kind != ROOM) & (kind != UNLIKELY))
    labels, count = groups_of(view.z, places, tightness)
    size = np.bincount(labels.ravel()[places], minlength=count + 1)
    return [labels == index for index in np.argsort(-size)[:_PIECES] if size[index] > 100]


def all_of(segments: Segments, main: LooseGroup, view: FrameView) -> tuple[Bool, BlobShape | None]:
    """(h, w) the main group with the fragments that belong to it, unless it is more like a person without.

    Returns its shape too, where that was measured to decide.
    """
    bare = segments.group(main)
    mask = _with_fragments(segments, main, bare, view)
    if mask is bare or main.area >= LARGEST_AREA:
        return mask, None
    shape = shape_of(view, mask, main.area)
    if shape.upright:
        return mask, shape
    without = shape_of(view, bare, main.area)
    return (bare, without) if without.upright else (mask, shape)


def _with_fragments(segments: Segments, main: LooseGroup, bare: Bool, view: FrameView) -> Bool:
    """(h, w) the main group and smaller ones that touch it within reach, such as a forearm held forward.

    Args:
        bare: (h, w) the main group's pixels; returned where there are no others.
    """
    mask = bare
    top, left, bottom, right = main.box
    near = [
        other
        for other in segments.loose
        if other.label != main.label
        and other.area < 0.6 * main.area
        and other.box[0] <= bottom + _TOUCHING
        and other.box[2] >= top - _TOUCHING
        and other.box[1] <= right + _TOUCHING
        and other.box[3] >= left - _TOUCHING
    ]
    for other in near:
        # What touches it is near its box: the rest of the image need not be searched.
        top, left, bottom, right = other.box
        window = np.s_[
            max(0, top - _TOUCHING) : bottom + _TOUCHING, max(0, left - _TOUCHING) : right + _TOUCHING
        ]
        part, points = segments.labels[window] == other.label, view.points[window]
        contact = widened(part, _TOUCHING) & mask[window]
        if contact.any() and _reaches(points[part], points[contact]):
            mask = mask.copy() if mask is bare else mask
            mask[window] |= part
    return mask


def _reaches(part: Float, contact: Float) -> bool:
    """Whether a fragment begins where it touches and ends within an arm's length of there, unlike a wall.

    Args:
        part, contact: (N, 3) and (M, 3) metres, world frame, of the fragment and of what it touches.
    """
    gap = _median(part[:, 2]) - _median(contact[:, 2])
    if abs(gap) >= _GAP:
        return False
    away = part - contact.mean(0)
    return quantile(np.sort(np.sqrt((away * away).sum(1))), 0.9) < _ARM


def _median(values: Float) -> float:
    return float(quantile(np.sort(values), 0.5))
