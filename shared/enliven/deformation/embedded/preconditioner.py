"""The matrix that preconditions the descent: six unknowns per node, its rotation and its translation.

A step is written in node frames (``node_frame``): a rotation w and a symmetric stretch S of R, and a
translation of the position. In these, the second derivative of the energy has two parts: E_rot constrains the
stretches, and E_reg, E_con and E_rig constrain rotations and translations. So one rotation and one
translation per node form a sparse system of 6x6 blocks, with an eighth of the work of a system with all
twelve unknowns. The stretch of each node is a separate 6x6 matrix. Points that pull at a node's side couple
the two parts. Most of this coupling disappears if each stretch is combined with the response of its node's
rotation and translation (``node_blocks``). Relative to this matrix, the true second derivative has
eigenvalues between 0.46 and 1.7 in the test with a possessed chair. Without this combination, they are
between 0.2 and 2.4.

The matrix rotates with the nodes (``align_with_nodes``), as in corotational finite elements. So it becomes
outdated only when neighbours rotate relative to each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Float32, Int16, Int32
from enliven.deformation.embedded.assembly import assemble_matrix
from enliven.deformation.embedded.block_cholesky import (
    SIZE,
    SOLVING_SIZE,
    BlockPattern,
    factorise,
    substitute,
    weighted_row_sum,
)
from enliven.deformation.embedded.energy import EnergyTerms
from enliven.kernels import copy_row, njit
from enliven.lanes import (
    apart8,
    cross4,
    fma4,
    load4,
    load8,
    narrowed4,
    splat4,
    splat8,
    store4,
    store8,
    storeq,
    together8,
    total4,
    turned8,
)

_NO_LENGTH = 1e-30
"""Squared metres that are added to prevent a division by 0 for a column of zero length."""
_TIKHONOV_WEIGHT = 1e-4
"""Tikhonov regularization that keeps the matrix definite if nothing constrains a node; the energy itself
has no such term."""


class RigidSystem(NamedTuple):
    """The factorized matrix of the preconditioner, its pattern, and the state and weights for which it was
    computed.

    Attributes:
        start, row, product, row_start, column, by_row: the fields of
            :class:`enliven.deformation.embedded.block_cholesky.BlockPattern`.
        unit: the unit of translations in metres, a power of two near the length of an edge. So the numbers of
            a block have similar sizes for any size of the mesh, and int16 is precise enough for all of them.
        edge_block: (E,) int32 the block that couples the ends of an edge.
        pair_block: (L, 10) int32 the blocks that couple a constraint's nodes: (0, 0), (1, 0), (1, 1), ...
        lower: (48 B,) float32 the matrix, which the factorization overwrites.
        room: (48 C,) float32 scratch space for the longest column.
        rows, scales, inverse: (36 (B - N) + 8,) int16, (B - N,) and (48 N,) float32 the factor.
        linear, frames: (9 N,) and (12 N,) the columns of each node's R, and those orthonormalized with a 0.
        turns: (24 N,) float32 each node's rotation since the factorization, in rows of four, and the
            transpose of this rotation.
        held, first: (9 N,), (3 N,) the sums of w u uᵀ and w u over the arms u that pull at a node.
        coupling, coupled: (48 N,) float32 the rotation and translation that respond to each number of a
            node's stretch, and their transpose.
        compliance: (48 N,) float32 the inverse of each node's stretch block.
        pulls: (L,) the constraints' weights that are included.
        side: (8 N,) float32 scratch space for the right-hand side.
    """

    start: Int32
    row: Int32
    product: Int32
    row_start: Int32
    column: Int32
    by_row: Int32
    unit: float
    edge_block: Int32
    pair_block: Int32
    lower: Float32
    room: Float32
    rows: Int16
    scales: Float32
    inverse: Float32
    linear: Float
    frames: Float
    turns: Float32
    held: Float
    first: Float
    coupling: Float32
    coupled: Float32
    compliance: Float32
    pulls: Float
    side: Float32

    @staticmethod
    def empty(pattern: BlockPattern, terms: EnergyTerms) -> RigidSystem:
        """Returns empty buffers for the matrix, with the blocks of each edge and constraint."""
        count = len(terms.stretch)
        ends = np.sort(terms.edges.astype(np.int64), 1)[:, ::-1]
        places = [(a, b) for a in range(4) for b in range(a + 1)]
        nodes = terms.nodes.astype(np.int64)
        pairs = np.stack([nodes[:, list(pair)] for pair in places], 1)
        return RigidSystem(
            pattern.start,
            pattern.row,
            pattern.product,
            pattern.row_start,
            pattern.column,
            pattern.by_row,
            _translation_unit(terms.offsets),
            pattern.block_of(ends),
            pattern.block_of(pairs.reshape(-1, 2)).reshape(-1, len(places)),
            np.zeros(SIZE * pattern.blocks, np.float32),
            np.zeros(SIZE * pattern.max_blocks_per_column, np.float32),
            np.zeros(SOLVING_SIZE * len(pattern.column) + 8, np.int16),
            np.zeros(len(pattern.column), np.float32),
            np.zeros(SIZE * count, np.float32),
            np.zeros(9 * count),
            np.zeros(12 * count),
            np.zeros(24 * count, np.float32),
            np.zeros(9 * count),
            np.zeros(3 * count),
            np.zeros(SIZE * count, np.float32),
            np.zeros(SIZE * count, np.float32),
            np.zeros(SIZE * count, np.float32),
            np.zeros(len(nodes)),
            np.zeros(8 * count, np.float32),
        )

    def create_empty_copy(self) -> RigidSystem:
        """Returns empty buffers for another matrix of the same pattern."""
        pattern = ("start", "row", "product", "row_start", "column", "by_row", "unit")
        pattern += ("edge_block", "pair_block")
        return self._replace(**{n: np.zeros_like(v) for n, v in self._asdict().items() if n not in pattern})


def _translation_unit(offsets: Float) -> float:
    """Returns the power of two nearest to the root mean square length of (E, 3) offsets, or 1 if there are
    none.
    """
    square = float(np.sum(offsets**2)) / max(1, len(offsets))
    return 2.0 ** round(0.5 * np.log2(square)) if square > 0.0 else 1.0


@njit(cache=True, nogil=True)
def _node_units(unit):
    """Returns (8,) float32 the units of a node's rotation (3) and translation (3), and two zeros."""
    out = np.zeros(8, np.float32)
    out[:3], out[3:6] = np.float32(1.0), np.float32(unit)
    return out


@njit(cache=True, nogil=True)
def _scale_to_units(lower, unit):
    """Scales the translations of the matrix's blocks (48 B,) to units of ``unit`` metres."""
    turns = _node_units(unit)
    row = load8(turns, 0)
    for block in range(0, lower.shape[0], SIZE):
        for r in range(6):
            at = block + 8 * r
            store8(lower, at, splat8(turns[r]) * row * load8(lower, at))


@njit(cache=True, nogil=True)
def is_outdated(t, planes, s, repulled):
    """Returns True if the matrix was computed for other constraints.

    This is the case if a weight has changed by more than the fraction ``repulled`` of the strongest weight,
    or if there are planes, which change in every frame.
    """
    strongest, change = 0.0, 0.0
    for m in range(t.pulls.shape[0]):
        strongest = max(strongest, t.pulls[m])
        change = max(change, abs(t.pulls[m] - s.pulls[m]))
    # A zero as the first number of the inverse means that no factorization has been computed yet.
    return s.inverse[0] == 0.0 or planes.nodes.shape[0] > 0 or change > repulled * strongest


@njit(cache=True, nogil=True)
def refactorize_matrix(x, t, planes, raw, s):
    """Computes and factorizes the matrix at the state ``x``, given ``raw`` (16 N,) = dE/dx."""
    for j in range(s.start.shape[0] - 1):
        for c in range(3):
            for a in range(3):
                s.linear[9 * j + 3 * c + a] = x[16 * j + 4 * c + a]
        a, b, c = _orthonormal_columns(x, 16 * j)
        store4(s.frames, 12 * j, a)
        store4(s.frames, 12 * j + 4, b)
        store4(s.frames, 12 * j + 8, c)
        for i in range(24):
            s.turns[24 * j + i] = np.float32(1.0 if i % 12 % 5 == 0 else 0.0)
    copy_row(s.pulls, t.pulls)
    ridge = _TIKHONOV_WEIGHT
    while True:
        assemble_matrix(x, t, planes, raw, s, ridge)
        _scale_to_units(s.lower, s.unit)
        pattern = (s.start, s.product, s.by_row)
        if factorise(pattern, s.lower, s.room, s.rows, s.scales, s.inverse) or ridge > 1e6:
            return
        ridge *= 100.0


@njit(cache=True, nogil=True)
def _orthonormal_columns(x, at):
    """Returns three orthonormal columns, from the first two of the R at ``at`` (Gram-Schmidt)."""
    a, b = load4(x, at), load4(x, at + 4)
    a = splat4(1.0 / np.sqrt(total4(a * a) + _NO_LENGTH)) * a
    b = fma4(-total4(a * b), a, b)
    b = splat4(1.0 / np.sqrt(total4(b * b) + _NO_LENGTH)) * b
    return a, b, cross4(a, b)


@njit(cache=True, nogil=True)
def align_with_nodes(x, s):
    """Rotates the matrix with the nodes: computes each node's rotation since the factorization into
    ``s.turns``.

    The rotation is N Uᵀ, where N is the orthonormal frame now, and U is the frame at the factorization. The
    transpose is stored after it.
    """
    frames, turns = s.frames, s.turns
    now = np.empty(12)
    for j in range(s.start.shape[0] - 1):
        at, to = 12 * j, 24 * j
        a, b, c = _orthonormal_columns(x, 16 * j)
        p, q, r = load4(frames, at), load4(frames, at + 4), load4(frames, at + 8)
        store4(now, 0, a)
        store4(now, 4, b)
        store4(now, 8, c)
        for k in range(3):
            forth = fma4(now[k], p, fma4(now[4 + k], q, splat4(now[8 + k]) * r))
            back = fma4(frames[at + k], a, fma4(frames[at + 4 + k], b, splat4(frames[at + 8 + k]) * c))
            storeq(turns, to + 4 * k, narrowed4(forth))
            storeq(turns, to + 12 + 4 * k, narrowed4(back))


@njit(cache=True, nogil=True)
def apply_preconditioner(s, way):
    """Replaces the force ``way`` (16 N,) in node frames by the preconditioned step.

    The second derivative is twice the matrix, so everything is halved.
    """
    side, half, units = s.side, splat8(np.float32(0.5)), load8(_node_units(s.unit), 0)
    count = s.start.shape[0] - 1
    for j in range(count):
        turn, stretch, y, at = 16 * j, 16 * j + 8, 8 * j, SIZE * j
        store8(side, y, together8(turned8(s.turns, 24 * j, half * load8(way, turn))))
        force = together8(half * load8(way, stretch)) + weighted_row_sum(s.coupled, at, side, y)
        store8(way, stretch, force)
        store8(way, stretch, weighted_row_sum(s.compliance, at, way, stretch))
        store8(side, y, units * load8(side, y))
    substitute(s.row_start, s.column, s.rows, s.scales, s.inverse, side)
    for j in range(count):
        turn, stretch = 16 * j, 16 * j + 8
        own = units * load8(side, 8 * j) + weighted_row_sum(s.coupling, SIZE * j, way, stretch)
        store8(way, turn, turned8(s.turns, 24 * j + 12, apart8(own)))
        store8(way, stretch, apart8(load8(way, stretch)))
