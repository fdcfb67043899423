"""Limb-to-limb retargeting: maps a performer's joints to the skeleton that was found in a mesh."""

from __future__ import annotations

import numpy as np

from enliven import rotation
from enliven.arrays import Float, Float32
from enliven.person import PARENTS, Body, J, Joint
from enliven.possession.attachment.bone_cylinders import bone_rotations, fill_joints
from enliven.possession.likeness.skeleton import BodyInMesh
from enliven.possession.likeness.standing_person import make_standing_figure
from enliven.possession.placement import body_yaw, rotation_about_y, wrap_angle
from enliven.rotation import unit

_HIP_JOINT = Joint.HIP_CENTER
_MESH_POSED_JOINTS = frozenset(
    joint for joint in Joint if joint.name.split("_")[0] in ("ELBOW", "WRIST", "KNEE", "ANKLE")
)
"""Child joints of the arm and leg bones that point in the same direction as the performer's bones. The trunk,
the hands and the feet of a mesh may be built differently, so their bones only rotate by the same amount as
the performer's."""
_MAX_EASING_SLOPE = 1.5 * np.pi / 2
"""Maximum ratio of the easing's top speed to its mean speed: the maximum slope of the cubic easing (1.5),
times the ratio of arc to chord of a half turn (pi / 2)."""


class LimbRetargeting:
    """A limb-to-limb retargeting. Each bone of the mesh's own skeleton rotates like the corresponding bone of
    the performer.

    Joints are chained down the mesh's skeleton: j = parent + Q R Q^T (rest bone). R is the rotation of the
    performer's bone since its reference pose. Q is the rotation from the direction that the mesh faces in the
    world to the direction that it faces in its rest space. A human-like mesh moves from its own pose into its
    performer's pose, and always faces in the performer's direction. Any other mesh keeps its pose when the
    performer attaches, and rotates by the same amount as the performer. The hip moves as the performer's hip
    does, scaled by the ratio of the leg lengths if the mesh has legs.

    While a human-like mesh moves into the pose, R is split into the heading of the performer's hips, a
    rotation about +Y, and the remaining rotation. Only the remaining rotation is interpolated. Interpolating
    all of R would show only a part of each turn of the performer, and would jump when a turn passes 180
    degrees.

    Args:
        likeness: the mesh's skeleton.
        body: the performer at the time of attaching.
        scale: metres of the performer per metre of the rest space.
        travel: fraction of the performer's travel over the floor that the mesh follows.
        seconds: duration of the move of the mesh into the performer's pose.
        pace: maximum speed of this move, in the performer's metres per second.
        inside: True if the mesh is at the performer's position and travels exactly like the performer.
        front: radians about +Y, the direction that a human-like mesh at rest faces in the world. None means
            the performer's direction.

    Attributes:
        turns: (19, 3, 3) rotation of each bone of the mesh since rest, for the last joints.
        turned: radians about +Y by which the performer's hips turned between the last two calls.
    """

    fits = True

    def __init__(
        self,
        likeness: BodyInMesh,
        body: Body,
        scale: float,
        travel: float = 1.0,
        seconds: float = 0.0,
        pace: float = np.inf,
        inside: bool = False,
        front: float | None = None,
    ) -> None:
        self.likeness, self.scale, self.body = likeness, scale, body.id
        self._last = current = fill_joints(body.joints, body.joints)
        self._front = body_yaw(body) if front is None or not likeness.human else front
        self._turn = rotation_about_y(likeness.yaw - self._front)
        self._rest = (
            _pose_like_mesh(likeness, current, self._front, self._turn) if likeness.human else current
        )
        self._heading, self.turned = _hip_heading(current), 0.0
        self._start_gap = wrap_angle(self._heading - self._front)
        self.turns: Float = np.tile(np.eye(3), (J - 1, 1, 1))
        self._home = self._rest[_HIP_JOINT].copy()
        measure = scale
        if np.isfinite(likeness.leg_length):
            of_legs = BodyInMesh(self._rest, 0.0).leg_length / likeness.leg_length
            measure = float(np.clip(of_legs, scale / 5, 5 * scale))
        over_floor = travel / (scale if inside else measure)
        self._steps = np.array([over_floor, 1.0 / measure, over_floor])
        self._share, self._start_ns, self._seconds = 1.0, -1, seconds
        if likeness.human and seconds > 0:
            farthest = float(np.linalg.norm(self(body.joints) - likeness.joints, axis=1).max())
            self._seconds = max(seconds, _MAX_EASING_SLOPE * farthest * scale / pace)
            self._share = 0.0

    @property
    def at_rest(self) -> Float | None:
        """(20, 3) metres, the joint positions at which the bones attach to the mesh at rest. If None, the
        current joints are used.
        """
        return self.likeness.joints if self.likeness.human else None

    def continue_from(self, other: LimbRetargeting) -> None:
        """Continues the move into the performer's pose from the progress of an earlier transform of the same
        performer.
        """
        self._share, self._start_ns, self._seconds = other._share, other._start_ns, other._seconds
        self._start_gap = other._start_gap

    def set_time(self, time_ns: int) -> None:
        """Advances the move of the mesh into the performer's pose to a time."""
        if self._share < 1.0:
            self._start_ns = time_ns if self._start_ns < 0 else self._start_ns
            fraction = float(np.clip((time_ns - self._start_ns) * 1e-9 / self._seconds, 0.0, 1.0))
            self._share = fraction * fraction * (3.0 - 2.0 * fraction)

    def __call__(self, joints: Float) -> Float:
        """Converts the performer's joints (20, 3) in the world to joints (20, 3) of the mesh's skeleton.
        Joints that the mesh lacks are NaN.
        """
        current = fill_joints(joints, self._last)
        self._last = current
        last_heading, self._heading = self._heading, _hip_heading(current)
        self.turned = wrap_angle(self._heading - last_heading)
        since_rest = bone_rotations(self._rest, current)[0]
        if self._share < 1.0:
            since_rest = self._partial_rotations(since_rest, self._heading - self._front)
        self.turns = turns = self._turn @ since_rest @ self._turn.T
        mesh_joints = self.likeness.joints
        displacement = (current[_HIP_JOINT] - self._home) * self._steps
        mesh_skeleton = np.empty((J, 3))
        mesh_skeleton[_HIP_JOINT] = mesh_joints[_HIP_JOINT] + self._share * (self._turn @ displacement)
        for child in range(1, J):
            parent = PARENTS[child]
            mesh_skeleton[child] = mesh_skeleton[parent] + turns[child - 1] @ (
                mesh_joints[child] - mesh_joints[parent]
            )
        return mesh_skeleton

    def _partial_rotations(self, since_rest: Float, heading: float) -> Float:
        """Returns (19, 3, 3) bone rotations interpolated from rest to ``since_rest``, in the world.

        Args:
            heading: radians about +Y from the mesh's front at rest to the front of the performer's hips.
        """
        level = rotation.from_matrix(rotation_about_y(-heading) @ since_rest)
        partial = rotation.slerp(rotation.IDENTITY, level, np.array(self._share))
        shown_heading = heading - (1.0 - self._share) * self._start_gap
        return np.asarray(rotation_about_y(shown_heading) @ rotation.to_matrix(partial))

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """Returns two empty arrays (0, 3), because a person's surface does not fit a mesh of another
        shape.
        """
        return np.empty((0, 3)), np.empty((0, 3))

    def hand_over_to(self, body: Body) -> None:
        """Continues with another body from the last position of the previous body."""
        self.body = body.id
        self._heading = _hip_heading(fill_joints(body.joints, self._last))
        step = body.joints[_HIP_JOINT] - self._last[_HIP_JOINT]
        if np.isfinite(step).all():
            self._home = self._home + step
            self._last = self._last + step


def _hip_heading(joints: Float) -> float:
    """Returns the heading of the hips of (20, 3) joints: radians about +Y from +Z."""
    left = joints[Joint.HIP_LEFT] - joints[Joint.HIP_RIGHT]
    return float(np.arctan2(-left[2], left[0]))


def _pose_like_mesh(likeness: BodyInMesh, current_joints: Float, yaw: float, turn: Float) -> Float:
    """Returns joints (20, 3), metres, of the performer standing upright on the floor. The limbs have the
    directions of the mesh's limbs at rest.

    Args:
        current_joints: (20, 3) current joints of the performer, metres.
        yaw: radians about +Y, the direction that the returned figure faces.
        turn: (3, 3) rotation from the direction ``yaw`` to the mesh's front.
    """
    figure = make_standing_figure() @ rotation_about_y(yaw).T
    mesh = likeness.joints @ turn
    upright = np.empty((J, 3))
    upright[_HIP_JOINT] = current_joints[_HIP_JOINT]
    for joint in list(Joint)[1:]:
        parent = PARENTS[joint]
        direction = figure[joint] - figure[parent]
        if joint in _MESH_POSED_JOINTS:
            direction = mesh[joint] - mesh[parent]
        elif Joint(parent) in _MESH_POSED_JOINTS:
            grandparent = PARENTS[parent]
            direction = rotation.rotate(
                rotation.swing(
                    unit(figure[parent] - figure[grandparent]), unit(mesh[parent] - mesh[grandparent])
                ),
                direction,
            )
        upright[joint] = upright[parent] + float(
            np.linalg.norm(current_joints[joint] - current_joints[parent])
        ) * unit(direction)
    upright[:, 1] += current_joints[:, 1].min() - upright[:, 1].min()
    return upright
