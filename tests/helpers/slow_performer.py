"""A second implementation of the performer's forward kinematics, limb by limb in NumPy: slow, but easy to
read."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven.person.joints import Joint
from enliven.person.limbs import Limb
from enliven_synthesis.body.kinematics import MAX_LEG_REACH, MIN_LEG_REACH
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.body.rotations import (
    rotation_about_x,
    rotation_about_y,
    rotation_about_z,
    round_to_grid,
)


class SlowPerformer(Performer):
    """A performer with postures computed by the reference implementation."""

    def pose(self, posture: PerformerPosture) -> Figure:
        """Computes forward kinematics.

        The pelvis is lowered if a planted foot could otherwise not reach the floor. A foot in the air is
        moved along the leg if it is out of reach, or closer than a folded leg allows.
        """
        joints, frames = np.zeros((20, 3)), np.zeros((16, 3, 4))
        pelvis = (
            rotation_about_y(posture.yaw) @ rotation_about_x(posture.pitch) @ rotation_about_z(-posture.roll)
        )
        feet = [self._ankle(posture.left_foot), self._ankle(posture.right_foot)]
        joints[Joint.HIP_CENTER] = self._pelvis_position(posture, pelvis, feet)
        frames[Limb.PELVIS] = _frame(pelvis, joints[Joint.HIP_CENTER])
        self._trunk(posture, pelvis, joints, frames)
        self._arm(posture.left_arm, 0, joints, frames)
        self._arm(posture.right_arm, 1, joints, frames)
        for side, foot in enumerate((posture.left_foot, posture.right_foot)):
            self._leg(foot, *feet[side], side, pelvis, joints, frames)
        return Figure(round_to_grid(joints), round_to_grid(frames))

    def _ankle(self, foot: FootPose) -> tuple[Float, Float]:
        """Returns (3,) the target position of the ankle, and (3, 3) the foot's orientation."""
        heading = rotation_about_y(foot.yaw)
        ball = np.array([foot.x, self.ankle_height + foot.lift, foot.z]) + heading @ self.ball
        orientation = heading @ rotation_about_x(-foot.pitch)
        return ball - orientation @ self.ball, orientation

    def _pelvis_position(
        self, posture: PerformerPosture, pelvis: Float, feet: list[tuple[Float, Float]]
    ) -> Float:
        """Returns (3,) the hip centre at the requested height, or lower if a planted leg is too short."""
        y = self.standing + posture.rise
        reach = MAX_LEG_REACH * (self.thigh + self.shank)
        for side, foot in enumerate((posture.left_foot, posture.right_foot)):
            if foot.lift > 0:
                continue
            hip = pelvis @ _mirrored(self.hip, side)
            flat = np.array([posture.x, 0.0, posture.z]) + hip - feet[side][0]
            across = flat[0] ** 2 + flat[2] ** 2
            y = min(y, float(feet[side][0][1] - hip[1] + math.sqrt(max(reach**2 - across, 0.0))))
        return np.array([posture.x, y, posture.z])

    def _trunk(self, posture: PerformerPosture, pelvis: Float, joints: Float, frames: Float) -> None:
        """Fills pelvis to head. A third of the spine's bend is below the spine joint, the rest above it."""
        lower = _bend(posture.spine_yaw / 3, posture.spine_pitch / 3, posture.spine_roll / 3)
        upper = _bend(2 * posture.spine_yaw / 3, 2 * posture.spine_pitch / 3, 2 * posture.spine_roll / 3)
        abdomen = pelvis @ lower
        chest = abdomen @ upper
        half_neck = _bend(posture.head_yaw / 3, posture.head_pitch / 3, posture.head_roll / 3)
        skull = chest @ _bend(posture.head_yaw, posture.head_pitch, posture.head_roll)
        joints[Joint.SPINE] = joints[Joint.HIP_CENTER] + abdomen @ self.spine
        joints[Joint.SHOULDER_CENTER] = joints[Joint.SPINE] + chest @ self.neck_base
        joints[Joint.HEAD] = joints[Joint.SHOULDER_CENTER] + chest @ half_neck @ self.head
        frames[Limb.ABDOMEN] = _frame(abdomen, joints[Joint.SPINE])
        frames[Limb.CHEST] = _frame(chest, joints[Joint.SHOULDER_CENTER])
        frames[Limb.SKULL] = _frame(skull, joints[Joint.HEAD])

    def _arm(self, arm: ArmPose, side: int, joints: Float, frames: Float) -> None:
        """Fills shoulder to hand; ``side`` 0 is the left, 1 the right."""
        sign = 1.0 - 2.0 * side
        first = (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)[side]
        chest = frames[Limb.CHEST, :, :3]
        girdle = chest @ rotation_about_z(sign * arm.shrug)
        upper = (
            chest
            @ rotation_about_z(sign * arm.abduct)
            @ rotation_about_x(-arm.flex)
            @ rotation_about_y(-sign * arm.twist)
        )
        fore = upper @ rotation_about_x(-arm.elbow)
        palm = fore @ rotation_about_y(-sign * arm.pronate) @ rotation_about_z(-sign * arm.wrist)
        down = np.array([0.0, -1.0, 0.0])
        joints[first] = joints[Joint.SHOULDER_CENTER] + girdle @ _mirrored(self.shoulder, side)
        joints[first + 1] = joints[first] + self.upper_arm * (upper @ down)
        joints[first + 2] = joints[first + 1] + self.forearm * (fore @ down)
        joints[first + 3] = joints[first + 2] + self.hand * (palm @ down)
        for limb, rotation, joint in ((4, upper, first), (6, fore, first + 1), (8, palm, first + 2)):
            frames[limb + side] = _frame(rotation, joints[joint])

    def _leg(
        self,
        foot: FootPose,
        ankle: Float,
        orientation: Float,
        side: int,
        pelvis: Float,
        joints: Float,
        frames: Float,
    ) -> None:
        """Fills hip to foot. The two segment lengths determine the knee, which bends in the plane of the foot
        and its splay.
        """
        first = (Joint.HIP_LEFT, Joint.HIP_RIGHT)[side]
        hip = joints[Joint.HIP_CENTER] + pelvis @ _mirrored(self.hip, side)
        reach = MAX_LEG_REACH * (self.thigh + self.shank)
        leg = ankle - hip
        apart = float(np.sqrt(leg @ leg))
        along = leg / apart if apart > 1e-6 else np.array([0.0, -1.0, 0.0])
        distance = min(max(apart, MIN_LEG_REACH * reach), reach)
        ankle = hip + distance * along
        ahead = rotation_about_y(foot.yaw + (1.0 - 2.0 * side) * foot.splay) @ np.array([0.0, 0.0, 1.0])
        forward = ahead + 0.35 * (pelvis @ np.array([0.0, 0.0, 1.0]))
        forward = forward - (forward @ along) * along
        forward /= float(np.sqrt(forward @ forward))
        reach_along = (distance**2 + self.thigh**2 - self.shank**2) / (2 * distance)
        bow = math.sqrt(max(self.thigh**2 - reach_along**2, 0.0))
        knee = hip + reach_along * along + bow * forward
        joints[first], joints[first + 1], joints[first + 2] = hip, knee, ankle
        joints[first + 3] = ankle + orientation @ self.ball
        frames[10 + side] = _frame(_limb_axes(hip - knee, forward), hip)
        frames[12 + side] = _frame(_limb_axes(knee - ankle, forward), knee)
        frames[14 + side] = _frame(orientation, ankle)


def _bend(yaw: float, pitch: float, roll: float) -> Float:
    """Returns (3, 3) the rotation by ``yaw`` to the left, ``pitch`` forward and ``roll`` to the left."""
    return rotation_about_y(yaw) @ rotation_about_x(pitch) @ rotation_about_z(-roll)


def _limb_axes(up: Float, forward: Float) -> Float:
    """Returns (3, 3) axes with +Y along ``up`` and +Z as close to ``forward`` as possible."""
    y = up / float(np.sqrt(up @ up))
    z = forward - (forward @ y) * y
    z /= float(np.sqrt(z @ z))
    return np.stack([np.cross(y, z), y, z], 1)


def _frame(rotation: Float, origin: Float) -> Float:
    """Returns (3, 4) a rotation and an origin side by side."""
    return np.concatenate([rotation, origin[:, None]], 1)


def _mirrored(offset: Float, side: int) -> Float:
    """Returns (3,) a left-side offset for ``side`` 0 (left), or its mirror image for 1 (right)."""
    return offset if side == 0 else offset * np.array([-1.0, 1.0, 1.0])
