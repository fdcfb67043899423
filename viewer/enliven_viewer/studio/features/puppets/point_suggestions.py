"""Suggests control points at the ends of the mesh's limbs, found in a background thread."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import scipy

from enliven.deformation.graph.sampling import sample_uniform_points
from enliven.deformation.graph.surface_ends import find_extremity_vertices
from enliven.document import ExampleCharacter
from enliven.meshes import Mesh
from enliven_viewer.studio.puppets.mesh_cache import measure_mesh

_MAX_CANDIDATES = 14
"""Maximum number of extreme vertices to examine. It is more than the number of a spider's limbs."""
_LIMBLESS_COUNT = 5
"""Number of suggested vertices on a mesh without limbs. They are enough to bend the mesh."""
_SURFACE_SAMPLES = 4000
"""Number of surface samples for measuring the neighbourhood of a vertex."""
_NEIGHBOURHOOD_RADIUS = 0.12
"""Radius of a vertex's neighbourhood, as a fraction of the mesh's size: about the thickness of a limb."""
_MIN_MEAN_OFFSET = 0.36
"""A vertex is the end of a limb if the mean of its neighbourhood is at least this far away, as a fraction of
the radius.
"""
_MIN_POINT_DISTANCE = 0.06
"""Minimum distance to existing control points, as a fraction of the mesh's size."""


class PointSuggestions:
    """Suggests control points for one mesh at a time."""

    def __init__(self) -> None:
        self._threads: ThreadPoolExecutor | None = None
        self._mesh: Mesh | None = None
        self._search: Future[tuple[int, ...]] | None = None

    def suggest_vertices(self, puppet: ExampleCharacter) -> tuple[int, ...]:
        """Returns suggested vertices that are not near a control point, or an empty result while the search
        runs.
        """
        if self._mesh is not puppet.mesh:
            self._mesh = puppet.mesh
            self._threads = self._threads or ThreadPoolExecutor(1, "suggested points")
            self._search = self._threads.submit(_find_limb_ends, puppet.mesh)
        search = self._search
        if search is None or not search.done() or search.exception() is not None:
            return ()
        vertices = puppet.mesh.vertices
        rest, min_distance = puppet.rest, _MIN_POINT_DISTANCE * measure_mesh(puppet.mesh)
        return tuple(
            vertex
            for vertex in search.result()
            if not len(rest) or np.linalg.norm(rest - vertices[vertex], axis=1).min() > min_distance
        )

    def wait(self) -> None:
        """Waits until the vertices are found. For sessions without a window."""
        if self._search is not None:
            self._search.result()


def _find_limb_ends(mesh: Mesh) -> tuple[int, ...]:
    """Returns the indices of the vertices at the ends of limbs, or of the most extreme vertices if there are
    no limbs. At an end, the neighbourhood is on one side of the vertex.
    """
    candidates = find_extremity_vertices(mesh, _MAX_CANDIDATES)
    samples = sample_uniform_points(mesh, _SURFACE_SAMPLES, np.random.default_rng(0)).positions
    tree, reach = scipy.spatial.cKDTree(samples), _NEIGHBOURHOOD_RADIUS * measure_mesh(mesh)
    ends = []
    for vertex in candidates:
        neighbours = tree.query_ball_point(mesh.vertices[vertex], reach)
        mean_offset = (
            np.linalg.norm(samples[neighbours].mean(0) - mesh.vertices[vertex]) if neighbours else 0.0
        )
        if mean_offset > _MIN_MEAN_OFFSET * reach:
            ends.append(int(vertex))
    return tuple(ends) if len(ends) > 1 else tuple(int(vertex) for vertex in candidates[:_LIMBLESS_COUNT])
