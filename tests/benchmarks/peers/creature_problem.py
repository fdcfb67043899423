"""Ten random creatures in fast motion: the gap of each frame to the minimum, and its time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import numpy as np
from creatures import Creature, random_creature
from embedded_problem import wait_as_live
from plain_gauss_newton import PlainGaussNewton

from enliven.arrays import Bool, Float
from enliven.deformation.embedded.solver import EmbeddedSettings, EmbeddedSolver

CREATURES = 10
FRAMES = 60
COMPARED = 6
"""The reference is solved in every sixth frame, since it needs half a second."""
FLAT = 0.05
"""Minimum determinant of a node's linear part in the reference. Below it, the node is inverted, which is
invalid for a mesh.
"""
NOTHING = 1e-3
"""Energy below which relative gaps are meaningless."""
REPEATS = 5
WARM = 3
"""Number of frames after the attachment that are left out."""


@dataclass
class CreatureRun:
    """All creatures of one size.

    Attributes:
        frame_ms: milliseconds of each frame.
        gaps: for each compared frame, its excess over the minimum, relative to the minimum.
        said: True for those of the same frames in which the solver reported convergence.
    """

    frame_ms: Float
    gaps: Float
    said: Bool


@cache
def make_creatures(nodes: int) -> list[Creature]:
    """Returns the ten creatures of one size."""
    return [random_creature(seed, nodes, FRAMES) for seed in range(CREATURES)]


def measure_frames(nodes: int, compare: bool, budget_ms: float = 0.0) -> CreatureRun:
    """Returns the shortest time of each frame in several passes, and the gaps to a plain Gauss-Newton that
    starts from the results.
    """
    times, gaps, settled = [], [], []
    for creature in make_creatures(nodes):
        solver = EmbeddedSolver(creature.graph, creature.points, EmbeddedSettings(budget_ms=budget_ms))
        peer, passes = PlainGaussNewton(creature.graph, creature.points), []
        for turn in range(REPEATS):
            solver.reset()
            each = []
            for frame, targets in enumerate(creature.targets):
                wait_as_live(solver)
                start = time.thread_time_ns()
                solver.solve(targets)
                each.append(1e-6 * (time.thread_time_ns() - start))
                if compare and turn == 0 and frame >= WARM and frame % COMPARED == 0:
                    differences = _compute_gap(peer, solver, targets)
                    gaps += differences
                    settled += [solver.is_settled] * len(differences)
            passes.append(each)
        times.append(np.min(passes, 0)[WARM:])
    return CreatureRun(np.concatenate(times), np.array(gaps), np.array(settled, bool))


def _compute_gap(peer: PlainGaussNewton, solver: EmbeddedSolver, targets: Float) -> list[float]:
    """Returns the frame's relative excess over the minimum, or an empty list if there is no valid minimum."""
    peer.set_targets(targets)
    x, least, _ = peer.solve(peer.pack(solver.state()), lambda energy: False)
    turned = np.linalg.det(x[: 9 * len(solver.graph.positions)].reshape(-1, 3, 3)).min() < FLAT
    return [] if turned or least < NOTHING else [solver.energy_terms["total"] / least - 1.0]
