"""Finds the faces of a posed puppet that pass through one another, in a thread in the background."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.deformation.arap import SelfIntersection
from enliven.document import Puppet
from enliven.meshes import Mesh
from enliven_viewer.language import tr

_FEW = 2
"""Faces: fewer that cross are a rounding of the surface, and not worth a word."""


class SelfCrossing:
    """Looks for faces that cross and did not at rest; always at the newest pose that was asked for.

    Attributes:
        faces: (K,) faces of the mesh that cross in the pose that was looked at last.
        said: one line about them, or empty.
    """

    def __init__(self) -> None:
        self.faces: Int = np.zeros(0, np.int64)
        self.said = ""
        self._threads: ThreadPoolExecutor | None = None
        self._now: Future[tuple[Int, str]] | None = None
        self._seen: Float | None = None
        self._mesh: Mesh | None = None
        self._finder: SelfIntersection | None = None

    def look(self, puppet: Puppet, surface: Float) -> None:
        """Looks at a surface (V, 3) metres; called once per frame, it never waits."""
        if puppet.mesh is not self._mesh:
            self.forget()
            self._mesh, self._finder = puppet.mesh, None
        if self._now is not None and self._now.done():
            now, self._now = self._now, None
            if now.exception() is None:
                self.faces, self.said = now.result()
        if self._now is None and surface is not self._seen:
            self._seen = surface
            self._threads = self._threads or ThreadPoolExecutor(1, "crossing faces")
            self._now = self._threads.submit(self._found, puppet, surface)

    def wait(self) -> None:
        """Waits for the newest answer: for sessions without a window."""
        if self._now is not None:
            self.faces, self.said = self._now.result()
            self._now = None

    def forget(self) -> None:
        """Nothing is looked at."""
        if self._now is not None:
            self._now.cancel()
        self.faces, self.said, self._now, self._seen = np.zeros(0, np.int64), "", None, None

    def _found(self, puppet: Puppet, surface: Float) -> tuple[Int, str]:
        finder = self._finder
        if finder is None:
            finder = self._finder = SelfIntersection(puppet.mesh)
        faces = finder.newly_crossing(surface)
        return faces, sentence(puppet, faces) if len(faces) > _FEW else ""


def sentence(puppet: Puppet, faces: Int) -> str:
    """Returns a sentence about the parts that cross; faces (K,) belong to the control point nearest at
    rest.
    """
    if not puppet.points:
        return tr("the surface passes through itself")
    middles = puppet.mesh.vertices[puppet.mesh.faces[faces]].mean(1)
    counts = np.bincount(scipy.spatial.cKDTree(puppet.rest).query(middles)[1], minlength=len(puppet.points))
    first, *others = np.argsort(counts, kind="stable")[::-1]
    name = puppet.points[first].name
    if others and counts[others[0]] > 0.15 * counts[first]:
        return tr("{0} goes through {1}", name, puppet.points[others[0]].name)
    return tr("the surface passes through itself near {0}", name)
