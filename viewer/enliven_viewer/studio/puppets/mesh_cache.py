"""Caches properties of a mesh: its size, its plane of symmetry, and a k-d tree of its vertices."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np
import scipy

from enliven.arrays import Float, Int32
from enliven.document import Plane
from enliven.meshes import Mesh
from enliven.modeling.mesh import plane_of_symmetry

Cached = TypeVar("Cached")
_MAX_MESHES = 8
"""Maximum number of meshes with cached results. A stage seldom has more puppets."""


def by_mesh(find: Callable[[Mesh], Cached]) -> Callable[[Mesh], Cached]:
    """Returns the function with a cache for the last few meshes. Meshes are compared by identity."""
    cache: OrderedDict[int, tuple[Mesh, Cached]] = OrderedDict()

    @wraps(find)
    def ask(mesh: Mesh) -> Cached:
        if id(mesh) not in cache or cache[id(mesh)][0] is not mesh:
            cache[id(mesh)] = (mesh, find(mesh))
            while len(cache) > _MAX_MESHES:
                cache.popitem(last=False)
        return cache[id(mesh)][1]

    return ask


@by_mesh
def size_of(mesh: Mesh) -> float:
    """Returns the diagonal of the mesh's bounding box in metres."""
    return float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


@by_mesh
def middle_of(mesh: Mesh) -> Float:
    """Returns (3,) metres, the centre of the mesh's bounding box."""
    return np.asarray(mesh.bounds.mean(0))


@by_mesh
def normals_of(mesh: Mesh) -> Float:
    """Returns (V, 3) unit normals of the mesh's vertices at rest."""
    return mesh.vertex_normals()


@by_mesh
def plane_of(mesh: Mesh) -> Plane | None:
    """Returns the mesh's plane of symmetry, or None if it has none."""
    return plane_of_symmetry(mesh)


@by_mesh
def tree_of(mesh: Mesh) -> tuple[scipy.spatial.cKDTree, Int32]:
    """Returns a k-d tree of the vertices that faces use, and (U,) their indices."""
    used = np.unique(mesh.faces)
    return scipy.spatial.cKDTree(mesh.vertices[used]), used
