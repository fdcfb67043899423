"""A straightforward SciPy implementation of embedded deformation by sparse Gauss-Newton, as a reference for
comparison.

It follows KinÊtre, eq. 3-8, with all twelve unknowns per node and Levenberg damping. The pattern of the
sparse Jacobian is computed once. SciPy computes JᵀJ, and SuperLU factorises it with a symmetric ordering in
every iteration.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, identity, vstack
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Int
from enliven.deformation.constraints.planes import PointConstraints
from enliven.deformation.embedded.solver import EmbeddedSettings
from enliven.deformation.graph.graph import DeformationGraph

State = tuple[Float, Float]


class PlainGaussNewton:
    """The energy of a deformation graph. The unknowns are R (N, 9), row by row, then positions (N, 3)."""

    def __init__(
        self, graph: DeformationGraph, points: PointConstraints, settings: EmbeddedSettings | None = None
    ) -> None:
        self.graph, self.points = graph, points
        self.settings = settings or EmbeddedSettings()
        self._count = len(graph.positions)
        self._rigid = graph.edges[graph.rigid].astype(np.int64)
        self._linear, self._constant = self._linear_part()
        self._pattern, self._hanging = self._quadratic_patterns()

    def _quadratic_patterns(self) -> tuple[tuple[Int, Int], tuple[Int, Int]]:
        """Returns rows and columns of the Jacobians of E_rot and of the rotations in E_rig, in the order of
        their values.
        """
        rows, columns = [], []
        for node in range(self._count):
            for c in range(3):
                for d in range(3):
                    for a in range(3):
                        # d(RᵀR)_cd / dR_ac = R_ad, and / dR_ad = R_ac.
                        rows += [9 * node + 3 * c + d] * 2
                        columns += [9 * node + 3 * a + c, 9 * node + 3 * a + d]
        pattern = np.array(rows), np.array(columns)
        # E_rig's (R_kᵀ R_j)_cd, by R_k's (a, c), and by R_j's (a, d).
        m, c, d, a = np.meshgrid(np.arange(len(self._rigid)), *[np.arange(3)] * 3, indexing="ij")
        j, k = self._rigid[m, 0], self._rigid[m, 1]
        row, of_k, of_j = 9 * m + 3 * c + d, 9 * k + 3 * a + c, 9 * j + 3 * a + d
        return pattern, (np.stack([row, row], -1).ravel(), np.stack([of_k, of_j], -1).ravel())

    def _linear_part(self) -> tuple[csr_matrix, Float]:
        """Returns E_reg and E_con as residual = matrix x - constant. The last rows belong to the targets."""
        graph, points, count = self.graph, self.points, self._count
        i = np.concatenate([graph.edges[:, 0], graph.edges[:, 1]]).astype(np.int64)
        j = np.concatenate([graph.edges[:, 1], graph.edges[:, 0]]).astype(np.int64)
        arms, smooth = graph.positions[j] - graph.positions[i], np.sqrt(self.settings.smoothness)
        rows, columns, values = [], [], []
        for a in range(3):
            row = 3 * np.arange(len(i)) + a
            for c in range(3):
                rows, columns = [*rows, row], [*columns, 9 * i + 3 * a + c]
                values.append(smooth * arms[:, c])
            for node, sign in ((i, 1.0), (j, -1.0)):
                rows, columns = [*rows, row], [*columns, 9 * count + 3 * node + a]
                values.append(np.full(len(i), sign * smooth))
        rigid, hang = self._rigid, np.sqrt(self.settings.rigidity)
        for a in range(3):
            row = 3 * len(i) + 3 * np.arange(len(rigid)) + a
            for side, sign in ((1, 1.0), (0, -1.0)):
                rows, columns = [*rows, row], [*columns, 9 * count + 3 * rigid[:, side] + a]
                values.append(np.full(len(rigid), sign * hang))
        first, pull = 3 * len(i) + 3 * len(rigid), np.sqrt(self.settings.constraint)
        for k in range(4):
            node, weight = points.node_indices[:, k].astype(np.int64), points.node_weights[:, k]
            arm = points.points - graph.positions[node]
            for a in range(3):
                row = first + 3 * np.arange(len(node)) + a
                for c in range(3):
                    rows, columns = [*rows, row], [*columns, 9 * node + 3 * a + c]
                    values.append(pull * weight * arm[:, c])
                rows, columns = [*rows, row], [*columns, 9 * count + 3 * node + a]
                values.append(pull * weight)
        shape = first + 3 * len(points.points), 12 * count
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        constant = np.zeros(shape[0])
        along = graph.positions[rigid[:, 1]] - graph.positions[rigid[:, 0]]
        constant[3 * len(i) : first] = hang * along.ravel()
        return csr_matrix(entries, shape), constant

    def set_targets(self, targets: Float) -> None:
        """Sets the targets of the points, (L, 3)."""
        self._constant[-3 * len(targets) :] = np.sqrt(self.settings.constraint) * targets.ravel()

    def pack(self, state: State) -> Float:
        """Packs (linear parts, positions) into the unknowns."""
        return np.concatenate([state[0].ravel(), state[1].ravel()])

    def residuals(self, x: Float) -> Float:
        """Returns all weighted residuals."""
        r = x[: 9 * self._count].reshape(-1, 3, 3)
        turned = np.swapaxes(r, 1, 2) @ r - np.eye(3)
        apart = np.swapaxes(r[self._rigid[:, 1]], 1, 2) @ r[self._rigid[:, 0]] - np.eye(3)
        return np.concatenate(
            [
                np.sqrt(self.settings.rotation) * turned.ravel(),
                np.sqrt(self.settings.rigidity) * apart.ravel(),
                self._linear @ x - self._constant,
            ]
        )

    def _jacobian(self, x: Float) -> csc_matrix:
        r = x[: 9 * self._count].reshape(-1, 3, 3)
        values = np.empty((self._count, 3, 3, 3, 2))
        for c in range(3):
            for d in range(3):
                values[:, c, d, :, 0] = r[:, :, d]
                values[:, c, d, :, 1] = r[:, :, c]
        weight = np.sqrt(self.settings.rotation)
        shape = 9 * self._count, 12 * self._count
        upper = csr_matrix((weight * values.ravel(), self._pattern), shape)
        rj, rk = r[self._rigid[:, 0]], r[self._rigid[:, 1]]
        # Both indexed (m, c, d, a): R_j's (a, d), and R_k's (a, c).
        by_k = np.broadcast_to(np.swapaxes(rj, 1, 2)[:, None], (len(rj), 3, 3, 3))
        by_j = np.broadcast_to(np.swapaxes(rk, 1, 2)[:, :, None], (len(rk), 3, 3, 3))
        values = np.sqrt(self.settings.rigidity) * np.stack([by_k, by_j], -1).ravel()
        hanging = csr_matrix((values, self._hanging), (9 * len(rj), 12 * self._count))
        return vstack([upper, hanging, self._linear]).tocsc()

    def solve(self, x: Float, done: Callable[[float], bool], most: int = 100) -> tuple[Float, float, int]:
        """Iterates from ``x`` until ``done`` (called with the energy) or until nothing decreases. Returns x,
        energy, iterations."""
        value, damping = self.residuals(x), 1e-6
        energy = float(value @ value)
        for iteration in range(most):
            if done(energy):
                return x, energy, iteration
            jacobian = self._jacobian(x)
            normal, force = (jacobian.T @ jacobian).tocsc(), -(jacobian.T @ value)
            while True:
                factor = splu(
                    normal + damping * identity(len(x), format="csc"),
                    permc_spec="MMD_AT_PLUS_A",
                    diag_pivot_thresh=0.0,
                    options={"SymmetricMode": True},
                )
                ahead = x + factor.solve(force)
                trial = self.residuals(ahead)
                if trial @ trial < energy or damping > 1e8:
                    break
                damping *= 10.0
            if damping > 1e8:
                return x, energy, iteration
            x, value, damping = ahead, trial, max(damping / 10.0, 1e-9)
            fallen, energy = energy - float(trial @ trial), float(trial @ trial)
            if fallen <= 1e-9 * energy:
                return x, energy, iteration + 1
        return x, energy, most
