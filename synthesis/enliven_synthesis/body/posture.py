"""A performer's posture at one moment: angles of trunk and arms, and places of the feet."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class ArmPose:
    """The angles of one arm, radians; at zero it hangs straight down with the palm to the thigh.

    Attributes:
        flex: the upper arm forward (backward where negative).
        abduct: the upper arm away from the trunk, sideways.
        twist: the upper arm about its own length, the forearm inward.
        elbow: bend of the elbow, 0 when straight.
        pronate: the hand about the forearm, the palm turning down when the forearm is level.
        wrist: bend of the hand towards the palm.
        shrug: the shoulder joint lifted about the base of the neck.
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
    """The pose of one foot, by the point where its ball touches, or would touch, the floor.

    Attributes:
        x, z: metres, world, of the ankle when the foot is flat.
        lift: metres from the floor to the ball's resting height; 0 while the foot is planted.
        yaw: radians about +Y, the toes towards +X where positive.
        pitch: radians the toes point up; negative raises the heel about the planted ball.
        splay: radians the knee leans outward from the foot's own direction.
    """

    x: float
    z: float
    lift: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    splay: float = 0.08


@dataclass(frozen=True)
class PerformerPosture:
    """A whole body's posture; angles in radians, positions in metres of the world.

    Attributes:
        x, z: the pelvis above the floor plan.
        rise: the pelvis above its standing height (negative: knees bent; positive in a hop).
        yaw, pitch, roll: the pelvis: turned to its left, tilted forward, leaning to its left.
        spine_yaw, spine_pitch, spine_roll: the chest against the pelvis, spread over the back.
        head_yaw, head_pitch, head_roll: the head against the chest.
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
