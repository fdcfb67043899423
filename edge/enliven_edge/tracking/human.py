"""Whether a group of points may be a person, by size and shape alone; and people who touch, parted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from enliven.arrays import Bool, Float
from enliven_edge.tracking.view import View

SMALLEST_AREA, LARGEST_AREA = 0.06, 1.6
_SHORTEST, _WIDEST, _DEEPEST = 0.3, 2.4, 1.6
_TALLEST = 2.6
_FLAT, _BROAD = 0.022, 0.45
_TOP, _BIN, _WIDEST_TOP = 0.15, 0.05, 0.62
_FREE = 0.6
_SAMPLES = 1500


@dataclass(frozen=True)
class Shape:
    """What a group of points looks like.

    Attributes:
        likeness: how much it is like a person by its size alone; 0 where it cannot be one.
        top: metres above the floor of its highest points.
        thickness: metres, the standard deviation from its best plane.
        wide: metres across, the larger of its two horizontal extents.
        top_width: metres that its uppermost hand's breadth fills across.
        free: the share of its outline, sideways and above, beyond which the sensor sees farther: a person
            stands before something, a piece of a wall ends at the next thing or at the image's border.
        cut: whether it runs out of the image below.
    """

    likeness: float
    top: float
    thickness: float
    wide: float
    top_width: float
    free: float
    cut: bool

    @property
    def human(self) -> bool:
        """Whether it may be a person: of a person's size, no panel, and no broader at the top than a head."""
        panel = self.thickness < _FLAT and self.wide > _BROAD
        if self.likeness == 0 or panel or self.top > _TALLEST:
            return False
        return self.free > _FREE and (self.cut or self.top_width < _WIDEST_TOP)


def shape_of(view: View, mask: Bool, area: float) -> Shape:
    """The shape of the (h, w) masked pixels, which cover ``area`` square metres towards the sensor."""
    free, cut = outline(view.z, mask)
    points = view.points[mask]
    points = points[:: max(1, len(points) // _SAMPLES)]
    low, high = np.percentile(points, [3, 97], axis=0)
    wide, tall, deep = high - low
    fits = SMALLEST_AREA < area < LARGEST_AREA and tall >= _SHORTEST and wide <= _WIDEST and deep <= _DEEPEST
    likeness = float(min(area, 0.7) * min(tall, 1.8)) if fits else 0.0
    centred = points - points.mean(0)
    values = np.linalg.eigvalsh(centred.T @ centred / len(points))
    thickness = float(np.sqrt(max(0.0, values[0])))
    return Shape(likeness, float(high[1]), thickness, float(max(wide, deep)), _top(points), free, cut)


@njit(cache=True, nogil=True)
def outline(z, mask):  # type: ignore[no-untyped-def]
    """The share of the mask's outline, sideways and above, with farther depth beyond; if it is cut below.

    Beyond two pixels, because the first may lie on the edge itself; unknown depth says nothing.
    """
    height, width = z.shape
    farther, other, below = 0, 0, 0
    for v in range(height):
        for u in range(width):
            if not mask[v, u]:
                continue
            below += v >= height - 2
            for q, p, y, x in ((v, u - 1, v, u - 3), (v, u + 1, v, u + 3), (v - 1, u, v - 3, u)):
                if q < 0 or p < 0 or p >= width:
                    other += 1
                elif not mask[q, p] and y >= 0 and 0 <= x < width and not mask[y, x]:
                    if z[y, x] > z[v, u] + 0.05 + 0.012 * z[v, u] * z[v, u]:
                        farther += 1
                    elif z[y, x] > 0.0:
                        other += 1
    return farther / max(1.0, farther + other), below > 0.05 * width


def _top(points: Float) -> float:
    """Metres across that the uppermost points fill, whatever is between them."""
    highest = np.percentile(points[:, 1], 99)
    top = points[points[:, 1] > highest - _TOP][:, [0, 2]]
    centred = top - top.mean(0)
    along = centred @ np.linalg.eigh(centred.T @ centred)[1][:, 1]
    return float(len(np.unique(np.floor(along / _BIN))) * _BIN)


def parted(points: Float, mask: Bool) -> list[Bool]:
    """The (h, w) mask, or its parts where several people stand side by side in it, joined at a hand say.

    Seen from above, each person is a column that reaches from a head to the legs; a pixel belongs to the
    nearest column.

    Args:
        points: (h, w, 3) world frame.
    """
    found = points[mask]
    columns = _columns(found)
    if len(columns) < 2:
        return [mask]
    nearest = np.argmin(np.linalg.norm(found[:, None, [0, 2]] - columns[None], axis=2), axis=1)
    parts = []
    for k in range(len(columns)):
        part = np.zeros(mask.shape, bool)
        part[mask] = nearest == k
        parts.append(part)
    return parts


_CELL, _APART, _RADIUS = 0.06, 0.42, 0.24
_STANDING = 0.7


def _columns(points: Float) -> Float:
    """(N, 2) x and z of the people in (M, 3) points: peaks of the height map over a filled column."""
    points = points[:: max(1, len(points) // (2 * _SAMPLES))]
    flat = points[:, [0, 2]]
    origin = flat.min(0)
    cells = np.floor((flat - origin) / _CELL).astype(int)
    height = np.zeros(cells.max(0) + 1)
    np.maximum.at(height, (cells[:, 0], cells[:, 1]), points[:, 1])
    kept: list[Float] = []
    for index in np.argsort(-height, axis=None)[:200]:
        x, z = np.unravel_index(index, height.shape)
        top = float(height[x, z])
        if top < _STANDING:
            break
        centre = origin + (np.array([x, z]) + 0.5) * _CELL
        if all(np.linalg.norm(centre - other) > _APART for other in kept) and _filled(points, centre, top):
            kept.append(centre)
    return np.array(kept).reshape(-1, 2)


def _filled(points: Float, centre: Float, top: float) -> bool:
    """Whether there is somebody under a peak: most heights from the knees up are met within the column."""
    near = np.linalg.norm(points[:, [0, 2]] - centre, axis=1) < _RADIUS
    bins = np.unique(np.floor(points[near, 1] / 0.1))
    wanted = np.arange(np.ceil(0.35 * top / 0.1), np.floor(top / 0.1))
    return len(wanted) > 0 and float(np.isin(wanted, bins).mean()) > 0.8
