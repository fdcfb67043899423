"""Splits and merges blobs: people next to each other, people at walls, and fragments of one person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.scene.background_kernels import BACKGROUND, UNLIKELY, dilate
from enliven_edge.tracking.scene.walls import remove_walls
from enliven_edge.tracking.segment.candidate import MIN_STANDING_CROWN_M
from enliven_edge.tracking.segment.person_shape import MAX_AREA_M2, BlobShape, measure_shape, samples
from enliven_edge.tracking.segment.segmentation import LooseGroup, Segments, label_groups

_SEARCH_SAMPLES = 3000
"""Approximate number of points in which people are searched. The cost grows with their number."""
_CELL_M = 0.06
"""Cell size in metres of the height map seen from above. A head covers several cells."""
_MIN_AXIS_DISTANCE_M = 0.42
"""Minimum horizontal distance in metres between two people's axes: the width of a person."""
_COLUMN_RADIUS_M = 0.24
"""Horizontal radius in metres around an axis in which points belong to the person's column: half a person's
width."""
_MIN_CROWN_M = 0.7
"""Minimum crown height above the floor in metres of a standing person."""
_SHOULDER_RADIUS_M = 0.3
"""Horizontal radius in metres around a shoulder that contains its head."""
_MIN_HEAD_RISE_M = 0.2
"""Minimum height in metres of a head above its shoulders. If a point near a peak is higher than the peak by
at least this height, the peak is a shoulder.
"""
_HEAD_DEPTH_M = 0.15
"""Depth in metres below a peak within which points belong to a head."""
_HEAD_RADIUS_M = 0.2
"""Horizontal radius in metres around a peak within which points belong to a head."""
_MAX_PEAKS = 200
"""Maximum number of examined cells, the highest first. It bounds the cost of a group."""
_LAYER_M = 0.1
"""Height in metres of a layer of a column."""
_KNEE_RATIO = 0.35
"""Height of the knees as a fraction of body height. Layers below the knees may be empty, because shanks may
be hidden or spread.
"""
_MIN_LAYERS = 0.8
"""Minimum fraction of a person's layers above the knees that must contain points. The other layers may be
hidden.
"""


def split_people(points: Float, mask: Bool) -> list[Bool]:
    """Splits a mask between people who stand next to each other. Returns [(h, w)] its parts, or only the
    mask.

    Seen from above, each person is a column from a head to the legs. A pixel belongs to the nearest column.

    Args:
        points: (h, w, 3) world frame.
        mask: (h, w) the blob.
    """
    columns = find_columns(samples(points, pixels_of(mask), _SEARCH_SAMPLES))
    if len(columns) < 2:
        return [mask]
    return list(_assign_to_columns(points, mask, columns))


def find_columns(points: Float) -> Float:
    """Returns (N, 2) x and z of the people in (3, M) points: peaks of the height map above filled columns."""
    height, origin = _height_map(points)
    order = np.argsort(-height, axis=None)[:_MAX_PEAKS]
    return np.asarray(_columns(points, height, order, origin))


@njit(cache=True, nogil=True)
def _height_map(points):
    """Returns (X, Z) the height map of (3, M) points in metres, and (2,) the first cell's corner.

    Heights are at least 0.
    """
    left, back = points[0].min(), points[2].min()
    wide, deep = int((points[0].max() - left) / _CELL_M), int((points[2].max() - back) / _CELL_M)
    height = np.zeros((wide + 1, deep + 1))
    for n in range(points.shape[1]):
        i, j = int((points[0, n] - left) / _CELL_M), int((points[2, n] - back) / _CELL_M)
        height[i, j] = max(height[i, j], points[1, n])
    return height, np.array([left, back])


@njit(cache=True, nogil=True)
def _columns(points, height, order, origin):
    """Computes :func:`find_columns`: returns (N, 2) x and z of the people.

    Args:
        points: (3, M) metres, world frame.
        height: (X, Z) the highest point of each cell in metres, 0 in empty cells.
        order: (P,) the flat indices of the highest cells, the highest first.
        origin: (2,) x and z of the first cell's corner.
    """
    kept, count = np.empty((len(order), 2)), 0
    for index in order:
        i, j = divmod(index, height.shape[1])
        top = height[i, j]
        if top < _MIN_CROWN_M:
            break
        x, z = _peak_centre(points, origin[0] + (i + 0.5) * _CELL_M, origin[1] + (j + 0.5) * _CELL_M, top)
        new = True
        for k in range(count):
            new &= np.hypot(x - kept[k, 0], z - kept[k, 1]) > _MIN_AXIS_DISTANCE_M
        if new and _is_filled_column(points, x, z, top):
            kept[count, 0], kept[count, 1] = x, z
            count += 1
    return kept[:count].copy()


@njit(cache=True, nogil=True, fastmath=True)
def _peak_centre(points, x, z, top):
    """Returns x and z of the mean of the highest points around a place, such as a head."""
    right, deep, count = 0.0, 0.0, 0
    for i in range(points.shape[1]):
        dx, dz = points[0, i] - x, points[2, i] - z
        # Compare without a branch, so that the compiler can vectorise the loop.
        on = (points[1, i] > top - _HEAD_DEPTH_M) & (dx * dx + dz * dz < _HEAD_RADIUS_M * _HEAD_RADIUS_M)
        right += points[0, i] if on else 0.0
        deep += points[2, i] if on else 0.0
        count += on
    return right / count, deep / count


@njit(cache=True, nogil=True)
def _is_filled_column(points, x, z, top):
    """Returns True if a person is below a peak.

    The peak is not a shoulder, and most layers above the knees contain points.
    """
    if _is_shoulder(points, x, z, top):
        return False
    first, last = int(np.ceil(_KNEE_RATIO * top / _LAYER_M)), int(np.floor(top / _LAYER_M))
    met = np.zeros(max(0, last - first), np.bool_)
    for i in range(points.shape[1]):
        dx, dz = points[0, i] - x, points[2, i] - z
        if dx * dx + dz * dz < _COLUMN_RADIUS_M * _COLUMN_RADIUS_M:
            layer = int(np.floor(points[1, i] / _LAYER_M)) - first
            if 0 <= layer < len(met):
                met[layer] = True
    return len(met) > 0 and np.count_nonzero(met) > _MIN_LAYERS * len(met)


@njit(cache=True, nogil=True, fastmath=True)
def _is_shoulder(points, x, z, top):
    """Returns True if points near a peak are so much higher that the peak is a shoulder."""
    higher = 0
    for i in range(points.shape[1]):
        dx, dz = points[0, i] - x, points[2, i] - z
        higher += (points[1, i] > top + _MIN_HEAD_RISE_M) & (
            dx * dx + dz * dz < _SHOULDER_RADIUS_M * _SHOULDER_RADIUS_M
        )
    return higher > 0


@njit(cache=True, nogil=True)
def _assign_to_columns(points, mask, columns):
    """Returns (N, h, w) the masked pixels that are horizontally nearest to each of (N, 2) columns."""
    points, out = points.reshape(-1, 3), np.zeros((len(columns), mask.size), np.bool_)
    for i in pixels_of(mask):
        least, nearest = np.inf, 0
        for k in range(len(columns)):
            dx, dz = points[i, 0] - columns[k, 0], points[i, 2] - columns[k, 1]
            if dx * dx + dz * dz < least:
                least, nearest = dx * dx + dz * dz, k
        out[nearest, i] = True
    return out.reshape((len(columns), mask.shape[0], mask.shape[1]))


_MAX_TOUCH_PX = 3
"""Maximum distance in pixels between a fragment and a group that touch."""
_MAX_DEPTH_STEP_M = 0.6
"""Maximum depth difference in metres between a fragment and the group that it touches. It is that of a raised
forearm.
"""
_MAX_FRAGMENT_M = 0.8
"""Nine tenths of a fragment must be within this distance in metres of the contact: the length of an arm."""
_STEP_FACTOR = 0.35
"""Factor on the maximum depth step within a group, used to separate a person from a wall next to it."""
_MAX_PIECES = 6
"""Maximum number of examined pieces of a group, the largest first. It bounds the cost of a frame."""
Part = tuple[Bool, Bool | None]
"""A part of a group: its (h, w) pixels, and the (h, w) pixels of the walls behind it, or None without
walls.
"""


def split_walls(view: FrameView, kind: UInt8, mask: Bool) -> list[Part]:
    """Returns parts of a group that may be people in front of a wall in the group, or next to one."""
    rest = remove_walls(view, mask)
    walls = mask & ~rest
    in_front: list[Part] = [(part, walls) for part in _parts_before_walls(view, kind, rest, walls)]
    return in_front + [(part, None) for part in _split_at_small_steps(view, kind, mask)]


def _parts_before_walls(view: FrameView, kind: UInt8, rest: Bool, walls: Bool) -> list[Bool]:
    """Returns the tall parts that remain of a group after its walls are removed, such as people in front of
    them.
    """
    if not walls.any():
        return []
    parts = [
        part
        for group in _find_largest_parts(view, kind, rest, 1.0)
        for part in split_people(view.points, group)
    ]
    return [
        part for part in parts if quantile(np.sort(view.points[..., 1][part]), 0.99) > MIN_STANDING_CROWN_M
    ]


def _split_at_small_steps(view: FrameView, kind: UInt8, mask: Bool) -> list[Bool]:
    """Returns the parts of a group within smaller depth steps, such as a person next to a wall."""
    return _find_largest_parts(view, kind, mask, _STEP_FACTOR)


def _find_largest_parts(view: FrameView, kind: UInt8, mask: Bool, tightness: float) -> list[Bool]:
    """Returns the largest connected parts of a mask. The maximum depth step is scaled by ``tightness``."""
    places = pixels_of(mask & (kind != BACKGROUND) & (kind != UNLIKELY))
    labels, count = label_groups(view.z, places, tightness)
    size = np.bincount(labels.ravel()[places], minlength=count + 1)
    return [labels == index for index in np.argsort(-size)[:_MAX_PIECES] if size[index] > 100]


def add_fragments(segments: Segments, main: LooseGroup, view: FrameView) -> tuple[Bool, BlobShape | None]:
    """Returns the main group (h, w) with or without its fragments, whichever looks more like a person.

    It also returns the shape if it was measured for this decision.
    """
    bare = segments.group(main)
    mask = _with_fragments(segments, main, bare, view)
    if mask is bare or main.area >= MAX_AREA_M2:
        return mask, None
    shape = measure_shape(view, mask, main.area)
    if shape.is_upright:
        return mask, shape
    without = measure_shape(view, bare, main.area)
    return (bare, without) if without.is_upright else (mask, shape)


def _with_fragments(segments: Segments, main: LooseGroup, bare: Bool, view: FrameView) -> Bool:
    """Returns the main group (h, w) with smaller groups that touch it, such as a forearm held forward.

    Args:
        segments: the segmentation of the frame.
        main: the main group.
        bare: (h, w) the main group's pixels. They are returned unchanged without fragments.
        view: the frame.
    """
    mask = bare
    top, left, bottom, right = main.box
    neighbours = [
        other
        for other in segments.loose
        if other.label != main.label
        and other.area < 0.6 * main.area
        and other.box[0] <= bottom + _MAX_TOUCH_PX
        and other.box[2] >= top - _MAX_TOUCH_PX
        and other.box[1] <= right + _MAX_TOUCH_PX
        and other.box[3] >= left - _MAX_TOUCH_PX
    ]
    for other in neighbours:
        # Search only the window around the fragment's box, because other pixels cannot touch the fragment.
        top, left, bottom, right = other.box
        window = np.s_[
            max(0, top - _MAX_TOUCH_PX) : bottom + _MAX_TOUCH_PX,
            max(0, left - _MAX_TOUCH_PX) : right + _MAX_TOUCH_PX,
        ]
        part, points = segments.labels[window] == other.label, view.points[window]
        contact = dilate(part, _MAX_TOUCH_PX) & mask[window]
        if contact.any() and is_limb_fragment(points[part], points[contact]):
            mask = mask.copy() if mask is bare else mask
            mask[window] |= part
    return mask


def is_limb_fragment(part: Float, contact: Float) -> bool:
    """Returns True if a fragment begins at the contact and ends within an arm's length of it, unlike a wall.

    Args:
        part, contact: (N, 3) points of the fragment and (M, 3) points of the touched pixels in metres, world
            frame.
    """
    gap = _median(part[:, 2]) - _median(contact[:, 2])
    if abs(gap) >= _MAX_DEPTH_STEP_M:
        return False
    distances = part - contact.mean(0)
    return quantile(np.sort(np.sqrt((distances * distances).sum(1))), 0.9) < _MAX_FRAGMENT_M


def _median(values: Float) -> float:
    return float(quantile(np.sort(values), 0.5))
