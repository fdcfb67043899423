"""How much of a moved surface is inside another part of the body, and which parts these are.

    overlap = Overlap(shape)                       # once: what is inside at rest does not count
    overlap.at(vertices) -> (share, parts)         # of a pose, vertices (V, 3) in metres

A face is inside where the winding number of the surface about a point just outside of it is 1 or more. Along
a ray that number is the count of the faces it leaves by less those that it enters by (Nooruddin and Turk,
"Simplification and repair of polygonal models using volumetric techniques", 2003); rays along the three axes
vote, so that open borders of game models decide nothing. The part that it is in has the surface that its rays
reach first. A fold at a joint is not another part: bones that share a joint are let into one another.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import Shape
from enliven.kernels import njit

_FACES = 3000
"""Faces that are looked at, evenly over the list of all: within half a per cent of the share of all."""
_OFF = 1e-4
"""Share of the size by which a point stands off its face: more than rounding, less than any limb is thick."""
_IN_A_CELL = 4.0
"""Faces for a cell of the grid that rays go through, on average: then a ray passes some twenty."""
_DOUBT = 1e6
"""Metres, more than any model has, that are added to the way of a ray that went through other parts first."""
_MOST_CELLS = 256
"""Cells along a side of that grid at most: 512 KB of places in it."""


class Overlap:
    """The faces of a shape that are looked at, and where they are inside at rest."""

    def __init__(self, shape: Shape) -> None:
        assert shape.mesh is not None and shape.skin is not None
        self.faces = shape.mesh.faces
        self.looked = np.arange(0, len(self.faces), max(len(self.faces) // _FACES, 1))
        self.area = _areas(shape.mesh.vertices[self.faces[self.looked]])
        self.bone = _bones(shape)
        self._beside = _touching(shape)
        self._rest = self._inside(shape.mesh.vertices)[0]

    def at(self, vertices: Float) -> tuple[float, dict[tuple[int, int], float]]:
        """The share of the surface that is inside another part, and that of each (bone, bone it is in)."""
        inside, hit = self._inside(vertices)
        new = np.flatnonzero(inside & ~self._rest)
        whole = max(float(self.area.sum()), 1e-300)
        parts: dict[tuple[int, int], float] = {}
        for k in new:
            pair = int(self.bone[self.looked[k]]), int(self.bone[hit[k]])
            parts[pair] = parts.get(pair, 0.0) + float(self.area[k]) / whole
        return sum(parts.values()), parts

    def _inside(self, vertices: Float) -> tuple[Bool, Int]:
        """(K,) which of the faces that are looked at are in another part, and (K,) the face before them."""
        corners = np.ascontiguousarray(vertices[self.faces], np.float64)
        some = corners[self.looked]
        normals = np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
        points = some.mean(1) + _OFF * size * normals
        cells = int(np.clip(np.sqrt(len(corners) / _IN_A_CELL), 1, _MOST_CELLS))
        numbers = np.empty((3, len(points)), np.int64)
        exits, ways = np.full(len(points), -1), np.full(len(points), np.inf)
        for axis in range(3):
            wind(points, corners, self.bone, axis, cells, numbers[axis], exits, ways)
        inside = (np.median(numbers, axis=0) >= 1) & (exits >= 0)
        own, other = self.bone[self.looked], self.bone[np.maximum(exits, 0)]
        return inside & ~self._beside[own, other], exits


def _areas(corners: Float) -> Float:
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(vectors, axis=1) / 2.0)


def _bones(shape: Shape) -> Int:
    """(F,) the bone that the corners of each face follow most."""
    assert shape.mesh is not None and shape.skin is not None
    indices, weights = (np.asarray(of)[shape.mesh.faces].reshape(-1, 12) for of in _skin(shape))
    total = np.where(indices[:, :, None] == indices[:, None], weights[:, None], 0.0).sum(2)
    return np.asarray(np.take_along_axis(indices, total.argmax(1)[:, None], 1)[:, 0], np.int64)


def _skin(shape: Shape) -> tuple[Int, Float]:
    assert shape.skin is not None
    return np.asarray(shape.skin.indices, np.int64), np.asarray(shape.skin.weights, np.float64)


def _touching(shape: Shape) -> Bool:
    """(N, N) which bones are one, or share a joint: those that are folded there."""
    skeleton, count = shape.skeleton, len(shape.skeleton)
    ends = np.zeros((count, count), bool)
    ends[np.arange(count), np.arange(count)] = True
    ends[np.arange(count), np.maximum(skeleton.parents, 0)] = True
    return np.asarray(ends.astype(np.int64) @ ends.T.astype(np.int64) > 0)


@njit(cache=True, nogil=True)
def wind(points, corners, bones, axis, cells, numbers, exits, ways):
    """Kernel: winding numbers (P,) of faces about points (P, 3), counted along an axis.

    ``exits`` (P,) takes the face by which the ray, or the one the other way, leaves what the point is in,
    where that is nearer than ``ways`` (P,) metres.

    Args:
        corners: (F, 3, 3) metres; bones: (F,) the part that each is of.
        axis: 0, 1 or 2, the direction of the rays; across it are ``cells`` by ``cells`` cells.
    """
    one, two = (axis + 1) % 3, (axis + 2) % 3
    low, high = np.empty(2), np.empty(2)
    for k in range(2):
        side = one if k == 0 else two
        low[k], high[k] = corners[:, :, side].min(), corners[:, :, side].max()
    per = cells / np.maximum(high - low, 1e-300)
    first = np.zeros(cells * cells + 1, np.int64)
    held = np.empty(0, np.int64)
    for fill in range(2):
        for f in range(len(corners)):
            ua, ub = _span(corners[f, :, one], low[0], per[0], cells)
            va, vb = _span(corners[f, :, two], low[1], per[1], cells)
            for u in range(ua, ub + 1):
                for v in range(va, vb + 1):
                    cell = u * cells + v
                    if fill == 0:
                        first[cell + 1] += 1
                    else:
                        first[cell] -= 1
                        held[first[cell]] = f
        if fill == 0:
            first = np.cumsum(first)
            held = np.empty(first[-1], np.int64)
            # Filled from behind: each cell's end comes down to its begin.
            first[:-1] = first[1:]
    most = np.diff(first).max()
    met, sides, faces = np.empty(most), np.empty(most, np.int64), np.empty(most, np.int64)
    entered = np.empty(most, np.int64)
    for p in range(len(points)):
        numbers[p] = 0
        x, y, z = points[p, one], points[p, two], points[p, axis]
        if x < low[0] or x > high[0] or y < low[1] or y > high[1]:
            continue
        cell = min(int((x - low[0]) * per[0]), cells - 1) * cells + min(int((y - low[1]) * per[1]), cells - 1)
        count = 0
        for i in range(first[cell], first[cell + 1]):
            side, at = _met(corners[held[i]], x, y, one, two, axis)
            if side != 0:
                k = count
                while k > 0 and met[k - 1] > at:
                    met[k], sides[k], faces[k] = met[k - 1], sides[k - 1], faces[k - 1]
                    k -= 1
                met[k], sides[k], faces[k] = at, side, held[i]
                count += 1
        above = 0
        while above < count and met[above] <= z:
            above += 1
        for k in range(above, count):
            numbers[p] += sides[k]
        for way in (1, -1):
            # What the ray enters on its way it leaves again: the way out is where it leaves something else.
            count_in, k = 0, above if way > 0 else above - 1
            while 0 <= k < count:
                part, again = bones[faces[k]], -1
                for e in range(count_in):
                    again = e if entered[e] == part else again
                if way * sides[k] < 0:
                    entered[count_in], count_in = part, count_in + 1
                elif again >= 0:
                    entered[again], count_in = entered[count_in - 1], count_in - 1
                else:
                    # A ray that met nothing before is believed more than one that went through other parts.
                    far = way * (met[k] - z) + (0.0 if k == (above if way > 0 else above - 1) else _DOUBT)
                    if far < ways[p]:
                        ways[p], exits[p] = far, faces[k]
                    break
                k += way


@njit(cache=True, nogil=True)
def _span(values, low, per, cells):
    """Kernel: the first and the last cell that three numbers lie in."""
    a = int((min(values[0], values[1], values[2]) - low) * per)
    b = int((max(values[0], values[1], values[2]) - low) * per)
    return min(max(a, 0), cells - 1), min(max(b, 0), cells - 1)


@njit(cache=True, nogil=True)
def _met(corners, x, y, one, two, axis):
    """Kernel: whether the line through (x, y) along an axis meets a face, and where on the axis.

    1 where the face looks along the axis, -1 against it, 0 where it is missed. An edge belongs to one of the
    faces beside it: it is looked at from the same end for both.
    """
    inside = False
    for k in range(3):
        a, b = k, (k + 1) % 3
        if (corners[a, two] > y) == (corners[b, two] > y):
            continue
        if corners[a, two] > corners[b, two]:
            a, b = b, a
        part = (y - corners[a, two]) / (corners[b, two] - corners[a, two])
        if x < corners[a, one] + part * (corners[b, one] - corners[a, one]):
            inside = not inside
    if not inside:
        return 0, 0.0
    ux, uy, uz = (
        corners[1, one] - corners[0, one],
        corners[1, two] - corners[0, two],
        corners[1, axis] - corners[0, axis],
    )
    vx, vy, vz = (
        corners[2, one] - corners[0, one],
        corners[2, two] - corners[0, two],
        corners[2, axis] - corners[0, axis],
    )
    flat = ux * vy - uy * vx
    if flat == 0.0:
        return 0, 0.0
    dx, dy = x - corners[0, one], y - corners[0, two]
    s, t = (dx * vy - dy * vx) / flat, (ux * dy - uy * dx) / flat
    return (1 if flat > 0.0 else -1), corners[0, axis] + s * uz + t * vz
