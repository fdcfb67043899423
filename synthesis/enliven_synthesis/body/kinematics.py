"""Compiled forward kinematics of a performer. It fills the joints and the (3, 4) frames world_from_limb."""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import fields
from operator import attrgetter
from typing import Any, NamedTuple

from enliven.arrays import Float
from enliven.kernels import copy_row, copy_rows, njit
from enliven.person import Joint, Limb
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture

MAX_LEG_REACH = 0.997
"""Maximum reach of a leg as a fraction of thigh + shank, because a knee is never fully straight."""
MIN_LEG_REACH = 0.3
"""Minimum reach of a leg as a fraction of thigh + shank, because a knee cannot bend further."""
_PELVIS_WEIGHT = 0.35
"""Weight of the pelvis' forward direction in the bending direction of the knee. The foot's direction has
weight 1."""

_PELVIS, _ABDOMEN, _CHEST, _SKULL = (int(limb) for limb in list(Limb)[:4])
# The index of the left limb of each pair. The right limb follows it.
_UPPER_ARM, _FOREARM, _HAND, _THIGH, _SHANK, _FOOT = (int(limb) for limb in list(Limb)[4::2])
_SPINE, _NECK, _HEAD = int(Joint.SPINE), int(Joint.SHOULDER_CENTER), int(Joint.HEAD)
_SHOULDER, _HIP = int(Joint.SHOULDER_LEFT), int(Joint.HIP_LEFT)
_SIDES_APART = int(Joint.HIP_RIGHT) - int(Joint.HIP_LEFT)


class Lengths(NamedTuple):
    """A performer's build in metres: lengths and (3,) offsets.

    Values of paired limbs are for the left side.
    """

    spine: Float
    neck_base: Float
    head: Float
    shoulder: Float
    hip: Float
    ball: Float
    upper_arm: float
    forearm: float
    hand: float
    thigh: float
    shank: float
    ankle_height: float
    standing: float


def _make_tuple_type(name: str, kind: type) -> Any:
    """Creates a named tuple type from the float fields of a dataclass."""
    named: Any = namedtuple
    return named(name, [f.name for f in fields(kind) if f.type == "float"])


_Trunk, _Arm = _make_tuple_type("_Trunk", PerformerPosture), _make_tuple_type("_Arm", ArmPose)
_Foot = _make_tuple_type("_Foot", FootPose)
_trunk_of, _arm_of, _foot_of = (attrgetter(*numbers._fields) for numbers in (_Trunk, _Arm, _Foot))


def posture_tuples(posture: PerformerPosture) -> tuple[Any, Any, Any]:
    """Returns the trunk, the two arms and the two feet as named tuples of floats.

    Compiled kernels accept this form.
    """
    trunk = _Trunk._make(map(float, _trunk_of(posture)))
    arms = tuple(_Arm._make(map(float, _arm_of(arm))) for arm in (posture.left_arm, posture.right_arm))
    feet = tuple(_Foot._make(map(float, _foot_of(foot))) for foot in (posture.left_foot, posture.right_foot))
    return trunk, arms, feet


@njit(cache=True, nogil=True, error_model="numpy")
def forward_kinematics(build: Any, trunk: Any, arms: Any, feet: Any, joints: Float, frames: Float) -> None:
    """Fills the joints (20, 3) and the frames (16, 3, 4) of a posture.

    Args:
        build: :class:`Lengths`.
        trunk, arms, feet: the result of :func:`posture_tuples`.
    """
    for side in range(2):
        _place_foot_frame(build, feet[side], frames[_FOOT + side])
    pelvis = frames[_PELVIS]
    _set_identity(pelvis)
    pelvis[0, 3], pelvis[1, 3], pelvis[2, 3] = trunk.x, build.standing + trunk.rise, trunk.z
    _bend_frame(pelvis, trunk.yaw, trunk.pitch, trunk.roll, 1.0)
    for side in range(2):
        if feet[side].lift <= 0:
            pelvis[1, 3] = min(
                pelvis[1, 3], _max_pelvis_height(build, pelvis, frames[_FOOT + side], 1.0 - 2.0 * side)
            )
    copy_row(joints[0], pelvis[:, 3])
    _place_trunk_frames(build, trunk, joints, frames)
    for side in range(2):
        _place_arm_frames(build, arms[side], side, joints[_SHOULDER + _SIDES_APART * side :], frames)
        _place_leg_frames(build, feet[side], side, joints[_HIP + _SIDES_APART * side :], frames)


@njit(cache=True, nogil=True)
def _set_identity(frame: Float) -> None:
    """Sets the rotation of a frame to the identity."""
    for i in range(3):
        for j in range(3):
            frame[i, j] = 1.0 if i == j else 0.0


@njit(cache=True, nogil=True)
def _rotate_frame(frame: Float, axis: int, angle: float) -> None:
    """Rotates a frame by ``angle`` radians about its own axis number ``axis``."""
    first_axis, second_axis = (axis + 1) % 3, (axis + 2) % 3
    c, s = math.cos(angle), math.sin(angle)
    for i in range(3):
        a, b = frame[i, first_axis], frame[i, second_axis]
        frame[i, first_axis], frame[i, second_axis] = c * a + s * b, c * b - s * a


@njit(cache=True, nogil=True)
def _bend_frame(frame: Float, yaw: float, pitch: float, roll: float, share: float) -> None:
    """Rotates a frame by a fraction of three angles: yaw to its left, pitch forward, roll to its left."""
    _rotate_frame(frame, 1, share * yaw)
    _rotate_frame(frame, 0, share * pitch)
    _rotate_frame(frame, 2, -share * roll)


@njit(cache=True, nogil=True)
def _add_offset(point: Float, frame: Float, x: float, y: float, z: float) -> None:
    """Adds an offset, given in the coordinates of a frame, to a point (3,)."""
    for i in range(3):
        point[i] += frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z


@njit(cache=True, nogil=True)
def _place_foot_frame(build: Any, foot: Any, frame: Float) -> None:
    """Fills the frame of a foot: the target ankle position and the rotation.

    The foot pitches about its ball.
    """
    _set_identity(frame)
    frame[0, 3], frame[1, 3], frame[2, 3] = foot.x, build.ankle_height + foot.lift, foot.z
    _rotate_frame(frame, 1, foot.yaw)
    _add_offset(frame[:, 3], frame, build.ball[0], build.ball[1], build.ball[2])
    _rotate_frame(frame, 0, -foot.pitch)
    _add_offset(frame[:, 3], frame, -build.ball[0], -build.ball[1], -build.ball[2])


@njit(cache=True, nogil=True)
def _max_pelvis_height(build: Any, pelvis: Float, foot: Float, sign: float) -> float:
    """Returns the pelvis height in metres at which the leg to a planted foot is fully stretched."""
    x, y, z = sign * build.hip[0], build.hip[1], build.hip[2]
    up = pelvis[1, 0] * x + pelvis[1, 1] * y + pelvis[1, 2] * z
    aside = pelvis[0, 3] + (pelvis[0, 0] * x + pelvis[0, 1] * y + pelvis[0, 2] * z) - foot[0, 3]
    along = pelvis[2, 3] + (pelvis[2, 0] * x + pelvis[2, 1] * y + pelvis[2, 2] * z) - foot[2, 3]
    reach = MAX_LEG_REACH * (build.thigh + build.shank)
    return foot[1, 3] - up + math.sqrt(max(reach * reach - (aside * aside + along * along), 0.0))


@njit(cache=True, nogil=True)
def _place_trunk_frames(build: Any, trunk: Any, joints: Float, frames: Float) -> None:
    """Fills the frames from pelvis to head.

    A third of the spine's bend is below the spine joint, the rest is above it.
    """
    abdomen, chest, skull = frames[_ABDOMEN], frames[_CHEST], frames[_SKULL]
    copy_rows(abdomen, frames[_PELVIS])
    _bend_frame(abdomen, trunk.spine_yaw, trunk.spine_pitch, trunk.spine_roll, 1.0 / 3.0)
    _add_offset(abdomen[:, 3], abdomen, build.spine[0], build.spine[1], build.spine[2])
    copy_rows(chest, abdomen)
    _bend_frame(chest, trunk.spine_yaw, trunk.spine_pitch, trunk.spine_roll, 2.0 / 3.0)
    _add_offset(chest[:, 3], chest, build.neck_base[0], build.neck_base[1], build.neck_base[2])
    copy_rows(skull, chest)
    _bend_frame(skull, trunk.head_yaw, trunk.head_pitch, trunk.head_roll, 1.0 / 3.0)
    _add_offset(skull[:, 3], skull, build.head[0], build.head[1], build.head[2])
    copy_rows(skull[:, :3], chest[:, :3])
    _bend_frame(skull, trunk.head_yaw, trunk.head_pitch, trunk.head_roll, 1.0)
    copy_row(joints[_SPINE], abdomen[:, 3])
    copy_row(joints[_NECK], chest[:, 3])
    copy_row(joints[_HEAD], skull[:, 3])


@njit(cache=True, nogil=True)
def _place_arm_frames(build: Any, arm: Any, side: int, joints: Float, frames: Float) -> None:
    """Fills the frames from shoulder to hand of one side.

    ``side`` is 0 for the left and 1 for the right. ``joints`` starts at the shoulder.
    """
    sign, chest = 1.0 - 2.0 * side, frames[_CHEST]
    upper, fore, palm = frames[_UPPER_ARM + side], frames[_FOREARM + side], frames[_HAND + side]
    copy_rows(upper, chest)
    _rotate_frame(upper, 2, sign * arm.shrug)
    _add_offset(upper[:, 3], upper, sign * build.shoulder[0], build.shoulder[1], build.shoulder[2])
    copy_rows(upper[:, :3], chest[:, :3])
    _rotate_frame(upper, 2, sign * arm.abduct)
    _rotate_frame(upper, 0, -arm.flex)
    _rotate_frame(upper, 1, -sign * arm.twist)
    copy_rows(fore, upper)
    _add_offset(fore[:, 3], upper, 0.0, -build.upper_arm, 0.0)
    _rotate_frame(fore, 0, -arm.elbow)
    copy_rows(palm, fore)
    _add_offset(palm[:, 3], fore, 0.0, -build.forearm, 0.0)
    _rotate_frame(palm, 1, -sign * arm.pronate)
    _rotate_frame(palm, 2, -sign * arm.wrist)
    copy_row(joints[0], upper[:, 3])
    copy_row(joints[1], fore[:, 3])
    copy_row(joints[2], palm[:, 3])
    copy_row(joints[3], palm[:, 3])
    _add_offset(joints[3], palm, 0.0, -build.hand, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _place_leg_frames(build: Any, foot: Any, side: int, joints: Float, frames: Float) -> None:
    """Fills the frames from hip to foot of one side.

    The knee bends in the direction of the foot plus its splay. ``joints`` starts at the hip.
    """
    sign, pelvis, sole = 1.0 - 2.0 * side, frames[_PELVIS], frames[_FOOT + side]
    hip, knee, ankle = joints[0], joints[1], joints[2]
    copy_row(hip, pelvis[:, 3])
    _add_offset(hip, pelvis, sign * build.hip[0], build.hip[1], build.hip[2])
    shank = frames[_SHANK + side]
    along, forward = shank[:, 0], shank[:, 1]
    reach = MAX_LEG_REACH * (build.thigh + build.shank)
    apart = _direction(sole[:, 3], hip, along)
    distance = min(max(apart, MIN_LEG_REACH * reach), reach)
    heading = foot.yaw + sign * foot.splay
    copy_row(forward, pelvis[:, 2])
    forward[0], forward[1] = _PELVIS_WEIGHT * forward[0] + math.sin(heading), _PELVIS_WEIGHT * forward[1]
    forward[2] = _PELVIS_WEIGHT * forward[2] + math.cos(heading)
    _make_perpendicular(forward, along)
    reach_along = (distance**2 + build.thigh**2 - build.shank**2) / (2.0 * distance)
    bow = math.sqrt(max(build.thigh**2 - reach_along**2, 0.0))
    for i in range(3):
        knee[i] = hip[i] + reach_along * along[i] + bow * forward[i]
        ankle[i] = hip[i] + distance * along[i]
    copy_row(sole[:, 3], ankle)
    copy_row(joints[3], ankle)
    _add_offset(joints[3], sole, build.ball[0], build.ball[1], build.ball[2])
    _place_bone_frame(hip, knee, forward, frames[_THIGH + side])
    _place_bone_frame(knee, ankle, forward, shank)


@njit(cache=True, nogil=True, error_model="numpy")
def _direction(to: Float, start: Float, out: Float) -> float:
    """Fills the unit vector (3,) from ``start`` to ``to``, and returns the distance.

    If the points coincide, the vector points down.
    """
    x, y, z = to[0] - start[0], to[1] - start[1], to[2] - start[2]
    apart = math.sqrt(x * x + y * y + z * z)
    out[0], out[1], out[2] = 0.0, -1.0, 0.0
    if apart > 1e-6:
        out[0], out[1], out[2] = x / apart, y / apart, z / apart
    return apart


@njit(cache=True, nogil=True, error_model="numpy")
def _make_perpendicular(vector: Float, unit: Float) -> None:
    """Removes the component along a unit vector (3,) from a vector (3,) in place, and normalises the
    vector.
    """
    shared = vector[0] * unit[0] + vector[1] * unit[1] + vector[2] * unit[2]
    for i in range(3):
        vector[i] -= shared * unit[i]
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    for i in range(3):
        vector[i] /= length


@njit(cache=True, nogil=True, error_model="numpy")
def _place_bone_frame(top: Float, end: Float, forward: Float, frame: Float) -> None:
    """Fills a frame at ``top`` with +Y pointing away from ``end`` and +Z as close to ``forward`` as possible.

    ``forward`` may be the frame's own second column.
    """
    x, y, z = frame[:, 0], frame[:, 1], frame[:, 2]
    copy_row(z, forward)
    _direction(top, end, y)
    _make_perpendicular(z, y)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        x[i] = y[j] * z[k] - y[k] * z[j]
    copy_row(frame[:, 3], top)
