"""Squash-and-stretch ARAP deformation of a surface by handles. Factorizes a matrix once, then solves in real
time.

U. Celikcan, I. O. Yaz and T. Capin, "Example-based retargeting of human motion to arbitrary mesh models",
2015, section 4, based on O. Sorkine and M. Alexa, "As-rigid-as-possible surface modeling", 2007:

    solver = ArapSolver(mesh)
    solver.set_handles([Handle("hand", (4711,)), Handle("feet", (12, 980))])
    vertices = solver.solve({"hand": [[0.3, 1.2, 0.1]]})      # the feet keep their targets

A frame needs a few iterations that start from the shape of the last frame. In the iterations of the shape
state, each cell gets its best rotation and uniform scale (eq. 4 to 9), which never raises the energy. The
last iteration computes the pose state (eq. 10 to 13). Its volume-preserving V_i R_i give the pose that is
shown. The next frame starts from the shape, not from this pose.

Each solve computes a correction of the positions: the residual of eq. 9 is computed in float64 and solved
with a float32 factor. Handles are added to the factor exactly (:mod:`enliven.deformation.arap.handles`).
Adding a handle costs less than a frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from time import perf_counter
from typing import Any

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.arap.cells import residual, turn_and_scale, turn_and_squash
from enliven.deformation.arap.detail import compute_vertex_maps
from enliven.deformation.arap.handles import (
    HandleVertices,
    build_held_vertices,
    move_with_handles,
    solve_handles,
)
from enliven.deformation.arap.input import ERROR_CONTEXT, Handle, check_handle, check_target
from enliven.deformation.arap.solves import solve_backward, solve_forward
from enliven.deformation.arap.step import apply_correction, move_positions, set_zero, write_pose
from enliven.deformation.arap.surface import prepare_surface
from enliven.deformation.arap.threads import ThreadChoice, run_on_threads
from enliven.deformation.arap.volume import add_pressure
from enliven.document import ArapSettings
from enliven.errors import InputError
from enliven.meshes import Mesh

_SAME_TARGET_FRACTION = 1e-6
"""Two hard handles on one vertex agree if their targets are closer than this fraction of the mesh's size."""
_MAX_HANDLE_VERTICES = 2000
"""Maximum number of vertices of all handles. Each frame multiplies by a dense square matrix of this size."""
_MAX_CACHED_COLUMNS = 4000
"""Maximum number of cached columns of the factor for handles. Each column needs about 10 kB."""


class ArapSolver:
    """An ARAP solver of a mesh with handles. Each frame starts from the result of the last frame.

    Args:
        mesh: any triangle mesh, in metres. Triangle soups, several shells, open borders and needles (thin
            triangles) are allowed.
        settings: settings of the solver. They may be replaced between frames, except ``most_vertices``.
        links: (L, 2) pairs of vertices that are connected without a face. With links, vertices without a face
            are allowed.

    Attributes:
        notes: sentences about repairs to the mesh.
        pose: (V, 3) metres, the last valid result, read-only.
        handles: the handles by name.
        pressure: the pressure in the last frame (:mod:`enliven.deformation.arap.volume`).
    """

    def __init__(self, mesh: Mesh, settings: ArapSettings | None = None, links: Int | None = None) -> None:
        self.mesh, self.settings = mesh, settings or ArapSettings()
        self._surface = prepare_surface(mesh, self.settings.most_vertices, links)
        self.notes = self._surface.notes
        count = len(self._surface.rest)
        self._frames = np.zeros((count, 16))
        self._shown, self._forces, self.pressure = np.zeros((count, 3)), np.zeros((count, 3)), 0.0
        self._z = np.zeros(4 * (count + 4), np.float32)
        self._room = np.zeros(4 * (self._surface.factor.tallest + 4), np.float32)
        self._columns: dict[int, tuple[Int32, Float]] = {}
        self._thread_choice, self._threads = ThreadChoice(), 1
        self.handles: dict[str, Handle] = {}
        self._held: HandleVertices | None = None
        self._wanted: dict[str, Float] = {}
        self.reset()

    def reset(self) -> None:
        """Resets the mesh to rest, and every handle to its position in the mesh."""
        self._frames[:] = 0.0
        self._frames[:, [0, 5, 10]] = 1.0
        self._frames[:, 12:15] = self._surface.rest
        self.pose = self.mesh.vertices.copy()
        self.pose.setflags(write=False)
        self._shown[:], self.pressure = self._surface.rest, 0.0
        self._wanted = {
            name: self.mesh.vertices[list(handle.vertices)] for name, handle in self.handles.items()
        }

    def set_handles(self, handles: Sequence[Handle]) -> None:
        """Replaces all handles. Unchanged handles keep their targets."""
        for handle in handles:
            check_handle(handle, self._surface)
        names = [handle.name for handle in handles]
        if len(set(names)) < len(names):
            raise InputError(
                f"two handles have the same name in this list: {', '.join(names)}", where=ERROR_CONTEXT
            )
        places = np.array(
            [self._surface.place_of[vertex] for h in handles for vertex in h.vertices], np.int64
        )
        soft = np.array([0.0 if h.weight is None else 2.0 / h.weight for h in handles for _ in h.vertices])
        # If several hard handles hold the same vertex, add it only once. solve() checks that their targets
        # agree.
        is_used = np.ones(len(places), bool)
        hard_rows = np.flatnonzero(soft == 0.0)
        is_used[np.setdiff1d(hard_rows, hard_rows[np.unique(places[hard_rows], return_index=True)[1]])] = (
            False
        )
        if is_used.sum() > _MAX_HANDLE_VERTICES:
            raise InputError(
                f"the handles have {is_used.sum()} vertices in total, but at most "
                f"{_MAX_HANDLE_VERTICES} are allowed",
                where=ERROR_CONTEXT,
                remedy="Use fewer vertices per handle. A few dozen are enough.",
            )
        held = None
        if len(self._columns) > _MAX_CACHED_COLUMNS:
            self._columns.clear()
        if is_used.any():
            factor, eliminated = self._surface.factor, self._surface.cells.eliminated
            held = build_held_vertices(factor, eliminated, places[is_used], soft[is_used], self._columns)
        kept_targets = {h.name: self._wanted[h.name] for h in handles if self.handles.get(h.name) == h}
        self._held, self._chosen, self._places = held, np.flatnonzero(is_used), places
        self._exact = self._find_hard_vertices(places, np.flatnonzero(is_used & (soft == 0.0)))
        self.handles = {handle.name: handle for handle in handles}
        self._wanted = {h.name: kept_targets.get(h.name, self.pose[list(h.vertices)]) for h in handles}

    def solve(self, targets: Mapping[str, Float] | None = None) -> Float:
        """Solves the next frame.

        Args:
            targets: (K, 3) metres for each handle that moves, one row per vertex of the handle. The other
                handles keep their targets.

        Returns:
            (V, 3) metres, the mesh's vertices. Hard handles are exactly at their targets.

        Raises:
            InputError: if targets have the wrong shape, are not finite or contradict each other. The last
                valid pose is kept.
        """
        all_targets, held, rows = self.check_targets(targets)
        settings, surface = self.settings, self._surface
        self._threads, start = settings.threads or self._thread_choice.choose_thread_count(), perf_counter()
        frames = self._frames.reshape(-1)
        move_with_handles(held, frames, self._shown, rows, settings.follow)
        for _ in range(max(settings.iterations - settings.squash_and_stretch, 1)):
            self._fit_cells()
            shift = self._solve_global_step(held, rows)
            apply_correction(frames, self._z, shift, surface.cells.eliminated)
        shift = (0.0, 0.0, 0.0)
        if settings.squash_and_stretch:
            exaggeration, max_stretch = settings.exaggeration, settings.most_stretch
            self._run_over_vertices(turn_and_squash, surface.cells, frames, exaggeration, max_stretch)
            shift = self._solve_global_step(held, rows, settings.volume)
        else:
            set_zero(self._z)
        pose: Float = np.empty_like(self.pose)
        write_pose(frames, self._z, shift, surface.cells.eliminated, surface.place_of, surface.centre, pose)
        if not np.isfinite(pose).all():
            self.start_from(self.pose, 0.0)
            raise InputError(
                "the positions of the handles lead to a surface that is not finite",
                where=ERROR_CONTEXT,
                remedy="Move the handles by smaller distances.",
            )
        vertices, target_rows = self._exact
        pose[vertices] = np.concatenate([all_targets[name] for name in self.handles])[target_rows]
        pose.setflags(write=False)
        self._shown[surface.place_of] = pose - surface.centre
        self._wanted, self.pose = all_targets, pose
        self._thread_choice.record_duration(self._threads, perf_counter() - start)
        return pose

    def check_targets(
        self, targets: Mapping[str, Float] | None = None
    ) -> tuple[dict[str, Float], HandleVertices, Float]:
        """Returns the targets by handle, the handle vertices and their targets (H, 3), without changing
        anything.

        Raises the same errors as :meth:`solve`.
        """
        all_targets = self._wanted | {
            name: check_target(name, value, self.handles, self._surface)
            for name, value in (targets or {}).items()
        }
        held, rows = self._merge_handles(all_targets)
        return all_targets, held, rows

    def _fit_cells(self) -> None:
        """Computes each cell's best rotation and scale at the current positions."""
        max_stretch = self.settings.most_stretch if self.settings.squash_and_stretch else 1.0
        frames, scale_resistance = self._frames.reshape(-1), float(self.settings.hold)
        self._run_over_vertices(
            turn_and_scale, self._surface.cells, frames, scale_resistance, 1 / max_stretch, float(max_stretch)
        )

    def _run_over_vertices(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Runs the kernel over all vertices, on one or two threads."""
        run_on_threads(kernel, len(self._surface.rest), self._threads, *arguments)

    def _solve_global_step(
        self, held: HandleVertices, rows: Float, volume: float = 0.0
    ) -> tuple[float, float, float]:
        """Writes the correction of eq. 9 (or 13, with a pressure) into ``_z``, and returns the translation of
        the whole surface.
        """
        surface, frames = self._surface, self._frames.reshape(-1)
        self._run_over_vertices(residual, surface.cells, frames, self._z)
        if volume > 0.0 and surface.volume is not None:
            volume_arguments = (surface.volume, frames, surface.cells.eliminated, self._shown, self._forces)
            self.pressure = add_pressure(*volume_arguments, self.pressure, volume, self._z)
        solve_forward(surface.factor, self._z, self._room)
        shift: tuple[float, float, float] = solve_handles(held, frames, rows, self._z)
        solve_backward(surface.factor, self._z, self._room)
        return shift

    def get_surface(self) -> Float:
        """Returns the surface (V, 3) in metres of the shape state. The next frame starts from it."""
        return self._frames[self._surface.place_of, 12:15] + self._surface.centre

    @property
    def joints(self) -> Int:
        """(J, 2) pairs of vertices that are connected without a face: edges between shells, and ``links``."""
        return self._surface.joints

    def start_from(self, shown: Float, pressure: float) -> None:
        """Starts the next frame from a pose (V, 3) in metres and the pressure that preserves its volume."""
        self._frames[:] = 0.0
        self._frames[:, [0, 5, 10]] = 1.0
        self.pressure = pressure
        self._frames[self._surface.place_of, 12:15] = shown - self._surface.centre
        self._shown[:] = self._frames[:, 12:15]

    def move_with_proxy(self, previous: Float, current: Float, turn: Float) -> None:
        """Moves the shape with a proxy.

        Args:
            previous, current: (V, 3) metres, the mesh as moved by the proxy in the last frame and in this
                frame.
            turn: (3, 3) the rotation of the shape's offsets from the proxy.
        """
        surface, frames = self._surface, self._frames.reshape(-1)
        move_positions(frames, self._shown, surface.place_of, surface.centre, previous, current, turn)

    def create_solver_at_rest(self) -> ArapSolver:
        """Returns another solver for the same mesh and handles, at rest. Both share the factor."""
        second = copy(self)
        second._frames, second._z, second._room = self._frames.copy(), self._z.copy(), self._room.copy()
        second._shown, second._forces = self._shown.copy(), self._forces.copy()
        second._columns, second.handles = dict(self._columns), dict(self.handles)
        second.reset()
        return second

    def get_vertex_maps(self) -> Float:
        """Returns (16 V,) each vertex's affine map: see
        :func:`enliven.deformation.arap.detail.compute_vertex_maps`.
        """
        surface, out = self._surface, np.empty(16 * len(self.pose))
        frames = self._frames.reshape(-1)
        compute_vertex_maps(surface.cells, frames, self.pose, surface.place_of, self.mesh.vertices, out)
        return out

    def _find_hard_vertices(self, places: Int, hard: Int) -> tuple[Int, Int]:
        """Returns the mesh's vertices (X,) that belong to hard handles, including welded vertices, and the
        row (X,) of the targets for each.
        """
        row_at = np.full(len(self._surface.rest), -1)
        row_at[places[hard]] = hard
        rows = row_at[self._surface.place_of]
        vertices = np.flatnonzero(rows >= 0)
        return vertices, rows[vertices]

    def _merge_handles(self, all_targets: Mapping[str, Float]) -> tuple[HandleVertices, Float]:
        """Returns the handle vertices and their targets (H, 3) in metres, relative to the centre of the mesh.

        Raises:
            InputError: if the mesh has no handle, or if hard handles contradict each other.
        """
        if self._held is None:
            raise InputError(
                "the mesh has no handle",
                where=ERROR_CONTEXT,
                remedy="Add a handle. Without a handle, the mesh stays at rest.",
            )
        all_rows = np.concatenate([all_targets[name] for name in self.handles]) - self._surface.centre
        if len(self._chosen) < len(all_rows):
            self._check_agreement(all_rows)
        return self._held, np.ascontiguousarray(all_rows[self._chosen])

    def _check_agreement(self, all_rows: Float) -> None:
        """Raises InputError if hard handles on one (welded) vertex have different targets."""
        names = [name for name, handle in self.handles.items() for _ in handle.vertices]
        hard = [handle.weight is None for handle in self.handles.values() for _ in handle.vertices]
        first_row: dict[int, int] = {}
        for k, place in enumerate(self._places.tolist()):
            if not hard[k]:
                continue
            other_row = first_row.setdefault(place, k)
            distance = float(np.linalg.norm(all_rows[k] - all_rows[other_row]))
            if distance > _SAME_TARGET_FRACTION * self._surface.extent:
                raise InputError(
                    f"the hard handles {names[other_row]!r} and {names[k]!r} move the same vertex to "
                    f"targets that are {distance:.3g} m apart",
                    where=ERROR_CONTEXT,
                    remedy="Remove one of the two handles, or set a weight for it, so that it becomes soft.",
                )
