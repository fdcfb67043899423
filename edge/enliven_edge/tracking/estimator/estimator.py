"""Runs the shipped network: it estimates joints, their uncertainty, the facing and the body parts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.person import Joint
from enliven_edge.assets import ESTIMATOR
from enliven_edge.onnx_runtime import load_onnxruntime
from enliven_edge.tracking.estimator.crop import Crop, crop_person
from enliven_edge.tracking.estimator.labels import FACINGS
from enliven_edge.tracking.estimator.part_map import parts_at_rays

_MEAN_DISTANCE = 3.0
"""Mean distance of a joint from its estimate, in units of the network's scale. The network learns a density
in space that falls exponentially with the distance; its mean distance is 3."""
_MAX_SPREAD_M = 1.0
"""Maximum reported spread in metres. A joint with a larger error is simply unknown."""
_MIN_SPREAD_M = 0.03
"""Spread in metres below which a joint's weight does not increase further, because the network is not more
accurate."""
_USUAL_SPREAD_M = 0.05
"""Reference spread in metres. A joint with this spread has a weight of 1/20, the number of joints being
20."""
_MIN_FUSED_SPREAD_M = 0.05
"""Minimum spread, like ``_MIN_SPREAD_M``, in a fit to depth, which is more accurate than the network. Limbs
of real people deviate by more than the spread predicts. At 3 cm the network pulled elbows off visible
arms."""
JOINT_TRUST = np.repeat([1.0, 0.4], [12, 8])
"""(20,) factors on the weights of the joints. Legs have a lower one, because depth shows them well and the
network easily confuses crouching with kneeling."""
_ROBUST_SPREADS = 3.0
"""Robust width of a joint in units of its spread: three sigma. Beyond it the network is assumed to be
wrong."""
_ROBUST_WIDTHS_M = (0.12, 0.4)
"""Minimum and maximum robust width in metres, because the spread itself is sometimes wrong."""
_AGREEMENT_M = 0.08
"""Metres from the network's joint within which a fitted joint agrees. Both have errors of centimetres."""
_ALL_JOINTS = np.arange(len(Joint))
"""The indices of all joints."""
_DISAGREEMENT_SPREADS = 1.5
"""Distance of a fitted joint from the network's joint, in units of its spread, beyond which the two clearly
disagree."""


@dataclass(frozen=True)
class Estimate:
    """The network's estimate of one person in one frame.

    Attributes:
        joints: (20, 3) metres, world frame, ordered by :class:`enliven.person.body.Joint`.
        expected_errors: (20,) metres, the expected error of each joint according to the network.
        facing: (8,) log probabilities of the facing directions, see :func:`labels.facing_in_plan`. They do
            not depend on the conditioning facing of the estimate.
        parts: (17, 40, 32) logits of the parts at every second cell of the crop.
        crop: the network's input.
        person_probability: probability in [0, 1] that the crop shows a person and not an object.
    """

    joints: Float
    expected_errors: Float
    facing: Float
    parts: Float32
    crop: Crop
    person_probability: float = 1.0

    @property
    def landmarks(self) -> Float:
        """Returns (20, 5) places, weights and robust widths of the joints, for ``terms.near_landmarks``."""
        return self._landmarks(_MIN_SPREAD_M)

    @property
    def weak_landmarks(self) -> Float:
        """Returns (20, 5) landmarks with lower weights than :attr:`landmarks`, for fits to depth."""
        return self._landmarks(_MIN_FUSED_SPREAD_M)

    def _landmarks(self, min_spread: float) -> Float:
        """Returns (20, 5) landmarks, each with a spread of at least ``min_spread`` metres."""
        return np.asarray(_landmarks(self.joints, self.expected_errors, min_spread, JOINT_TRUST))

    def count_disagreeing(self, joints: Float, which: Int = _ALL_JOINTS) -> int:
        """Counts the (20, 3) joints, or those of ``which``, that are clearly away from the estimate's
        joints."""
        return int(_count_disagreeing(joints, self.joints, self.expected_errors, which))

    def parts_at(self, rays: Float) -> Float32:
        """Returns (17, M) bilinearly interpolated part probabilities at (M, 2) rays, x/z and y/z."""
        return np.asarray(parts_at_rays(self.parts, rays, *self.crop.place))


@njit(cache=True, nogil=True)
def _landmarks(joints, spread, min_spread, trust):
    """Computes (J, 5) place, weight and robust width of the joints, see :attr:`Estimate.landmarks`."""
    out = np.empty((len(joints), 5))
    low, high = _ROBUST_WIDTHS_M
    for j in range(len(joints)):
        sure = max(spread[j], min_spread)
        for a in range(3):
            out[j, a] = joints[j, a]
        out[j, 3] = trust[j] * (_USUAL_SPREAD_M / sure) ** 2 / len(joints)
        out[j, 4] = min(high, max(low, _ROBUST_SPREADS * sure))
    return out


@njit(cache=True, nogil=True)
def _count_disagreeing(joints, seen, spread, which):
    """Computes :meth:`Estimate.count_disagreeing`."""
    count = 0
    for j in which:
        x, y, z = joints[j, 0] - seen[j, 0], joints[j, 1] - seen[j, 1], joints[j, 2] - seen[j, 2]
        apart = np.sqrt(x * x + y * y + z * z)
        count += apart > _AGREEMENT_M and apart > _DISAGREEMENT_SPREADS * spread[j]
    return count


class PoseEstimator:
    """Runs a network with ONNX Runtime on one core. Safe to call from several threads."""

    def __init__(self, path: Path) -> None:
        """Reads a network.

        Raises:
            InputError: if its file is missing or damaged.
        """
        onnxruntime = load_onnxruntime()
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        except Exception:  # The errors of ONNX Runtime have no common base class.
            raise InputError(
                "the neural network cannot be read",
                where=str(path),
                remedy="Install enliven again, or set tracker.estimator = false.",
            ) from None

    def estimates(self, crop: Crop, world_from_camera: Float, facings: list[float | None]) -> list[Estimate]:
        """Runs the network on one crop, once for each of the given facings.

        Args:
            crop: the network's input.
            world_from_camera: (4, 4) the camera's pose.
            facings: radians relative to facing the sensor, anticlockwise from above; None if unknown.
        """
        condition = np.array(
            [[0.0, 0.0, crop.cell] if f is None else [math.cos(f), math.sin(f), crop.cell] for f in facings],
            np.float32,
        )
        image = crop.image[None]
        image = image if len(condition) == 1 else np.repeat(image, len(condition), 0)
        joints, spread, facing, parts = self._session.run(None, {"image": image, "told": condition})
        estimates = []
        for n in range(len(condition)):
            in_camera = crop.to_camera(joints[n].astype(np.float64))
            world, spreads, facing_logs, person = decode_output(
                in_camera, spread[n], facing[n], world_from_camera
            )
            estimates.append(Estimate(world, spreads, facing_logs, parts[n], crop, person))
        return estimates

    def estimate(
        self, z: Float, mask: Bool, camera: Float, world_from_camera: Float, facing: float | None
    ) -> Estimate:
        """Runs the network on the masked person.

        Arguments are those of :func:`crop_person`, and the facing in radians.
        """
        crop = crop_person(z, mask, camera, world_from_camera)
        return self.estimates(crop, world_from_camera, [facing])[0]


@njit(cache=True, nogil=True)
def decode_output(here, spread, facing, pose):
    """Decodes the network's output: joints, spread, facing and person probability, as in :class:`Estimate`.

    Args:
        here: (20, 3) metres, the joints in the camera's frame.
        spread: (20,) float32 logarithms of the joints' scales, metres.
        facing: (9,) float32 logits of the facing directions, and of not being a person.
        pose: (4, 4) world_from_camera.
    """
    world, off = np.empty(here.shape), np.empty(len(here))
    for j in range(len(here)):
        for a in range(3):
            world[j, a] = pose[a, 0] * here[j, 0] + pose[a, 1] * here[j, 1] + pose[a, 2] * here[j, 2]
            world[j, a] += pose[a, 3]
        off[j] = min(_MAX_SPREAD_M, _MEAN_DISTANCE * np.exp(np.float64(spread[j])))
    person = np.exp(_log_softmax(facing)[:FACINGS]).sum()
    return world, off, _log_softmax(facing[:FACINGS]), person


@njit(cache=True, nogil=True)
def _log_softmax(logits):
    """Returns (N,) log probabilities, float64, of (N,) float32 logits."""
    shifted = logits.astype(np.float64) - np.float64(logits.max())
    return shifted - np.log(np.exp(shifted).sum())


@lru_cache(maxsize=1)
def load_shipped_estimator() -> PoseEstimator:
    """Returns the network that was trained by ``enliven train-estimator``.

    Raises:
        InputError: if its file is missing or damaged.
    """
    return PoseEstimator(ESTIMATOR)
