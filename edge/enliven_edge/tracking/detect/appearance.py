"""The network's estimate, sampled at the points of the fit: body parts, facing, and agreement with a
posture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32
from enliven.kernels import njit
from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.capsules import nearest_capsules
from enliven_edge.tracking.body_model.posture import Posture, chest_axes, rotation
from enliven_edge.tracking.estimator.estimator import Estimate
from enliven_edge.tracking.estimator.labels import FACINGS, MIRRORED, PARTS, BodyPart, facing_in_plan
from enliven_edge.tracking.estimator.part_map import parts_at_rays
from enliven_edge.tracking.frame.observation import Observation


def _capsule_parts() -> Float:
    """Returns a (C, 17) matrix: 1 if a capsule belongs to a body part, else 0."""
    capsule_parts = np.zeros((len(model.CAPSULES.frame), PARTS))
    for right in (0, 1):
        pelvis, chest, girdle = 3 * right, 3 * right + 1, 3 * right + 2
        arm, leg = 8 + 3 * right, 14 + 3 * right
        capsule_parts[pelvis, BodyPart.BELLY_LEFT + right] = 1.0
        capsule_parts[chest, [BodyPart.CHEST_LEFT + right, BodyPart.BELLY_LEFT + right]] = 1.0
        capsule_parts[girdle, BodyPart.CHEST_LEFT + right] = 1.0
        capsule_parts[6, [BodyPart.CHEST_LEFT + right, BodyPart.HEAD]] = 1.0
        for k, part in enumerate((BodyPart.UPPER_ARM_LEFT, BodyPart.FOREARM_LEFT, BodyPart.HAND_LEFT)):
            capsule_parts[arm + k, part + right] = 1.0
        for k, part in enumerate((BodyPart.THIGH_LEFT, BodyPart.SHANK_LEFT, BodyPart.FOOT_LEFT)):
            capsule_parts[leg + k, part + right] = 1.0
    capsule_parts[7, BodyPart.HEAD] = 1.0
    return capsule_parts


CAPSULE_PARTS = _capsule_parts()
"""(20, 17) matrix: 1 if a capsule of the model belongs to a body part, else 0."""
_MAX_PARTS = int(CAPSULE_PARTS.sum(1).max())
"""Maximum number of body parts of a capsule: the neck has the head and both sides of the chest."""
_PART_INDICES = np.array([[*np.flatnonzero(row), *_MAX_PARTS * [-1]][:_MAX_PARTS] for row in CAPSULE_PARTS])
"""(20, 3) indices of the body parts of each capsule, filled up with -1."""
_SIDELESS_CAPSULE_PARTS = np.maximum(CAPSULE_PARTS, CAPSULE_PARTS[:, MIRRORED])
"""(20, 17) matrix like ``CAPSULE_PARTS`` in which left and right parts count as the same part."""
_FACING_PRIOR = 0.5
"""Log probability added for facing the sensor, and subtracted for facing away. People usually face the
sensor."""
DISAGREEMENT_COST = 4.0
"""Cost in square centimetres per point if the network assigns all points to other body parts. It is as high
as the cost of a bad fit."""


@dataclass(frozen=True)
class EstimateAtPoints:
    """The network's estimate of one observation, sampled at its points.

    Attributes:
        estimate: the network's estimate of joints, spread, facing and parts.
        surface: (6, M) metres, the points of the observation, world frame, and their normals.
        probabilities: (17, M) float32 probabilities of the parts at these points.
        rays: (M, 2) x/z and y/z of the points in the image.
    """

    estimate: Estimate
    surface: Float32
    probabilities: Float32
    rays: Float

    def with_estimate(self, estimate: Estimate) -> EstimateAtPoints:
        """Samples another estimate of the same frame at the points of this object."""
        return EstimateAtPoints(estimate, self.surface, estimate.parts_at(self.rays), self.rays)

    def thin(self, step: int) -> EstimateAtPoints:
        """Returns a copy with every ``step``-th point."""
        surface, shown = (
            np.ascontiguousarray(array[:, ::step]) for array in (self.surface, self.probabilities)
        )
        return EstimateAtPoints(self.estimate, surface, shown, self.rays[::step])

    def affinity(self, metres: float) -> Float32:
        """Returns the penalties (20, M) in metres that are added to a point's distance from a capsule of
        another body part.
        """
        return np.asarray(_affinity(self.probabilities, CAPSULE_PARTS, np.float32(metres)))

    def sideless_affinity(self, metres: float) -> Float32:
        """Returns :meth:`affinity` with left and right parts treated as one."""
        return np.asarray(_affinity(self.probabilities, _SIDELESS_CAPSULE_PARTS, np.float32(metres)))


def estimate_at_points(observation: Observation, estimate: Estimate) -> EstimateAtPoints:
    """Samples an estimate of the same frame at the points of an observation."""
    view_arguments = (observation.pixels, observation.view.camera)
    rays, probabilities = _parts_at_pixels(*view_arguments, estimate.parts, *estimate.crop.place)
    return EstimateAtPoints(estimate, observation.surface, probabilities, rays)


@njit(cache=True, nogil=True)
def _parts_at_pixels(pixels, camera, parts, axes, centre, scale):
    """Returns the (M, 2) rays of pixels, and (P, M) part probabilities from
    :func:`part_map.parts_at_rays`."""
    rays = _rays(pixels, camera)
    return rays, parts_at_rays(parts, rays, axes, centre, scale)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _affinity(shown, capsule_parts, metres):
    """Computes :meth:`EstimateAtPoints.affinity`.

    Args:
        shown: (P, M) float32 probabilities.
        capsule_parts: (C, P) 1 if a capsule belongs to a part, else 0.
        metres: the maximum of an entry.
    """
    out = np.empty((len(capsule_parts), shown.shape[1]), np.float32)
    for c in range(len(capsule_parts)):
        row = out[c]
        row[:] = metres
        for p in range(len(shown)):
            if capsule_parts[c, p] == 0.0:
                continue
            like = shown[p]
            for i in range(len(row)):
                row[i] = max(np.float32(0.0), row[i] - metres * like[i])
    return out


@njit(cache=True, nogil=True)
def _rays(pixels, camera):
    """Returns (M, 2) x/z and y/z of (M, 2) rows and columns."""
    rays = np.empty((len(pixels), 2))
    for i in range(len(pixels)):
        rays[i, 0] = (pixels[i, 1] - camera[2]) / camera[0]
        rays[i, 1] = (pixels[i, 0] - camera[3]) / camera[1]
    return rays


def network_agreement(network_output: EstimateAtPoints, posture: Posture) -> float:
    """Returns the mean network probability in [0, 1] of the body parts that the posture has at the points.

    A comparison of a posture with its flipped version shows whether front and back, or left and right, are
    confused.
    """
    return float(
        _agreement(network_output.surface, network_output.probabilities, _PART_INDICES, *posture.capsules())
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _agreement(surface, shown, capsule_parts, ends, radii):
    """Computes :func:`network_agreement`.

    The arrays come from :class:`EstimateAtPoints` and :meth:`Posture.capsules`.

    Args:
        surface, shown: the points and the probabilities of their parts.
        capsule_parts: (C, N) the parts of each capsule, or -1.
        ends, radii: the capsules.
    """
    which = np.empty(shown.shape[1], np.int32)
    nearest_capsules(which, surface, np.zeros((0, 0), np.float32), ends, radii, np.float32(0.0))
    total = 0.0
    for i in range(len(which)):
        for part in capsule_parts[which[i]]:
            total += shown[part, i] if part >= 0 else 0.0
    return total / len(which)


def compute_facing_score(network_output: EstimateAtPoints, posture: Posture, eye: Float) -> float:
    """Returns the log probability of the posture's facing relative to the network's likeliest direction.

    It is interpolated between the eight directions of the network. A prior is added that favours directions
    towards the sensor.
    """
    return float(facing_log_probability(network_output.estimate.facing, chest_facing(posture, eye)))


@njit(cache=True, nogil=True)
def facing_log_probability(ways, angle):
    """Computes :func:`compute_facing_score`.

    Args:
        ways: (8,) log probabilities of the facing directions.
        angle: radians, as returned by :func:`chest_facing`.
    """
    turns = angle * FACINGS / (2.0 * np.pi)
    before = int(np.floor(turns))
    share = turns - before
    likely = (1.0 - share) * ways[before % FACINGS] + share * ways[(before + 1) % FACINGS]
    return likely - ways.max() + _FACING_PRIOR * np.cos(angle)


def chest_facing(posture: Posture, eye: Float) -> float:
    """Returns the chest's horizontal facing in radians: 0 towards the sensor, anticlockwise from above."""
    return float(_facing(posture.rotations, posture.position, eye))


@njit(cache=True, nogil=True)
def _facing(rotations, place, eye):
    left, _ = chest_axes(rotations)
    return facing_in_plan(left, place, eye)


def flip_posture(posture: Posture) -> Posture:
    """Returns the posture flipped: rotated by 180 degrees about its trunk's axis, with exchanged limbs."""
    flipped = posture.copy()
    flipped.rotations = joint_limits.mirror_rotations(posture.rotations)
    flipped.rotations[model.PELVIS] = posture.rotations[model.PELVIS] @ rotation(y=np.pi)
    return flipped
