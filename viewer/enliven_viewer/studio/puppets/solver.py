"""The surface solver of one puppet. A large mesh is prepared in a thread."""

from __future__ import annotations

from concurrent.futures import Executor, Future

import numpy as np

from enliven.arrays import Float
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document import ExampleCharacter
from enliven.errors import EnlivenError
from enliven_viewer.language import tr
from enliven_viewer.studio.puppets.mesh_cache import measure_mesh
from enliven_viewer.studio.toasts import Toasts

MAX_VERTICES_AT_ONCE = 4000
"""Meshes with at most this number of vertices are prepared without a thread, which takes less than 0.1 s."""
MIN_BACKGROUND_VERTICES = 30_000
"""For meshes with more vertices than this, changed control points are applied in the background."""
MIN_ANNOUNCED_VERTICES = 150_000
"""For meshes with more vertices than this, a message announces the preparation, and scrubbing does not fully
settle every frame.
"""
_SETTLED_MOVEMENT = 1e-4
"""The surface has settled if it moves less than this per frame, as a fraction of the mesh's size. That is
less than a pixel.
"""
_MAX_SETTLING_FRAMES = 60
"""Maximum number of frames for settling the surface after a drag: one or two seconds."""
HeldPoints = tuple[tuple[int, float | None], ...]


class SurfaceSolver:
    """The surface solver of one mesh.

    Args:
        pool: runs long computations.
        toasts: shows messages about waiting times and errors.
    """

    def __init__(self, puppet: ExampleCharacter, pool: Executor, toasts: Toasts) -> None:
        self.mesh, self.settings = puppet.mesh, puppet.surface
        self._name, self._pool, self._toasts = puppet.id, pool, toasts
        self._vertex_count = len(puppet.mesh.vertices)
        self._held_points = find_held_points(puppet)
        self._shown_surface: Float = puppet.mesh.vertices
        self._places: Float | None = None
        self._surface: PuppetSurface | None = None
        self._remaining_frames = 0
        self._refused: HeldPoints | None = None
        self._preparation: Future[PuppetSurface] | None = self._begin(puppet)
        if self._vertex_count > MIN_ANNOUNCED_VERTICES:
            toasts.show_message(
                tr("{0} is a very fine mesh: you can drag it in a moment", puppet.id),
                tr("You can continue to work in the meantime."),
            )

    def solve(self, puppet: ExampleCharacter, places: Float, *, warm: bool) -> Float:
        """Returns the surface (V, 3) in metres with control points at ``places`` (P, 3).

        Returns the last valid surface while it is being prepared, or if it cannot be solved.
        """
        surface = self.find_prepared(puppet)
        if surface is None:
            return self._shown_surface
        if not puppet.points:
            self._shown_surface = self.mesh.vertices
        elif self._places is None or not np.array_equal(places, self._places):
            self._shown_surface = self._move_points(surface, places, warm=warm)
        return self._shown_surface

    def find_prepared(self, puppet: ExampleCharacter) -> PuppetSurface | None:
        """Returns the solver with the puppet's control points, or None while it is being prepared."""
        held = find_held_points(puppet)
        if self._refused == held or (self._preparation is not None and not self._preparation.done()):
            return None
        try:
            # The control points have changed, so forget that earlier control points were refused.
            if self._refused is not None:
                self._refused, self._held_points, self._places = None, held, None
                self._preparation = self._begin(puppet)
                return self.find_prepared(puppet)
            if self._preparation is not None:
                work, self._preparation = self._preparation, None
                self._use_prepared(work.result())
            if held != self._held_points:
                self._change_points(held)
        except Exception as error:
            self._report_refusal(error)
            return None
        return self._surface if self._preparation is None else None

    def has_result(self) -> bool:
        """Returns True if the preparation has finished but its result has not been fetched yet."""
        return self._preparation is not None and self._preparation.done()

    def forget(self) -> None:
        """Discards the last positions, so that the next surface does not depend on earlier poses."""
        self._places, self._remaining_frames = None, 0

    def improve(self) -> bool:
        """Solves one more frame of settling. Returns True if anything has moved."""
        if (
            self._remaining_frames <= 0
            or self._surface is None
            or self._places is None
            or self._preparation is not None
        ):
            return False
        old_surface = self._shown_surface
        self._remaining_frames -= 1
        try:
            self._shown_surface = self._surface.solve(self._places)
        except EnlivenError:  # This error was reported when the surface was first requested.
            self._remaining_frames = 0
            return False
        if float(np.abs(self._shown_surface - old_surface).max()) < _SETTLED_MOVEMENT * measure_mesh(
            self.mesh
        ):
            self._remaining_frames = 0
        return True

    def _move_points(self, surface: PuppetSurface, places: Float, *, warm: bool) -> Float:
        small = self._vertex_count <= MIN_ANNOUNCED_VERTICES
        self._places, self._remaining_frames = (
            np.array(places),
            0 if small and not warm else _MAX_SETTLING_FRAMES,
        )
        try:
            if (
                not warm
                and small
                and np.array_equal(places, self.mesh.vertices[[v for v, _ in self._held_points]])
            ):
                surface.set_control_points(
                    *_split_points(self._held_points)
                )  # The rest pose needs no solving.
                return surface.pose
            return surface.solve_from_rest(places) if small and not warm else surface.solve(places)
        except EnlivenError as error:
            self._toasts.show_error(error)
            self._remaining_frames = 0
            return self._shown_surface

    def _report_refusal(self, error: Exception) -> None:
        """Reports that these control points cannot be prepared."""
        self._toasts.show_any_error(error)
        self._refused = self._held_points

    def _begin(self, puppet: ExampleCharacter) -> Future[PuppetSurface]:
        held, weights = _split_points(self._held_points)
        if self._vertex_count > MAX_VERTICES_AT_ONCE:
            return self._pool.submit(PuppetSurface, puppet.mesh, held, weights, puppet.surface)
        future: Future[PuppetSurface] = Future()
        try:
            future.set_result(PuppetSurface(puppet.mesh, held, weights, puppet.surface))
        except EnlivenError as error:
            future.set_exception(error)
        return future

    def _use_prepared(self, surface: PuppetSurface) -> None:
        first, self._surface, self._places = self._surface is None, surface, None
        if first and self._vertex_count > MIN_ANNOUNCED_VERTICES:
            self._toasts.show_message(tr("You can drag {0} now", self._name), *surface.notes[:1])

    def _change_points(self, held: HeldPoints) -> None:
        """Changes the control points. This happens in the background if it takes long."""
        surface, self._held_points, self._places = self._surface, held, None
        assert surface is not None

        def work() -> PuppetSurface:
            surface.set_control_points(*_split_points(held))
            return surface

        if self._vertex_count > MIN_BACKGROUND_VERTICES:
            self._preparation = self._pool.submit(work)
        else:
            work()


def find_held_points(puppet: ExampleCharacter) -> HeldPoints:
    """Returns the vertex and the weight of each control point, which determine the surface."""
    return tuple((point.vertex, point.weight) for point in puppet.points)


def _split_points(held: HeldPoints) -> tuple[list[int], list[float | None]]:
    return [vertex for vertex, _ in held], [weight for _, weight in held]
