"""Surfaces of puppets. An edge sends control points, and the viewer solves for the surface that follows them.

surfaces = Surfaces()
vertices = surfaces.vertices(character, pose)     # (V, 3) metres in the world; None: draw it rigidly
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import Character, Pose
from enliven.errors import EnlivenError
from enliven.kernels import njit
from enliven.meshes import Mesh

if TYPE_CHECKING:
    from enliven.deformation.arap.control_point_surface import PuppetSurface

log = logging.getLogger(__name__)

T = TypeVar("T")
_SOLVE_BUDGET_S = 0.012
"""Maximum seconds for solving a surface within a frame. A slower mesh is solved in the background."""
_SOLVER_ERRORS = (EnlivenError, ArithmeticError, ValueError, RuntimeError, MemoryError)
"""Exceptions that solving a mesh may raise. A mesh from another machine must not end the viewer."""
_SETTLING_FRAMES = 12
"""Number of frames for which solving continues after the control points have stopped, so that the surface
converges.
"""


class SolvedSurfaces:
    """The surfaces of all puppets, from frame to frame.

    A mesh is prepared in a thread. Until then, or if the preparation fails, the mesh is drawn rigidly.

    Args:
        wait: True waits for the surface of every frame's own pose, as films need.
    """

    def __init__(self, *, wait: bool = False) -> None:
        self._wait = wait
        self._known: dict[str, _SolvedSurface] = {}

    def vertices(self, character: Character, pose: Pose) -> Float32 | None:
        """Returns the vertices of a puppet in a pose, (V, 3) in metres of the world.

        Returns None for characters moved only by transforms.
        """
        if character.kind != "points":
            return None
        surface = self._known.get(character.id)
        if surface is None or surface.character is not character:
            surface = _SolvedSurface(character)
            self._known[character.id] = surface
        return surface.vertices(pose, wait=self._wait)

    def keep_only(self, characters: Iterable[Character]) -> None:
        """Discards the surfaces of all other puppets."""
        names = {character.id for character in characters}
        self._known = {name: surface for name, surface in self._known.items() if name in names}


class _SolvedSurface:
    """One puppet's surface: prepared once, then solved as its control points move."""

    def __init__(self, character: Character) -> None:
        self.character = character
        self._prepare_surface = _run_in_thread(lambda: _prepare_surface(character))
        self._solving: Future[Float32] | None = None
        self._local: Float32 | None = None
        self._places: Float | None = None
        self._unchanged_frames, self._seconds = 0, 0.0
        self._told = False
        self._world: Float32 | None = None
        self._carried_from: Float32 | None = None
        self._transform: Float = np.zeros((3, 4))

    def vertices(self, pose: Pose, *, wait: bool) -> Float32 | None:
        """Returns the vertices (V, 3) in metres of the world, or None before the surface is prepared, or if
        that failed.
        """
        surface = self._get_surface(wait)
        frame, pivot = _puppet_frame(pose), self.character.pivots[0].astype(np.float64)
        if surface is None or frame is None:
            return None
        linear, position = frame
        places = (pose.positions[1:] - position) @ np.linalg.inv(linear).T + pivot
        self._fetch_solved()
        if self._is_due(places):
            self._solve(surface, places, wait)
        if self._local is None:
            return None
        return self._place_surface(linear, position - linear @ pivot)

    def _place_surface(self, linear: Float, offset: Float) -> Float32:
        """Returns the surface (V, 3) in metres of the world. While nothing moves, returns the same array
        again.
        """
        assert self._local is not None
        transform = np.concatenate([linear, offset[:, None]], 1)
        if (
            self._world is None
            or self._carried_from is not self._local
            or not np.array_equal(transform, self._transform)
        ):
            self._world = np.empty_like(self._local)
            transform_points(self._local, transform, self._world)
            self._carried_from, self._transform = self._local, transform
        return self._world

    def _get_surface(self, wait: bool) -> PuppetSurface | None:
        """Returns the prepared surface, or None before it is ready. An error is logged once."""
        if not wait and not self._prepare_surface.done():
            return None
        try:
            return self._prepare_surface.result()
        except _SOLVER_ERRORS as error:
            if not self._told:
                self._told = True
                log.warning(
                    "%s is shown as a rigid mesh, because its surface cannot be solved: %s",
                    self.character.id,
                    error,
                )
            return None

    def _is_due(self, places: Float) -> bool:
        """Returns True if the positions have changed, or the surface is still settling."""
        if self._solving is not None:
            return False
        if not np.isfinite(places).all():
            return False
        is_unchanged = self._places is not None and np.array_equal(places, self._places)
        self._unchanged_frames = self._unchanged_frames + 1 if is_unchanged else 0
        self._places = places
        return self._unchanged_frames < _SETTLING_FRAMES

    def _solve(self, surface: PuppetSurface, places: Float, wait: bool) -> None:
        """Solves the next frame: immediately, or in a thread if the mesh exceeds ``_SOLVE_BUDGET_S``."""
        if wait or (self._seconds < _SOLVE_BUDGET_S and self._local is not None):
            self._local = self._solve_surface(surface, places)
        else:
            self._solving = _run_in_thread(lambda: self._solve_surface(surface, places))

    def _solve_surface(self, surface: PuppetSurface, places: Float) -> Float32:
        """Returns the surface in the mesh's frame. If the positions are invalid, returns the last valid
        surface.
        """
        started_at = time.perf_counter()
        try:
            vertices = surface.solve_from_rest(places) if self._local is None else surface.solve(places)
        except _SOLVER_ERRORS as error:
            vertices = surface.pose
            log.debug("%s keeps its last surface in this frame: %s", self.character.id, error)
        if self._local is not None:
            self._seconds = time.perf_counter() - started_at
        return vertices.astype(np.float32)

    def _fetch_solved(self) -> None:
        """Fetches the surface that a thread has solved, if it is ready."""
        if self._solving is not None and self._solving.done():
            self._local, self._solving = self._solving.result(), None


def _run_in_thread(work: Callable[[], T]) -> Future[T]:
    """Returns the future of a function in a daemon thread, so that the program's end does not wait for it."""
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:  # The error is raised again when the result is requested.
            future.set_exception(error)

    threading.Thread(target=run, name="puppet", daemon=True).start()
    return future


def _prepare_surface(character: Character) -> PuppetSurface:
    """Returns the solver of a character's surface."""
    from enliven.deformation.arap.control_point_surface import PuppetSurface

    assert character.held is not None
    mesh = Mesh(character.vertices.astype(np.float64), character.faces)
    held_vertices = character.held.tolist()
    pulls = (
        [None] * len(held_vertices)
        if character.pulls is None
        else [w or None for w in character.pulls.tolist()]
    )
    return PuppetSurface(mesh, held_vertices, pulls, character.surface)


@njit(cache=True, nogil=True)
def transform_points(local: Float32, by: Float, world: Float32) -> None:
    """Transforms (V, 3) points by ``by`` (3, 4): a linear part and an offset (kernel)."""
    for v in range(len(local)):
        x, y, z = local[v, 0], local[v, 1], local[v, 2]
        for c in range(3):
            world[v, c] = by[c, 0] * x + by[c, 1] * y + by[c, 2] * z + by[c, 3]


def _puppet_frame(pose: Pose) -> tuple[Float, Float] | None:
    """Returns the linear part (3, 3) and the offset (3,) of the first transform, or None if it is not
    invertible.
    """
    linear, position = pose.linear[0].astype(np.float64), pose.positions[0].astype(np.float64)
    is_finite = np.isfinite(linear).all() and np.isfinite(position).all()
    return (linear, position) if is_finite and abs(np.linalg.det(linear)) > 1e-9 else None
