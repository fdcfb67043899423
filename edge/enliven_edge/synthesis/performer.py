"""The performer's skeleton: proportions, and forward kinematics from a posture to 20 joints and 16 frames.

The body's own frame is +X to its left, +Y up, +Z forward. Legs are solved from the feet (two-bone inverse
kinematics), so that a planted foot stays where it is whatever the pelvis does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from enliven.arrays import Float
from enliven.body import Joint
from enliven.settings import setting
from enliven_edge.synthesis.posture import Arm, Foot, Posture
from enliven_edge.synthesis.rotations import about_x, about_y, about_z, on_grid

REFERENCE_HEIGHT = 1.75
"""Metres: the stature at which the lengths and girths of this package are written down."""
STRAIGHTEST = 0.997
"""The part of thigh + shank that a leg reaches at most: a knee is never quite locked."""

FOLDED = 0.3
"""The part of thigh + shank at which a leg is folded: no knee bends further."""


@dataclass(frozen=True)
class Proportions:
    """The performer's build."""

    height: float = setting(1.75, "Stature from the soles to the crown.", unit="m", low=0.8, high=2.3)
    girth: float = setting(1.0, "Thickness of the flesh against an average build.", low=0.6, high=1.8)
    shoulders: float = setting(1.0, "Width of the shoulders against an average build.", low=0.7, high=1.4)
    hips: float = setting(1.0, "Width of the hips against an average build.", low=0.7, high=1.4)
    arms: float = setting(1.0, "Length of the arms against an average build.", low=0.7, high=1.3)
    legs: float = setting(1.0, "Length of the legs against an average build.", low=0.7, high=1.3)


class Limb(IntEnum):
    """The frames that flesh hangs on; each has its origin at the joint nearer to the pelvis."""

    PELVIS = 0
    ABDOMEN = 1
    CHEST = 2
    SKULL = 3
    UPPER_ARM_LEFT = 4
    UPPER_ARM_RIGHT = 5
    FOREARM_LEFT = 6
    FOREARM_RIGHT = 7
    HAND_LEFT = 8
    HAND_RIGHT = 9
    THIGH_LEFT = 10
    THIGH_RIGHT = 11
    SHANK_LEFT = 12
    SHANK_RIGHT = 13
    FOOT_LEFT = 14
    FOOT_RIGHT = 15


@dataclass(frozen=True)
class Figure:
    """A performer in a posture.

    Attributes:
        joints: (20, 3) metres, world, ordered by :class:`enliven.body.Joint`: anatomical centres.
        frames: (16, 3, 4) world_from_limb (rotation, origin), ordered by :class:`Limb`.
    """

    joints: Float
    frames: Float


class Performer:
    """A skeleton of given proportions that takes postures."""

    def __init__(self, proportions: Proportions | None = None) -> None:
        self.proportions = p = proportions or Proportions()
        s = p.height / REFERENCE_HEIGHT
        self.scale = s
        self.spine = np.array([0.0, 0.17, -0.006]) * s
        self.neck_base = np.array([0.0, 0.275, -0.008]) * s
        self.head = np.array([0.0, 0.195, 0.022]) * s
        self.shoulder = np.array([0.172 * p.shoulders, -0.035, -0.006]) * s
        self.upper_arm, self.forearm = 0.285 * s * p.arms, 0.252 * s * p.arms
        self.hand = 0.082 * s * p.arms
        self.hip = np.array([0.088 * p.hips, -0.062, 0.0]) * s
        self.thigh, self.shank = 0.428 * s * p.legs, 0.418 * s * p.legs
        self.ball = np.array([0.0, -0.052, 0.128]) * s
        self.ankle_height = 0.082 * s
        reach = STRAIGHTEST * (self.thigh + self.shank)
        self.standing = self.ankle_height + reach - float(self.hip[1]) - 0.014 * s

    def pose(self, posture: Posture) -> Figure:
        """Forward kinematics.

        The pelvis sinks below the height asked for where a planted foot would otherwise lose the floor; a
        foot in the air that is out of reach, or nearer than a folded leg, is moved along the leg.
        """
        joints, frames = np.zeros((20, 3)), np.zeros((16, 3, 4))
        pelvis = about_y(posture.yaw) @ about_x(posture.pitch) @ about_z(-posture.roll)
        feet = [self._ankle(posture.left_foot), self._ankle(posture.right_foot)]
        joints[Joint.HIP_CENTER] = self._pelvis_position(posture, pelvis, feet)
        frames[Limb.PELVIS] = _frame(pelvis, joints[Joint.HIP_CENTER])
        self._trunk(posture, pelvis, joints, frames)
        self._arm(posture.left_arm, 0, joints, frames)
        self._arm(posture.right_arm, 1, joints, frames)
        for side, foot in enumerate((posture.left_foot, posture.right_foot)):
            self._leg(foot, *feet[side], side, pelvis, joints, frames)
        return Figure(on_grid(joints), on_grid(frames))

    def figure(self, rotations: Float, pelvis: Float) -> Figure:
        """The figure whose limbs are turned as given, whatever turned them: a motion capture, a dice.

        Args:
            rotations: (16, 3, 3) world_from_limb, ordered by :class:`Limb`. At the identity each limb is as
                in a person who stands upright facing +Z with hanging arms: limbs lie along -Y of their
                frame, the trunk and the skull along +Y, feet point to +Z.
            pelvis: (3,) metres, the hip centre, world.
        """
        joints, down = np.zeros((20, 3)), np.array([0.0, -1.0, 0.0])
        joints[Joint.HIP_CENTER] = pelvis
        joints[Joint.SPINE] = pelvis + rotations[Limb.ABDOMEN] @ self.spine
        joints[Joint.SHOULDER_CENTER] = joints[Joint.SPINE] + rotations[Limb.CHEST] @ self.neck_base
        joints[Joint.HEAD] = joints[Joint.SHOULDER_CENTER] + rotations[Limb.SKULL] @ self.head
        origins = [pelvis, joints[Joint.SPINE], joints[Joint.SHOULDER_CENTER], joints[Joint.HEAD]]
        for chain in (
            (self.shoulder, Limb.CHEST, Joint.SHOULDER_LEFT, 4, (self.upper_arm, self.forearm)),
            (self.hip, Limb.PELVIS, Joint.HIP_LEFT, 10, (self.thigh, self.shank)),
        ):
            root, trunk, first_left, limb_left, lengths = chain
            for side in (0, 1):
                first, limb = first_left + 4 * side, limb_left + side
                joints[first] = origins[trunk] + rotations[trunk] @ _mirrored(root, side)
                for k, length in enumerate(lengths):
                    joints[first + k + 1] = joints[first + k] + length * (rotations[limb + 2 * k] @ down)
                last = self.hand * down if limb_left == 4 else self.ball
                joints[first + 3] = joints[first + 2] + rotations[limb + 4] @ last
        at = [*origins]
        for left, right in ((Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT), (Joint.HIP_LEFT, Joint.HIP_RIGHT)):
            for k in range(3):
                at += [joints[left + k], joints[right + k]]
        frames = np.concatenate([rotations, np.stack(at)[:, :, None]], 2)
        return Figure(on_grid(joints), on_grid(frames))

    def soles(self, figure: Figure) -> Float:
        """(2, 3) metres above the floor: heel, ball and toe-cap of the left and the right sole."""
        points = np.array([[0.0, -0.082, -0.06], [0.0, -0.082, 0.128], [0.0, -0.076, 0.185]]) * self.scale
        feet = figure.frames[[Limb.FOOT_LEFT, Limb.FOOT_RIGHT]]
        return np.asarray((feet[:, None, 1, :3] * points).sum(-1) + feet[:, 1, 3:])

    def _ankle(self, foot: Foot) -> tuple[Float, Float]:
        """(3,) where the ankle wants to be, and (3, 3) the foot's orientation."""
        heading = about_y(foot.yaw)
        ball = np.array([foot.x, self.ankle_height + foot.lift, foot.z]) + heading @ self.ball
        orientation = heading @ about_x(-foot.pitch)
        return ball - orientation @ self.ball, orientation

    def _pelvis_position(self, posture: Posture, pelvis: Float, feet: list[tuple[Float, Float]]) -> Float:
        """(3,) the hip centre: the height asked for, or less where a planted leg is not that long."""
        y = self.standing + posture.rise
        reach = STRAIGHTEST * (self.thigh + self.shank)
        for side, foot in enumerate((posture.left_foot, posture.right_foot)):
            if foot.lift > 0:
                continue
            hip = pelvis @ _mirrored(self.hip, side)
            flat = np.array([posture.x, 0.0, posture.z]) + hip - feet[side][0]
            across = flat[0] ** 2 + flat[2] ** 2
            y = min(y, float(feet[side][0][1] - hip[1] + math.sqrt(max(reach**2 - across, 0.0))))
        return np.array([posture.x, y, posture.z])

    def _trunk(self, posture: Posture, pelvis: Float, joints: Float, frames: Float) -> None:
        """Pelvis to head: a third of the spine's bend below the spine joint, the rest above it."""
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

    def _arm(self, arm: Arm, side: int, joints: Float, frames: Float) -> None:
        """Shoulder to hand; ``side`` 0 is the left, 1 the right."""
        sign = 1.0 - 2.0 * side
        first = (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)[side]
        chest = frames[Limb.CHEST, :, :3]
        girdle = chest @ about_z(sign * arm.shrug)
        upper = chest @ about_z(sign * arm.abduct) @ about_x(-arm.flex) @ about_y(-sign * arm.twist)
        fore = upper @ about_x(-arm.elbow)
        palm = fore @ about_y(-sign * arm.pronate) @ about_z(-sign * arm.wrist)
        down = np.array([0.0, -1.0, 0.0])
        joints[first] = joints[Joint.SHOULDER_CENTER] + girdle @ _mirrored(self.shoulder, side)
        joints[first + 1] = joints[first] + self.upper_arm * (upper @ down)
        joints[first + 2] = joints[first + 1] + self.forearm * (fore @ down)
        joints[first + 3] = joints[first + 2] + self.hand * (palm @ down)
        for limb, rotation, joint in ((4, upper, first), (6, fore, first + 1), (8, palm, first + 2)):
            frames[limb + side] = _frame(rotation, joints[joint])

    def _leg(
        self,
        foot: Foot,
        ankle: Float,
        orientation: Float,
        side: int,
        pelvis: Float,
        joints: Float,
        frames: Float,
    ) -> None:
        """Hip to foot: the knee from the two lengths, bending in the plane of the foot and its splay."""
        first = (Joint.HIP_LEFT, Joint.HIP_RIGHT)[side]
        hip = joints[Joint.HIP_CENTER] + pelvis @ _mirrored(self.hip, side)
        reach = STRAIGHTEST * (self.thigh + self.shank)
        leg = ankle - hip
        apart = float(np.sqrt(leg @ leg))
        along = leg / apart if apart > 1e-6 else np.array([0.0, -1.0, 0.0])
        distance = min(max(apart, FOLDED * reach), reach)
        ankle = hip + distance * along
        ahead = about_y(foot.yaw + (1.0 - 2.0 * side) * foot.splay) @ np.array([0.0, 0.0, 1.0])
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
    """(3, 3) turn to the own left, bend forward, lean to the own left."""
    return about_y(yaw) @ about_x(pitch) @ about_z(-roll)


def _limb_axes(up: Float, forward: Float) -> Float:
    """(3, 3) axes with +Y along ``up`` and +Z as near to ``forward`` as that allows."""
    y = up / float(np.sqrt(up @ up))
    z = forward - (forward @ y) * y
    z /= float(np.sqrt(z @ z))
    return np.stack([np.cross(y, z), y, z], 1)


def _frame(rotation: Float, origin: Float) -> Float:
    """(3, 4) a rotation and an origin side by side."""
    return np.concatenate([rotation, origin[:, None]], 1)


def _mirrored(offset: Float, side: int) -> Float:
    """(3,) an offset written for the left side, for ``side`` 0 (left) or 1 (right)."""
    return offset if side == 0 else offset * np.array([-1.0, 1.0, 1.0])
