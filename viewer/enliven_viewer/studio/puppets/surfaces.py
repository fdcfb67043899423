"""The solved surfaces of all puppets. Each mesh is prepared once."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

from enliven.arrays import Float
from enliven.document import ExampleCharacter
from enliven.errors import EnlivenError
from enliven_viewer.studio.puppets.solver import SurfaceSolver
from enliven_viewer.studio.toasts import Toasts


class PuppetSurfaces:
    """The solvers of all puppets, by id.

    Args:
        toasts: shows messages about waiting times and errors.

    Attributes:
        version: changes whenever a surface has moved without a request, because it settles.
    """

    def __init__(self, toasts: Toasts) -> None:
        self._toasts = toasts
        self._solvers: dict[str, SurfaceSolver] = {}
        self._pool = ThreadPoolExecutor(1, "puppet surface")
        self._background = ThreadPoolExecutor(1, "another pose")
        self.version = 0

    def solve(self, puppet: ExampleCharacter, places: Float, *, warm: bool) -> Float:
        """Returns the surface with control points at ``places`` (P, 3), (V, 3) in metres of the mesh's frame.

        While the mesh is being prepared, returns the rest surface. If the positions are invalid, returns the
        last valid surface.

        Args:
            warm: if True, start from the previous frame of a drag or performance. If False, the result does
                not depend on earlier frames.
        """
        return self._get_solver(puppet).solve(puppet, places, warm=warm)

    def solve_in_background(self, puppet: ExampleCharacter, places: Float) -> Future[Float] | None:
        """Returns the future of the settled surface (V, 3) at positions (P, 3), or None. A current drag is
        not affected.
        """
        surface = self._get_solver(puppet).find_prepared(puppet)
        if surface is None or not puppet.points:
            return None
        return self._background.submit(surface.settle_separately, places)

    def settle_each(self, puppet: ExampleCharacter, many: Sequence[Float]) -> list[Float] | None:
        """Returns the settled surface (V, 3) at each of several positions (P, 3).

        Returns None if they cannot be computed yet.
        """
        futures = [self.solve_in_background(puppet, places) for places in many]
        try:
            return [future.result() for future in futures if future is not None] if all(futures) else None
        except EnlivenError:
            return None

    def improve(self) -> None:
        """Runs more solver iterations on dragged surfaces, and fetches surfaces solved in the background."""
        moved = [solver.improve() or solver.has_result() for solver in self._solvers.values()]
        self.version += any(moved)

    def settle(self) -> None:
        """Makes every surface settle from its rest pose at the next request. Called after scrubbing."""
        for solver in self._solvers.values():
            solver.forget()
        self.version += 1

    def is_prepared(self, puppet: ExampleCharacter) -> bool:
        """Returns True if the surface is prepared. The first call starts the preparation."""
        return self._get_solver(puppet).find_prepared(puppet) is not None

    def keep_only(self, ids: set[str]) -> None:
        """Discards the solvers of removed puppets."""
        self._solvers = {name: solver for name, solver in self._solvers.items() if name in ids}

    def _get_solver(self, puppet: ExampleCharacter) -> SurfaceSolver:
        solver = self._solvers.get(puppet.id)
        if solver is None or solver.mesh is not puppet.mesh or solver.settings is not puppet.surface:
            solver = self._solvers[puppet.id] = SurfaceSolver(puppet, self._pool, self._toasts)
        return solver
