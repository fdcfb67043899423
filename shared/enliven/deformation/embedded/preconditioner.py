"""The matrix that preconditions the descent: six unknowns a node, its turn and its shift.

A step is written in node frames (``node_frame``): dR = (w x R) + R S, with w
a turn and S a symmetric stretch, and a shift of its position. In these the second derivative of the energy
falls into two nearly independent parts: E_rot alone holds the stretches, and E_reg, E_con and E_rig alone
hold turns and shifts. So a turn and a shift a node make a sparse system of 6x6 blocks, an eighth of the work
of one with all twelve unknowns, and the stretch of each node is a 3x3 matrix of its own. Against this matrix
the true one has its eigenvalues between 0.35 and 2.6 (a man of 128 and of 256 nodes, walking); that is why
the number of iterations does not grow with the nodes.

Where nodes turn, their lever arms turn with them, so the matrix is made anew whenever it no longer ends a
frame in a few steps.
"""

from __future__ import annotations

from typing import NamedTuple

from enliven.arrays import Float, Float32, Int32
from enliven.deformation.embedded.assembly import assemble
from enliven.deformation.embedded.block_cholesky import factorise, substitute
from enliven.kernels import copy_row, njit

_TIKHONOV = 1e-4
"""Keeps the matrix definite where nothing holds a node; the energy itself has no such term."""


class RigidSystem(NamedTuple):
    """The factor, its pattern, and the state and weights that it was made at.

    Attributes:
        start, row, product: of :class:`enliven.deformation.embedded.block_cholesky.BlockPattern`.
        edge_block: (E,) int32 the block that couples the ends of an edge.
        pair_block: (L, 10) int32 the blocks that couple a constraint's nodes: (0, 0), (1, 0), (1, 1), ...
        lower, upper: (48 B,) float32 the blocks of the factor, and transposed.
        linear: (9 N,) the columns of each node's R.
        compliance: (9 N,) the inverse of what holds each node's stretch.
        pulls: (L,) the constraints' weights that are in it.
        side: (8 N,) float32 room for the right-hand side.
    """

    start: Int32
    row: Int32
    product: Int32
    edge_block: Int32
    pair_block: Int32
    lower: Float32
    upper: Float32
    linear: Float
    compliance: Float
    pulls: Float
    side: Float32


@njit(cache=True, nogil=True)
def outdated(t, planes, s, repulled):  # type: ignore[no-untyped-def]
    """Kernel: whether the matrix was made for other constraints: a weight has changed by the part
    ``repulled`` of the strongest, or there are planes, which are others in every frame.
    """
    strongest, change = 0.0, 0.0
    for m in range(t.pulls.shape[0]):
        strongest = max(strongest, t.pulls[m])
        change = max(change, abs(t.pulls[m] - s.pulls[m]))
    # The first number of a factor is the inverse of a root; 0 where there is no factor yet.
    return s.lower[0] == 0.0 or planes.nodes.shape[0] > 0 or change > repulled * strongest


@njit(cache=True, nogil=True)
def refactor(x, t, planes, s):  # type: ignore[no-untyped-def]
    """Kernel: make and factorise the matrix at ``x``."""
    for j in range(s.start.shape[0] - 1):
        for c in range(3):
            for a in range(3):
                s.linear[9 * j + 3 * c + a] = x[16 * j + 4 * c + a]
    copy_row(s.pulls, t.pulls)
    ridge = _TIKHONOV
    while True:
        assemble(t, planes, s, ridge)
        if factorise(s.start, s.row, s.product, s.lower, s.upper) or ridge > 1e6:
            return
        ridge *= 100.0


@njit(cache=True, nogil=True)
def precondition(s, way):  # type: ignore[no-untyped-def]
    """Kernel: replace ``way`` (16 N,), a force in node frames, by the step that the matrix makes
    of it.

    The second derivative is twice the matrix, so everything is halved.
    """
    side = s.side
    count = s.start.shape[0] - 1
    for j in range(count):
        g, y = 16 * j, 8 * j
        for a in range(3):
            side[y + a], side[y + 3 + a] = way[g + a], way[g + 4 + a]
    substitute(s.start, s.row, s.lower, s.upper, side)
    for j in range(count):
        g, y = 16 * j, 8 * j
        for a in range(3):
            way[g + a], way[g + 4 + a] = 0.5 * side[y + a], 0.5 * side[y + 3 + a]
        _stretch_of(s.compliance, 9 * j, way, g + 8)


@njit(cache=True, nogil=True)
def _stretch_of(c, at, way, g):  # type: ignore[no-untyped-def]
    """The stretch that a force F makes: S of (S C + C S) / 2 = F / 2, by S = (F C⁻¹ + C⁻¹ F) / 4, which is
    exact where C is a multiple of I. Of the force's off-diagonal numbers each stands for two entries.
    """
    f00, f11, f22 = way[g], way[g + 1], way[g + 2]
    f01, f02, f12 = 0.5 * way[g + 4], 0.5 * way[g + 5], 0.5 * way[g + 6]
    c00, c01, c02, c11, c12, c22 = c[at], c[at + 1], c[at + 2], c[at + 4], c[at + 5], c[at + 8]
    way[g] = 0.5 * (f00 * c00 + f01 * c01 + f02 * c02)
    way[g + 1] = 0.5 * (f01 * c01 + f11 * c11 + f12 * c12)
    way[g + 2] = 0.5 * (f02 * c02 + f12 * c12 + f22 * c22)
    way[g + 4] = 0.25 * (f00 * c01 + f01 * c11 + f02 * c12 + f01 * c00 + f11 * c01 + f12 * c02)
    way[g + 5] = 0.25 * (f00 * c02 + f01 * c12 + f02 * c22 + f02 * c00 + f12 * c01 + f22 * c02)
    way[g + 6] = 0.25 * (f01 * c02 + f11 * c12 + f12 * c22 + f02 * c01 + f12 * c11 + f22 * c12)
