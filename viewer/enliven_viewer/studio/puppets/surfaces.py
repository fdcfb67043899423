"""The solved surfaces of puppets: each mesh is prepared once, large ones in a thread."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from enliven.arrays import Float
from enliven.deformation.puppet_surface import PuppetSurface
from enliven.errors import EnlivenError
from enliven.puppet import Puppet
from enliven_viewer.studio.puppets.kept import size_of
from enliven_viewer.studio.toasts import Toasts

_AT_ONCE = 4000
"""Vertices up to which a mesh is prepared without a thread: less than a tenth of a second."""
_SLOW = 30_000
"""Vertices from which it is worth telling, and from which scrubbing does not settle every frame."""
_STILL = 1e-4
_MOST_ROUNDS = 60


class Surfaces:
    """The solvers of all puppets, by id.

    Args:
        toasts: where it is told that something takes a moment, or cannot be.
    """

    def __init__(self, toasts: Toasts) -> None:
        self._toasts = toasts
        self._known: dict[str, _Solver] = {}
        self._threads: ThreadPoolExecutor | None = None
        self._others: ThreadPoolExecutor | None = None
        self.version = 0

    def of(self, puppet: Puppet, places: Float, *, warm: bool) -> Float:
        """(V, 3) metres in the mesh's frame, the surface when the control points are at ``places`` (P, 3).

        At rest while the mesh is being prepared. Where the places cannot be meant, the last good surface.

        Args:
            warm: the next frame of a drag or of a performance; else the same whatever came before.
        """
        solver = self._solver(puppet)
        surface = solver.ready(puppet, self._toasts) if solver is not None else None
        if solver is None or surface is None or not puppet.points:
            return puppet.mesh.vertices
        if not solver.new(places):
            return surface.pose
        small = len(puppet.mesh.vertices) < _SLOW
        if not warm and np.array_equal(places, puppet.rest):
            return solver.rest(surface, places)
        return solver.move(surface, places, settle=not warm and small, toasts=self._toasts)

    def aside(self, puppet: Puppet, places: Float) -> Future[Float] | None:
        """(V, 3) the settled surface at other places (P, 3), what is dragged left as it is; None for none."""
        solver = self._solver(puppet)
        surface = solver.ready(puppet, self._toasts) if solver is not None else None
        if surface is None or not puppet.points:
            return None
        self._others = self._others or ThreadPoolExecutor(1, "another pose")
        return self._others.submit(surface.aside, places)

    def settled(self, puppet: Puppet, many: Sequence[Float]) -> list[Float] | None:
        """(V, 3) the settled surface at each of some places (P, 3); None where that cannot be said."""
        found = [self.aside(puppet, places) for places in many]
        try:
            return [future.result() for future in found if future is not None] if all(found) else None
        except EnlivenError:
            return None

    def improve(self) -> bool:
        """Bring what was dragged nearer to where it comes to rest; whether anything moved."""
        moved = [solver.improve() for solver in self._known.values()]
        if any(moved):
            self.version += 1
        return any(moved)

    def prepared(self, puppet: Puppet) -> bool:
        """Whether the surface can follow; asking begins to prepare it."""
        solver = self._solver(puppet)
        return solver is not None and solver.ready(puppet, self._toasts) is not None

    def keep_only(self, ids: set[str]) -> None:
        """Forget puppets that are gone."""
        self._known = {name: solver for name, solver in self._known.items() if name in ids}

    def _solver(self, puppet: Puppet) -> _Solver | None:
        known = self._known.get(puppet.id)
        if known is None or known.mesh is not puppet.mesh or known.settings is not puppet.surface:
            known = self._known[puppet.id] = self._begun(puppet)
        return known

    def _begun(self, puppet: Puppet) -> _Solver:
        count = len(puppet.mesh.vertices)
        if count > _SLOW:
            self._toasts.say(
                f"{puppet.id} has {count:,} vertices: it takes a moment until it can be dragged",
                "Everything else goes on meanwhile.",
            )
        if count <= _AT_ONCE:
            made: Future[PuppetSurface] = Future()
            try:
                made.set_result(_prepared(puppet))
            except EnlivenError as error:
                made.set_exception(error)
        else:
            self._threads = self._threads or ThreadPoolExecutor(1, "puppet surface")
            made = self._threads.submit(_prepared, puppet)
        return _Solver(puppet, made, told=count <= _SLOW)


def _prepared(puppet: Puppet) -> PuppetSurface:
    held = [point.vertex for point in puppet.points]
    return PuppetSurface(puppet.mesh, held, [point.weight for point in puppet.points], puppet.surface)


def _held_by(puppet: Puppet) -> tuple[tuple[int, float | None], ...]:
    return tuple((point.vertex, point.weight) for point in puppet.points)


class _Solver:
    """One mesh's solver, and what it was asked last."""

    def __init__(self, puppet: Puppet, made: Future[PuppetSurface], *, told: bool) -> None:
        self.mesh, self.settings = puppet.mesh, puppet.surface
        self._made, self._told = made, told
        self._surface: PuppetSurface | None = None
        self._failed = False
        self._held = _held_by(puppet)
        self._places: Float | None = None
        self._rounds = 0

    def ready(self, puppet: Puppet, toasts: Toasts) -> PuppetSurface | None:
        """The surface with the puppet's control points, or None while it is not prepared."""
        if self._failed or not self._made.done():
            return None
        try:
            if self._surface is None:
                self._surface = self._made.result()
                if not self._told:
                    toasts.say(f"{puppet.id} can be dragged now", *self._surface.notes[:1])
            held = _held_by(puppet)
            if held != self._held:
                self._surface.hold([vertex for vertex, _ in held], [weight for _, weight in held])
                self._held, self._places = held, None
        except EnlivenError as error:
            toasts.complain(error)
            self._failed = True
            return None
        return self._surface

    def new(self, places: Float) -> bool:
        """Whether these are other places (P, 3) than last time."""
        return self._places is None or not np.array_equal(places, self._places)

    def rest(self, surface: PuppetSurface, places: Float) -> Float:
        """(V, 3) the mesh at rest, without looking for it."""
        self._places, self._rounds = np.array(places), 0
        surface.hold([vertex for vertex, _ in self._held], [weight for _, weight in self._held])
        return surface.pose

    def move(self, surface: PuppetSurface, places: Float, *, settle: bool, toasts: Toasts) -> Float:
        """(V, 3) the surface at other places; the last good one where they cannot be meant."""
        self._places, self._rounds = np.array(places), 0 if settle else _MOST_ROUNDS
        try:
            return surface.settle(places) if settle else surface.solve(places)
        except EnlivenError as error:
            toasts.complain(error)
            self._rounds = 0
            return surface.pose

    def improve(self) -> bool:
        """One more frame towards rest; whether anything moved."""
        if self._rounds <= 0 or self._surface is None or self._places is None:
            return False
        before = self._surface.pose
        self._rounds -= 1
        after = self._surface.solve(self._places)
        if float(np.abs(after - before).max()) < _STILL * size_of(self.mesh):
            self._rounds = 0
        return True
