"""Embedded deformation solved for every frame: analyse once, factor when a weight changes, solve often.

KinÊtre, eq. 8, is minimised by L-BFGS, preconditioned with one constant matrix. E_reg and E_con are linear
least squares and the same for each coordinate; with E_rot and E_rig taken as in the rest pose they make one
symmetric system of four unknowns a node, which is factorised in 4x4 blocks
(:mod:`enliven.deformation.block_cholesky`). An iteration is a gradient, a solve with that factor, and an
exact step: along a line the energy is a polynomial of degree four, so the best step is known and the energy
never rises.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.block_cholesky import analyse, elimination_order
from enliven.deformation.descent import Memory, assemble, solve_frame
from enliven.deformation.energy import Terms, gradient
from enliven.deformation.graph import DeformationGraph
from enliven.errors import InputError
from enliven.settings import setting

_FARTHEST = 1e4
"""Metres; a target farther away than this is no measurement."""


@dataclass(frozen=True)
class EmbeddedSettings:
    """The weights of the energy (Sumner et al. 2007; KinÊtre, eq. 8) and how far to go in a frame."""

    rotation: float = setting(1.0, "Weight of E_rot: how little a node may stretch.", low=0.0)
    smoothness: float = setting(10.0, "Weight of E_reg: how much neighbours agree.", low=0.0)
    constraint: float = setting(100.0, "Weight of E_con: how hard the body pulls.", low=0.0)
    rigidity: float = setting(1.0, "Weight of E_rig at loose parts; the paper's is smoothness / 10.", low=0.0)
    rigid_translation: Literal["printed", "turning"] = setting(
        "printed",
        "E_rig compares translations as eq. 7 prints it, which resists turning a loose part with the whole, "
        "or in the middle of the edge, which does not.",
    )
    iterations: int = setting(20, "Most iterations in a frame.", low=1, high=1000)
    tolerance: float = setting(
        1e-4,
        "A frame is done when an iteration promises to lower the energy by less than this part.",
        low=0.0,
    )


class PointConstraints(Protocol):
    """Points of the rest space and the nodes that move them; an Attachment is one, or several together."""

    @property
    def points(self) -> Float:
        """(L, 3) metres."""

    @property
    def node_indices(self) -> Int32:
        """(L, 4) nodes."""

    @property
    def node_weights(self) -> Float:
        """(L, 4) weights that sum to one."""


class EmbeddedSolver:
    """Moves a graph's nodes so that the constrained points go to their targets; warm from frame to frame.

    Args:
        graph: the deformation graph.
        attachment: the constraints; none at all leaves the graph where it is.
        settings: weights and limits.
        start: (N, 3, 3) linear parts and (N, 3) positions to start from; at rest where None.
    """

    def __init__(
        self,
        graph: DeformationGraph,
        attachment: PointConstraints,
        settings: EmbeddedSettings | None = None,
        start: tuple[Float, Float] | None = None,
    ) -> None:
        self.graph = graph
        self.settings = settings or EmbeddedSettings()
        count = len(graph.positions)
        nodes = np.ascontiguousarray(attachment.node_indices, np.int32).reshape(-1, 4)
        pairs = np.concatenate([graph.edges.astype(np.int64), *_pairs_of(nodes)])
        self._order = elimination_order(count, pairs)
        place = np.empty(count, np.int64)
        place[self._order] = np.arange(count)
        self._terms = self._terms_of(attachment, nodes, place)
        self._pattern = analyse(count, place[pairs])
        self._blocks = np.empty((self._pattern.blocks, 4, 4))
        self._factored = np.full(len(nodes), np.nan)
        self._memory = Memory.empty(count)
        self._rest = np.empty((count, 4, 3))
        self._rest[:, :3] = np.eye(3)
        self._rest[:, 3] = graph.positions[self._order]
        self._x = self._rest.copy()
        self.energy: dict[str, float] = {}
        self.iterations = 0
        self.reset(start)

    def _terms_of(self, attachment: PointConstraints, nodes: Int32, place: Int) -> Terms:
        """The energy's constants, with the nodes numbered in elimination order."""
        graph, settings = self.graph, self.settings
        weights = np.asarray(attachment.node_weights, np.float64).reshape(-1, 4)
        points = np.asarray(attachment.points, np.float64).reshape(-1, 3)
        arms = points[:, None] - graph.positions[nodes]
        rows = np.concatenate([arms, np.ones((len(nodes), 4, 1))], -1) * weights[..., None]
        edges = graph.edges
        return Terms(
            edges=place[edges].astype(np.int32),
            offsets=np.ascontiguousarray(graph.positions[edges[:, 1]] - graph.positions[edges[:, 0]]),
            rigid=np.flatnonzero(graph.rigid).astype(np.int32),
            turning=float(settings.rigid_translation == "turning"),
            nodes=place[nodes].astype(np.int32),
            rows=np.ascontiguousarray(rows),
            targets=points.copy(),
            pulls=np.ones(len(points)),
            weights=np.array(
                [settings.rotation, settings.smoothness, settings.constraint, settings.rigidity]
            ),
        )

    def reset(self, start: tuple[Float, Float] | None = None) -> None:
        """Go to ``start`` (linear parts, positions), or to rest."""
        if start is None:
            self._x[:] = self._rest
        else:
            self._x[:, :3] = np.swapaxes(start[0], 1, 2)[self._order]
            self._x[:, 3] = start[1][self._order]
        self._memory = Memory.empty(len(self._x))
        self._report()

    def solve(self, targets: Float, weights: Float | None = None) -> tuple[Float, Float]:
        """Minimise the energy, starting from the last frame's answer.

        Args:
            targets: (L, 3) metres, q_l; a point whose target is not finite, or farther than 10 km, is free.
            weights: (L,) not negative, how much each constraint counts; 1 where None.

        Returns:
            (N, 3, 3) the nodes' linear parts R_j and (N, 3) their positions g_j + t_j; always finite.
        """
        self._take(targets, weights)
        if not np.array_equal(self._terms.pulls, self._factored):
            assemble(self._terms, self._pattern.start, self._pattern.row, self._pattern.product, self._blocks)
            self._factored = self._terms.pulls.copy()
        self.iterations = solve_frame(
            self._x,
            self._rest,
            self._terms,
            self._pattern.start,
            self._pattern.row,
            self._blocks,
            self._memory,
            self.settings.iterations,
            self.settings.tolerance,
        )
        self._report()
        return self.state()

    def state(self) -> tuple[Float, Float]:
        """(N, 3, 3) linear parts and (N, 3) positions as they are."""
        linear, positions = np.empty((len(self._x), 3, 3)), np.empty((len(self._x), 3))
        linear[self._order] = np.swapaxes(self._x[:, :3], 1, 2)
        positions[self._order] = self._x[:, 3]
        return linear, positions

    def _take(self, targets: Float, weights: Float | None) -> None:
        """Copy the frame's targets and weights, those that cannot be meant left out."""
        terms = self._terms
        targets = np.asarray(targets, np.float64)
        pulls = np.ones(len(terms.pulls)) if weights is None else np.asarray(weights, np.float64)
        if targets.shape != terms.targets.shape or pulls.shape != terms.pulls.shape:
            raise InputError(
                f"targets {targets.shape} and weights {pulls.shape} for {len(terms.pulls)} constraints",
                where="embedded deformation",
            )
        usable = (np.abs(targets) < _FARTHEST).all(1) & (pulls > 0) & np.isfinite(pulls)
        terms.targets[:] = np.where(usable[:, None], targets, 0.0)
        terms.pulls[:] = np.where(usable, pulls, 0.0)

    def _report(self) -> None:
        """Fill ``energy`` with each term, weighted, and their sum."""
        parts = gradient(self._x, self._terms, np.empty_like(self._x))
        names = ("rotation", "smoothness", "constraint", "rigidity", "total")
        self.energy = dict(zip(names, parts, strict=True))


def _pairs_of(nodes: Int32) -> list[Int]:
    """The pairs of nodes that a constraint couples."""
    return [nodes[:, [a, b]].astype(np.int64) for a in range(4) for b in range(a)]
