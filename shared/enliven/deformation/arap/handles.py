"""Adds handles to a factor of the Laplacian, exactly and without a new factorization.

Only the Laplacian is factorized (with vertex 0 fixed, which gives one of its solutions). The forces f on the
handle vertices E and a translation c of the whole surface are the solution of

    [ EᵀGE + D   1 ] [ f ]   [ target - EᵀG r ]
    [ 1ᵀ         0 ] [ c ] = [ -1ᵀ r          ]        x = G (r + E f) + c

Here r is the residual, G is the inverse of the factorized matrix, and D is 0 for a hard handle and 2 / weight
for a soft handle. This is exact for both kinds. Let U = C⁻¹ E. It is non-zero only on the path from a handle
to the root of the elimination tree (a few hundred positions), and EᵀGE is UᵀU. So a frame needs one forward
and one backward pass, with a few thousand multiplications between them. Adding a handle needs one column of U
and the inverse of a matrix with the number of handles as its size, but no factorization.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.arap.factor import Factor
from enliven.deformation.arap.solves import solve_for_unit_vector
from enliven.kernels import njit
from enliven.rotation import nearest_quaternion, rotation_matrix


class HandleVertices(NamedTuple):
    """The vertices of all handles (H vertices), and the arrays to solve for the forces on them.

    Attributes:
        places: (H,) the index of each vertex in the solver's order.
        start: (H + 1,) the index at which its column of U begins.
        rows: (K,) the positions of the column's entries in elimination order.
        values: (K,) the values of these entries.
        inverse: (H + 1, H + 1) the inverse of the matrix in the module's docstring.
        soft: (H,) 2 / weight; 0 for a hard handle.
    """

    places: Int32
    start: Int
    rows: Int32
    values: Float
    inverse: Float
    soft: Float


def build_held_vertices(
    factor: Factor,
    eliminated: Int32,
    places: Int,
    soft: Float,
    columns_by_place: dict[int, tuple[Int32, Float]],
) -> HandleVertices:
    """Returns the handle vertices at ``places`` (H,), indices in the solver's order.

    No vertex of a hard handle may occur twice.

    Args:
        eliminated: (V,) the position of each vertex in elimination order.
        soft: (H,) 2 / weight; 0 for a hard handle.
        columns_by_place: cache of the columns of U by position. New columns are added to it.
    """
    for place in set(places.tolist()) - columns_by_place.keys():
        columns_by_place[place] = solve_for_unit_vector(factor, int(eliminated[place]))
    columns = [columns_by_place[place] for place in places.tolist()]
    start = np.concatenate([[0], np.cumsum([len(rows) for rows, _ in columns])]).astype(np.int64)
    rows = np.concatenate([rows for rows, _ in columns])
    values = np.concatenate([column for _, column in columns])
    count = len(places)
    matrix = np.ones((count + 1, count + 1))
    matrix[-1, -1] = 0.0
    _transposed_products(start, rows, values, len(factor.order), matrix)
    matrix[np.arange(count), np.arange(count)] += soft
    return HandleVertices(
        places.astype(np.int32), start, rows, values, np.asarray(np.linalg.inv(matrix), np.float64), soft
    )


@njit(cache=True, nogil=True)
def _transposed_products(start, rows, values, count, matrix):
    """Computes UᵀU into the upper left part of ``matrix``, given the ``count`` columns of U in CSC form."""
    work = np.zeros(count)
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            work[rows[k]] = values[k]
        for j in range(i + 1):
            total = 0.0
            for k in range(start[j], start[j + 1]):
                total += work[rows[k]] * values[k]
            matrix[i, j] = matrix[j, i] = total
        for k in range(start[i], start[i + 1]):
            work[rows[k]] = 0.0


@njit(cache=True, nogil=True)
def solve_handles(held, frames, targets, z):
    """Adds the handle forces to the residual: z = C⁻¹ r becomes C⁻¹ (r + E f). Returns the translation c
    (3,).

    Args:
        frames: (16 V,) the state of the vertices, with the positions at which r was computed.
        targets: (H, 3) metres, the targets of the handle vertices.
        z: (4 V,) float32, in elimination order. The sum of r is 0, because each edge adds to one end what it
            subtracts from the other.
    """
    count = len(held.places)
    right, answer = np.empty((count, 3)), np.zeros((count + 1, 3))
    for h in range(count):
        x = y = w = 0.0
        for k in range(held.start[h], held.start[h + 1]):
            p, u = 4 * held.rows[k], held.values[k]
            x += u * z[p]
            y += u * z[p + 1]
            w += u * z[p + 2]
        at = 16 * held.places[h] + 12
        # Set up the right-hand side: the handle targets minus the positions without handle forces.
        right[h, 0] = targets[h, 0] - frames[at] - x
        right[h, 1] = targets[h, 1] - frames[at + 1] - y
        right[h, 2] = targets[h, 2] - frames[at + 2] - w
    for i in range(count + 1):
        for j in range(count):
            for c in range(3):
                answer[i, c] += held.inverse[i, j] * right[j, c]
    for h in range(count):
        for k in range(held.start[h], held.start[h + 1]):
            p, u = 4 * held.rows[k], held.values[k]
            for c in range(3):
                z[p + c] += u * answer[h, c]
    return answer[count, 0], answer[count, 1], answer[count, 2]


@njit(cache=True, nogil=True)
def move_with_handles(held, frames, shown, targets, share):
    """Moves the whole surface rigidly with the handles, if a rigid motion explains their motion.

    This is the case if the squared distances to the targets after the motion are below the fraction ``share``
    of those before it.

    Without this, a rotation of all handles would reach the inner cells only over many frames.

    Args:
        shown: (V, 3) metres, the positions that were shown last. They are moved too.
    """
    count = len(held.places)
    old, new = np.zeros(3), np.zeros(3)
    for h in range(count):
        for c in range(3):
            old[c] += frames[16 * held.places[h] + 12 + c] / count
            new[c] += targets[h, c] / count
    m, before = np.zeros((3, 3)), 0.0
    for h in range(count):
        for r in range(3):
            before += (targets[h, r] - frames[16 * held.places[h] + 12 + r]) ** 2
            for c in range(3):
                m[r, c] += (targets[h, r] - new[r]) * (frames[16 * held.places[h] + 12 + c] - old[c])
    # If all handles lie on a line, the rotation about this line is undetermined. Adding a tiny multiple of
    # the identity selects the smallest rotation.
    push = 1e-12 * np.abs(m).max()
    for r in range(3):
        m[r, r] += push
    w, x, y, z = nearest_quaternion(m)
    rotation_matrix((w, x, y, z), m)
    after = 0.0
    for h in range(count):
        at = 16 * held.places[h] + 12
        for r in range(3):
            gap = targets[h, r] - new[r]
            for c in range(3):
                gap -= m[r, c] * (frames[at + c] - old[c])
            after += gap * gap
    # If the squared error after the motion lies between ``share`` and twice ``share`` of the error before it,
    # apply only a part of the motion. So small changes of the input cause only small changes of the result.
    part = 2.0 - after / (share * before) if before > 0.0 and share > 0.0 else 0.0
    if part <= 0.0:
        return
    if part < 1.0:
        length = math.sqrt(x * x + y * y + z * z)
        half = part * math.atan2(length, abs(w))
        bend = math.copysign(math.sin(half) / length, w) if length > 0.0 else 0.0
        rotation_matrix((math.cos(half), bend * x, bend * y, bend * z), m)
        for c in range(3):
            new[c] = old[c] + part * (new[c] - old[c])
    for i in range(len(shown)):
        at = 16 * i + 12
        x, y, z = frames[at] - old[0], frames[at + 1] - old[1], frames[at + 2] - old[2]
        u, v, w = shown[i, 0] - old[0], shown[i, 1] - old[1], shown[i, 2] - old[2]
        for r in range(3):
            frames[at + r] = m[r, 0] * x + m[r, 1] * y + m[r, 2] * z + new[r]
            shown[i, r] = m[r, 0] * u + m[r, 1] * v + m[r, 2] * w + new[r]
