"""Initial postures of a detection: the network's estimate, standing postures, and a bank of other
postures."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32, Int
from enliven.matching.assignment import solve_assignment
from enliven.person import Joint
from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.capsules import misfits
from enliven_edge.tracking.body_model.joint_limits import RELAXED, mirror_rotations, standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.detect.extremities import Extremities
from enliven_edge.tracking.estimator.estimator import Estimate
from enliven_edge.tracking.fit.alignment import align
from enliven_edge.tracking.frame.observation import Observation

_ROBUST_WIDTH_M = 0.3
"""Robust width in metres of the joints with which the model is aligned."""
_NEAR_STEPS = 10
"""Alignment steps for a posture that is already near its targets."""
_RELAXED_STEPS = 20
"""Alignment steps from a relaxed posture. Its limbs are farther from their targets."""


def pose_from_estimate(estimate: Estimate, lengths: Float) -> Posture:
    """Returns a posture of (12,) lengths, aligned with the estimate's joints from a relaxed start."""
    start = Posture(estimate.joints[Joint.HIP_CENTER].copy(), joint_limits.RELAXED.copy(), lengths.copy())
    start.rotations[model.PELVIS] = _trunk_axes(estimate.joints)
    return align_to_estimate(start, estimate, _RELAXED_STEPS)


def align_to_estimate(posture: Posture, estimate: Estimate, steps: int = _NEAR_STEPS) -> Posture:
    """Aligns a posture with the estimate's joints, weighted by their confidence. Keeps its lengths."""
    weights = estimate.landmarks[:, 3]
    aligned, _ = align(
        posture,
        model.JOINT_FRAMES,
        model.JOINT_OFFSETS,
        estimate.joints,
        weights,
        width=_ROBUST_WIDTH_M,
        iterations=steps,
    )
    return aligned


def _trunk_axes(joints: Float) -> Float:
    """Returns the (3, 3) axes of the trunk between hips and shoulders, as columns: left, up and ahead."""
    left = joints[Joint.SHOULDER_LEFT] - joints[Joint.SHOULDER_RIGHT]
    left = left + joints[Joint.HIP_LEFT] - joints[Joint.HIP_RIGHT]
    up = joints[Joint.SHOULDER_CENTER] - joints[Joint.HIP_CENTER]
    up = up / (np.linalg.norm(up) + 1e-9)
    left = left - (left @ up) * up
    left = left / (np.linalg.norm(left) + 1e-9)
    return np.stack([left, up, np.cross(left, up)], 1)


_ARMS = (
    {"arm_raise": 0.12, "elbow": 0.2},
    {"arm_raise": 0.15, "arm_forward": 0.1, "elbow": 1.5},
    {"arm_raise": 1.4, "elbow": 0.1},
    {"arm_raise": 2.6, "elbow": 0.2},
)
"""Arm angles in radians of standing postures: arms hanging, forearms forward, arms out, arms overhead."""
_LEFT_ARM = [model.UPPER_ARM_L, model.FOREARM_L]
_RIGHT_ARM = [model.UPPER_ARM_R, model.FOREARM_R]
_SIDE_YAW = 1.2
"""Heading in radians, relative to facing the sensor, of the two postures that are turned sideways. At this
heading both arms are still visible.
"""
_YAWS = (0.0, 1.57, 3.14, -1.57)
"""Headings in radians, relative to facing the sensor, at which each posture of the bank is tried: quarter
turns."""
_BANK_POINTS = 100
"""Number of points with which a posture of the bank is compared: enough to rank it."""
_MAX_MISFIT_M = 0.4
"""Upper limit in metres to which a point's distance from a posture is clipped. It limits the effect of stray
points.
"""
_BEHIND_SURFACE = 0.1
"""Metres from the visible surface back to the middle of a standing body: half of a trunk's depth."""
_BEHIND_POINTS = 0.08
"""Metres from the median of all points back to the middle of a body in another posture."""
_BEHIND_TIP = 0.04
"""Metres from a visible extremity back to the middle of a hand, foot or the head's top."""


def _bent_rotations(
    *,
    pitch: float = 0.0,
    bend: float = 0.0,
    thighs: tuple[float, float] = (0.0, 0.0),
    knees: tuple[float, float] = (0.05, 0.05),
    leg_spread: tuple[float, float] = (0.06, 0.06),
    arm_raise: float = 0.15,
    arm_forward: float = 0.0,
    elbow: float = 0.4,
) -> Float:
    """Returns the (13, 3, 3) posture for some angles of trunk and legs, left and right, in radians."""
    rotations = standing_pose(arm_raise=arm_raise, arm_forward=arm_forward, elbow=elbow)
    rotations[model.PELVIS], rotations[model.CHEST] = rotation(x=pitch), rotation(x=bend)
    for side, thigh in enumerate((model.THIGH_L, model.THIGH_R)):
        outward = leg_spread[side] * (1 - 2 * side)
        rotations[thigh] = rotation(x=-thighs[side], z=outward)
        rotations[thigh + 1] = rotation(x=knees[side])
    return rotations


def _create_bank() -> list[Float]:
    """Creates the bank: crouching, kneeling, sitting, reaching for the floor, one leg up, lunging."""
    symmetric = [
        _bent_rotations(
            pitch=0.3, bend=0.3, thighs=(2.0, 2.0), knees=(2.2, 2.2), leg_spread=(0.3, 0.3), arm_forward=0.8
        ),
        _bent_rotations(
            pitch=0.3, bend=0.3, thighs=(1.2, 1.2), knees=(1.4, 1.4), leg_spread=(0.2, 0.2), arm_forward=0.4
        ),
        _bent_rotations(thighs=(0.05, 0.05), knees=(1.6, 1.6)),
        _bent_rotations(thighs=(1.5, 1.5), knees=(1.5, 1.5), arm_forward=0.3, elbow=0.8),
        _bent_rotations(pitch=1.1, bend=0.7, thighs=(1.0, 1.0), knees=(0.1, 0.1), arm_forward=1.5, elbow=0.1),
        _bent_rotations(pitch=0.6, bend=0.5, thighs=(0.6, 0.6), knees=(0.2, 0.2), arm_forward=1.0, elbow=0.1),
    ]
    left = [
        _bent_rotations(thighs=(1.5, 0.05), knees=(1.5, 1.6)),
        _bent_rotations(thighs=(1.4, 0.05), knees=(1.3, 0.1)),
        _bent_rotations(thighs=(1.3, 0.05), knees=(0.1, 0.1)),
        _bent_rotations(leg_spread=(1.0, 0.0)),
        _bent_rotations(thighs=(-0.4, 0.05), knees=(1.3, 0.1)),
        _bent_rotations(pitch=0.1, thighs=(1.2, -0.4), knees=(1.2, 0.5)),
    ]
    return [*symmetric, *left, *(mirror_rotations(rotations) for rotations in left)]


BANK = _create_bank()
"""[(13, 3, 3)] the bank: rotations of postures other than standing upright, facing +Z."""


def make_standing_starts(observation: Observation, eye: Float, lengths: Float) -> list[Posture]:
    """Returns standing postures below the crown: six poses of the arms, and two sideways headings.

    Args:
        observation: the observed person.
        eye: (3,) the sensor's position, world frame.
        lengths: (12,) metres, bone lengths of this person or of an average one.
    """
    centre = np.median(observation.points, axis=0).astype(np.float64)
    facing = _yaw_towards(eye, centre)
    return [
        _place_under_crown(observation, centre, _rotate_about_vertical(rotations, facing + yaw), lengths)
        for rotations, yaw in _STANDING
    ]


def bank_starts(
    observation: Observation, extremities: Extremities, eye: Float, lengths: Float, max_count: int
) -> list[Posture]:
    """Returns the ``max_count`` postures of the bank that fit the points best, aligned with the
    extremities."""
    points = np.ascontiguousarray(observation.points[:: max(1, len(observation.points) // _BANK_POINTS)])
    centre = np.median(points, axis=0).astype(np.float64)
    facing = _yaw_towards(eye, centre)
    bank_postures = [Posture(np.zeros(3), rotations, lengths) for rotations in (*BANK, RELAXED)]
    shapes = np.stack([posture.capsules()[0] for posture in bank_postures])
    headings = np.stack([rotation(y=facing + yaw) for yaw in _YAWS])
    ends = np.einsum("yij,pcej->pycei", headings, shapes).reshape(-1, *shapes.shape[1:])
    radii = bank_postures[0].capsules()[1]
    positions = _centre_on_points(points, centre, ends, radii, eye)
    misfit = misfits(np.ascontiguousarray(points.T), ends + positions[:, None, None], radii, _MAX_MISFIT_M)
    starts = []
    for index in np.argsort(misfit, kind="stable")[:max_count]:
        rotations = _rotate_about_vertical(
            bank_postures[index // len(headings)].rotations, facing + _YAWS[index % len(headings)]
        )
        starts.append(
            _reach_extremities(Posture(positions[index], rotations, lengths.copy()), extremities, eye)
        )
    return starts


def _yaw_towards(eye: Float, centre: Float) -> float:
    """Returns the angle about +Y in radians from +Z to the direction from ``centre`` to the eye."""
    return float(np.arctan2(eye[0] - centre[0], eye[2] - centre[2]))


def _rotate_about_vertical(rotations: Float, yaw: float) -> Float:
    """Returns the (13, 3, 3) posture rotated about the vertical."""
    turned = rotations.copy()
    turned[model.PELVIS] = rotation(y=yaw) @ rotations[model.PELVIS]
    return turned


def _raise_one_arm(limbs: list[int]) -> Float:
    """Returns the (13, 3, 3) posture with one arm up and out, the other hanging."""
    rotations = standing_pose()
    rotations[limbs] = standing_pose(arm_raise=2.2, elbow=0.2)[limbs]
    return rotations


_STANDING = [
    *((standing_pose(**arms), 0.0) for arms in _ARMS),
    *((_raise_one_arm(limbs), 0.0) for limbs in (_LEFT_ARM, _RIGHT_ARM)),
    *((RELAXED, yaw) for yaw in (_SIDE_YAW, -_SIDE_YAW)),
]
"""Standing postures, and their headings in radians relative to facing the sensor."""


def _place_under_crown(observation: Observation, centre: Float, rotations: Float, lengths: Float) -> Posture:
    """Returns a posture with its highest end, head or raised hand, at the top of the observed points."""
    posture = Posture(np.zeros(3), rotations, lengths.copy())
    ends, radii = posture.capsules()
    tops = (ends[..., 1] + radii).max(1)
    highest = int(np.argmax(tops))
    crown = observation.crown
    # Put a head half-way between the top and the middle of the body, because a head is horizontally near the
    # middle. A raised hand is not.
    head_x = 0.5 * (crown[0] + centre[0]) if model.CAPSULES.frame[highest] == model.HEAD else centre[0]
    head = np.array([head_x, crown[1] - tops[highest], 0.0])
    backward = centre - observation.view.world_from_camera[:3, 3]
    backward[1] = 0.0
    head[2] = centre[2]
    posture.position = head + _BEHIND_SURFACE * backward / max(1e-6, float(np.linalg.norm(backward)))
    return posture


def _centre_on_points(points: Float32, centre: Float, ends: Float, radii: Float, eye: Float) -> Float:
    """Returns (N, 3) positions that align the middle, top and bottom of N postures with those of the points.

    The positions are half a body's depth behind the visible surface, so that each posture is inside the body.

    Args:
        points: (M, 3) metres.
        centre: (3,) the median of the points.
        ends: (N, C, 2, 3) the capsules of the postures about the origin.
        radii: (C, 2) their radii.
        eye: (3,) the sensor's position.
    """
    backward = centre - eye
    backward[1] = 0.0
    backward /= max(1e-6, float(np.linalg.norm(backward)))
    positions = centre + _BEHIND_POINTS * backward - ends.mean((1, 2))
    low, high = (ends[..., 1] - radii).min((1, 2)), (ends[..., 1] + radii).max((1, 2))
    positions[:, 1] = 0.5 * (points[:, 1].min() + points[:, 1].max()) - 0.5 * (low + high)
    return np.asarray(positions)


def _end_anchors() -> tuple[Int, Float]:
    """Returns (5,) frames and (5, 3, 12) offsets of the head's top, the hands and the feet."""
    frames, local = np.zeros(5, np.int64), np.zeros((5, 3, len(model.LENGTHS)))
    frames[0], local[0, 1, model.NECK] = model.HEAD, 1.3
    for k, arm in enumerate((model.FOREARM_L, model.FOREARM_R)):
        frames[1 + k], local[1 + k, 1, [model.FORE, model.HAND]] = arm, (-1.0, -1.2)
    for k, foot in enumerate((model.FOOT_L, model.FOOT_R)):
        frames[3 + k], local[3 + k, 1, model.FOOT], local[3 + k, 2, model.FOOT] = foot, -0.35, 0.8
    return frames, local


_END_FRAMES, _ENDS = _end_anchors()
_HIPS = np.zeros((1, 3, len(model.LENGTHS)))
"""(1, 3, 12) the offset of the hip centre in the pelvis: zero."""
_MAX_EXTREMITY_DISTANCE_M = 0.45
"""Maximum distance in metres between a limb's end and its extremity: the length of a forearm and a hand. A
more distant extremity belongs to another limb."""


def _reach_extremities(posture: Posture, ends: Extremities, eye: Float) -> Posture:
    """Moves head, hands and feet of a posture to the extremities, with the assignment of the least total
    distance.
    """
    if len(ends.points) == 0:
        return posture
    capsules, _ = posture.capsules()
    tips = capsules[[7, 10, 13, 16, 19], 1]
    inward = ends.points - eye
    targets = ends.points + _BEHIND_TIP * inward / np.linalg.norm(inward, axis=1, keepdims=True)
    distance = np.linalg.norm(tips[:, None] - targets[None], axis=2)
    limb, extremity = solve_assignment(np.minimum(distance, _MAX_EXTREMITY_DISTANCE_M))
    matched = distance[limb, extremity] < _MAX_EXTREMITY_DISTANCE_M
    frames = np.concatenate([_END_FRAMES[limb[matched]], [model.PELVIS]])
    local = np.concatenate([_ENDS[limb[matched]], _HIPS])
    anchor_targets = np.concatenate([targets[extremity[matched]], posture.position[None]])
    weights = np.full(len(frames), 0.02)
    aligned, _ = align(posture, frames, local, anchor_targets, weights, width=0.3, iterations=10)
    return aligned
