"""Parts of groups of pixels: people side by side, those beside and before walls, fragments of one person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.scene import ROOM, UNLIKELY, widened, without_walls
from enliven_edge.tracking.segment.candidate import STANDS
from enliven_edge.tracking.segment.person_shape import LARGEST_AREA, BlobShape, samples, shape_of
from enliven_edge.tracking.segment.segmentation import LooseGroup, Segments, groups_of

_SAMPLES = 3000
"""Points in which the people are looked for, about: the cost grows with them."""
_CELL = 0.06
"""Metres of a cell of the height map from above: a head covers several."""
_APART = 0.42
"""Metres in plan between two people's axes at the least: the width of a person."""
_RADIUS = 0.24
"""Metres in plan about an axis within which points belong to the person's column: half a person's width."""
_STANDING = 0.7
"""Metres above the floor of the lowest crown: lower ones stand on no legs."""
_NECK = 0.3
"""Metres in plan around a shoulder within which its head is."""
_HIGHER = 0.2
"""Metres by which a head is higher than its shoulders at the least."""
_TOP = 0.15
"""Metres below a peak within which the points are a head's."""
_HEAD = 0.2
"""Metres in plan around a peak within which the points are a head's."""
_PEAKS = 200
"""Cells that are looked at, the highest first: this bounds the cost of a group."""
_LAYER = 0.1
"""Metres of height of a layer of a column."""
_KNEES = 0.35
"""Share of the height where the knees are: legs below them may be hidden or apart."""
_MET = 0.8
"""Share of the layers above the knees that must hold points where a person is: the rest may be hidden."""


def parted(points: Float, mask: Bool) -> list[Bool]:
    """[(h, w)] the mask, or its parts where several people stand in it side by side.

    Seen from above, each person is a column that reaches from a head to the legs; a pixel is the nearest's.

    Args:
        points: (h, w, 3) world frame.
    """
    columns = columns_of(samples(points, pixels_of(mask), _SAMPLES))
    if len(columns) < 2:
        return [mask]
    return list(_nearest(points, mask, columns))


def columns_of(points: Float) -> Float:
    """(N, 2) x and z of the people in (3, M) points: peaks of the height map over a filled column."""
    height, origin = _seen_from_above(points)
    order = np.argsort(-height, axis=None)[:_PEAKS]
    return np.asarray(_columns(points, height, order, origin))


@njit(cache=True, nogil=True)
def _seen_from_above(points):
    """(X, Z) metres, the highest of (3, M) points in each cell, at least 0; (2,) the first cell's corner."""
    left, back = points[0].min(), points[2].min()
    wide, deep = int((points[0].max() - left) / _CELL), int((points[2].max() - back) / _CELL)
    height = np.zeros((wide + 1, deep + 1))
    for n in range(points.shape[1]):
        i, j = int((points[0, n] - left) / _CELL), int((points[2, n] - back) / _CELL)
        height[i, j] = max(height[i, j], points[1, n])
    return height, np.array([left, back])


@njit(cache=True, nogil=True)
def _columns(points, height, order, origin):
    """(N, 2) see :func:`columns_of`.

    Args:
        points: (3, M) metres, world frame.
        height: (X, Z) metres, the highest point of each cell, 0 where there is none.
        order: (P,) the flat places of the highest cells, the highest first.
        origin: (2,) x and z of the first cell's corner.
    """
    kept, count = np.empty((len(order), 2)), 0
    for index in order:
        i, j = divmod(index, height.shape[1])
        top = height[i, j]
        if top < _STANDING:
            break
        x, z = _summit(points, origin[0] + (i + 0.5) * _CELL, origin[1] + (j + 0.5) * _CELL, top)
        new = True
        for k in range(count):
            new &= np.hypot(x - kept[k, 0], z - kept[k, 1]) > _APART
        if new and _filled(points, x, z, top):
            kept[count, 0], kept[count, 1] = x, z
            count += 1
    return kept[:count].copy()


@njit(cache=True, nogil=True, fastmath=True)
def _summit(points, x, z, top):
    """x and z of the mean of the highest points around a place, such as a head."""
    right, deep, count = 0.0, 0.0, 0
    for i in range(points.shape[1]):
        dx, dz = points[0, i] - x, points[2, i] - z
        # Without a branch, so that many points are looked at at once.
        on = (points[1, i] > top - _TOP) & (dx * dx + dz * dz < _HEAD * _HEAD)
        right += points[0, i] if on else 0.0
        deep += points[2, i] if on else 0.0
        count += on
    return right / count, deep / count


@njit(cache=True, nogil=True)
def _filled(points, x, z, top):
    """Whether a person is under a peak: it is no shoulder, and most layers from the knees up hold points."""
    if _shoulder(points, x, z, top):
        return False
    first, last = int(np.ceil(_KNEES * top / _LAYER)), int(np.floor(top / _LAYER))
    met = np.zeros(max(0, last - first), np.bool_)
    for i in range(points.shape[1]):
        dx, dz = points[0, i] - x, points[2, i] - z
        if dx * dx + dz * dz < _RADIUS * _RADIUS:
            layer = int(np.floor(points[1, i] / _LAYER)) - first
            if 0 <= layer < len(met):
                met[layer] = True
    return len(met) > 0 and np.count_nonzero(met) > _MET * len(met)


@njit(cache=True, nogil=True, fastmath=True)
def _shoulder(points, x, z, top):
    """Whether something near a peak is so much higher that the peak is a shoulder."""
    higher = 0
    for i in range(points.shape[1]):
        dx, dz = points[0, i] - x, points[2, i] - z
        higher += (points[1, i] > top + _HIGHER) & (dx * dx + dz * dz < _NECK * _NECK)
    return higher > 0


@njit(cache=True, nogil=True)
def _nearest(points, mask, columns):
    """(N, h, w) the masked points that are nearest in plan to each of (N, 2) columns."""
    points, out = points.reshape(-1, 3), np.zeros((len(columns), mask.size), np.bool_)
    for i in pixels_of(mask):
        least, nearest = np.inf, 0
        for k in range(len(columns)):
            dx, dz = points[i, 0] - columns[k, 0], points[i, 2] - columns[k, 1]
            if dx * dx + dz * dz < least:
                least, nearest = dx * dx + dz * dz, k
        out[nearest, i] = True
    return out.reshape((len(columns), mask.shape[0], mask.shape[1]))


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
