"""Ten random creatures in fast motion: how near each frame comes to the minimum, and how long it takes."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import numpy as np
from creatures import Creature, random_creature
from embedded_problem import as_live
from plain_gauss_newton import PlainGaussNewton

from enliven.arrays import Bool, Float
from enliven.deformation.embedded.solver import EmbeddedSettings, EmbeddedSolver

CREATURES = 10
FRAMES = 60
COMPARED = 6
"""Every so many frames the reference is solved too: it needs half a second for one."""
FLAT = 0.05
"""The determinant below which the reference has turned a node inside out, which is no answer for a mesh."""
NOTHING = 1e-3
"""An energy below which parts of it mean nothing."""
REPEATS = 5
WARM = 3
"""Frames after the hold that are left out."""


@dataclass
class CreatureRun:
    """All creatures of one size.

    Attributes:
        frame_ms: milliseconds of each frame.
        gaps: of each frame that was compared, the share of the minimum by which it ended above it.
        said: of the same, whether the frame said that it is at its minimum.
    """

    frame_ms: Float
    gaps: Float
    said: Bool


@cache
def creatures(nodes: int) -> list[Creature]:
    """The ten of one size."""
    return [random_creature(seed, nodes, FRAMES) for seed in range(CREATURES)]


def measured(nodes: int, compare: bool, budget_ms: float = 0.0) -> CreatureRun:
    """The least time of each frame in several passes; gaps to a plain Gauss-Newton from the answers."""
    times, gaps, said = [], [], []
    for creature in creatures(nodes):
        solver = EmbeddedSolver(creature.graph, creature.points, EmbeddedSettings(budget_ms=budget_ms))
        peer, passes = PlainGaussNewton(creature.graph, creature.points), []
        for turn in range(REPEATS):
            solver.reset()
            each = []
            for frame, targets in enumerate(creature.targets):
                as_live(solver)
                start = time.thread_time_ns()
                solver.solve(targets)
                each.append(1e-6 * (time.thread_time_ns() - start))
                if compare and turn == 0 and frame >= WARM and frame % COMPARED == 0:
                    found = _gap(peer, solver, targets)
                    gaps += found
                    said += [solver.settled] * len(found)
            passes.append(each)
        times.append(np.min(passes, 0)[WARM:])
    return CreatureRun(np.concatenate(times), np.array(gaps), np.array(said, bool))


def _gap(peer: PlainGaussNewton, solver: EmbeddedSolver, targets: Float) -> list[float]:
    """The share of the minimum by which the frame is above it, or nothing where there is no such answer."""
    peer.aim(targets)
    x, least, _ = peer.solve(peer.pack(solver.state()), lambda energy: False)
    turned = np.linalg.det(x[: 9 * len(solver.graph.positions)].reshape(-1, 3, 3)).min() < FLAT
    return [] if turned or least < NOTHING else [solver.energy["total"] / least - 1.0]
