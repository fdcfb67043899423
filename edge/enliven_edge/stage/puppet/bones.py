"""Tracks the directions of a performer's bones in the performer's own frame.

Occluded bones keep their direction.

Directions do not depend on a performer's height, position or facing. So a child moves a puppet in the same
way as an adult.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven.person import PARENTS, Body, Joint
from enliven.possession import rotation_about_y

_UP = (0.0, 1.0, 0.0)
"""Unit direction of the trunk's bones of a standing person."""
_DOWN = (0.0, -1.0, 0.0)
"""Unit direction of hanging arms and of legs."""
_FOOT_DIRECTION = (0.0, -0.5, 0.866)
"""Unit direction from ankle to foot of a level sole: 30 degrees below the horizontal."""
_PARENT = np.maximum(np.array(PARENTS), 0)
_MIN_LENGTH_M = 1e-3
"""Minimum length in metres of a bone with a direction. A millimetre is below the noise of joints."""


def compute_standing_directions() -> Float:
    """Returns (20, 3) unit directions of the bones that end at the joints: upright, facing +Z, arms
    hanging."""
    directions = np.tile(np.array(_DOWN), (len(Joint), 1))
    for joint in (Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD):
        directions[joint] = _UP
    for joint, direction in (
        (Joint.SHOULDER_LEFT, (0.94, -0.34, 0.0)),
        (Joint.SHOULDER_RIGHT, (-0.94, -0.34, 0.0)),
        (Joint.HIP_LEFT, (0.77, -0.64, 0.0)),
        (Joint.HIP_RIGHT, (-0.77, -0.64, 0.0)),
        (Joint.FOOT_LEFT, _FOOT_DIRECTION),
        (Joint.FOOT_RIGHT, _FOOT_DIRECTION),
    ):
        directions[joint] = direction
    return directions


@dataclass(frozen=True, eq=False)
class BonePose:
    """The directions of a performer's bones at one moment, in the performer's own frame.

    Attributes:
        directions: (20, 3) unit directions of the bones that end at the joints. Front is +Z, left is +X.
        pelvis, chest, head: (3, 3) rotations; the identity for an upright performer.
        yaw: radians about +Y from +Z to the facing direction, without jumps of a whole turn.
    """

    directions: Float
    pelvis: Float
    chest: Float
    head: Float
    yaw: float


class BoneTracker:
    """Tracks the bones of one performer over time.

    Args:
        ease: seconds until a bone has full weight after it became visible again.
    """

    def __init__(self, ease: float) -> None:
        self._ease = ease
        self._directions = compute_standing_directions()
        self._trust = np.zeros(len(Joint))
        self._turns = np.tile(np.eye(3), (3, 1, 1))
        self._trunk_trust = np.zeros(3)
        self._yaw: float | None = None
        self._is_first = True

    def update(self, body: Body, seconds: float) -> BonePose:
        """Updates the bones from a body ``seconds`` after the last one, and returns them."""
        is_tracked = (body.confidence > 0) & np.isfinite(body.joints).all(1)
        gain = 1.0 if self._is_first or self._ease <= 0.0 else seconds / self._ease
        turns, sure = _trunk_rotations(body, is_tracked)
        # If the performer is too near for the hips to be visible, use the chest as the facing direction.
        self._update_yaw(turns[0] if sure[0] else turns[1], bool(sure[0] or sure[1]))
        yaw = self._yaw or 0.0
        world_to_front = rotation_about_y(-yaw)
        self._blend_trunk(world_to_front @ turns, sure, gain)
        joints = np.where(is_tracked[:, None], body.joints, 0.0)
        vectors = (joints - joints[_PARENT]) @ world_to_front.T
        lengths = np.linalg.norm(vectors, axis=1)
        is_known = is_tracked & is_tracked[_PARENT] & (lengths > _MIN_LENGTH_M)
        self._trust = np.where(is_known, np.minimum(self._trust + gain, 1.0), 0.0)
        directions = vectors / np.maximum(lengths, _MIN_LENGTH_M)[:, None]
        old_directions = self._directions
        self._directions = _normalise(
            old_directions + self._trust[:, None] * (directions - old_directions), old_directions
        )
        self._is_first = False
        return self.seen

    @property
    def seen(self) -> BonePose:
        """Returns the bones of the last body."""
        pelvis, chest, head = self._turns
        return BonePose(self._directions, pelvis, chest, head, self._yaw or 0.0)

    def _update_yaw(self, pelvis: Float, sure: bool) -> None:
        """Updates the yaw continuously, without a jump of a whole turn at +-pi."""
        if not sure:
            return
        yaw = _yaw_from_rotation(pelvis)
        old_yaw = yaw if self._yaw is None else self._yaw
        self._yaw = old_yaw + float((yaw - old_yaw + np.pi) % (2.0 * np.pi) - np.pi)

    def _blend_trunk(self, turns: Float, sure: Bool, gain: float) -> None:
        self._trunk_trust = np.where(sure, np.minimum(self._trunk_trust + gain, 1.0), 0.0)
        mixed = self._turns + self._trunk_trust[:, None, None] * (turns - self._turns)
        left, _, right = np.linalg.svd(mixed)
        rotations = left @ right
        is_proper = np.linalg.det(rotations) > 0
        self._turns = np.where(is_proper[:, None, None], rotations, self._turns)


def _trunk_rotations(body: Body, known: Bool) -> tuple[Float, Bool]:
    """Returns (3, 3, 3) world rotations of pelvis, chest and head, and (3,) flags of those with all joints
    visible."""
    positions, j = body.joints, Joint
    need = (
        (j.HIP_CENTER, j.HIP_LEFT, j.HIP_RIGHT, j.SHOULDER_CENTER),
        (j.SHOULDER_CENTER, j.SHOULDER_LEFT, j.SHOULDER_RIGHT, j.HIP_CENTER),
        (j.HEAD, j.SHOULDER_CENTER, j.SHOULDER_LEFT, j.SHOULDER_RIGHT),
    )
    sure = np.array([known[list(joints)].all() for joints in need])
    turns = np.tile(np.eye(3), (3, 1, 1))
    ends = (
        (j.HIP_LEFT, j.HIP_RIGHT, j.SHOULDER_CENTER, j.HIP_CENTER),
        (j.SHOULDER_LEFT, j.SHOULDER_RIGHT, j.SHOULDER_CENTER, j.HIP_CENTER),
        (j.SHOULDER_LEFT, j.SHOULDER_RIGHT, j.HEAD, j.SHOULDER_CENTER),
    )
    for k, (left, right, upper, lower) in enumerate(ends):
        frame = (
            _frame_from_axes(positions[left] - positions[right], positions[upper] - positions[lower])
            if sure[k]
            else None
        )
        sure[k] = frame is not None
        if frame is not None:
            turns[k] = frame
    return turns, sure


def _frame_from_axes(left: Float, up: Float) -> Float | None:
    """Returns a (3, 3) rotation with columns left, up, front. Returns None if the vectors are too short."""
    size = float(np.linalg.norm(up))
    if size < _MIN_LENGTH_M:
        return None
    y = up / size
    x = left - (left @ y) * y
    size = float(np.linalg.norm(x))
    if size < _MIN_LENGTH_M:
        return None
    x = x / size
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _yaw_from_rotation(turn: Float) -> float:
    """Returns the yaw of a (3, 3) rotation in radians about +Y.

    It equals :func:`enliven.examples.performer.yaw_from_rotation`.
    """
    return float(np.arctan2(turn[0, 2] - turn[2, 0], turn[0, 0] + turn[2, 2]))


def _normalise(vectors: Float, otherwise: Float) -> Float:
    """Returns (N, 3) unit vectors. Vectors without length are replaced by those of ``otherwise``."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), otherwise))
