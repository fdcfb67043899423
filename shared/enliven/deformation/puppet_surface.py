"""The surface of a puppet: a mesh that follows control points, one handle each.

surface = PuppetSurface(mesh, held=[4711, 12, 980])
vertices = surface.solve(places)        # (V, 3), the next frame of a drag or a performance
vertices = surface.settle(places)       # the same whatever came before, for scrubbing and export
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.deformation.arap import ArapSettings, ArapSolver
from enliven.deformation.arap_input import Handle
from enliven.errors import InputError
from enliven.mesh import Mesh

_WHERE = "puppet surface"
_MOST_SETTLING = 60
_STILL = 1e-4
"""Part of the mesh's size: a surface that moves less in a frame has settled."""


class PuppetSurface:
    """Deforms one mesh by its control points.

    Args:
        mesh: any triangle mesh, in its own frame, metres.
        held: (P,) the vertex of each control point.
        weights: (P,) how hard each pulls as a soft handle, None is hard; without them all are hard.
        settings: of the solver.

    Attributes:
        notes: sentences about what had to be mended in the mesh.
        pose: (V, 3) the last good answer, read-only.

    Raises:
        InputError: for a mesh that cannot be deformed, a vertex that is not there or that no face uses.
    """

    def __init__(
        self,
        mesh: Mesh,
        held: Sequence[int],
        weights: Sequence[float | None] | None = None,
        settings: ArapSettings | None = None,
    ) -> None:
        chosen = [int(vertex) for vertex in held]
        pulls = [None] * len(chosen) if weights is None else list(weights)
        if len(pulls) != len(chosen):
            raise InputError(f"{len(pulls)} weights for {len(chosen)} control points", where=_WHERE)
        self.mesh = mesh
        self._solver = ArapSolver(mesh, settings)
        self._solver.set_handles(
            [Handle(str(k), (v,), w) for k, (v, w) in enumerate(zip(chosen, pulls, strict=True))]
        )
        self._count = len(chosen)
        self.notes = self._solver.notes
        self.pose = self._solver.pose

    def solve(self, places: Float) -> Float:
        """The next frame, from the last one's shape.

        Args:
            places: (P, 3) metres in the mesh's frame.

        Returns:
            (V, 3) the mesh's vertices, read-only; hard control points are exactly where they are wanted.

        Raises:
            InputError: for places that cannot be meant. The last good pose stays.
        """
        wanted = self._targets(places)
        if wanted:
            self.pose = self._solver.solve(wanted)
        return self.pose

    def settle(self, places: Float) -> Float:
        """The surface at ``places`` (P, 3), found from rest: the same whatever came before.

        Raises:
            InputError: for places that cannot be meant. The last good pose stays.
        """
        wanted = self._targets(places)
        if not wanted:
            return self.pose
        self._solver.reset()
        still = _STILL * float(np.linalg.norm(np.ptp(self.mesh.vertices, axis=0)))
        last = self._solver.solve(wanted)
        for _ in range(_MOST_SETTLING):
            made = self._solver.solve(wanted)
            if np.abs(made - last).max() < still:
                break
            last = made
        self.pose = made
        return made

    def _targets(self, places: Float) -> dict[str, Float]:
        wanted = np.asarray(places, np.float64)
        if wanted.shape != (self._count, 3):
            raise InputError(
                f"places are {wanted.shape}, expected ({self._count}, 3)",
                where=_WHERE,
                mend="Give one row a control point.",
            )
        return {str(k): wanted[k][None] for k in range(self._count)}
