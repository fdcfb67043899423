"""Finds self-intersecting faces of a posed puppet in a background thread."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.deformation.arap.self_intersection import SelfIntersection
from enliven.document import ExampleCharacter
from enliven.meshes import Mesh
from enliven_viewer.language import tr

_MAX_IGNORED_FACES = 2
"""Up to this number of self-intersecting faces is ignored as a numerical error."""


class SelfIntersectionSearch:
    """Searches for faces that intersect in a pose but not in the rest pose. It always checks the newest
    requested pose.

    Attributes:
        faces: (K,) faces of the mesh that intersect in the last checked pose.
        message: one line about the intersecting faces, or empty.
    """

    def __init__(self) -> None:
        self.faces: Int = np.zeros(0, np.int64)
        self.message = ""
        self._threads: ThreadPoolExecutor | None = None
        self._search: Future[tuple[Int, str]] | None = None
        self._searched_surface: Float | None = None
        self._mesh: Mesh | None = None
        self._finder: SelfIntersection | None = None

    def start_check(self, puppet: ExampleCharacter, surface: Float) -> None:
        """Starts a self-intersection check of the surface (V, 3) metres in the background.

        Call once per frame; does not block.
        """
        if puppet.mesh is not self._mesh:
            self.forget()
            self._mesh, self._finder = puppet.mesh, None
        if self._search is not None and self._search.done():
            now, self._search = self._search, None
            if now.exception() is None:
                self.faces, self.message = now.result()
        if self._search is None and surface is not self._searched_surface:
            self._searched_surface = surface
            self._threads = self._threads or ThreadPoolExecutor(1, "crossing faces")
            self._search = self._threads.submit(self._find_faces, puppet, surface)

    def wait(self) -> None:
        """Waits for the current check. For sessions without a window."""
        if self._search is not None:
            self.faces, self.message = self._search.result()
            self._search = None

    def forget(self) -> None:
        """Clears the results, and stops the current check."""
        if self._search is not None:
            self._search.cancel()
        self.faces, self.message, self._search, self._searched_surface = np.zeros(0, np.int64), "", None, None

    def _find_faces(self, puppet: ExampleCharacter, surface: Float) -> tuple[Int, str]:
        finder = self._finder
        if finder is None:
            finder = self._finder = SelfIntersection(puppet.mesh)
        faces = finder.find_new_crossing_faces(surface)
        return faces, describe_intersection(puppet, faces) if len(faces) > _MAX_IGNORED_FACES else ""


def describe_intersection(puppet: ExampleCharacter, faces: Int) -> str:
    """Returns a sentence about the intersecting parts.

    Each of the faces (K,) is assigned to the control point that is nearest in the rest pose.
    """
    if not puppet.points:
        return tr("the surface passes through itself")
    middles = puppet.mesh.vertices[puppet.mesh.faces[faces]].mean(1)
    counts = np.bincount(scipy.spatial.cKDTree(puppet.rest).query(middles)[1], minlength=len(puppet.points))
    first, *others = np.argsort(counts, kind="stable")[::-1]
    name = puppet.points[first].name
    if others and counts[others[0]] > 0.15 * counts[first]:
        return tr("{0} passes through {1}", name, puppet.points[others[0]].name)
    return tr("the surface passes through itself near {0}", name)
