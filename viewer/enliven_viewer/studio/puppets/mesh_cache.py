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
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry

Cached = TypeVar("Cached")
_MAX_MESHES = 8
"""Maximum number of meshes with cached results. A stage rarely has more puppets."""


def cache_by_mesh(find: Callable[[Mesh], Cached]) -> Callable[[Mesh], Cached]:
    """Decorates a function with a cache for the last few meshes. Meshes are compared by identity."""
    cache: OrderedDict[int, tuple[Mesh, Cached]] = OrderedDict()

    @wraps(find)
    def ask(mesh: Mesh) -> Cached:
        if id(mesh) not in cache or cache[id(mesh)][0] is not mesh:
            cache[id(mesh)] = (mesh, find(mesh))
            while len(cache) > _MAX_MESHES:
                cache.popitem(last=False)
        return cache[id(mesh)][1]

    return ask


@cache_by_mesh
def measure_mesh(mesh: Mesh) -> float:
    """Returns the diagonal of the mesh's bounding box in metres."""
    return float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


@cache_by_mesh
def find_mesh_centre(mesh: Mesh) -> Float:
    """Returns the centre (3,) in metres of the mesh's bounding box."""
    return np.asarray(mesh.bounds.mean(0))


@cache_by_mesh
def find_mesh_normals(mesh: Mesh) -> Float:
    """Returns (V, 3) unit normals of the mesh's vertices at rest."""
    return mesh.vertex_normals()


@cache_by_mesh
def find_mesh_plane(mesh: Mesh) -> Plane | None:
    """Returns the mesh's plane of symmetry, or None if it is not symmetric."""
    return plane_of_symmetry(mesh)


@cache_by_mesh
def build_vertex_tree(mesh: Mesh) -> tuple[scipy.spatial.cKDTree, Int32]:
    """Returns a k-d tree of the vertices that faces use, and (U,) their indices."""
    used = np.unique(mesh.faces)
    return scipy.spatial.cKDTree(mesh.vertices[used]), used
