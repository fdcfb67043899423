"""Whether a group of pixels may be a person, by size and shape alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import View

SMALLEST_AREA, LARGEST_AREA = 0.06, 1.6
_SHORTEST, _WIDEST, _DEEPEST = 0.3, 2.4, 1.6
_TALLEST = 2.6
_FLAT, _BROAD = 0.022, 0.35
_BIN, _GRID = 0.04, 0.06
_HEAD = 0.14
_BANDS = np.array([(-1.0, _HEAD), (0.25, 0.35), (0.35, 0.45), (0.45, 0.55)])
"""Metres below the crown between which a head is, and shoulders may be."""
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
    points = samples(view.points, mask, _SAMPLES)
    ordered = np.sort(points, axis=1)
    wide, tall, deep = (_spread(axis, 0.03, 0.97) for axis in ordered)
    fits = SMALLEST_AREA < area < LARGEST_AREA and tall >= _SHORTEST and wide <= _WIDEST and deep <= _DEEPEST
    likeness = float(min(area, 0.7) * min(tall, 1.8)) if fits else 0.0
    centred = points - points.mean(1, keepdims=True)
    covariance = centred @ centred.T / points.shape[1]
    thickness = float(np.sqrt(max(0.0, np.linalg.eigvalsh(covariance)[0])))
    along = np.linalg.eigh(covariance[::2, ::2])[1][:, 1] @ centred[::2]
    crown = quantile(ordered[1], 0.99)
    head, *shoulders = _widths(along, points[1], crown, _BANDS)
    box = _spread(np.sort(along), 0.01, 0.99) * _spread(ordered[1], 0.01, 0.99)
    fill = float(_cells(along, points[1]) * _GRID**2 / max(1e-6, box))
    beside = max(*shoulders, _BIN)
    wide = max(wide, deep)
    return Shape(likeness, crown, thickness, wide, head / beside, head, fill, free, behind, border, cut)


def quantile(ordered: Float, share: float) -> float:
    """The number below which a share in [0, 1] of (N,) rising values is, between two of them linearly."""
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))


def _spread(ordered: Float, low: float, high: float) -> float:
    """How far apart two quantiles of (N,) rising values are."""
    return quantile(ordered, high) - quantile(ordered, low)


@njit(cache=True, nogil=True)
def samples(points, mask, most):  # type: ignore[no-untyped-def]
    """(3, M) every k-th of the (h, w, 3) points on the (h, w) mask, in reading order; M < 2 ``most``."""
    pixels = pixels_of(mask)
    step = max(1, len(pixels) // most)
    out, width = np.empty((3, (len(pixels) + step - 1) // step)), mask.shape[1]
    for i in range(out.shape[1]):
        v, u = divmod(pixels[i * step], width)
        for a in range(3):
            out[a, i] = points[v, u, a]
    return out


@njit(cache=True, nogil=True)
def _widths(along, height, crown, bands):  # type: ignore[no-untyped-def]
    """(B,) metres, in steps, that (M,) points fill ``along`` a line within each of (B, 2) bands of height.

    Args:
        bands: metres below the crown where each begins and ends.
    """
    first = np.floor(along.min() / _BIN)
    met = np.zeros((len(bands), int(np.floor(along.max() / _BIN) - first) + 1), np.bool_)
    for i in range(len(along)):
        place = int(np.floor(along[i] / _BIN) - first)
        for b in range(len(bands)):
            if crown - bands[b, 1] < height[i] <= crown - bands[b, 0]:
                met[b, place] = True
    return met.sum(1) * _BIN


@njit(cache=True, nogil=True)
def _cells(along, height):  # type: ignore[no-untyped-def]
    """How many cells of an upright grid (M,) points fill."""
    left, low = np.floor(along.min() / _GRID), np.floor(height.min() / _GRID)
    wide, tall = int(np.floor(along.max() / _GRID) - left), int(np.floor(height.max() / _GRID) - low)
    met = np.zeros((wide + 1, tall + 1), np.bool_)
    for i in range(len(along)):
        met[int(np.floor(along[i] / _GRID) - left), int(np.floor(height[i] / _GRID) - low)] = True
    return np.count_nonzero(met)


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
