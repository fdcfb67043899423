"""The plane in which a mesh is its own mirror image, if there is one.

Candidates (the axes, the principal axes, directions all around) are brought to the nearest plane of symmetry
by mirroring points of the surface, pairing each image with the nearest point that faces as it does, and
taking the plane that the pairs say. What is left between image and surface tells how good a plane is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.deformation.graph import scatter
from enliven.document import Plane
from enliven.meshes import Mesh

TOLERANCE = 0.012
"""Part of the mesh's size (its box's diagonal) that the image may miss the surface by, in the mean."""
_FEW = 250
"""Points for the first test of each of some dozens of candidates."""
_SOME = 1500
"""Points for the candidates that are left."""
_MANY = 6000
"""Points for the planes that are left at last: their gap decides against the tolerance."""
_DIRECTIONS = 40
"""Normals to begin with, spread over the upper half of the sphere, some 23 degrees apart."""
_KEPT = 5
"""Different planes that the finer tests get."""
_ALIKE = 0.98
"""Cosine between normals from which on two planes are one."""
_FACING = 0.3
"""Part of the size that a pair of points counts as apart, for the part by which they face differently."""
_LEVEL = 0.35
"""Sine of the angle to the level within which a plane's normal counts as level."""


class _Cloud(NamedTuple):
    """Points (N, 3) on a surface in units of its size, their normals (N, 3), and a tree of both together."""

    points: Float
    normals: Float
    tree: scipy.spatial.cKDTree


class _Found(NamedTuple):
    """A plane (``normal`` x = ``offset``), and by what part of the size the image misses the surface."""

    gap: float
    normal: Float
    offset: float


def plane_of_symmetry(mesh: Mesh) -> Plane | None:
    """The plane of symmetry, or None where the mirror image misses the surface by more than ``TOLERANCE``.

    Where several planes hold (a box, a flat star), it is the upright one with the mesh widest along its
    normal: the one between left and right.

    Raises:
        InputError: for a mesh without area.
    """
    size = max(float(np.linalg.norm(np.ptp(mesh.vertices[np.unique(mesh.faces)], axis=0))), 1e-300)
    # The samples' own middle keeps digits for a mesh far away; normals need no welding here.
    sampled = scatter(mesh, _MANY, np.random.default_rng(0), (mesh, np.arange(len(mesh.vertices))))
    middle = sampled.positions.mean(0)
    points = (sampled.positions - middle) / size
    few, some, many = (_cloud(points, sampled.normals, count) for count in (_FEW, _SOME, _MANY))
    first = sorted((_brought(few, axis, 5) for axis in _candidates(points)), key=lambda found: found.gap)
    second = [_brought(some, one.normal, 8, one.offset) for one in _different(first)]
    likely = [one for one in second if one.gap <= 1.5 * TOLERANCE]
    likely.sort(key=lambda one: (abs(one.normal[1]) >= _LEVEL, -_breadth(points, one), one.gap))
    last = (_brought(many, one.normal, 4, one.offset) for one in likely)
    best = next((one for one in last if one.gap <= TOLERANCE), None)
    if best is None:
        return None
    normal = best.normal * np.sign(best.normal[np.abs(best.normal).argmax()])
    point = middle + size * best.offset * best.normal
    return Plane(tuple(point.tolist()), tuple(normal.tolist()))


def _cloud(points: Float, normals: Float, count: int) -> _Cloud:
    """About ``count`` of the points."""
    step = max(len(points) // count, 1)
    points, normals = points[::step], normals[::step]
    return _Cloud(points, normals, scipy.spatial.cKDTree(np.concatenate([points, _FACING * normals], 1)))


def _candidates(points: Float) -> Float:
    """(C, 3) normals to begin with."""
    k = np.arange(_DIRECTIONS) + 0.5
    up, turn = k / _DIRECTIONS, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - up * up)
    around = np.stack([ring * np.cos(turn), up, ring * np.sin(turn)], 1)
    return np.concatenate([np.eye(3), np.linalg.eigh(points.T @ points)[1].T, around])


def _brought(cloud: _Cloud, normal: Float, steps: int, offset: float = 0.0) -> _Found:
    """The plane of symmetry nearest to one, after some steps of pairing."""
    points = cloud.points
    for _ in range(steps):
        pairs = cloud.points[_nearest(cloud, normal, offset)]
        middles, ways = (points + pairs) / 2, pairs - points
        # Parts that have no counterpart (a raised hand) say nothing.
        missed = np.linalg.norm(_mirrored(points, normal, offset) - pairs, axis=1)
        good = missed <= np.quantile(missed, 0.8)
        centre = middles[good].mean(0)
        about = middles[good] - centre
        # The normal is along the ways, and the middles lie in the plane.
        normal = np.linalg.eigh(about.T @ about - ways[good].T @ ways[good] / 4)[1][:, 0]
        offset = float(normal @ centre)
    nearest = _nearest(cloud, normal, offset)
    image = _mirrored(points, normal, offset)
    gaps = image - points[nearest]
    # To the surface, not to its samples: what lies along the surface is no gap, as far as samples are apart.
    apart = np.linalg.norm(gaps, axis=1)
    through = np.abs((gaps * cloud.normals[nearest]).sum(1))
    spacing = 2.0 / np.sqrt(len(points))
    return _Found(float(np.maximum(through, apart - spacing).mean()), normal, offset)


def _nearest(cloud: _Cloud, normal: Float, offset: float) -> Float:
    """(N,) the point nearest to the image of each, that faces alike."""
    facing = cloud.normals - 2 * (cloud.normals @ normal)[:, None] * normal
    image = np.concatenate([_mirrored(cloud.points, normal, offset), _FACING * facing], 1)
    return np.asarray(cloud.tree.query(image)[1])


def _mirrored(points: Float, normal: Float, offset: float) -> Float:
    return np.asarray(points - 2 * (points @ normal - offset)[:, None] * normal)


def _different(found: list[_Found]) -> list[_Found]:
    """The best few that are not the same plane."""
    kept: list[_Found] = []
    for one in found:
        if all(abs(one.normal @ other.normal) < _ALIKE for other in kept):
            kept.append(one)
    return kept[:_KEPT]


def _breadth(points: Float, found: _Found) -> float:
    """How far the mesh reaches along the plane's normal, in steps of a tenth, so that equal ones tie."""
    return float(np.round(np.ptp(points @ found.normal), 1))
