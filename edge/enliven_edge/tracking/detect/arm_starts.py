"""Start poses for fitting an arm: from the network, at the surface, mirrored, and at protruding points."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from enliven.arrays import Float, Float32, Int
from enliven.kernels import njit, quantile
from enliven.person import Joint
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.capsules import ray_clearances, signed_distances
from enliven_edge.tracking.body_model.joint_limits import mirror_rotations
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import EstimateAtPoints
from enliven_edge.tracking.fit.alignment import align
from enliven_edge.tracking.frame.observation import Observation

Arm = tuple[int, ...]
"""An arm as the model's two frames: upper arm and forearm."""
Start = Callable[[], Posture]
"""Function that creates a start posture. It is called only for the start postures that are tried in a
frame.
"""
ARM_JOINTS: dict[Arm, Int] = {
    (model.UPPER_ARM_L, model.FOREARM_L): np.array([Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT]),
    (model.UPPER_ARM_R, model.FOREARM_R): np.array([Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT]),
}
"""The joints of each arm beyond its shoulder."""
_WRIST_RADIUS_M = 0.035
"""Metres from an arm's surface to its axis: the radius of a wrist."""
_MAX_RAY_SHIFT_M = 0.25
"""Maximum shift in metres of a joint along its ray towards the measured depth. Depth farther away is another
part of the body."""
_MAX_DEPTH_ERROR_M = 0.03
"""Maximum distance in metres of a joint behind the surface. At a larger distance the joint was fitted too
deep.
"""
_ALIGNMENT_STEPS = 8
"""Steps of aligning an arm. Few are enough, because the rest of the body stays."""
_ROBUST_WIDTH_M = 0.3
"""Robust width of a target in metres: about a forearm."""
_TARGET_WEIGHT = 0.1
"""Weight of each target, including the joints of the rest of the body."""
_MIN_PROTRUSION_M = 0.04
"""Minimum distance in metres of a protruding point outside the whole model. Clothes and the fit's error are
smaller."""
_TRUNK_INTERVAL_M = (0.06, 0.3)
"""Interval in metres behind a point in which its ray must hit the trunk."""
_TRUNK = np.flatnonzero(model.CAPSULES.frame <= model.HEAD)
"""Indices of the capsules of trunk, neck and head."""
_GROUP_RADIUS_M = 0.16
"""Radius in metres around a protruding point in which other points belong to the same forearm."""
_MIN_GROUP_POINTS = 8
"""Minimum number of points of a group. A hand has about this number out of 500 points."""
_MIN_GROUP_LENGTH_M = 0.14
"""Minimum length in metres of a group to show a forearm's direction. A hand is shorter."""


def arm_starts(
    observation: Observation, posture: Posture, network_output: EstimateAtPoints | None, arms: list[Arm]
) -> list[Start]:
    """Returns functions that create start postures with one arm at another position, several for each arm."""
    joints, view = posture.joints(), observation.view
    eye = view.world_from_camera[:3, 3]
    starts: list[Start] = []
    for arm in arms:
        of_arm = ARM_JOINTS[arm]
        arm_joints = joints[of_arm]
        with_arm = partial(_with_arm, posture, joints, arm)
        if network_output is not None:
            network_joints = network_output.estimate.joints[of_arm]
            starts.append(partial(with_arm, network_joints))
            starts.append(
                partial(with_arm, np.concatenate([network_joints[:1], _at_surface(view, network_joints[1:])]))
            )
        at_surface = _at_surface(view, arm_joints)
        nearer = np.linalg.norm(arm_joints - eye, axis=1) - np.linalg.norm(at_surface - eye, axis=1)
        if nearer[1:].max() > _MAX_DEPTH_ERROR_M:
            starts.append(partial(with_arm, at_surface))
        starts.append(partial(mirror_other_arm, posture, arm))
    return starts + _starts_at_protrusion(observation, posture, joints, arms)


def _with_arm(posture: Posture, joints: Float, arm: Arm, places: Float) -> Posture:
    """Returns the posture with an arm's elbow, wrist and hand moved to (3, 3) places.

    A joint with NaN is ignored.
    """
    targets, weights = joints.copy(), np.full(len(joints), _TARGET_WEIGHT)
    for joint, place in zip(ARM_JOINTS[arm], places, strict=True):
        if np.isnan(place).any():
            weights[joint] = 0.0
        else:
            targets[joint] = place
    frames, offsets = model.JOINT_FRAMES, model.JOINT_OFFSETS
    return align(
        posture, frames, offsets, targets, weights, width=_ROBUST_WIDTH_M, iterations=_ALIGNMENT_STEPS
    )[0]


def mirror_other_arm(posture: Posture, arm: Arm) -> Posture:
    """Returns the posture with an arm posed as the mirror image of the person's other arm."""
    symmetric, index = posture.copy(), list(arm)
    symmetric.rotations[index] = mirror_rotations(posture.rotations)[index]
    return symmetric


@njit(cache=True, nogil=True)
def _at_surface(view, joints):
    """Returns (N, 3) joints, each moved along its ray to just behind the person's surface.

    A joint does not move if the person is not visible there, or the surface is too far away.
    """
    depth, mask, pose = view.depth, view.mask, view.world_from_camera
    fx, fy, cx, cy = view.camera
    moved, in_camera = joints.copy(), np.empty(3)
    for n in range(len(joints)):
        for a in range(3):
            in_camera[a] = 0.0
            for b in range(3):
                in_camera[a] += pose[b, a] * (joints[n, b] - pose[b, 3])
        u, v = (
            int(np.floor(fx * in_camera[0] / in_camera[2] + cx + 0.5)),
            int(np.floor(fy * in_camera[1] / in_camera[2] + cy + 0.5)),
        )
        if not (0 <= u < depth.shape[1] and 0 <= v < depth.shape[0] and mask[v, u]):
            continue
        along = depth[v, u] + _WRIST_RADIUS_M
        if abs(along - in_camera[2]) >= _MAX_RAY_SHIFT_M:
            continue
        for a in range(3):
            # Place the point on the line through the sensor and the joint, at the depth of the surface.
            moved[n, a] = pose[a, 3] + (joints[n, a] - pose[a, 3]) * (along / in_camera[2])
    return moved


def _starts_at_protrusion(
    observation: Observation, posture: Posture, joints: Float, arms: list[Arm]
) -> list[Start]:
    """Returns functions that create the posture with a forearm along the protruding points.

    Both directions of the forearm are tried.
    """
    out = _find_protruding_points(observation, posture)
    if len(out) < _MIN_GROUP_POINTS:
        return []
    group = out[densest_ball(out, np.float32(_GROUP_RADIUS_M))].astype(float)
    if len(group) < _MIN_GROUP_POINTS:
        return []
    middle = group.mean(0)
    distances = group - middle
    direction = np.linalg.eigh(distances.T @ distances)[1][:, -1]
    along = np.sort(distances @ direction)
    low, high = quantile(along, 0.1), quantile(along, 0.9)
    inward = middle - observation.view.world_from_camera[:3, 3]
    middle = middle + _WRIST_RADIUS_M * inward / np.linalg.norm(inward)
    if high - low < _MIN_GROUP_LENGTH_M:
        nowhere = np.full(3, np.nan)
        places = [np.stack([nowhere, nowhere, middle])]
    else:
        fore, hand = posture.lengths[model.FORE], posture.lengths[model.HAND]
        places = []
        for tip, elbow_end in ((high, -direction), (low, direction)):
            hand_end = middle + tip * direction
            places.append(
                np.stack([hand_end + (hand + fore) * elbow_end, hand_end + hand * elbow_end, hand_end])
            )
    return [partial(_with_arm, posture, joints, arm, target_arm) for arm in arms for target_arm in places]


@njit(cache=True, nogil=True)
def densest_ball(points, radius):
    """Returns an (M,) mask of the points within a radius of the point with the most neighbours in that
    radius."""
    most, best, square = 0, 0, radius * radius
    x, y, z = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    for i in range(len(points)):
        count = np.int32(0)
        for j in range(len(x)):
            dx, dy, dz = x[i] - x[j], y[i] - y[j], z[i] - z[j]
            count += np.int32(dx * dx + dy * dy + dz * dz < square)
        if count > most:
            most, best = count, i
    near = np.empty(len(points), np.bool_)
    for j in range(len(points)):
        dx, dy, dz = x[best] - x[j], y[best] - y[j], z[best] - z[j]
        near[j] = dx * dx + dy * dy + dz * dz < square
    return near


def _find_protruding_points(observation: Observation, posture: Posture) -> Float32:
    """Returns the (N, 3) points that protrude from the whole model, on rays that hit the trunk behind them.

    Furniture next to a person and another person's arm protrude, too, but the trunk is not behind them.
    """
    ends, radii = posture.capsules()
    out = observation.points[signed_distances(observation.points, ends, radii) > _MIN_PROTRUSION_M]
    eye = observation.view.world_from_camera[:3, 3].astype(np.float32)
    return out[ray_clearances(out, eye, *_TRUNK_INTERVAL_M, ends[_TRUNK], radii[_TRUNK]) < 0.0]
