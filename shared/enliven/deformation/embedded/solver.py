"""The embedded deformation solver. It analyses the pattern of its matrix once, and factorizes the matrix
again only when it is outdated.

The energy (KinÊtre, eq. 8) is minimized by L-BFGS. The preconditioner is a matrix of six unknowns per node, a
rotation and a translation, and a block of each node's stretch
(:mod:`enliven.deformation.embedded.preconditioner`), factorized in 6x6 blocks (``block_cholesky``). Steps are
taken in the nodes' own frames, along rotations and stretches that cannot turn a node inside out
(``node_frame``). A full step is taken if it lowers the energy, and a shorter step otherwise.

The matrix rotates with the nodes: each node's rotation since the factorization is applied before and after
it. In a test with a dancing creature of 128 nodes, its eigenvalues relative to the true second derivative are
between 0.15 and 5.6 after thirty frames. Without this rotation, they are between 0.007 and 91. So the matrix
is kept for many frames, as long as that lowers their mean number of steps, including the cost of a new matrix
(``lbfgs.is_aged``).

A frame is complete after a step with a small predicted decrease: half of g.Bg, where B is the inverse of the
matrix, updated by L-BFGS. If the matrix is accurate, this bounds the distance to the minimum. If the last
steps gained more than predicted, the energy is softer than the matrix, and a ten times smaller prediction is
required. Of 16,300 frames of creatures in fast motion, 29 ended more than 0.2 % above the minimum. In these
frames a limb was about to buckle, which the gradient does not show. ``is_settled`` is then False
(``final_refinement``), and the next frame starts from the lower state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints.planes import PlaneConstraints, PointConstraints
from enliven.deformation.embedded.block_cholesky import elimination_order, find_block_pattern
from enliven.deformation.embedded.budget import measure_allowance
from enliven.deformation.embedded.energy import EnergyTerms, compute_energy_gradient
from enliven.deformation.embedded.final_refinement import find_lower_state
from enliven.deformation.embedded.frame import SolverState, next_frame
from enliven.deformation.embedded.inputs import (
    NO_PLANES,
    check_stiffness,
    coefficient_rows,
    convert_planes,
    copy_usable_targets,
    sort_by_node,
)
from enliven.deformation.embedded.lbfgs import UNLIMITED, SolverBuffers, record_energies, reset_age
from enliven.deformation.embedded.node_frame import state_from_unknowns
from enliven.deformation.embedded.preconditioner import RigidSystem
from enliven.deformation.embedded.renewal import MatrixRenewal
from enliven.deformation.graph.graph import DeformationGraph
from enliven.errors import InputError
from enliven.kernels import hold
from enliven.settings import parameter, setting

_STALE_MATRIX_AGE = 1 << 30
"""Value of the step count that marks a matrix as outdated, so that it is always computed again."""
_MAX_STILL_FRAME_STEPS = 2
"""Maximum number of steps of a frame that has moved so little that its matrix is not computed again."""


@dataclass(frozen=True)
class EmbeddedSettings:
    """The weights of the energy (Sumner et al. 2007; KinÊtre, eq. 8) and the stopping criteria of a frame."""

    rotation: float = parameter(1.0, "Weight of E_rot: resistance of nodes to stretching.", low=0.0)
    smoothness: float = setting(
        10.0, "Weight of E_reg: neighbouring nodes move alike. Raise it for stiffer bending.", low=0.0
    )
    constraint: float = parameter(
        100.0, "Weight of E_con: attraction of the mesh to the performer's body.", low=0.0
    )
    rigidity: float = parameter(
        1.0, "Weight of E_rig: rigidity of loosely connected parts. The paper uses smoothness / 10.", low=0.0
    )
    rigid_translation: Literal["printed", "turning"] = parameter(
        "printed",
        "How E_rig compares translations. 'printed' follows eq. 7 and resists a rotation of "
        "loose parts with the whole mesh. 'turning' compares at the middle of each edge and "
        "allows this rotation.",
    )
    planes: float = parameter(
        10.0, "Weight of the soft plane constraints for floor, self-contact and observed depth.", low=0.0
    )
    iterations: int = parameter(60, "Maximum number of iterations per frame.", low=1, high=3000)
    budget_ms: float = setting(
        0.0,
        "Approximate time limit per frame. If the time is too short, later frames continue "
        "from the unfinished result. 0 removes the limit, so that results are repeatable.",
        low=0.0,
        high=1000.0,
        unit="ms",
    )
    tolerance: float = parameter(
        1e-4,
        "The solver ends a frame if the energy decreases by less than this relative amount. "
        "Lower values are more exact and slower.",
        low=0.0,
    )


class EmbeddedSolver:
    """A solver that moves a graph's nodes so that the constrained points reach their targets. Each frame
    starts from the result of the last frame.

    Args:
        graph: the deformation graph.
        attachment: the constrained points. Without any point, the graph does not move.
        settings: weights of the energy, and limits of a frame.
        start: (N, 3, 3) linear parts and (N, 3) positions of the initial state. None starts at rest.
        stiffness: (N,) above 0, factors on E_rot, E_reg and E_rig around each node (an edge uses the
            geometric mean of its ends). A part is stiffer if its factor is above 1. Below 1 it is softer,
            which exaggerates its motion.

    Attributes:
        iterations: number of iterations of the last frame.
        unknowns: (N, 4, 4) the unknowns of the nodes, in the order of elimination: R_j^T and g_j + t_j.
        terms: the constants of the energy.
        planes: the soft planes of the last frame.
        work: buffers of the descent, with the gradient and the energies of the last frame.
    """

    def __init__(
        self,
        graph: DeformationGraph,
        attachment: PointConstraints,
        settings: EmbeddedSettings | None = None,
        start: tuple[Float, Float] | None = None,
        stiffness: Float | None = None,
    ) -> None:
        self.graph = graph
        self.settings = settings or EmbeddedSettings()
        count = len(graph.positions)
        nodes = np.ascontiguousarray(attachment.node_indices, np.int32).reshape(-1, 4)
        node_pairs = [nodes[:, [a, b]] for a in range(4) for b in range(a)]
        pairs = np.concatenate([graph.edges, *node_pairs]).astype(np.int64)
        self._order = elimination_order(count, pairs)
        self._place = np.empty(count, np.int64)
        self._place[self._order] = np.arange(count)
        self.terms = self._build_terms(attachment, check_stiffness(stiffness, count))
        system = RigidSystem.empty(find_block_pattern(count, self._place[pairs]), self.terms)
        self._matrix = MatrixRenewal(system, self.settings.budget_ms > 0.0)
        self.work = SolverBuffers.empty(count)
        self._rest = np.zeros((count, 4, 4))
        self._rest[:, :3, :3] = np.eye(3)
        self._rest[:, 3, :3] = graph.positions[self._order]
        self.unknowns = self._rest.copy()
        self._ones = np.ones(len(nodes))
        self.planes, self._held_planes = NO_PLANES, hold(NO_PLANES)
        self.iterations = 0
        self._lower: list[Float | None] = []
        self.reset(start)
        self._held_state = hold(self._create_state(self.settings))

    def _build_terms(self, attachment: PointConstraints, stiffness: Float) -> EnergyTerms:
        """Returns the energy's constants, with the nodes numbered in elimination order."""
        graph, settings = self.graph, self.settings
        nodes, rows = coefficient_rows(attachment, graph.positions, self._place)
        held_start, held_by, arms = sort_by_node(nodes, rows, len(graph.positions))
        edges, rigid = graph.edges, np.flatnonzero(graph.rigid).astype(np.int32)
        edge_stiffness = np.sqrt(stiffness[edges[:, 0]] * stiffness[edges[:, 1]])
        return EnergyTerms(
            edges=self._place[edges].astype(np.int32),
            offsets=np.ascontiguousarray(graph.positions[edges[:, 1]] - graph.positions[edges[:, 0]]),
            rigid=rigid,
            turning=float(settings.rigid_translation == "turning"),
            nodes=nodes,
            rows=rows,
            held_start=held_start,
            held_by=held_by,
            arms=arms,
            forces=np.zeros(4 * len(nodes)),
            targets=np.zeros((len(nodes), 4)),
            pulls=np.zeros(len(nodes)),
            stretch=settings.rotation * stiffness[self._order],
            smooth=settings.smoothness * edge_stiffness,
            hanging=settings.rigidity * edge_stiffness[rigid],
        )

    def _create_state(self, settings: EmbeddedSettings) -> SolverState:
        """Returns the state that persists between frames. With a budget, the cost of a step is measured at
        the current state."""
        x, rest, terms, work = self.unknowns.reshape(-1), self._rest.reshape(-1), self.terms, self.work
        allowance = UNLIMITED
        if settings.budget_ms > 0.0:
            allowance = measure_allowance(settings.budget_ms, x, terms, self.planes, self.current_matrix)
        limits = int(settings.iterations), float(settings.tolerance), allowance
        return SolverState(x, rest, self._order, terms, work, float(settings.constraint), *limits)

    def reset(self, start: tuple[Float, Float] | None = None) -> None:
        """Moves the nodes to ``start`` (linear parts, positions), or to rest if it is None."""
        self._matrix.switch_to_latest_matrix()
        if start is None:
            self.unknowns[:] = self._rest
        else:
            self.unknowns[:, :3, :3] = np.swapaxes(start[0], 1, 2)[self._order]
            self.unknowns[:, 3, :3] = start[1][self._order]
        self.work.last[:] = self.unknowns.reshape(-1)
        self.work.age[:] = 1, 0, 1, _STALE_MATRIX_AGE
        self._lower.clear()
        record_energies(
            self.work,
            compute_energy_gradient(self.unknowns.reshape(-1), self.terms, self.planes, self.work.raw),
        )

    def solve(
        self, targets: Float, weights: Float | None = None, planes: PlaneConstraints | None = None
    ) -> tuple[Float, Float]:
        """Minimizes the energy, starting from the last frame's result.

        Args:
            targets: (L, 3) metres, q_l. A point with a target that is not finite, or farther than 10 km, is
                free.
            weights: (L,) the weight of each constraint, not negative. If None, all weights are 1.
            planes: soft planes of this frame.

        Returns:
            (N, 3, 3) the nodes' linear parts R_j and (N, 3) their positions g_j + t_j. Both are always
            finite.
        """
        if self._matrix.switch_to_latest_matrix():
            reset_age(self.work.age)
        targets, weights = self._check_targets(targets, weights)
        if planes is not None or self.planes is not NO_PLANES:
            self.planes = convert_planes(planes, self.settings.planes, self.graph.positions, self._place)
            self._held_planes = hold(self.planes)
        self._leave_energy_ridge(targets, weights)
        linear, positions = np.empty((len(self.unknowns), 3, 3)), np.empty((len(self.unknowns), 3))
        self.iterations, is_aged = next_frame(
            self._held_state,
            self._held_planes,
            self._matrix.held_arguments,
            targets,
            weights,
            linear,
            positions,
        )
        needs_matrix = is_aged or self._matrix.always
        if needs_matrix and self.iterations > _MAX_STILL_FRAME_STEPS and self.planes is NO_PLANES:
            self.start_next_matrix()
        return linear, positions

    def start_next_matrix(self) -> None:
        """Starts to compute another matrix at the last frame's result, for the next frame."""
        self._matrix.start_next_matrix(self.unknowns.reshape(-1), self.terms, self.planes, self.work.raw)

    @property
    def is_settled(self) -> bool:
        """True if the last frame ended within 0.1 % of the minimum below it.

        It is False if the frame ran out of its ``iterations`` or its ``budget_ms``, or ended on a ridge of
        the energy. The next frame starts from its result, or from the state below the ridge, and continues
        the descent. Computing this value continues the descent, which takes as long as a few frames.
        """
        is_finished = bool(self.work.age[2])
        if is_finished and not self._lower:
            self._lower.append(
                find_lower_state(self.unknowns.reshape(-1), self.terms, self.planes, self.current_matrix)
            )
        return is_finished and self._lower[0] is None

    @property
    def energy_terms(self) -> dict[str, float]:
        """The weighted energies "rotation", "smoothness", "constraint", "rigidity", "planes" and "total"."""
        names = ("rotation", "smoothness", "constraint", "rigidity", "planes", "total")
        return dict(zip(names, self.work.energies.tolist(), strict=True))

    def _leave_energy_ridge(self, targets: Float, weights: Float) -> None:
        """Continues from the lower state next to a ridge of the energy, if it is better for the new targets.

        This is called if the last frame ended on the ridge.
        """
        lower_state = self._lower.pop() if self._lower else None
        if lower_state is None:
            return
        self.store_targets(targets, weights)
        current_energy = compute_energy_gradient(
            self.unknowns.reshape(-1), self.terms, self.planes, self.work.trial
        )
        lower_energy = compute_energy_gradient(lower_state, self.terms, self.planes, self.work.trial)
        if lower_energy[5] < current_energy[5]:
            self.unknowns.reshape(-1)[:] = self.work.last[:] = lower_state
            record_energies(self.work, lower_energy)

    @property
    def current_matrix(self) -> RigidSystem:
        """Returns the matrix that the solver currently uses."""
        return self._matrix.system

    def state(self) -> tuple[Float, Float]:
        """Returns the current linear parts (N, 3, 3) and positions (N, 3) of the nodes."""
        linear, positions = np.empty((len(self.unknowns), 3, 3)), np.empty((len(self.unknowns), 3))
        state_from_unknowns(self.unknowns, self._order, linear, positions)
        return linear, positions

    def store_targets(self, targets: Float, weights: Float) -> None:
        """Copies the usable targets and weights into the energy's constants."""
        copy_usable_targets(targets, weights, self.settings.constraint, self.terms.targets, self.terms.pulls)

    def _check_targets(self, targets: Float, weights: Float | None) -> tuple[Float, Float]:
        """Returns the frame's targets (L, 3) and weights (L,) after checking their shapes and values."""
        targets = np.ascontiguousarray(targets, np.float64)
        weights = self._ones if weights is None else np.ascontiguousarray(weights, np.float64)
        count = len(self._ones)
        if targets.shape != (count, 3) or weights.shape != (count,):
            raise InputError(
                f"the arrays do not match: targets {targets.shape}, weights {weights.shape}, expected "
                f"{count} constraints",
                where="embedded deformation",
            )
        return targets, weights
