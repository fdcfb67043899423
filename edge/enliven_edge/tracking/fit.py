"""The articulated fit: damped Gauss-Newton of the body model on what one depth frame shows.

After Ganapathi et al. 2012 (ray-constrained ICP): points to surfaces, and the surface kept out of the space
that the camera saw through.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from enliven.arrays import Float
from enliven_edge.tracking import data_term, model, ranges, terms
from enliven_edge.tracking.observation import Observation
from enliven_edge.tracking.posture import Posture, exponential, forward
from enliven_edge.tracking.settings import FitSettings

_SQUARE_CM = 1e4
_SAMPLES = 5
_STIFF = np.ones(13)
_STIFF[[model.PELVIS, model.CHEST, model.HEAD]] = 1.0, 3.0, 2.0
_RELAXED = np.ones(13)
_RELAXED[model.PELVIS] = 0.0
_RELAXED[[model.CHEST, model.HEAD]] = 12.0, 6.0
_RELAXED[[model.FOOT_L, model.FOOT_R]] = 3.0


def _touching_pairs() -> Float:
    """(K, 2) capsules that must stay apart: arms and torso, arm and arm, leg and leg."""
    frame = model.CAPSULES.frame
    groups = {
        "torso": [c for c, f in enumerate(frame) if f in (model.PELVIS, model.CHEST, model.HEAD)],
        "left arm": [c for c, f in enumerate(frame) if f == model.FOREARM_L],
        "right arm": [c for c, f in enumerate(frame) if f == model.FOREARM_R],
        "left leg": [c for c, f in enumerate(frame) if f in (model.SHIN_L, model.FOOT_L)],
        "right leg": [c for c, f in enumerate(frame) if f in (model.SHIN_R, model.FOOT_R)],
        "left thigh": [c for c, f in enumerate(frame) if f == model.THIGH_L],
        "right thigh": [c for c, f in enumerate(frame) if f == model.THIGH_R],
    }
    meet = [
        ("left arm", "torso"),
        ("right arm", "torso"),
        ("left arm", "right arm"),
        ("left leg", "right leg"),
    ]
    meet += [("left arm", "left thigh"), ("right arm", "right thigh")]
    return np.array([(i, j) for a, b in meet for i in groups[a] for j in groups[b]])


_PAIRS = _touching_pairs()


@dataclass(frozen=True)
class FitReport:
    """How well a posture explains a frame.

    Attributes:
        energy: the minimised energy, square centimetres a point.
        explained: share of the person's points within the robust width of the model.
        support: (C,) observed points that each capsule explains.
        violated: (C,) share of each capsule that the camera saw through.
    """

    energy: float
    explained: float
    support: Float
    violated: Float


class Fitter:
    """Fits the model to observations; keeps nothing between calls but its settings."""

    def __init__(self, settings: FitSettings) -> None:
        self.settings = settings

    def fit(
        self,
        observation: Observation,
        start: Posture,
        *,
        predicted: Posture | None = None,
        iterations: int | None = None,
        width: float | None = None,
        proportions: Float | None = None,
    ) -> tuple[Posture, FitReport]:
        """The posture near ``start`` that explains the observation best.

        Args:
            predicted: the posture that time suggests; None where nothing is known (detection).
            iterations: Gauss-Newton steps, the setting's where None.
            width: metres at which residuals are doubted, the setting's where None.
            proportions: (12,) weights that hold the lengths at ``start``'s; fixed where None.
        """
        width = self.settings.width if width is None else width
        posture, damping = start.copy(), 1e-2
        reference = start.lengths.copy()
        system = self._system(observation, posture, predicted, width, proportions, reference)
        for _ in range(self.settings.iterations if iterations is None else iterations):
            step = _solve(system.matrix, system.gradient, damping)
            moved = _moved(posture, step)
            trial = self._system(observation, moved, predicted, width, proportions, reference)
            if trial.report.energy < system.report.energy:
                done = system.report.energy - trial.report.energy < 1e-4 * system.report.energy
                posture, system, damping = moved, trial, max(1e-6, damping / 4)
                if done:
                    break
            else:
                damping *= 8
                if damping > 1e4:
                    break
        return posture, system.report

    def _system(
        self,
        observation: Observation,
        posture: Posture,
        predicted: Posture | None,
        width: float,
        proportions: Float | None,
        reference: Float,
    ) -> _System:
        """The normal equations and the energy at a posture."""
        s = self.settings
        matrix = np.zeros((model.UNKNOWNS, model.UNKNOWNS))
        gradient = np.zeros(model.UNKNOWNS)
        world, pivots, by_length = forward(posture.position, posture.rotations, posture.lengths)
        ends, radii = posture.capsules()
        body = (world, pivots, by_length, model.MOVES, model.DOF_FRAME, model.DOF_AXIS)
        where = (ends, radii, model.CAPSULES.frame, model.CAPSULES.ends, body)
        support, violated = np.zeros(len(ends)), np.zeros(len(ends))
        energy, explained = data_term.depth_to_model(
            matrix,
            gradient,
            observation.points,
            observation.normals,
            *where,
            _SQUARE_CM,
            width,
            0.04,
            support,
        )
        energy += terms.free_space(
            matrix, gradient, *where, observation.view, s.free_space * _SQUARE_CM, 0.25, _SAMPLES, violated
        )
        energy += terms.self_intersection(matrix, gradient, *where, _PAIRS, 0.02 * _SQUARE_CM, 3)
        turns = (model.DOF_FRAME, model.DOF_AXIS)
        energy += terms.joint_ranges(
            matrix, gradient, posture.rotations, ranges.MIDDLE, ranges.REACH, s.ranges, *turns
        )
        energy += terms.stay_near(matrix, gradient, posture.rotations, _REST, s.rest * _RELAXED, *turns)
        if predicted is not None:
            energy += terms.stay_near(
                matrix, gradient, posture.rotations, predicted.rotations, s.temporal * _STIFF, *turns
            )
        energy += _hold_lengths(matrix, gradient, posture.lengths, reference, proportions)
        return _System(matrix, gradient, FitReport(float(energy), float(explained), support, violated))


@dataclass(frozen=True)
class _System:
    matrix: Float
    gradient: Float
    report: FitReport


_REST = ranges.standing()


def _hold_lengths(
    matrix: Float, gradient: Float, lengths: Float, reference: Float, weights: Float | None
) -> float:
    """Relative changes of the lengths cost ``weights``; without weights they are frozen."""
    index = np.arange(model.DOFS, model.UNKNOWNS)
    if weights is None:
        matrix[index, :] = 0.0
        matrix[:, index] = 0.0
        gradient[index] = 0.0
        matrix[index, index] = 1.0
        return 0.0
    change = (lengths - reference) / reference
    matrix[index, index] += weights / reference**2
    gradient[index] += weights * change / reference
    return float(np.sum(weights * change**2))


def _solve(matrix: Float, gradient: Float, damping: float) -> Float:
    """(42,) the Levenberg-Marquardt step; the upper triangle of the matrix is filled."""
    full = np.triu(matrix) + np.triu(matrix, 1).T
    diagonal = np.diag(full)
    full[np.diag_indices_from(full)] = diagonal * (1 + damping) + 1e-3
    return np.asarray(-np.linalg.solve(full, gradient))


def _moved(posture: Posture, step: Float) -> Posture:
    """The posture after a step, which is cut to half a radian a joint."""
    largest = float(np.abs(step[3 : model.DOFS]).max())
    step = step * min(1.0, 0.5 / max(largest, 1e-9))
    made = posture.copy()
    made.position += step[:3]
    _turn(made.rotations, step[3 : model.DOFS], model.DOF_FRAME, model.DOF_AXIS)
    made.lengths = posture.lengths * np.clip(1 + step[model.DOFS :] / posture.lengths, 0.8, 1.25)
    return made


@njit(cache=True, nogil=True)
def _turn(rotations, step, dof_frame, dof_axis):  # type: ignore[no-untyped-def]
    """Right-multiplies every frame's rotation by the exponential of its part of the step."""
    k = 0
    while k < len(dof_frame):
        frame = dof_frame[k]
        vector = np.zeros(3)
        while k < len(dof_frame) and dof_frame[k] == frame:
            vector[dof_axis[k]] = step[k]
            k += 1
        rotations[frame] = rotations[frame] @ exponential(vector)
