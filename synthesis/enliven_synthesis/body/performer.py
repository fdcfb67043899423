"""The performer's skeleton: proportions and forward kinematics.

The kinematics convert a posture to 20 joints and 16 limb frames.

The axes of the body's own frame are +X to its left, +Y up, +Z forward. Legs are solved from the feet by
two-bone inverse kinematics, so that planted feet stay in place when the pelvis moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import Joint, Limb
from enliven.settings import setting
from enliven_synthesis.body.kinematics import MAX_LEG_REACH, Lengths, forward_kinematics, posture_tuples
from enliven_synthesis.body.posture import PerformerPosture
from enliven_synthesis.body.rotations import round_to_grid

REFERENCE_HEIGHT = 1.75
"""Stature in metres for which the lengths and girths in this package are given."""


@dataclass(frozen=True)
class Proportions:
    """The performer's build."""

    height: float = setting(
        1.75, "Height from the soles to the top of the head.", unit="m", low=0.8, high=2.3
    )
    girth: float = setting(1.0, "Body thickness relative to an average build.", low=0.6, high=1.8)
    shoulders: float = setting(1.0, "Shoulder width relative to an average build.", low=0.7, high=1.4)
    hips: float = setting(1.0, "Hip width relative to an average build.", low=0.7, high=1.4)
    arms: float = setting(1.0, "Arm length relative to an average build.", low=0.7, high=1.3)
    legs: float = setting(1.0, "Leg length relative to an average build.", low=0.7, high=1.3)


@dataclass(frozen=True)
class Figure:
    """A performer's joints and limb frames in a posture.

    Attributes:
        joints: (20, 3) anatomical centres of the joints in metres, world frame, ordered by
            :class:`enliven.person.body.Joint`.
        frames: (16, 3, 4) world_from_limb (rotation, origin), ordered by :class:`Limb`.
    """

    joints: Float
    frames: Float


class Performer:
    """A skeleton of given proportions that can be posed."""

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
        reach = MAX_LEG_REACH * (self.thigh + self.shank)
        self.standing = self.ankle_height + reach - float(self.hip[1]) - 0.014 * s
        self._lengths = Lengths(*(getattr(self, name) for name in Lengths._fields))

    def pose(self, posture: PerformerPosture) -> Figure:
        """Returns the figure of a posture, computed by forward kinematics.

        The pelvis is lowered if a planted foot could otherwise not reach the floor. A foot in the air is
        moved along the leg if it is out of reach, or closer than a folded leg allows.
        """
        joints, frames = np.zeros((20, 3)), np.zeros((16, 3, 4))
        forward_kinematics(self._lengths, *posture_tuples(posture), joints, frames)
        return Figure(round_to_grid(joints), round_to_grid(frames))

    def figure(self, rotations: Float, pelvis: Float) -> Figure:
        """Returns the figure with given limb rotations, for example from a motion capture.

        Args:
            rotations: (16, 3, 3) world_from_limb, ordered by :class:`Limb`. Identity rotations mean a person
                standing upright, facing +Z, with hanging arms. Limbs point along -Y of their frame, the trunk
                and the skull along +Y, and feet along +Z.
            pelvis: (3,) the hip centre in metres, world frame.
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
                joints[first] = origins[trunk] + rotations[trunk] @ _mirror_offset(root, side)
                for k, length in enumerate(lengths):
                    joints[first + k + 1] = joints[first + k] + length * (rotations[limb + 2 * k] @ down)
                last = self.hand * down if limb_left == 4 else self.ball
                joints[first + 3] = joints[first + 2] + rotations[limb + 4] @ last
        joint_positions = [*origins]
        for left, right in ((Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT), (Joint.HIP_LEFT, Joint.HIP_RIGHT)):
            for k in range(3):
                joint_positions += [joints[left + k], joints[right + k]]
        frames = np.concatenate([rotations, np.stack(joint_positions)[:, :, None]], 2)
        return Figure(round_to_grid(joints), round_to_grid(frames))

    def soles(self, figure: Figure) -> Float:
        """Returns (2, 3) heights in metres above the floor: heel, ball and toe-cap of the left and the right
        sole.
        """
        points = np.array([[0.0, -0.082, -0.06], [0.0, -0.082, 0.128], [0.0, -0.076, 0.185]]) * self.scale
        feet = figure.frames[[Limb.FOOT_LEFT, Limb.FOOT_RIGHT]]
        return np.asarray((feet[:, None, 1, :3] * points).sum(-1) + feet[:, 1, 3:])


def _mirror_offset(offset: Float, side: int) -> Float:
    """Returns a left-side offset (3,) for ``side`` 0 (left), or its mirror image for ``side`` 1 (right)."""
    return offset if side == 0 else offset * np.array([-1.0, 1.0, 1.0])
