"""A performer's posture at one moment: angles of trunk and arms, and positions of the feet."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class ArmPose:
    """The joint angles of one arm in radians.

    At zero the arm hangs straight down with the palm facing the thigh.

    Attributes:
        flex: rotation of the upper arm forward (negative: backward).
        abduct: rotation of the upper arm sideways, away from the trunk.
        twist: rotation of the upper arm about its own length, which turns the forearm inward.
        elbow: bend of the elbow; 0 is straight.
        pronate: rotation of the hand about the forearm; turns the palm down if the forearm is level.
        wrist: bend of the hand towards the palm.
        shrug: rotation that lifts the shoulder joint about the base of the neck.
    """

    flex: float = 0.0
    abduct: float = 0.0
    twist: float = 0.0
    elbow: float = 0.0
    pronate: float = 0.0
    wrist: float = 0.0
    shrug: float = 0.0


@dataclass(frozen=True)
class FootPose:
    """The pose of one foot. It is given by the contact point of the ball of the foot with the floor.

    Attributes:
        x, z: position of the ankle of the flat foot in metres, world frame.
        lift: height of the ball in metres above its resting height; 0 while the foot is planted.
        yaw: radians about +Y. A positive yaw turns the toes towards +X.
        pitch: angle in radians, upwards for the toes. A negative pitch raises the heel about the planted
            ball.
        splay: radians by which the knee leans outward from the foot's own direction.
    """

    x: float
    z: float
    lift: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    splay: float = 0.08


@dataclass(frozen=True)
class PerformerPosture:
    """The posture of a whole body. Angles are in radians, positions in metres in world coordinates.

    Attributes:
        x, z: position of the pelvis in the floor plane.
        rise: height of the pelvis above its standing height (negative: knees bent; positive in a hop).
        yaw, pitch, roll: rotation of the pelvis: to its left, forward, and sideways to its left.
        spine_yaw, spine_pitch, spine_roll: rotation of the chest relative to the pelvis, distributed over the
            spine.
        head_yaw, head_pitch, head_roll: rotation of the head relative to the chest.
    """

    left_foot: FootPose
    right_foot: FootPose
    left_arm: ArmPose = field(default_factory=ArmPose)
    right_arm: ArmPose = field(default_factory=ArmPose)
    x: float = 0.0
    z: float = 0.0
    rise: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    spine_yaw: float = 0.0
    spine_pitch: float = 0.0
    spine_roll: float = 0.0
    head_yaw: float = 0.0
    head_pitch: float = 0.0
    head_roll: float = 0.0
