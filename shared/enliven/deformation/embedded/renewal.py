"""A matrix made anew on a second thread, between two frames, for the next.

Making it is what made single frames slow: of a frame with 1,024 nodes half. The next frame always takes the
matrix that was made at the end of the last one, and waits for it where it comes early: the same input gives
the same frames, however fast the machine is. It turns with the nodes like any (``preconditioner.align``).
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache

from enliven.arrays import Float
from enliven.deformation.embedded.energy import Planes, Terms
from enliven.deformation.embedded.preconditioner import RigidSystem, refactor
from enliven.kernels import Held, hold

_DEAR = 200
"""Nodes from which on a matrix is made after every frame: with fewer, waking the thread and moving the matrix
from one core's cache to the other's take as long as the steps that it saves."""


@cache
def _second() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-matrix")


class MatrixRenewal:
    """The matrix in use, and room for its successor.

    Args:
        system: empty.
        always: whether a matrix is made after every frame, of small graphs too.

    Attributes:
        system, held: the matrix in use, and the same held.
        always: whether one is made after every frame; else where it has aged.
    """

    def __init__(self, system: RigidSystem, always: bool) -> None:
        self._two: list[tuple[RigidSystem, Held]] = [(made, hold(made)) for made in (system, system.twin())]
        self.always = always or len(system.start) > _DEAR
        self._under_way: Future[None] | None = None

    @property
    def system(self) -> RigidSystem:
        """The matrix in use."""
        return self._two[0][0]

    @property
    def held(self) -> Held:
        """The matrix in use, held."""
        return self._two[0][1]

    def renew(self, x: Float, terms: Terms, planes: Planes, raw: Float) -> None:
        """Begin to make the matrix at ``x`` (16 N,), where ``raw`` (16 N,) is dE/dx.

        Nothing of these may change until :meth:`latest`.
        """
        self._under_way = _second().submit(refactor, x, terms, planes, raw, self._two[1][0])

    def latest(self) -> bool:
        """Take the matrix that was begun into use, once it is done; False where none was."""
        if self._under_way is None:
            return False
        self._under_way.result()
        self._under_way = None
        self._two.reverse()
        return True
