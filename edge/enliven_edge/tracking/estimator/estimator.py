"""Runs the shipped network: from a frame the joints, the spread of each, the facing and the body parts."""

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

_DISTANCE = 3.0
"""Mean distance, in units of its scale, of the distribution that the network learns: in space the density
falls off exponentially with the distance, and the mean of that is 3."""
_FARTHEST = 1.0
"""Metres of spread that are reported at most: a joint farther off than this is simply not known."""
_SUREST = 0.03
"""Metres of spread below which a joint's weight grows no more: the network is no better than that."""
_USUAL = 0.05
"""Metres of spread at which a joint weighs one twentieth of all."""
_SUREST_BESIDE_DEPTH = 0.05
"""The same as ``_SUREST`` beside depth, which knows better: limbs of real people are off by more than the
spread says, and at 3 cm the network pulled elbows off arms that were seen."""
TRUST = np.repeat([1.0, 0.4], [12, 8])
"""(20,) shares of that weight: legs are found by their surface, and a crouch is easily taken for a kneel."""
_DOUBTED = 3.0
"""Spreads: the robust width of a joint, beyond which the network is taken to be wrong: three sigma."""
_WIDTHS = (0.12, 0.4)
"""Metres: least and greatest robust width, as the spread itself is off now and then."""
_APART = 0.08
"""Metres from the network's joint up to which a fitted one is not elsewhere: both are off by centimetres."""
_ALL = np.arange(len(Joint))
"""The numbers of all joints."""
_SPREADS = 1.5
"""Spreads from the network's joint from which a fitted one is plainly elsewhere."""


@dataclass(frozen=True)
class Estimate:
    """The network's estimate of one person in one frame.

    Attributes:
        joints: (20, 3) metres, world frame, ordered by :class:`enliven.person.body.Joint`.
        spread: (20,) metres: the mean error of each joint that the network expects.
        facing: (8,) log probabilities of the ways to face, see :func:`labels.facing_in_plan`; they do not
            depend on the facing that the estimate was conditioned on.
        parts: (17, 40, 32) logits of the parts at every second cell of the crop.
        crop: the network's input.
        person_probability: in [0, 1], that the crop shows a person and no thing.
    """

    joints: Float
    spread: Float
    facing: Float
    parts: Float32
    crop: Crop
    person_probability: float = 1.0

    @property
    def landmarks(self) -> Float:
        """(20, 5) places, weights and robust widths of the joints, as ``terms.near_landmarks`` takes them."""
        return self._landmarks(_SUREST)

    @property
    def guides(self) -> Float:
        """(20, 5) the same for a fit to depth, which knows better where a joint is."""
        return self._landmarks(_SUREST_BESIDE_DEPTH)

    def _landmarks(self, surest: float) -> Float:
        """Returns (20, 5) landmarks, each with a spread of at least ``surest`` metres."""
        return np.asarray(_landmarks(self.joints, self.spread, surest, TRUST))

    def count_apart(self, joints: Float, which: Int = _ALL) -> int:
        """Returns how many of (20, 3) joints, or of ``which``, are plainly elsewhere than here."""
        return int(_apart(joints, self.joints, self.spread, which))

    def parts_at(self, rays: Float) -> Float32:
        """Returns (17, M) probabilities of the parts at (M, 2) rays, x/z and y/z, between four cells."""
        return np.asarray(parts_at_rays(self.parts, rays, *self.crop.place))


@njit(cache=True, nogil=True)
def _landmarks(joints, spread, surest, trust):
    """(J, 5) place, weight and robust width of the joints, see :attr:`Estimate.landmarks`."""
    out = np.empty((len(joints), 5))
    low, high = _WIDTHS
    for j in range(len(joints)):
        sure = max(spread[j], surest)
        for a in range(3):
            out[j, a] = joints[j, a]
        out[j, 3] = trust[j] * (_USUAL / sure) ** 2 / len(joints)
        out[j, 4] = min(high, max(low, _DOUBTED * sure))
    return out


@njit(cache=True, nogil=True)
def _apart(joints, seen, spread, which):
    """See :meth:`Estimate.count_apart`."""
    count = 0
    for j in which:
        x, y, z = joints[j, 0] - seen[j, 0], joints[j, 1] - seen[j, 1], joints[j, 2] - seen[j, 2]
        apart = np.sqrt(x * x + y * y + z * z)
        count += apart > _APART and apart > _SPREADS * spread[j]
    return count


class PoseEstimator:
    """Runs a network with ONNX Runtime on one core; safe to call from several threads."""

    def __init__(self, path: Path) -> None:
        """Reads a network.

        Raises:
            InputError: where its file is missing or damaged.
        """
        onnxruntime = load_onnxruntime()
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        except Exception:  # ONNX Runtime has no common error
            raise InputError(
                "the network cannot be read",
                where=str(path),
                mend="Install enliven again, or set tracker.estimator = false.",
            ) from None

    def estimates(self, crop: Crop, world_from_camera: Float, facings: list[float | None]) -> list[Estimate]:
        """Runs the network on one crop, conditioned on each of some facings in turn.

        Args:
            facings: radians from facing the sensor, anticlockwise from above; None: not known.
        """
        condition = np.array(
            [[0.0, 0.0, crop.cell] if f is None else [math.cos(f), math.sin(f), crop.cell] for f in facings],
            np.float32,
        )
        image = crop.image[None]
        image = image if len(condition) == 1 else np.repeat(image, len(condition), 0)
        joints, spread, facing, parts = self._session.run(None, {"image": image, "told": condition})
        made = []
        for n in range(len(condition)):
            here = crop.to_camera(joints[n].astype(np.float64))
            world, off, ways, person = _decoded(here, spread[n], facing[n], world_from_camera)
            made.append(Estimate(world, off, ways, parts[n], crop, person))
        return made

    def estimate(
        self, z: Float, mask: Bool, camera: Float, world_from_camera: Float, facing: float | None
    ) -> Estimate:
        """Runs the network on the masked person; arguments as of :func:`crop_person`, facing in radians."""
        crop = crop_person(z, mask, camera, world_from_camera)
        return self.estimates(crop, world_from_camera, [facing])[0]


@njit(cache=True, nogil=True)
def _decoded(here, spread, facing, pose):
    """Decodes the network's output: joints, spread, facing and person probability, as of :class:`Estimate`.

    Args:
        here: (20, 3) metres, the joints in the camera's frame.
        spread: (20,) float32 logarithms of the joints' scales, metres.
        facing: (9,) float32 logits of the ways to face, and of being no person.
        pose: (4, 4) world_from_camera.
    """
    world, off = np.empty(here.shape), np.empty(len(here))
    for j in range(len(here)):
        for a in range(3):
            world[j, a] = pose[a, 0] * here[j, 0] + pose[a, 1] * here[j, 1] + pose[a, 2] * here[j, 2]
            world[j, a] += pose[a, 3]
        off[j] = min(_FARTHEST, _DISTANCE * np.exp(np.float64(spread[j])))
    person = np.exp(_log_softmax(facing)[:FACINGS]).sum()
    return world, off, _log_softmax(facing[:FACINGS]), person


@njit(cache=True, nogil=True)
def _log_softmax(logits):
    """(N,) log probabilities, float64, of (N,) float32 logits."""
    shifted = logits.astype(np.float64) - np.float64(logits.max())
    return shifted - np.log(np.exp(shifted).sum())


@lru_cache(maxsize=1)
def shipped_estimator() -> PoseEstimator:
    """Returns the network that ``enliven train-estimator`` trained.

    Raises:
        InputError: where its file is missing or damaged.
    """
    return PoseEstimator(ESTIMATOR)
