"""Solves all transforms of a frame of a baked surface together, by least squares.

If the weights are known, a frame's surface is linear in its K affine maps. The matrix of this least-squares
system is the same for all frames, so it is factored once. The vertices of a frame are only needed for its
right-hand side of 12 numbers per transform. All other steps use these numbers.

A glTF node can only represent maps of the form A = R Q diag(s) Q', with constant axes Q per transform. Maps
of this form are fitted transform by transform (B. H. Le and Z. Deng, "Smooth skinning decomposition with
rigid bones", 2012, section 4.2, extended by scale).
"""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Float, Int32
from enliven.kernels import njit
from enliven.rotation import nearest_quaternion, nearest_rotation, rotation_matrix

_PIVOT_WEIGHT = 1e-6
"""Weight that keeps a pivot at the position given by its rotation if the surface does not determine it."""
_GLOBAL_ROTATION_WEIGHT = 1e-3
"""Weight of the whole surface's rotation in the fit of each transform's rotation. It resolves the ambiguity
if a transform's vertices are on a line."""
_TRANSFORM_SWEEPS = 4
"""Number of passes over all transforms, each solved with the others fixed."""
_MIN_SCALE = 0.1
"""Minimum scale along an axis. A smaller one would flatten the part, and its inverse would lose precision."""
_MAX_SCALE = 10.0
"""Maximum scale along an axis, the inverse of the minimum."""


class Maps:
    """A solver for the maps of frames with given weights.

    Args:
        rest: (V, 3) metres.
        pivots: (K, 3) metres.
        indices, weights: (V, 4) int32 and float64.
        rigid: weight of the regularization towards a rotation, for directions in which the surface does not
            determine the map.

    Attributes:
        axes: (K, 3, 3) the axes Q of the scales, or None if any maps are allowed.
    """

    def __init__(self, rest: Float, pivots: Float, indices: Int32, weights: Float, rigid: float) -> None:
        self._parts = (rest, pivots, indices, weights)
        count = len(pivots)
        self._gram = compute_gram_matrix(*self._parts)
        flat = self._gram.reshape(4 * count, 4 * count)
        spread = np.array([np.trace(self._gram[k, :3, k, :3]) / 3 for k in range(count)])
        mass = np.array([self._gram[k, 3, k, 3] for k in range(count)])
        typical = max(float(spread.mean()), 1e-30)
        self._pull = np.empty((count, 4))
        # A transform with few vertices would stretch wildly to fit them. So its regularization uses the mean
        # of its own spread and the typical spread.
        self._pull[:, :3] = (rigid * (spread + typical) / 2)[:, None]
        self._pull[:, 3] = _PIVOT_WEIGHT * mass + 1e-9 * max(float(mass.mean()), 1e-30)
        flat[np.diag_indices(4 * count)] += self._pull.ravel()
        self._factor = cholesky_factor(flat)
        self._sums = first_moments(*self._parts)
        self.axes: Float | None = None

    def solve_maps(self, vertices: Float) -> Float:
        """Solves for the least-squares maps (F, K, 4, 3) of the frames ``vertices`` (V, F, 3). A map moves a
        vertex v to (v - pivot, 1) map.
        """
        frames = vertices.shape[1]
        moments = compute_moments(*self._parts, np.ascontiguousarray(vertices).reshape(len(vertices), -1))
        right = np.ascontiguousarray(moments.reshape(-1, 4, frames, 3).transpose(2, 0, 1, 3))
        turns, places = self._fit_rigid_motions(right)
        right[:, :, :3] += self._pull[None, :, :3, None] * turns
        right[:, :, 3] += self._pull[None, :, 3, None] * places
        count = right.shape[1]
        flat = right.reshape(frames, 4 * count, 3).transpose(1, 0, 2).reshape(4 * count, 3 * frames)
        solution = (
            scipy.linalg.cho_solve((self._factor, True), flat, check_finite=False)
            .reshape(4 * count, frames, 3)
            .transpose(1, 0, 2)
        )
        maps = np.ascontiguousarray(solution).reshape(frames, count, 4, 3)
        if self.axes is not None:
            restrict_to_separable(self._gram, right, self.axes, _TRANSFORM_SWEEPS, maps)
        return maps

    def find_axes(self, maps: Float) -> None:
        """Sets the axes to the principal stretch directions of maps (F, K, 4, 3) over all frames."""
        self.axes = stretch_axes(maps[:, :, :3].transpose(0, 1, 3, 2))

    def _fit_rigid_motions(self, right: Float) -> tuple[Float, Float]:
        """Fits a rigid motion per frame to the vertices of each transform.

        Returns:
            (F, K, 3, 3) transposed rotations, and (F, K, 3) positions of the pivots after the motion.
        """
        weight = np.maximum(self._sums[:, 3], 1e-30)
        centre, moved_centre = self._sums[:, :3] / weight[:, None], right[:, :, 3] / weight[None, :, None]
        moment = right[:, :, :3] - self._sums[None, :, :3, None] * moved_centre[:, :, None]
        global_moment = moment.sum(1, keepdims=True)
        size = np.abs(moment).sum((2, 3), keepdims=True)
        size = np.maximum(size, 1e-9 * size.max(1, keepdims=True))
        shared = global_moment / np.maximum(np.abs(global_moment).sum((2, 3), keepdims=True), 1e-300)
        rotations = nearest_rotation(moment + _GLOBAL_ROTATION_WEIGHT * size * shared)
        return rotations, moved_centre - np.einsum("ka,fkab->fkb", centre, rotations)


def stretch_axes(linear: Float) -> Float:
    """Returns (K, 3, 3) rotations. Their columns are the principal stretch directions of maps (F, K, 3, 3)
    over all frames.
    """
    strain = np.einsum("fkba,fkbc->fkac", linear, linear) - np.eye(3)
    axes = np.linalg.eigh(np.einsum("fkab,fkbc->kac", strain, strain))[1]
    axes[np.linalg.det(axes) < 0, :, 0] *= -1.0
    axes[np.abs(strain).max((0, 2, 3)) < 1e-6] = np.eye(3)
    return np.ascontiguousarray(axes)


@njit(cache=True, nogil=True, fastmath=True)
def cholesky_factor(matrix):
    """Computes the lower Cholesky factor of a positive definite matrix (N, N).

    LAPACK would split this small task among threads. On busy cores the threads wait for one another, which
    took thirty times as long.
    """
    lower = np.zeros_like(matrix)
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / lower[j, j]
    return lower


@njit(cache=True, nogil=True)
def compute_moments(rest, pivots, indices, weights, vertices):
    """Computes the right-hand side (K, 4, 3 F) of the least squares: sum_v w (v - pivot, 1) x', with x from
    ``vertices`` (V, 3 F)."""
    out = np.zeros((len(pivots), 4, vertices.shape[1]))
    for v in range(len(rest)):
        for s in range(4):
            w, k = weights[v, s], indices[v, s]
            if w <= 0.0:
                continue
            a, b = w * (rest[v, 0] - pivots[k, 0]), w * (rest[v, 1] - pivots[k, 1])
            c = w * (rest[v, 2] - pivots[k, 2])
            for j in range(vertices.shape[1]):
                x = vertices[v, j]
                out[k, 0, j] += a * x
                out[k, 1, j] += b * x
                out[k, 2, j] += c * x
                out[k, 3, j] += w * x
    return out


@njit(cache=True, nogil=True)
def first_moments(rest, pivots, indices, weights):
    """Computes the first moments (K, 4) of the weights: sum_v w (v - pivot, 1)."""
    out = np.zeros((len(pivots), 4))
    for v in range(len(rest)):
        for s in range(4):
            w, k = weights[v, s], indices[v, s]
            for a in range(3):
                out[k, a] += w * (rest[v, a] - pivots[k, a])
            out[k, 3] += w
    return out


@njit(cache=True, nogil=True)
def compute_gram_matrix(rest, pivots, indices, weights):
    """Computes the Gram matrix (K, 4, K, 4) of the least squares: sum_v w_k w_l (v - pivot_k, 1)(v - pivot_l,
    1)'."""
    count = len(pivots)
    out = np.zeros((count, 4, count, 4))
    row = np.empty((4, 4))
    for v in range(len(rest)):
        for s in range(4):
            for a in range(3):
                row[s, a] = weights[v, s] * (rest[v, a] - pivots[indices[v, s], a])
            row[s, 3] = weights[v, s]
        for s in range(4):
            if weights[v, s] <= 0.0:
                continue
            for r in range(4):
                if weights[v, r] > 0.0:
                    for a in range(4):
                        for b in range(4):
                            out[indices[v, s], a, indices[v, r], b] += row[s, a] * row[r, b]
    return out


@njit(cache=True, nogil=True)
def restrict_to_separable(gram, right, axes, sweeps, maps):
    """Restricts ``maps`` (F, K, 4, 3) in place to the form R Q diag(s) Q', one transform at a time.

    The best rotation, scales and position of each transform are computed with the others fixed. Its part of
    the system reduces to |(A - A_k) H^(1/2)|², and A_k and H follow from the elimination of its position.
    """
    frames, count = maps.shape[0], maps.shape[1]
    linked = np.zeros((count, count), np.bool_)
    for k in range(count):
        for m in range(count):
            linked[k, m] = k != m and np.abs(gram[k, :, m, :]).max() > 0.0
    for f in range(frames):
        for sweep in range(sweeps):
            for k in range(count):
                left = right[f, k].copy()
                for m in range(count):
                    if linked[k, m]:
                        for a in range(4):
                            for b in range(4):
                                g = gram[k, a, m, b]
                                for e in range(3):
                                    left[a, e] -= g * maps[f, m, b, e]
                _solve_transform(gram[k, :, k, :], left, axes[k], sweep == 0, maps[f, k])


@njit(cache=True, nogil=True)
def _solve_transform(own, left, axes, fresh, found):
    """Computes the best map R Q diag(s) Q' and position of one transform, and writes them to ``found`` (4,
    3)."""
    mass = own[3, 3]
    # Find N = A H by eliminating the position. Rows are world axes, and columns are the scale axes.
    flat, spread = np.zeros((3, 3)), np.zeros((3, 3))
    for a in range(3):
        for e in range(3):
            flat[e, a] = left[a, e] - own[a, 3] * left[3, e] / mass
            spread[a, e] = own[a, e] - own[a, 3] * own[3, e] / mass
    flat = flat @ axes
    spread = axes.T @ spread @ axes
    turned = np.ascontiguousarray(found[:3].T) @ axes
    scale = np.empty(3)
    for a in range(3):
        scale[a] = min(max(np.sqrt((turned[:, a] ** 2).sum()), _MIN_SCALE), _MAX_SCALE)
    turn = np.empty((3, 3))
    for _ in range(3 if fresh else 2):
        rotation_matrix(nearest_quaternion(flat * scale), turn)
        for a in range(3):
            along = turn[0, a] * flat[0, a] + turn[1, a] * flat[1, a] + turn[2, a] * flat[2, a]
            scale[a] = min(max(along / max(spread[a, a], 1e-300), _MIN_SCALE), _MAX_SCALE)
    linear = (turn * scale) @ axes.T
    for a in range(3):
        for e in range(3):
            found[a, e] = linear[e, a]
    for e in range(3):
        total = left[3, e]
        for a in range(3):
            total -= own[3, a] * found[a, e]
        found[3, e] = total / mass


@njit(cache=True, nogil=True)
def skin_one_frame(rest, pivots, indices, weights, maps, out):
    """Computes the vertices skinned by one frame's ``maps`` (K, 4, 3), and writes them to ``out`` (V, 3)."""
    for v in range(len(rest)):
        p = q = r = 0.0
        for s in range(4):
            w, k = weights[v, s], indices[v, s]
            if w <= 0.0:
                continue
            a, b, c = rest[v, 0] - pivots[k, 0], rest[v, 1] - pivots[k, 1], rest[v, 2] - pivots[k, 2]
            m = maps[k]
            p += w * (a * m[0, 0] + b * m[1, 0] + c * m[2, 0] + m[3, 0])
            q += w * (a * m[0, 1] + b * m[1, 1] + c * m[2, 1] + m[3, 1])
            r += w * (a * m[0, 2] + b * m[1, 2] + c * m[2, 2] + m[3, 2])
        out[v, 0], out[v, 1], out[v, 2] = p, q, r


@njit(cache=True, nogil=True)
def add_errors(rest, pivots, indices, weights, maps, wanted, squares, worst):
    """Measures the square errors of skinned vertices relative to their true positions ``wanted`` (V, F, 3).

    The errors are added to ``squares`` (V,), and their maximum is kept in ``worst`` (V,).

    Returns the largest square error of each frame (F,).
    """
    of_frame = np.zeros(maps.shape[0])
    out = np.empty((len(rest), 3))
    for f in range(maps.shape[0]):
        skin_one_frame(rest, pivots, indices, weights, maps[f], out)
        for v in range(len(rest)):
            x, y, z = out[v, 0] - wanted[v, f, 0], out[v, 1] - wanted[v, f, 1], out[v, 2] - wanted[v, f, 2]
            off = x * x + y * y + z * z
            squares[v] += off
            worst[v] = max(worst[v], off)
            of_frame[f] = max(of_frame[f], off)
    return of_frame
