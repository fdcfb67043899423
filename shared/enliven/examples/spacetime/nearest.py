"""The energy of a control point at a pose: the nearest examples, and how well their weights explain the pose.

For frame i and pair p, let j be the joint and j_e its position in the nearest examples. The energy of weights
w is

    |sum_e w_e (j_e - j)|^2  +  affine^2 (sum_e w_e - 1)^2  +  sum_e t_e w_e^2            (eq. 14, 16)

with positions in units of the performer's size. The first two terms are the paper's, in a form that is
invariant to the performer's position. t_e grows with the distance of example e from the pose and is zero at
the example itself. So if the pose equals an example, its weight is one and all others are zero (law 3). If
many weights explain a pose, near examples are preferred. When an example is about to leave the set of nearest
examples, its t_e grows without bound. So its weight is zero when another example replaces it, and weights
change continuously.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleSettings
from enliven.examples.poses import Examples
from enliven.examples.spacetime.bounded import BoundedQuadratics
from enliven.kernels import njit

_MIN_EXCLUDED_DISTANCE = 1e-6
"""Minimum relative distance to the first example that is not in the set of nearest examples. It limits t_e of
an example that is about to leave the set."""


class Nearest:
    """The poses (F, P, 3) of a motion, prepared for comparisons with the examples."""

    def __init__(self, examples: Examples, settings: ExampleSettings, poses: Float) -> None:
        size, middle = examples.source_size, examples.targets.mean(0)
        self._settings = settings
        self._seen = np.ascontiguousarray(np.swapaxes(poses, 0, 1)) / size
        self._known = np.ascontiguousarray(np.swapaxes(examples.sources, 0, 1)) / size
        self._goals = (
            np.ascontiguousarray(np.swapaxes(examples.targets - middle, 0, 1)) / examples.target_size
        )
        self._whole = np.zeros((len(poses), len(examples)))
        add_pose_distances(self._seen, self._known, self._whole)

    def nodes(self, points: Sequence[int], spare: BoundedQuadratics | None = None) -> BoundedQuadratics:
        """Computes the energies of some control points at all frames, with E = min(n, nearest) weights each.

        The energies are w' matrix w / 2 - right' w plus a constant. ``reach`` contains the control points'
        positions in the examples relative to their centre, in units of the mesh's size. If ``spare`` (nodes
        of the same number of points) is given, the results are written into it.
        """
        frames, count = self._whole.shape
        weight_count = min(self._settings.nearest, count)
        result = spare or BoundedQuadratics.empty(len(points), frames, weight_count)
        cost_weights = (self._settings.affine**2, self._settings.far, self._settings.pose)
        for i, p in enumerate(points):
            point_inputs = self._seen[p], self._known[p], self._goals[p], self._whole
            compute_energies(*point_inputs, *cost_weights, result.matrix[i], result.right[i], result.reach[i])
        result.reset_bounds(self._settings.slack)
        return result


@njit(cache=True, nogil=True)
def add_pose_distances(seen, known, out):
    """Kernel: adds the mean square distance of joints (P, F, 3) from examples (P, n, 3) to ``out`` (F, n)."""
    pairs, frames, count = seen.shape[0], seen.shape[1], known.shape[1]
    for p in range(pairs):
        for f in range(frames):
            x, y, z = seen[p, f, 0], seen[p, f, 1], seen[p, f, 2]
            for e in range(count):
                dx, dy, dz = known[p, e, 0] - x, known[p, e, 1] - y, known[p, e, 2] - z
                out[f, e] += (dx * dx + dy * dy + dz * dz) / pairs


@njit(cache=True, nogil=True)
def compute_energies(seen, known, goals, whole, affine, far, pose, matrix, right, reach):
    """Kernel: fills ``matrix``, ``right`` and ``reach`` (F, E, ...) of one point; see :meth:`Nearest.nodes`.

    ``seen`` (F, 3) is its joint, ``known`` (n, 3) the joint in the examples, and ``goals`` (n, 3) the control
    point in the examples. ``whole`` (F, n) contains the distances of the poses from the examples.
    """
    frames, most = right.shape
    count = len(known)
    distance, order, away = np.empty(count), np.empty(count, np.int64), np.empty((most, 3))
    for f in range(frames):
        for e in range(count):
            dx, dy, dz = known[e, 0] - seen[f, 0], known[e, 1] - seen[f, 1], known[e, 2] - seen[f, 2]
            distance[e] = dx * dx + dy * dy + dz * dz + pose * whole[f, e]
        _partial_sort(distance, order, min(most + 1, count))
        edge = distance[order[most]] if most < count else np.inf
        for a in range(most):
            e = order[a]
            for i in range(3):
                away[a, i] = known[e, i] - seen[f, i]
                reach[f, a, i] = goals[e, i]
            for b in range(a + 1):
                product = away[a, 0] * away[b, 0] + away[a, 1] * away[b, 1] + away[a, 2] * away[b, 2]
                matrix[f, a, b] = product + affine
                matrix[f, b, a] = product + affine
            matrix[f, a, a] += far * distance[e] / max(1.0 - distance[e] / edge, _MIN_EXCLUDED_DISTANCE)
            right[f, a] = affine


@njit(cache=True, nogil=True)
def _partial_sort(distance, order, wanted):
    """Writes the indices of the ``wanted`` smallest values of ``distance`` to the start of ``order``,
    ascending."""
    held = 0
    for e in range(len(distance)):
        if held == wanted and distance[e] >= distance[order[held - 1]]:
            continue
        at = held if held < wanted else held - 1
        while at > 0 and distance[order[at - 1]] > distance[e]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = e
        held = min(held + 1, wanted)
