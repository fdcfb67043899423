"""Computes the next matrix of the preconditioner on a second thread, between two frames.

Within a frame, this computation would take half of the time with 1,024 nodes, and would make single frames
slow. The next frame always uses the matrix that was started at the end of the last frame, and waits for it if
necessary. So the same input gives the same result on fast and slow machines. Like any matrix, it rotates with
the nodes (``preconditioner.align_with_nodes``).
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache

from enliven.arrays import Float
from enliven.deformation.embedded.energy import EnergyTerms, SolverPlanes
from enliven.deformation.embedded.preconditioner import RigidSystem, refactorize_matrix
from enliven.kernels import HeldArguments, hold

_MIN_NODES_FOR_RENEWAL = 200
"""Number of nodes above which a matrix is computed after every frame. With fewer nodes, waking the thread
and moving the matrix between the cores' caches takes as long as the steps that it saves."""


@cache
def _second_thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-matrix")


class MatrixRenewal:
    """The matrix in use, and buffers for its successor.

    Args:
        system: an empty system, which defines the sizes of the buffers.
        always: True to compute a matrix after every frame, even for small graphs.

    Attributes:
        system, held_arguments: the matrix in use, and its prepared form as an argument of kernels.
        always: True if a matrix is computed after every frame, False if only after the old one is outdated.
    """

    def __init__(self, system: RigidSystem, always: bool) -> None:
        self._systems: list[tuple[RigidSystem, HeldArguments]] = [
            (twin, hold(twin)) for twin in (system, system.create_empty_copy())
        ]
        self.always = always or len(system.start) > _MIN_NODES_FOR_RENEWAL
        self._pending: Future[None] | None = None

    @property
    def system(self) -> RigidSystem:
        """The matrix that the solver currently uses."""
        return self._systems[0][0]

    @property
    def held_arguments(self) -> HeldArguments:
        """The matrix in use, prepared as an argument of kernels."""
        return self._systems[0][1]

    def start_next_matrix(self, x: Float, terms: EnergyTerms, planes: SolverPlanes, raw: Float) -> None:
        """Starts to compute the matrix at ``x`` (16 N,) in the background, with ``raw`` (16 N,) = dE/dx.

        The arguments must not change until :meth:`switch_to_latest_matrix` is called.
        """
        self._pending = _second_thread().submit(
            refactorize_matrix, x, terms, planes, raw, self._systems[1][0]
        )

    def switch_to_latest_matrix(self) -> bool:
        """Waits until the matrix that was started is complete, and switches to it. Returns False if none was
        started."""
        if self._pending is None:
            return False
        self._pending.result()
        self._pending = None
        self._systems.reverse()
        return True
