"""What a pose says about a control point: the nearest examples and how well their weights explain it.

Of frame i and pair p, with the joint at j and the examples j_e nearest to it, the energy of weights w is

    |sum_e w_e (j_e - j)|^2  +  affine^2 (sum_e w_e - 1)^2  +  sum_e t_e w_e^2            (eq. 14, 16)

in sizes of the performer. The first two are the paper's, written so that moving the performer moves nothing.
t_e grows with the distance of example e from the pose and is zero at the example itself: so there its weight
is one and all others are zero (law 3), and of many weights that explain a pose the near ones are taken. As an
example leaves the nearest, its t_e grows without bound: nothing jumps when another takes its place.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float
from enliven.examples.poses import Examples
from enliven.examples.settings import ExampleSettings

_LEAVING = 1e-6
"""Least share of the room that an example still has before it is one of the nearest no more."""


class Nearest:
    """The energies of all frames and pairs, of E = min(n, nearest) weights each.

    Attributes:
        chosen: (P, F, E) int32 which examples.
        matrix: (P, F, E, E) and ``right`` (P, F, E): the energy is w' matrix w / 2 - right' w + a constant.
        reach: (P, F, E, 3) the examples' control points from their middle, in sizes of the mesh.
    """

    def __init__(self, examples: Examples, settings: ExampleSettings, poses: Float) -> None:
        pairs, frames = len(examples.points), len(poses)
        most = min(settings.nearest, len(examples))
        size = examples.source_size
        seen = np.ascontiguousarray(np.swapaxes(poses, 0, 1)) / size
        known = np.ascontiguousarray(np.swapaxes(examples.sources, 0, 1)) / size
        middle = examples.targets.mean(0)
        goals = np.ascontiguousarray(np.swapaxes(examples.targets - middle, 0, 1)) / examples.target_size
        whole = np.zeros((frames, len(examples)))
        self.chosen = np.empty((pairs, frames, most), np.int32)
        self.matrix = np.empty((pairs, frames, most, most))
        self.right = np.empty((pairs, frames, most))
        self.reach = np.empty((pairs, frames, most, 3))
        whole_distances(seen, known, whole)
        how = (settings.affine**2, settings.far, settings.pose)
        energies(seen, known, goals, whole, *how, self.chosen, self.matrix, self.right, self.reach)


@njit(cache=True, nogil=True)
def whole_distances(seen, known, out):  # type: ignore[no-untyped-def]
    """Kernel: ``out`` (F, n) adds up the mean square distance of joints (P, F, 3) from examples (P, n, 3)."""
    pairs, frames, count = seen.shape[0], seen.shape[1], known.shape[1]
    for p in range(pairs):
        for f in range(frames):
            x, y, z = seen[p, f, 0], seen[p, f, 1], seen[p, f, 2]
            for e in range(count):
                dx, dy, dz = known[p, e, 0] - x, known[p, e, 1] - y, known[p, e, 2] - z
                out[f, e] += (dx * dx + dy * dy + dz * dz) / pairs


@njit(cache=True, nogil=True)
def energies(seen, known, goals, whole, affine, far, pose, chosen, matrix, right, reach):  # type: ignore[no-untyped-def]
    """Kernel: fills ``chosen``, ``matrix``, ``right`` and ``reach`` of :class:`Nearest`."""
    pairs, frames, most = chosen.shape
    count = known.shape[1]
    distance, order, cost = np.empty(count), np.empty(count, np.int64), np.empty(most)
    away = np.empty((most, 3))
    for p in range(pairs):
        for f in range(frames):
            for e in range(count):
                dx, dy, dz = (
                    known[p, e, 0] - seen[p, f, 0],
                    known[p, e, 1] - seen[p, f, 1],
                    known[p, e, 2] - seen[p, f, 2],
                )
                distance[e] = dx * dx + dy * dy + dz * dz + pose * whole[f, e]
            _first(distance, order, min(most + 1, count))
            edge = distance[order[most]] if most < count else np.inf
            for a in range(most):
                e = order[a]
                chosen[p, f, a] = e
                cost[a] = far * distance[e] / max(1.0 - distance[e] / edge, _LEAVING)
                right[p, f, a] = affine
                for i in range(3):
                    away[a, i] = known[p, e, i] - seen[p, f, i]
                    reach[p, f, a, i] = goals[p, e, i]
            for a in range(most):
                for b in range(a + 1):
                    product = away[a, 0] * away[b, 0] + away[a, 1] * away[b, 1] + away[a, 2] * away[b, 2]
                    matrix[p, f, a, b] = product + affine
                    matrix[p, f, b, a] = product + affine
                matrix[p, f, a, a] += cost[a]


@njit(cache=True, nogil=True)
def _first(distance, order, wanted):  # type: ignore[no-untyped-def]
    """The ``wanted`` smallest of ``distance`` come first in ``order``, ascending."""
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
