"""The surface of a puppet: a mesh of any size that follows control points, one handle each.

    surface = PuppetSurface(mesh, held=[4711, 12, 980])
    vertices = surface.solve(places)        # (V, 3), the next frame of a drag or a performance
    vertices = surface.settle(places)       # the same whatever came before, for scrubbing and export

A mesh of more than ``coarse_above`` vertices is solved coarsely, on some of its own vertices, evenly spread
(:mod:`enliven.deformation.arap_coarse`); the others are carried by the cells near them, with all detail.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.arap import ArapSettings, ArapSolver
from enliven.deformation.arap_coarse import Coarse, coarse_of
from enliven.deformation.arap_detail import carry
from enliven.deformation.arap_input import Handle
from enliven.deformation.arap_surface import check_mesh
from enliven.deformation.arap_threads import shared
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
        self.mesh, self._settings = mesh, settings or ArapSettings()
        self._held = np.array(held, np.int64).reshape(-1)
        pulls = [None] * len(self._held) if weights is None else list(weights)
        if len(pulls) != len(self._held):
            raise InputError(f"{len(pulls)} weights for {len(self._held)} control points", where=_WHERE)
        check_mesh(mesh, self._settings.most_carried)
        self._coarse = self._coarse_of(mesh)
        if self._coarse is None:
            self._solver, solved = ArapSolver(mesh, self._settings), self._held
        else:
            self._solver = ArapSolver(self._coarse.mesh, self._settings, self._coarse.links)
            solved = self._coarse.held
        handles = zip(solved.tolist(), pulls, strict=True)
        self._solver.set_handles([Handle(str(k), (v,), weight) for k, (v, weight) in enumerate(handles)])
        hard = np.array([k for k, weight in enumerate(pulls) if weight is None], np.int64)
        self._pins = None if self._coarse is None else _welded_to(self._coarse.welded, self._held, hard)
        self.notes = self._solver.notes if self._coarse is None else self._coarse.notes
        self.pose = self._solver.pose if self._coarse is None else _frozen(mesh.vertices.copy())

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
            self._solver.solve(wanted)
            self.pose = self._carried(wanted)
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
        self.pose = self._carried(wanted)
        return self.pose

    def _carried(self, wanted: dict[str, Float]) -> Float:
        """(V, 3) what the solver's pose makes of the mesh."""
        coarse, pins = self._coarse, self._pins
        if coarse is None or pins is None:
            return self._solver.pose
        out, maps = np.empty_like(self.mesh.vertices), self._solver.maps()
        follow = (maps, coarse.start, coarse.near, coarse.weights, self.mesh.vertices, out)
        shared(carry, len(out), self._settings.threads, *follow)
        vertices, rows = pins
        out[vertices] = np.concatenate([wanted[str(k)] for k in range(len(self._held))])[rows]
        return _frozen(out)

    def _targets(self, places: Float) -> dict[str, Float]:
        """What the solver is to do; refused before anything changes."""
        wanted = np.asarray(places, np.float64)
        if wanted.shape != (len(self._held), 3):
            raise InputError(
                f"places are {wanted.shape}, expected ({len(self._held)}, 3)",
                where=_WHERE,
                mend="Give one row a control point.",
            )
        return {str(k): place[None] for k, place in enumerate(wanted)}

    def _coarse_of(self, mesh: Mesh) -> Coarse | None:
        """The coarse surface, where one is needed."""
        if len(mesh.vertices) <= self._settings.coarse_above:
            return None
        return coarse_of(mesh, self._held, self._settings.coarse_vertices)


def _welded_to(welded: Int, held: Int, hard: Int) -> tuple[Int, Int]:
    """(X,) the vertices at the place of a hard control point, and (X,) its number."""
    number = np.full(int(welded.max()) + 1, -1)
    number[welded[held[hard]]] = hard
    numbers = number[welded]
    vertices = np.flatnonzero(numbers >= 0)
    return vertices, numbers[vertices]


def _frozen(array: Float) -> Float:
    array.setflags(write=False)
    return array
