"""The articulated fit: damped Gauss-Newton of the body model on what one depth frame shows.

After Ganapathi et al. 2012 (ray-constrained ICP): points to surfaces, and the surface kept out of the space
that the camera saw through.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import Held, hold
from enliven_edge.tracking.body_model import Posture, joint_limits, model
from enliven_edge.tracking.fit.gauss_newton import minimise
from enliven_edge.tracking.fit.structures import FitConstants, FitModel, weights_of
from enliven_edge.tracking.frame import Observation
from enliven_edge.tracking.settings import FitSettings

_STIFF = model.by_frame(1.0, {model.CHEST: 3.0, model.HEAD: 2.0})
"""(13,) factors on ``FitSettings.temporal``: the trunk turns less between two frames than the limbs do."""
_RELAXED = model.by_frame(
    1.0, {model.PELVIS: 0.0, model.CHEST: 12.0, model.HEAD: 6.0, model.FOOT_L: 3.0, model.FOOT_R: 3.0}
)
"""(13,) factors on ``FitSettings.rest``: depth says least of the back, the head and the feet, and nothing
holds the direction that the pelvis faces."""


def _touching_pairs() -> Int:
    """(K, 2) pairs of capsules that must stay apart: an arm and the torso, arm or thigh, leg and leg."""
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


def shape() -> FitModel:
    """The body model as the compiled fit takes it."""
    c = model.CAPSULES
    skeleton = (model.FRAME_PARENTS, model.PIVOTS, model.MOVES, model.DOF_FRAME, model.DOF_AXIS)
    surface = (c.frame, c.ends, c.radii, model.FRAME_LENGTHS, _touching_pairs())
    return FitModel(*skeleton, *surface, model.JOINT_FRAMES, model.JOINT_OFFSETS)


_LOW = 0.65
"""Height of the hips over the length of a leg below which the hips of a known person bend farther. With the
wider range for people who stand, too, four people side by side lost 4 % of their joints."""
_SHAPE = shape()
_NO_LENGTHS = np.zeros(0)
"""The weights of no lengths: they are frozen."""
_LOOSE = np.zeros(13)
"""(13,) weights of the prediction's rotations where there is none."""


@dataclass(frozen=True)
class FitReport:
    """How well a posture explains a frame.

    Attributes:
        energy: the minimised energy, square centimetres a point.
        explained: the share of the person's points within the robust width of the model.
        support: (C,) observed points that each capsule explains.
        violated: (C,) the share of each capsule that the camera saw through.
        information: (30, 30) the upper triangle of the Gauss-Newton matrix of the frame alone, without what
            time predicts, with the lengths frozen.
    """

    energy: float
    explained: float
    support: Float
    violated: Float
    information: Float

    @property
    def seen_through(self) -> float:
        """The share of the whole surface that the camera saw through."""
        return sum(self.violated.tolist()) / len(self.violated)


class Fitter:
    """Fits the model to observations; keeps nothing between calls but its settings, held for each width.

    Attributes:
        has_floor: whether limbs stay above y = 0. A guessed floor must not shorten legs.
        limber: the same for people who are followed: once they are low, their hips bend as far as when knees
            are drawn up. A search does without, since one limber body explains two people side by side.
    """

    def __init__(self, settings: FitSettings, strict: Fitter | None = None) -> None:
        self.settings = settings
        self.has_floor = True
        self._strict = strict
        self.limber: Fitter = Fitter(settings, self) if strict is None else self
        self._stiffness, self._relaxedness = settings.temporal * _STIFF, settings.rest * _RELAXED
        self._constants: dict[tuple[float, bool, bool], Held] = {}

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
        """The posture near ``start`` that explains the observation best, and a report.

        Args:
            predicted: the posture that time suggests; None where nothing is known (detection).
            iterations: Gauss-Newton steps, the setting's where None.
            width: metres at which residuals are doubted, the setting's where None.
            proportions: (12,) weights that hold the lengths at ``start``'s; fixed where None.
        """
        made = start.copy()
        prior = self._prior(start, predicted, proportions)
        support, violated = np.zeros(len(model.CAPSULES.frame)), np.zeros(len(model.CAPSULES.frame))
        information = np.zeros((model.DOFS, model.DOFS))
        constants = self._constants_of(width, self._bends_far(start))
        energy, explained = minimise(
            made.position, made.rotations, made.lengths, observation.held, constants, *prior,
            self.settings.iterations if iterations is None else iterations, support, violated, information,
        )  # fmt: skip
        return made, FitReport(energy, explained, support, violated, information)

    def _prior(
        self, start: Posture, predicted: Posture | None, proportions: Float | None
    ) -> tuple[Float, Float, Float, Float]:
        """The prior's part that changes from fit to fit, prediction and proportions: see :func:`minimise`."""
        firmness = _NO_LENGTHS if proportions is None else proportions
        if predicted is None:
            return start.rotations, _LOOSE, start.lengths, firmness
        return predicted.rotations, self._stiffness, start.lengths, firmness

    def _bends_far(self, posture: Posture) -> bool:
        """Whether hips have the wider range: a followed person crouches, kneels or sits on the floor."""
        leg = float(posture.lengths[model.THIGH] + posture.lengths[model.SHIN])
        return self._strict is not None and float(posture.position[1]) < _LOW * leg

    def _constants_of(self, width: float | None, bends_far: bool) -> Held:
        """The lasting part, with weights and body, for a width in metres; the setting's where None."""
        width = float(self.settings.width if width is None else width)
        has_floor = self.has_floor if self._strict is None else self._strict.has_floor
        key = width, has_floor, bends_far
        if key not in self._constants:
            middle, reach = joint_limits.LIMBER if bends_far else (joint_limits.MIDDLE, joint_limits.REACH)
            limits = joint_limits.RELAXED, self._relaxedness, middle, reach
            settings = self.settings if has_floor else replace(self.settings, floor=0.0)
            self._constants[key] = hold(FitConstants(_SHAPE, weights_of(settings, width), *limits))
        return self._constants[key]
