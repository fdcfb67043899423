"""Whether a group of pixels may be a person, by size and shape alone; and people who touch, parted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit
from enliven_edge.tracking.view import View

SMALLEST_AREA, LARGEST_AREA = 0.06, 1.6
_SHORTEST, _WIDEST, _DEEPEST = 0.3, 2.4, 1.6
_TALLEST = 2.6
_FLAT, _BROAD = 0.022, 0.35
_BIN, _GRID = 0.04, 0.06
_HEAD = 0.14
_SHOULDERS = ((0.25, 0.35), (0.35, 0.45), (0.45, 0.55))
"""Metres below the crown."""
_HEADLIKE, _HEAD_WIDTH, _SOLID = 0.75, (0.09, 0.45), 0.43
_SPARSE, _BOARD, _ROUND = 0.8, 0.85, 0.035
_FREE = 0.6
_HIDDEN, _MOSTLY_HIDDEN, _BORDER, _CUT = 0.2, 0.6, 0.03, 0.08
_TELLING, _TELLING_IN_THE_OPEN, _OPEN = 0.1, 0.3, 0.4
"""Share of an outline beyond which something must be measured for it to tell what stands free, that share
where less than a part of the image is measured, in a hall too deep for the sensor, and that part."""
_SAMPLES = 1500
_WALL_BEHIND = 1.0


@dataclass(frozen=True)
class Shape:
    """What a group of pixels looks like.

    Attributes:
        likeness: how much it is like a person by its size alone; 0 where it cannot be one.
        crown: metres above the floor of its top.
        thickness: metres, the standard deviation from its best plane.
        wide: metres across, the larger of its two horizontal extents.
        head: how wide the head's height is filled against the shoulders'; about 1 for a panel.
        head_width: metres that are filled at the head's height.
        fill: the share of its upright box that it fills.
        free: the share of its outline, sideways and above, beyond which the sensor sees farther: a person
            stands before something, a piece of a wall ends at the next thing or at the image's border.
        behind: the share of its outline at which something nearer begins, that may hide more of it.
        border: the share of its outline that is the image's border.
        cut: whether it runs out of the image below.
    """

    likeness: float
    crown: float
    thickness: float
    wide: float
    head: float
    head_width: float
    fill: float
    free: float
    behind: float
    border: float
    cut: bool

    @property
    def possible(self) -> bool:
        """Whether it may be a person in any posture: of a person's size, no panel, and free on its sides."""
        flat = self.thickness < _FLAT and self.wide > _BROAD
        panel = flat and not (self._headed and self.fill < _BOARD)
        return self.likeness > 0 and not panel and self.crown < _TALLEST and self._free > _FREE

    @property
    def upright(self) -> bool:
        """Whether it is shaped as somebody who stands or sits: a head above shoulders."""
        return self.possible and self._headed and self.fill > _SOLID

    @property
    def _free(self) -> float:
        """The free share of what nothing stands before: others may hide much of somebody in a crowd."""
        return self.free / max(1e-6, 1.0 - self.behind) if self.behind < _MOSTLY_HIDDEN else 0.0

    @property
    def _headed(self) -> bool:
        """Whether its top is as wide as a head, and what is below wider."""
        low, high = _HEAD_WIDTH
        return self.head < _HEADLIKE and low < self.head_width < high

    @property
    def human(self) -> bool:
        """Whether it is shaped as a person mostly is: upright, cut by the image, or with limbs that part."""
        limbs = self.fill < _SPARSE and self.thickness > _ROUND
        return self.upright or (self.possible and (self.cut or limbs or self.border > _CUT))

    @property
    def whole(self) -> bool:
        """Whether all of its upper end is seen, so that its height is its own."""
        return self.behind < _HIDDEN and self.border < _BORDER


def shape_of(view: View, mask: Bool, area: float, walls: Bool | None = None) -> Shape:
    """The shape of the (h, w) masked pixels, which cover ``area`` square metres towards the sensor.

    Args:
        walls: (h, w) what is a wall: behind the mask, however near.
    """
    z = view.z if walls is None else np.where(walls & (view.z > 0), view.z + _WALL_BEHIND, view.z)
    free, behind, border, cut = outline(z, mask)
    points = view.points[mask]
    points = points[:: max(1, len(points) // _SAMPLES)]
    low, high = np.percentile(points, [3, 97], axis=0)
    wide, tall, deep = high - low
    fits = SMALLEST_AREA < area < LARGEST_AREA and tall >= _SHORTEST and wide <= _WIDEST and deep <= _DEEPEST
    likeness = float(min(area, 0.7) * min(tall, 1.8)) if fits else 0.0
    centred = points - points.mean(0)
    covariance = centred.T @ centred / len(points)
    thickness = float(np.sqrt(max(0.0, np.linalg.eigvalsh(covariance)[0])))
    along = centred[:, [0, 2]] @ np.linalg.eigh(covariance[np.ix_([0, 2], [0, 2])])[1][:, 1]
    crown, head, shoulders = _head(along, points[:, 1])
    fill, wide = _fill(along, points[:, 1]), float(max(wide, deep))
    return Shape(likeness, crown, thickness, wide, head / shoulders, head, fill, free, behind, border, cut)


def _head(along: Float, height: Float) -> tuple[float, float, float]:
    """Metres: the crown above the floor, the width filled at the head's height and that at the shoulders'."""
    crown = float(np.percentile(height, 99))

    def width(top: float, bottom: float) -> float:
        part = along[(height <= crown - top) & (height > crown - bottom)]
        return len(np.unique(np.floor(part / _BIN))) * _BIN

    shoulders = max(width(top, bottom) for top, bottom in _SHOULDERS)
    return crown, width(-1.0, _HEAD), max(shoulders, _BIN)


def _fill(along: Float, height: Float) -> float:
    """The share of the upright box around the points that they fill, cell by cell."""
    cells = np.unique(np.floor(along / _GRID) * 1000 + np.floor(height / _GRID))
    wide, tall = np.ptp(np.percentile(along, [1, 99])), np.ptp(np.percentile(height, [1, 99]))
    return float(len(cells) * _GRID**2 / max(1e-6, wide * tall))


@njit(cache=True, nogil=True)
def outline(z, mask):  # type: ignore[no-untyped-def]
    """Of the mask's outline, sideways and above: the shares before farther, nearer and nothing; cut below.

    Beyond two pixels, because the first may lie on the edge itself. Unknown depth says nothing; what is
    surrounded by nothing else is free.
    """
    height, width = z.shape
    farther, nearer, other, border, below, unknown = 0, 0, 0, 0, 0, 0
    for v in range(height):
        for u in range(width):
            if not mask[v, u]:
                continue
            below += v >= height - 2
            for q, p, y, x in ((v, u - 1, v, u - 3), (v, u + 1, v, u + 3), (v - 1, u, v - 3, u)):
                if q < 0 or p < 0 or p >= width:
                    border += 1
                elif not mask[q, p] and y >= 0 and 0 <= x < width and not mask[y, x]:
                    if z[y, x] == 0.0:
                        unknown += 1
                        continue
                    step = 0.05 + 0.012 * z[v, u] * z[v, u]
                    farther += z[y, x] > z[v, u] + step
                    nearer += z[y, x] < z[v, u] - step
                    other += abs(z[y, x] - z[v, u]) <= step
    total = max(1.0, farther + nearer + other + border)
    telling = _TELLING if np.count_nonzero(z) > _OPEN * z.size else _TELLING_IN_THE_OPEN
    if total < telling * (total + unknown):
        return 1.0, 0.0, border / total, below > 0.05 * width
    return farther / total, nearer / total, border / total, below > 0.05 * width


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
_STANDING, _NECK, _HIGHER = 0.7, 0.3, 0.2


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
        centre = _summit(points, origin + (np.array([x, z]) + 0.5) * _CELL, top)
        if all(np.linalg.norm(centre - other) > _APART for other in kept) and _filled(points, centre, top):
            kept.append(centre)
    return np.array(kept).reshape(-1, 2)


def _summit(points: Float, near: Float, top: float) -> Float:
    """(2,) x and z of the middle of what is highest about a place, of a head say."""
    high = points[points[:, 1] > top - 0.15]
    high = high[np.linalg.norm(high[:, [0, 2]] - near, axis=1) < 0.2]
    return np.asarray(high[:, [0, 2]].mean(0))


def _filled(points: Float, centre: Float, top: float) -> bool:
    """Whether somebody is under a peak: no shoulder, and most heights from the knees up are met."""
    away = np.linalg.norm(points[:, [0, 2]] - centre, axis=1)
    near = away < _RADIUS
    if float(points[away < _NECK, 1].max()) > top + _HIGHER:
        return False
    bins = np.unique(np.floor(points[near, 1] / 0.1))
    wanted = np.arange(np.ceil(0.35 * top / 0.1), np.floor(top / 0.1))
    return len(wanted) > 0 and float(np.isin(wanted, bins).mean()) > 0.8
