"""Self-intersection: the fraction of a posed surface that is inside another part of the body, for each part.

    overlap = Overlap(shape)                       # once: faces that are inside at rest do not count
    overlap.at(vertices) -> (share, parts)         # for a pose, vertices (V, 3) in metres

A face is inside if the winding number of the surface about a point just outside the face is 1 or more. The
winding number is counted along a ray: the number of faces through which the ray exits, minus the number of
faces through which it enters (Nooruddin and Turk, "Simplification and repair of polygonal models using
volumetric techniques", 2003). The median over rays along the three axes is used, because game models often
have open borders. The containing part is the part with the surface that the rays reach first. Overlap of
bones that share a joint is ignored, because skin folds at joints.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import RiggedCharacter
from enliven.kernels import njit

_TESTED_FACES = 3000
"""Approximate number of tested faces, evenly spaced in the list of faces. With this number the result differs
from that for all faces by at most half a per cent of the surface."""
_TEST_POINT_OFFSET = 1e-4
"""Distance of a test point from its face, as a fraction of the size. It is larger than rounding errors and
smaller than the thickness of limbs."""
_FACES_PER_CELL = 4.0
"""Average number of faces per cell of the ray grid. A ray then tests about twenty faces."""
_UNCERTAIN_EXIT_M = 1e6
"""Metres added to the exit distance of a ray that crosses other parts first. It is larger than any
model, so direct exits come first."""
_MAX_CELLS = 256
"""Maximum number of cells along a side of the ray grid. It limits the grid's indices to 512 KB."""


class SelfIntersectionTest:
    """A test for self-intersection: the tested faces of a shape, and the faces that are inside at rest."""

    def __init__(self, shape: RiggedCharacter) -> None:
        assert shape.mesh is not None and shape.skin is not None
        self.faces = shape.mesh.faces
        self.tested_faces = np.arange(0, len(self.faces), max(len(self.faces) // _TESTED_FACES, 1))
        self.area = _face_areas(shape.mesh.vertices[self.faces[self.tested_faces]])
        self.bone = _face_bones(shape)
        self._adjacent = _adjacent_bones(shape)
        self._rest = self._faces_inside(shape.mesh.vertices)[0]

    def measure_overlap(self, vertices: Float) -> tuple[float, dict[tuple[int, int], float]]:
        """Returns the fraction of the surface that is inside other parts, in total and for each pair (inner
        bone, outer bone)."""
        inside, outer_faces = self._faces_inside(vertices)
        intersecting_faces = np.flatnonzero(inside & ~self._rest)
        total_area = max(float(self.area.sum()), 1e-300)
        parts: dict[tuple[int, int], float] = {}
        for k in intersecting_faces:
            pair = int(self.bone[self.tested_faces[k]]), int(self.bone[outer_faces[k]])
            parts[pair] = parts.get(pair, 0.0) + float(self.area[k]) / total_area
        return sum(parts.values()), parts

    def _faces_inside(self, vertices: Float) -> tuple[Bool, Int]:
        """Returns (K,) True for tested faces inside another part, and (K,) the face through which a ray
        leaves that part."""
        corners = np.ascontiguousarray(vertices[self.faces], np.float64)
        tested_corners = corners[self.tested_faces]
        normals = np.cross(
            tested_corners[:, 1] - tested_corners[:, 0], tested_corners[:, 2] - tested_corners[:, 0]
        )
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
        points = tested_corners.mean(1) + _TEST_POINT_OFFSET * size * normals
        cells = int(np.clip(np.sqrt(len(corners) / _FACES_PER_CELL), 1, _MAX_CELLS))
        numbers = np.empty((3, len(points)), np.int64)
        exits, exit_distances = np.full(len(points), -1), np.full(len(points), np.inf)
        for axis in range(3):
            compute_winding_numbers(
                points, corners, self.bone, axis, cells, numbers[axis], exits, exit_distances
            )
        inside = (np.median(numbers, axis=0) >= 1) & (exits >= 0)
        inner_bones, outer_bones = self.bone[self.tested_faces], self.bone[np.maximum(exits, 0)]
        return inside & ~self._adjacent[inner_bones, outer_bones], exits


def _face_areas(corners: Float) -> Float:
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(vectors, axis=1) / 2.0)


def _face_bones(shape: RiggedCharacter) -> Int:
    """Returns (F,) the bone with the largest total skin weight on the corners of each face."""
    assert shape.mesh is not None and shape.skin is not None
    indices, weights = (
        np.asarray(skin_array)[shape.mesh.faces].reshape(-1, 12) for skin_array in _skin_arrays(shape)
    )
    total = np.where(indices[:, :, None] == indices[:, None], weights[:, None], 0.0).sum(2)
    return np.asarray(np.take_along_axis(indices, total.argmax(1)[:, None], 1)[:, 0], np.int64)


def _skin_arrays(shape: RiggedCharacter) -> tuple[Int, Float]:
    assert shape.skin is not None
    return np.asarray(shape.skin.indices, np.int64), np.asarray(shape.skin.weights, np.float64)


def _adjacent_bones(shape: RiggedCharacter) -> Bool:
    """Returns (N, N) True for pairs of bones that share a joint, where the surface may fold, and for each
    bone with itself."""
    skeleton, count = shape.skeleton, len(shape.skeleton)
    has_end = np.zeros((count, count), bool)
    has_end[np.arange(count), np.arange(count)] = True
    has_end[np.arange(count), np.maximum(skeleton.parents, 0)] = True
    return np.asarray(has_end.astype(np.int64) @ has_end.T.astype(np.int64) > 0)


@njit(cache=True, nogil=True)
def compute_winding_numbers(points, corners, bones, axis, cells, numbers, exits, ways):  # noqa: PLR0915, a kernel
    """Computes the winding numbers of the surface about points, along rays parallel to an axis.

    Args:
        points: (P, 3) metres, the test points.
        corners: (F, 3, 3) metres, the corners of all faces.
        bones: (F,) the part that each face belongs to.
        axis: 0, 1 or 2, the direction of the rays.
        cells: number of grid cells along each of the two other axes.
        numbers: (P,) receives the winding numbers.
        exits: (P,) receives the face through which the ray, in either direction, leaves the part that
            contains the point. It is only replaced by a face nearer than ``ways``.
        ways: (P,) metres, the distances of ``exits``. Both arrays are updated together.
    """
    u_axis, v_axis = (axis + 1) % 3, (axis + 2) % 3
    # Build a grid perpendicular to the axis: the first pass counts the faces of each cell, the second stores
    # them.
    low, high = np.empty(2), np.empty(2)
    for k in range(2):
        side = u_axis if k == 0 else v_axis
        low[k], high[k] = corners[:, :, side].min(), corners[:, :, side].max()
    per = cells / np.maximum(high - low, 1e-300)
    first = np.zeros(cells * cells + 1, np.int64)
    cell_faces = np.empty(0, np.int64)
    for fill in range(2):
        for f in range(len(corners)):
            ua, ub = _cell_span(corners[f, :, u_axis], low[0], per[0], cells)
            va, vb = _cell_span(corners[f, :, v_axis], low[1], per[1], cells)
            for u in range(ua, ub + 1):
                for v in range(va, vb + 1):
                    cell = u * cells + v
                    if fill == 0:
                        first[cell + 1] += 1
                    else:
                        first[cell] -= 1
                        cell_faces[first[cell]] = f
        if fill == 0:
            first = np.cumsum(first)
            cell_faces = np.empty(first[-1], np.int64)
            # Each cell is filled from its end: ``first`` counts down to the beginning of the cell.
            first[:-1] = first[1:]
    most = np.diff(first).max()
    met, sides, faces = np.empty(most), np.empty(most, np.int64), np.empty(most, np.int64)
    entered = np.empty(most, np.int64)
    for p in range(len(points)):
        numbers[p] = 0
        x, y, z = points[p, u_axis], points[p, v_axis], points[p, axis]
        if x < low[0] or x > high[0] or y < low[1] or y > high[1]:
            continue
        # Intersect the ray through a test point with the faces of its cell, and sort the hits along the axis.
        cell = min(int((x - low[0]) * per[0]), cells - 1) * cells + min(int((y - low[1]) * per[1]), cells - 1)
        count = 0
        for i in range(first[cell], first[cell + 1]):
            side, at = _intersect_face(corners[cell_faces[i]], x, y, u_axis, v_axis, axis)
            if side != 0:
                k = count
                while k > 0 and met[k - 1] > at:
                    met[k], sides[k], faces[k] = met[k - 1], sides[k - 1], faces[k - 1]
                    k -= 1
                met[k], sides[k], faces[k] = at, side, cell_faces[i]
                count += 1
        # The winding number is the sum of the sides (1 or -1) of all hits beyond the point.
        above = 0
        while above < count and met[above] <= z:
            above += 1
        for k in range(above, count):
            numbers[p] += sides[k]
        for way in (1, -1):
            # Find the exit in each direction. The ray leaves every part that it enters. So the first face at
            # which it leaves a part that it did not enter belongs to the part that contains the point.
            count_in, k = 0, above if way > 0 else above - 1
            while 0 <= k < count:
                part, entry = bones[faces[k]], -1
                for e in range(count_in):
                    entry = e if entered[e] == part else entry
                if way * sides[k] < 0:
                    entered[count_in], count_in = part, count_in + 1
                elif entry >= 0:
                    entered[entry], count_in = entered[count_in - 1], count_in - 1
                else:
                    # A ray that reaches the exit directly is more reliable than a ray that crosses other
                    # parts first.
                    far = way * (met[k] - z) + (
                        0.0 if k == (above if way > 0 else above - 1) else _UNCERTAIN_EXIT_M
                    )
                    if far < ways[p]:
                        ways[p], exits[p] = far, faces[k]
                    break
                k += way


@njit(cache=True, nogil=True)
def _cell_span(values, low, per, cells):
    """Returns the first and the last grid cell covered by three coordinates."""
    a = int((min(values[0], values[1], values[2]) - low) * per)
    b = int((max(values[0], values[1], values[2]) - low) * per)
    return min(max(a, 0), cells - 1), min(max(b, 0), cells - 1)


@njit(cache=True, nogil=True)
def _intersect_face(corners, x, y, one, two, axis):
    """Intersects a face with the line through (x, y) along an axis.

    Returns the side and the coordinate of the hit on the axis. The side is 1 if the face's normal points
    along the axis, -1 if it points against it, and 0 if the line misses the face. A point on an edge belongs
    to exactly one of the two faces, since both compute the edge from the same end.
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
