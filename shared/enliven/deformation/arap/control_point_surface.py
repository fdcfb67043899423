"""A deformable surface: a mesh of any size that follows control points, with one handle for each point.

    surface = PuppetSurface(mesh, held=[4711, 12, 980])
    vertices = surface.solve(places)        # (V, 3), the next frame of a drag or a performance
    vertices = surface.solve_from_rest(places)       # independent of earlier frames, for scrubbing and export

A mesh of more than ``coarse_above`` vertices is solved on an evenly distributed subset of its vertices
(:mod:`enliven.deformation.arap.coarse`). The other vertices follow the cells of this subset near them, so all
surface detail is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from time import perf_counter

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.arap.coarse import CoarseSurface, sample_coarse_surface
from enliven.deformation.arap.detail import apply_vertex_maps
from enliven.deformation.arap.guide import Guide, handles_from_vertices, settle_from_rest, targets_from_places
from enliven.deformation.arap.solver import ArapSolver
from enliven.deformation.arap.surface import check_mesh
from enliven.deformation.arap.threads import ThreadChoice, run_on_threads
from enliven.document import ArapSettings
from enliven.errors import InputError
from enliven.meshes import Mesh

_ERROR_CONTEXT = "puppet surface"
_MIN_GUIDE_VERTEX_RATIO = 3
"""Minimum ratio of the solver's number of vertices to that of the guide (a coarse proxy). With a smaller
ratio, a guide costs more time than it saves."""
_DETAIL_SETTLING_FRAMES = 6
"""Number of frames that are solved after the guide has moved the surface. Local details converge in these
frames."""


class PuppetSurface:
    """A mesh that is deformed by its control points.

    Args:
        mesh: any triangle mesh, in its own frame, metres.
        held: (P,) the vertex of each control point.
        weights: (P,) weight of each control point as a soft handle; None for a hard handle. If ``weights`` is
            None, all handles are hard.
        settings: settings of the solver.

    Attributes:
        mesh: the given mesh.
        notes: sentences about repairs to the mesh.
        pose: (V, 3) metres, the last valid result, read-only.

    Raises:
        InputError: if the mesh cannot be deformed, or a vertex does not exist or belongs to no face.
    """

    def __init__(
        self,
        mesh: Mesh,
        held: Sequence[int],
        weights: Sequence[float | None] | None = None,
        settings: ArapSettings | None = None,
    ) -> None:
        self.mesh, self._settings = mesh, settings or ArapSettings()
        check_mesh(mesh, self._settings.most_carried)
        self._second_surface: PuppetSurface | None = None
        self._thread_choice = ThreadChoice()
        self._body: tuple[ArapSolver, CoarseSurface | None] | None = None
        self.set_control_points(held, weights)

    def set_control_points(self, held: Sequence[int], weights: Sequence[float | None] | None = None) -> None:
        """Replaces the control points, and resets the mesh to rest.

        Raises:
            InputError: in the same cases as the constructor. In that case the control points stay unchanged.
        """
        vertices = np.array(held, np.int64).reshape(-1)
        soft_weights = [None] * len(vertices) if weights is None else list(weights)
        if len(soft_weights) != len(vertices):
            raise InputError(
                f"the number of weights ({len(soft_weights)}) differs from the number of control "
                f"points ({len(vertices)})",
                where=_ERROR_CONTEXT,
            )
        solver, coarse = self._solver_with_coarse(vertices)
        solver_vertices = vertices if coarse is None else coarse.held
        solver.set_handles(handles_from_vertices(solver_vertices, soft_weights))
        solver.reset()
        self._solver, self._coarse, self._guide = solver, coarse, None
        if (
            len(vertices)
            and len(solver.mesh.vertices) > _MIN_GUIDE_VERTEX_RATIO * self._settings.guide_vertices
        ):
            self._guide = Guide(solver, solver_vertices, soft_weights)
        hard_handles = np.array([k for k, weight in enumerate(soft_weights) if weight is None], np.int64)
        self._pins = (
            (hard_handles, hard_handles)
            if coarse is None
            else _find_welded_vertices(coarse.base.welded, vertices, hard_handles)
        )
        self._body, self._held, self._second_surface = (solver, coarse), vertices, None
        self.notes = solver.notes if coarse is None else coarse.notes
        self.pose = _as_read_only(self.mesh.vertices.copy())

    def _solver_with_coarse(self, held: Int) -> tuple[ArapSolver, CoarseSurface | None]:
        """Returns the solver and its coarse surface, and creates them if necessary.

        The coarse surface is None if the solver solves the whole mesh.
        """
        if len(self.mesh.vertices) <= self._settings.coarse_above:
            return (ArapSolver(self.mesh, self._settings), None) if self._body is None else self._body
        previous = None if self._body is None else self._body[1]
        coarse = sample_coarse_surface(self.mesh, held, self._settings.coarse_vertices, previous)
        if self._body is not None and previous is not None and coarse.mesh is previous.mesh:
            return self._body[0], coarse
        return ArapSolver(coarse.mesh, self._settings, coarse.links), coarse

    def solve(self, places: Float) -> Float:
        """Solves the next frame, starting from the shape of the last frame.

        Args:
            places: (P, 3) metres, the targets of the control points in the mesh's frame.

        Returns:
            (V, 3) metres, the mesh's vertices, read-only. Hard control points are exactly at their targets.

        Raises:
            InputError: if ``places`` has the wrong shape, is not finite or is too far away. The last valid
                pose is kept.
        """
        targets = self._check_places(places)
        if len(targets):
            if self._guide is not None:
                self._guide.move_surface(self._solver, targets)
            self._solver.solve(targets_from_places(targets))
            self.pose = self._deformed_vertices(targets)
        return self.pose

    def solve_from_rest(self, places: Float) -> Float:
        """Returns the surface (V, 3) for control points at ``places`` (P, 3) metres, independent of earlier
        frames.

        The control points are moved from rest in small steps.

        Raises:
            InputError: if ``places`` has the wrong shape, or is not finite. The last valid pose is kept.
        """
        targets = self._check_places(places)
        if not len(targets):
            return self.pose
        self._solver.check_targets(targets_from_places(targets))
        if self._guide is None:
            settle_from_rest(self._solver, self.mesh.vertices[self._held], targets)
        else:
            self._solver.start_from(self._guide.solve_from_rest(targets), self._guide.pressure)
        for _ in range(_DETAIL_SETTLING_FRAMES):
            self._solver.solve(targets_from_places(targets))
        self.pose = self._deformed_vertices(targets)
        return self.pose

    def settle_separately(self, places: Float) -> Float:
        """Returns the vertices (V, 3) of :meth:`solve_from_rest` from a second solver, without changing the
        current pose.

        It may be called from another thread than the other methods, but not by two threads at the same time.
        """
        if self._second_surface is None:
            self._second_surface = self._create_surface_at_rest()
        return self._second_surface.solve_from_rest(places)

    def _create_surface_at_rest(self) -> PuppetSurface:
        """Returns a second surface at rest with the same control points. It shares the factor and the
        weights.
        """
        second = copy(self)
        second._solver = self._solver.create_solver_at_rest()
        second._guide = None if self._guide is None else self._guide.create_guide_at_rest()
        return second

    def _deformed_vertices(self, targets: Float) -> Float:
        """Returns the mesh's vertices after the solver's pose was applied, (V, 3) in metres."""
        coarse = self._coarse
        if coarse is None:
            return self._solver.pose
        out, maps = np.empty_like(self.mesh.vertices), self._solver.get_vertex_maps()
        carry_arguments = (maps, coarse.start, coarse.near, coarse.weights, self.mesh.vertices, out)
        threads, start = self._settings.threads or self._thread_choice.choose_thread_count(), perf_counter()
        run_on_threads(apply_vertex_maps, len(out), threads, *carry_arguments)
        self._thread_choice.record_duration(threads, perf_counter() - start)
        vertices, rows = self._pins
        out[vertices] = targets[rows]
        return _as_read_only(out)

    def _check_places(self, places: Float) -> Float:
        targets = np.array(places, np.float64)
        if targets.shape != (len(self._held), 3):
            raise InputError(
                f"the positions of the control points have the shape {targets.shape} instead of "
                f"({len(self._held)}, 3)",
                where=_ERROR_CONTEXT,
                remedy="Pass one row of three numbers for each control point.",
            )
        return targets


def _find_welded_vertices(welded: Int, held: Int, hard: Int) -> tuple[Int, Int]:
    """Returns the vertices (X,) at the position of a hard control point, and the number (X,) of that control
    point.
    """
    control_point_at = np.full(int(welded.max()) + 1, -1)
    control_point_at[welded[held[hard]]] = hard
    control_points = control_point_at[welded]
    vertices = np.flatnonzero(control_points >= 0)
    return vertices, control_points[vertices]


def _as_read_only(array: Float) -> Float:
    array.setflags(write=False)
    return array
