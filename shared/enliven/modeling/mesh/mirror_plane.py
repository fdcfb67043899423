"""Finds the symmetry plane of a mesh, if it has one.

Candidate planes (the axes, the principal axes, and directions all around) are refined iteratively, as in ICP.
Each step mirrors points of the surface, pairs each image with the nearest point that has a similar normal,
and fits a plane to the pairs. A plane is rated by the remaining distance between image and surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.deformation.graph.sampling import sample_uniform_points
from enliven.document import Plane
from enliven.meshes import Mesh

TOLERANCE = 0.012
"""Maximum mean distance between the mirror image and the surface of a symmetric mesh, as a fraction of the
diagonal of the bounding box."""
_FIRST_TEST_POINTS = 250
"""Number of points for the first test of several dozen candidates."""
_SECOND_TEST_POINTS = 1500
"""Number of points for the second test, of the remaining candidates."""
_LAST_TEST_POINTS = 6000
"""Number of points for the last test. Its result is compared with the tolerance."""
_INITIAL_NORMALS = 40
"""Number of initial normals, spread over the upper hemisphere about 23 degrees apart."""
_MAX_PLANES_REFINED = 5
"""Maximum number of different planes that get the finer tests."""
_SAME_NORMAL_COSINE = 0.98
"""Two planes count as equal if the cosine between their normals is above this value."""
_NORMAL_WEIGHT = 0.3
"""Weight of normals in the nearest-neighbour search: a unit difference counts as a distance of this fraction
of the size."""
_MAX_HORIZONTAL_SINE = 0.35
"""Sine of the angle to the horizontal up to which a plane's normal counts as horizontal."""


class _Cloud(NamedTuple):
    """Surface points (N, 3) divided by the mesh's size, their normals (N, 3), and a k-d tree over both."""

    points: Float
    normals: Float
    tree: scipy.spatial.cKDTree


class _MirrorFit(NamedTuple):
    """A plane (``normal`` x = ``offset``), and the mean distance of the mirror image as a fraction of the
    size."""

    gap: float
    normal: Float
    offset: float


def plane_of_symmetry(mesh: Mesh) -> Plane | None:
    """Returns the symmetry plane of a mesh, or None if it is not symmetric within ``TOLERANCE``.

    If there are several symmetry planes (a box, a flat star), the result is the upright plane with the mesh
    widest along its normal: the plane between left and right.

    Raises:
        InputError: if the mesh has no area.
    """
    size = max(float(np.linalg.norm(np.ptp(mesh.vertices[np.unique(mesh.faces)], axis=0))), 1e-300)
    # Subtract the mean of the samples, which keeps precision for a mesh far from the origin. The mesh
    # is not welded, because the normals do not need it here.
    sampled = sample_uniform_points(
        mesh, _LAST_TEST_POINTS, np.random.default_rng(0), (mesh, np.arange(len(mesh.vertices)))
    )
    middle = sampled.positions.mean(0)
    points = (sampled.positions - middle) / size
    first_cloud, second_cloud, last_cloud = (
        _sample_points(points, sampled.normals, count)
        for count in (_FIRST_TEST_POINTS, _SECOND_TEST_POINTS, _LAST_TEST_POINTS)
    )
    first = sorted(
        (_refine_plane(first_cloud, axis, 5) for axis in _candidate_normals(points)),
        key=lambda found: found.gap,
    )
    second = [
        _refine_plane(second_cloud, candidate.normal, 8, candidate.offset)
        for candidate in _find_distinct_planes(first)
    ]
    likely_planes = [candidate for candidate in second if candidate.gap <= 1.5 * TOLERANCE]
    likely_planes.sort(
        key=lambda one: (abs(one.normal[1]) >= _MAX_HORIZONTAL_SINE, -_round_extent(points, one), one.gap)
    )
    last = (_refine_plane(last_cloud, candidate.normal, 4, candidate.offset) for candidate in likely_planes)
    best = next((candidate for candidate in last if candidate.gap <= TOLERANCE), None)
    if best is None:
        return None
    normal = best.normal * np.sign(best.normal[np.abs(best.normal).argmax()])
    point = middle + size * best.offset * best.normal
    return Plane(tuple(point.tolist()), tuple(normal.tolist()))


def _sample_points(points: Float, normals: Float, count: int) -> _Cloud:
    """Subsamples the points to about ``count``, and builds their tree."""
    step = max(len(points) // count, 1)
    points, normals = points[::step], normals[::step]
    return _Cloud(
        points, normals, scipy.spatial.cKDTree(np.concatenate([points, _NORMAL_WEIGHT * normals], 1))
    )


def _candidate_normals(points: Float) -> Float:
    """Returns (C, 3) unit normals of the candidate planes: the axes, the principal axes, and directions all
    around."""
    k = np.arange(_INITIAL_NORMALS) + 0.5
    up, turn = k / _INITIAL_NORMALS, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - up * up)
    around = np.stack([ring * np.cos(turn), up, ring * np.sin(turn)], 1)
    return np.concatenate([np.eye(3), np.linalg.eigh(points.T @ points)[1].T, around])


def _refine_plane(cloud: _Cloud, normal: Float, steps: int, offset: float = 0.0) -> _MirrorFit:
    """Moves a plane towards the nearest symmetry plane by ``steps`` pairing steps."""
    points = cloud.points
    for _ in range(steps):
        pairs = cloud.points[_find_nearest_mirrored(cloud, normal, offset)]
        middles, differences = (points + pairs) / 2, pairs - points
        # Use only the best 80 % of the pairs, so that parts without a counterpart, such as a raised hand, are
        # ignored.
        missed = np.linalg.norm(_mirror_points(points, normal, offset) - pairs, axis=1)
        good = missed <= np.quantile(missed, 0.8)
        centre = middles[good].mean(0)
        about = middles[good] - centre
        # The normal is parallel to the differences of the pairs, and the midpoints of the pairs lie in the
        # plane.
        normal = np.linalg.eigh(about.T @ about - differences[good].T @ differences[good] / 4)[1][:, 0]
        offset = float(normal @ centre)
    nearest = _find_nearest_mirrored(cloud, normal, offset)
    image = _mirror_points(points, normal, offset)
    gaps = image - points[nearest]
    # Measure the distance to the surface, not to its samples. So ignore tangential offsets that are smaller
    # than the spacing of the samples.
    distances = np.linalg.norm(gaps, axis=1)
    through = np.abs((gaps * cloud.normals[nearest]).sum(1))
    spacing = 2.0 / np.sqrt(len(points))
    return _MirrorFit(float(np.maximum(through, distances - spacing).mean()), normal, offset)


def _find_nearest_mirrored(cloud: _Cloud, normal: Float, offset: float) -> Float:
    """Returns the index (N,) of the nearest point with a similar normal for the image of each point."""
    facing = cloud.normals - 2 * (cloud.normals @ normal)[:, None] * normal
    image = np.concatenate([_mirror_points(cloud.points, normal, offset), _NORMAL_WEIGHT * facing], 1)
    return np.asarray(cloud.tree.query(image)[1])


def _mirror_points(points: Float, normal: Float, offset: float) -> Float:
    return np.asarray(points - 2 * (points @ normal - offset)[:, None] * normal)


def _find_distinct_planes(planes: list[_MirrorFit]) -> list[_MirrorFit]:
    """Returns the best planes, at most ``_MAX_PLANES_REFINED``, without planes that are nearly equal to a
    better plane."""
    distinct: list[_MirrorFit] = []
    for plane in planes:
        if all(abs(plane.normal @ other.normal) < _SAME_NORMAL_COSINE for other in distinct):
            distinct.append(plane)
    return distinct[:_MAX_PLANES_REFINED]


def _round_extent(points: Float, plane: _MirrorFit) -> float:
    """Returns the extent of the mesh along the plane's normal, rounded to a tenth so that nearly equal
    extents tie."""
    return float(np.round(np.ptp(points @ plane.normal), 1))
