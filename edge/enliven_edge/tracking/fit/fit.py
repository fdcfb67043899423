"""The articulated fit: damped Gauss-Newton of the body model on the observation of one depth frame.

The method follows Ganapathi et al. 2012 (ray-constrained ICP). The fit matches points to surfaces. It also
keeps the surface out of the free space between the camera and the observed depth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import HeldArguments, hold
from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.gauss_newton import minimise
from enliven_edge.tracking.fit.structures import FitConstants, FitModel, create_weights
from enliven_edge.tracking.frame.observation import Observation
from enliven_edge.tracking.settings import FitSettings

_TEMPORAL_FACTORS = model.frame_weights(1.0, {model.CHEST: 3.0, model.HEAD: 2.0})
"""(13,) factors on ``FitSettings.temporal``: the trunk rotates less between two frames than the limbs."""
_RELAXED = model.frame_weights(
    1.0, {model.PELVIS: 0.0, model.CHEST: 12.0, model.HEAD: 6.0, model.FOOT_L: 3.0, model.FOOT_R: 3.0}
)
"""(13,) factors on ``FitSettings.rest``. They are highest for the back, the head and the feet, which depth
constrains least. The pelvis' heading is free."""


def _find_touching_pairs() -> Int:
    """Returns (K, 2) pairs of capsules that must not intersect.

    These are arms with the torso, the other arm and the thighs, and one leg with the other.
    """
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


def create_fit_model() -> FitModel:
    """Returns the body model in the form that the compiled fit takes as an argument."""
    c = model.CAPSULES
    skeleton = (model.FRAME_PARENTS, model.PIVOTS, model.MOVES, model.DOF_FRAME, model.DOF_AXIS)
    surface = (c.frame, c.ends, c.radii, model.FRAME_LENGTHS, _find_touching_pairs())
    return FitModel(*skeleton, *surface, model.JOINT_FRAMES, model.JOINT_OFFSETS)


_LOW_HIP_RATIO = 0.65
"""If the hips of a tracked person are lower than this fraction of the leg length, the hips may bend farther.
If standing people also had the wider range, four people next to each other lost 4 % of their joints."""
_SHAPE = create_fit_model()
_NO_LENGTHS = np.zeros(0)
"""Empty weights, which mean that the lengths are frozen."""
_NO_ROTATION_WEIGHTS = np.zeros(13)
"""(13,) zero weights of the prediction's rotations, used without a prediction."""


@dataclass(frozen=True)
class FitReport:
    """Measures of how well a posture explains a frame.

    Attributes:
        energy: the minimised energy, square centimetres per point.
        explained: the fraction of the person's points within the robust width of the model.
        support: (C,) number of observed points that each capsule explains.
        violated: (C,) the fraction of each capsule in free space, where the camera measured depth behind the
            capsule.
        information: (30, 30) the upper triangle of the Gauss-Newton matrix of the frame alone, without the
            temporal prior, with the lengths frozen.
    """

    energy: float
    explained: float
    support: Float
    violated: Float
    information: Float

    @property
    def seen_through(self) -> float:
        """Returns the fraction of the whole body in free space, where the camera measured depth behind the
        body.
        """
        return sum(self.violated.tolist()) / len(self.violated)


class Fitter:
    """Fits the body model to observations. Caches only constants, for each robust width.

    Attributes:
        has_floor: whether limbs must stay above y = 0; False if the floor is guessed, because a wrong floor
            would shorten legs.
        for_tracked_people: the fitter for people who are already tracked. If they crouch, their hips may
            bend farther. Detection does not use this wider range, because one strongly bent body could
            explain two people next to each other.
    """

    def __init__(self, settings: FitSettings, strict: Fitter | None = None) -> None:
        self.settings = settings
        self.has_floor = True
        self._strict = strict
        self.for_tracked_people: Fitter = Fitter(settings, self) if strict is None else self
        self._stiffness, self._relaxedness = settings.temporal * _TEMPORAL_FACTORS, settings.rest * _RELAXED
        self._constants: dict[tuple[float, bool, bool], HeldArguments] = {}

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
        """Returns the posture near ``start`` that explains the observation best, and a report.

        Args:
            observation: the observed person.
            start: the initial posture.
            predicted: the posture that the temporal prior expects; None in detection.
            iterations: maximum number of Gauss-Newton steps. If None, uses the settings' value.
            width: robust width in metres. If None, uses the settings' value.
            proportions: (12,) weights that keep the lengths near those of ``start``; If None, the lengths are
                fixed.
        """
        fitted = start.copy()
        prior = self._prior(start, predicted, proportions)
        support, violated = np.zeros(len(model.CAPSULES.frame)), np.zeros(len(model.CAPSULES.frame))
        information = np.zeros((model.DOFS, model.DOFS))
        constants = self._create_constants(width, self._hips_bend_far(start))
        energy, explained = minimise(
            fitted.position, fitted.rotations, fitted.lengths, observation.held, constants, *prior,
            self.settings.iterations if iterations is None else iterations, support, violated, information,
        )  # fmt: skip
        return fitted, FitReport(energy, explained, support, violated, information)

    def _prior(
        self, start: Posture, predicted: Posture | None, proportions: Float | None
    ) -> tuple[Float, Float, Float, Float]:
        """Returns the part of the prior that changes per frame: prediction and proportions, see
        :func:`minimise`.
        """
        firmness = _NO_LENGTHS if proportions is None else proportions
        if predicted is None:
            return start.rotations, _NO_ROTATION_WEIGHTS, start.lengths, firmness
        return predicted.rotations, self._stiffness, start.lengths, firmness

    def _hips_bend_far(self, posture: Posture) -> bool:
        """Returns True if hips have the wider range: a tracked person crouches, kneels or sits."""
        leg = float(posture.lengths[model.THIGH] + posture.lengths[model.SHIN])
        return self._strict is not None and float(posture.position[1]) < _LOW_HIP_RATIO * leg

    def _create_constants(self, width: float | None, bends_far: bool) -> HeldArguments:
        """Returns the constant data, weights and body for a robust width in metres.

        If the width is None, uses that of the settings.
        """
        width = float(self.settings.width if width is None else width)
        has_floor = self.has_floor if self._strict is None else self._strict.has_floor
        key = width, has_floor, bends_far
        if key not in self._constants:
            middle, reach = (
                joint_limits.WIDE_HIP_LIMITS if bends_far else (joint_limits.MIDDLE, joint_limits.HALF_RANGES)
            )
            limits = joint_limits.RELAXED, self._relaxedness, middle, reach
            settings = self.settings if has_floor else replace(self.settings, floor=0.0)
            self._constants[key] = hold(FitConstants(_SHAPE, create_weights(settings, width), *limits))
        return self._constants[key]
