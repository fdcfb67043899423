"""Random plausible postures: people stand, walk, crouch, kneel, sit, bend, lunge, crawl, lie and leap.

Angles are in radians. A posture consists of the world orientation of every limb of the synthetic performer.
The feet (or knees, hands, seat) touch the floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from enliven.arrays import Float
from enliven.person import Limb
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.body.rotations import rotation_about_x, rotation_about_y, rotation_about_z
from enliven_synthesis.training.arm_poses import random_arms


@dataclass(frozen=True)
class LegPose:
    """The angles of one leg relative to the facing of the pelvis.

    Attributes:
        flex: rotation of the thigh forward (negative: backward).
        abduct: rotation of the thigh outward.
        twist: rotation of the thigh about its length, which turns the toes outward.
        knee: bend of the knee.
        ankle: rotation that lifts the toes (negative: points them).
    """

    flex: float
    abduct: float
    twist: float
    knee: float
    ankle: float


@dataclass(frozen=True)
class TrunkAndLegs:
    """The angles of legs and trunk in a posture.

    The trunk has pitch and roll of the pelvis, and forward and sideways bend of the spine.
    """

    left: LegPose
    right: LegPose
    pitch: float = 0.0
    roll: float = 0.0
    bend: float = 0.0
    lean: float = 0.0


def _leg_with_level_sole(flex: float, knee: float, rng: Generator, spread: float = 0.14) -> LegPose:
    """Returns a leg with a level sole: the ankle compensates for thigh and shank."""
    return LegPose(flex, abs(rng.normal(0.04, spread)), rng.normal(0.12, 0.2), knee, knee - flex)


def _make_standing_pose(rng: Generator) -> TrunkAndLegs:
    spread = rng.choice([0.06, 0.2])
    knees = np.abs(rng.normal(0.0, 0.12, 2))
    left, right = (_leg_with_level_sole(0.5 * k + rng.normal(0, 0.05), k, rng, spread) for k in knees)
    return TrunkAndLegs(left, right, rng.normal(0.03, 0.08), rng.normal(0, 0.05), rng.normal(0.08, 0.12),
                  rng.normal(0, 0.1))  # fmt: skip


def _make_leaning_pose(rng: Generator) -> TrunkAndLegs:
    base = _make_standing_pose(rng)
    side = rng.uniform(-0.5, 0.5)
    return TrunkAndLegs(
        base.left, base.right, rng.normal(0.1, 0.15), 0.4 * side, rng.uniform(-0.3, 0.7), side
    )


def _make_walking_pose(rng: Generator) -> TrunkAndLegs:
    stride = rng.uniform(-0.6, 0.6)
    behind = np.array([max(0.0, -stride), max(0.0, stride)])
    knees = np.abs(rng.normal(0.15, 0.2, 2)) + 0.8 * behind
    left, right = (
        _leg_with_level_sole(s + 0.3 * k, k, rng, 0.05) for s, k in zip((stride, -stride), knees, strict=True)
    )
    return TrunkAndLegs(left, right, rng.normal(0.06, 0.06), rng.normal(0, 0.04), rng.normal(0.05, 0.08),
                  rng.normal(0, 0.05))  # fmt: skip


def _make_crouching_pose(rng: Generator) -> TrunkAndLegs:
    depth = rng.uniform(0.6, 2.3)
    legs = []
    for _ in range(2):
        knee = np.clip(depth + rng.normal(0, 0.15), 0.3, 2.5)
        legs.append(_leg_with_level_sole(0.55 * knee + rng.uniform(-0.1, 0.5), knee, rng, 0.35))
    pitch = 0.15 * depth + rng.normal(0.05, 0.15)
    return TrunkAndLegs(
        legs[0], legs[1], pitch, rng.normal(0, 0.05), rng.uniform(0.0, 0.7), rng.normal(0, 0.1)
    )


def _kneeling_leg(rng: Generator) -> LegPose:
    flex = rng.normal(0.05, 0.2)
    knee = np.clip(flex + 1.55 + rng.normal(0, 0.15), 1.2, 2.5)
    return LegPose(flex, abs(rng.normal(0.08, 0.12)), rng.normal(0, 0.15), knee, rng.uniform(-0.9, 0.4))


def _make_kneeling_pose(rng: Generator) -> TrunkAndLegs:
    left, right = _kneeling_leg(rng), _kneeling_leg(rng)
    if rng.random() < 0.25:  # The person sits on the heels.
        flex = rng.uniform(0.7, 1.4)
        left = right = LegPose(flex, abs(rng.normal(0.1, 0.1)), 0.0, min(2.5, flex + 1.5), -0.9)
    elif rng.random() < 0.55:  # The person kneels on one knee.
        front = _leg_with_level_sole(rng.uniform(1.1, 1.7), rng.uniform(1.2, 1.8), rng, 0.15)
        left, right = (front, right) if rng.random() < 0.5 else (left, front)
    return TrunkAndLegs(left, right, rng.normal(0.05, 0.15), rng.normal(0, 0.05), rng.uniform(-0.1, 0.6),
                  rng.normal(0, 0.15))  # fmt: skip


def _make_sitting_pose(rng: Generator) -> TrunkAndLegs:
    legs = []
    for _ in range(2):
        flex = rng.uniform(1.2, 1.75)
        legs.append(_leg_with_level_sole(flex, flex + rng.uniform(-0.5, 0.4), rng, 0.2))
    return TrunkAndLegs(legs[0], legs[1], rng.normal(-0.05, 0.15), 0.0, rng.uniform(-0.1, 0.6),
                  rng.normal(0, 0.12))  # fmt: skip


def _make_sitting_down_pose(rng: Generator) -> TrunkAndLegs:
    """Returns a person sitting down or getting up: the trunk leans forward over bent knees for balance."""
    knee = rng.uniform(0.7, 1.7)
    legs = [
        _leg_with_level_sole(0.8 * knee + rng.normal(0, 0.1), knee + rng.normal(0, 0.1), rng, 0.15)
        for _ in range(2)
    ]
    return TrunkAndLegs(legs[0], legs[1], rng.uniform(0.2, 0.8), rng.normal(0, 0.05), rng.uniform(0.0, 0.6),
                  rng.normal(0, 0.1))  # fmt: skip


def _make_bowing_pose(rng: Generator) -> TrunkAndLegs:
    """Returns a person bending towards the floor by a random amount."""
    depth = rng.uniform(0.4, 1.0)
    legs = []
    for _ in range(2):
        knee = abs(rng.normal(0.1, 0.3))
        legs.append(_leg_with_level_sole(0.5 * knee - 0.15 * depth + rng.normal(0, 0.06), knee, rng, 0.2))
    return TrunkAndLegs(legs[0], legs[1], 1.3 * depth + rng.normal(0, 0.1), rng.normal(0, 0.08),
                  0.9 * depth + rng.normal(0, 0.15), rng.normal(0, 0.2))  # fmt: skip


def _make_one_leg_pose(rng: Generator) -> TrunkAndLegs:
    knee = abs(rng.normal(0.05, 0.1))
    ground = _leg_with_level_sole(0.5 * knee, knee, rng, 0.06)
    flex = rng.uniform(-0.7, 2.0)
    bend = rng.uniform(0.0, 2.2) if flex > 0 else rng.uniform(0.0, 1.8)
    up = LegPose(flex, max(-0.1, rng.normal(0.2, 0.35)), rng.normal(0.1, 0.3), bend, rng.normal(-0.2, 0.3))
    left, right = (ground, up) if rng.random() < 0.5 else (up, ground)
    return TrunkAndLegs(left, right, rng.normal(0.0, 0.15), rng.normal(0, 0.1), rng.normal(0.1, 0.2),
                  rng.normal(0, 0.15))  # fmt: skip


def _make_lunging_pose(rng: Generator) -> TrunkAndLegs:
    knee = rng.uniform(0.4, 1.6)
    front = _leg_with_level_sole(rng.uniform(0.4, 1.4), knee, rng, 0.15)
    back = LegPose(rng.uniform(-0.9, -0.1), abs(rng.normal(0.1, 0.2)), rng.normal(0.2, 0.2),
               rng.uniform(0.0, 1.3), rng.uniform(-0.3, 0.5))  # fmt: skip
    left, right = (front, back) if rng.random() < 0.5 else (back, front)
    return TrunkAndLegs(left, right, rng.normal(0.1, 0.15), 0.0, rng.normal(0.15, 0.2), rng.normal(0, 0.15))


def _make_sideways_lunging_pose(rng: Generator) -> TrunkAndLegs:
    knee = rng.uniform(0.2, 1.6)
    bent = LegPose(0.6 * knee, rng.uniform(0.2, 0.7), rng.uniform(0, 0.6), knee, 0.4 * knee)
    straight = LegPose(0.1, rng.uniform(0.2, 0.8), 0.1, 0.05, 0.0)
    left, right = (bent, straight) if rng.random() < 0.5 else (straight, bent)
    return TrunkAndLegs(left, right, rng.normal(0.15, 0.2), 0.0, rng.normal(0.15, 0.2), rng.normal(0, 0.2))


def _make_all_fours_pose(rng: Generator) -> TrunkAndLegs:
    """Returns a person crawling, or getting up from the floor."""
    legs = [_kneeling_leg(rng) for _ in range(2)]
    legs = [
        LegPose(leg.flex + rng.uniform(-0.2, 0.5), leg.abduct, leg.twist, leg.knee, leg.ankle) for leg in legs
    ]
    return TrunkAndLegs(legs[0], legs[1], rng.uniform(0.8, 1.6), rng.normal(0, 0.15), rng.uniform(-0.2, 0.5),
                  rng.normal(0, 0.2))  # fmt: skip


def _make_lying_pose(rng: Generator) -> TrunkAndLegs:
    """Returns a person lying on the back or the belly, or falling into this posture."""
    on_back = rng.random() < 0.5
    legs = [
        LegPose(rng.uniform(-0.1, 1.2) if on_back else rng.normal(0.0, 0.15), abs(rng.normal(0.1, 0.2)),
            rng.normal(0.1, 0.3), abs(rng.normal(0.2, 0.7)), rng.normal(-0.3, 0.3))
        for _ in range(2)
    ]  # fmt: skip
    pitch = rng.uniform(0.9, 1.7)
    pitch = -pitch if on_back else pitch
    return TrunkAndLegs(legs[0], legs[1], pitch, rng.normal(0, 0.4), rng.normal(0.1, 0.25),
                        rng.normal(0, 0.2))  # fmt: skip


def _make_leaping_pose(rng: Generator) -> TrunkAndLegs:
    """Returns random legs, as in the air or in a dance."""
    legs = [
        LegPose(rng.uniform(-0.7, 1.9), rng.uniform(-0.1, 0.9), rng.normal(0.1, 0.3), rng.uniform(0.0, 2.2),
            rng.normal(-0.2, 0.3))
        for _ in range(2)
    ]  # fmt: skip
    return TrunkAndLegs(legs[0], legs[1], rng.normal(0.1, 0.3), rng.normal(0, 0.2), rng.normal(0.15, 0.3),
                  rng.normal(0, 0.25))  # fmt: skip


def _make_high_leg_pose(rng: Generator) -> TrunkAndLegs:
    """Returns a posture with one leg raised sideways or forward, as high as dancers can.

    The trunk leans away from the leg.
    """
    knee = abs(rng.normal(0.05, 0.1))
    ground = _leg_with_level_sole(0.5 * knee, knee, rng, 0.06)
    abduction = rng.uniform(0.3, 1.7)
    up = LegPose(rng.normal(0.2, 0.35), abduction, rng.normal(0.3, 0.4), abs(rng.normal(0.0, 0.4)),
             rng.normal(-0.2, 0.3))  # fmt: skip
    left = rng.random() < 0.5
    roll = (-1.0 if left else 1.0) * rng.uniform(0.1, 0.4) * abduction
    return TrunkAndLegs(up if left else ground, ground if left else up, rng.normal(0.0, 0.12), roll,
                  rng.normal(0.1, 0.15), rng.uniform(-0.6, 0.6) * roll)  # fmt: skip


_POSTURE_FAMILIES: dict[str, tuple[float, Callable[[Generator], TrunkAndLegs]]] = {
    "stand": (0.30, _make_standing_pose),
    "lean": (0.08, _make_leaning_pose),
    "walk": (0.10, _make_walking_pose),
    "crouch": (0.12, _make_crouching_pose),
    "kneel": (0.09, _make_kneeling_pose),
    "sit": (0.06, _make_sitting_pose),
    "sit down": (0.05, _make_sitting_down_pose),
    "bow": (0.08, _make_bowing_pose),
    "one leg": (0.08, _make_one_leg_pose),
    "high leg": (0.05, _make_high_leg_pose),
    "lunge": (0.05, _make_lunging_pose),
    "side lunge": (0.03, _make_sideways_lunging_pose),
    "all fours": (0.02, _make_all_fours_pose),
    "lie": (0.02, _make_lying_pose),
    "leap": (0.05, _make_leaping_pose),
}
"""Every family of postures with its probability. Rare postures are more frequent than in reality, so that the
network learns them."""
FAMILIES = tuple(_POSTURE_FAMILIES)
"""Names of all families."""


def random_figure(
    performer: Performer, rng: Generator, yaw: float, family: str | None = None, arms: str | None = None
) -> Figure:
    """Returns a performer in a random posture above the world's origin, touching the floor.

    Args:
        yaw: facing of the pelvis in radians about +Y. 0 is +Z.
        family: a name of :data:`FAMILIES`; None draws one by its probability.
        arms: a name of :data:`enliven_synthesis.training.arm_poses.HOLDS`; None draws one at random.
    """
    if family is None:
        shares = np.array([share for share, _ in _POSTURE_FAMILIES.values()])
        family = FAMILIES[int(rng.choice(len(FAMILIES), p=shares / shares.sum()))]
    pose = _POSTURE_FAMILIES[family][1](rng)
    rotations = np.tile(np.eye(3), (len(Limb), 1, 1))
    heading = rotation_about_y(yaw)
    _turn_trunk(rotations, heading, pose, rng)
    for side, leg in enumerate((pose.left, pose.right)):
        _turn_leg(rotations, heading @ rotation_about_x(0.15 * pose.pitch), leg, side)
    random_arms(performer, rotations, rng, "hang" if arms is None and _arms_hang(family, rng) else arms)
    figure = performer.figure(rotations, np.zeros(3))
    return performer.figure(rotations, np.array([0.0, -_compute_lowest_height(figure, performer.scale), 0.0]))


def _arms_hang(family: str, rng: Generator) -> bool:
    """Returns at random whether the arms hang, as they often do in postures that reach for the floor."""
    return family == "bow" and rng.random() < 0.4


def _turn_trunk(rotations: Float, heading: Float, pose: TrunkAndLegs, rng: Generator) -> None:
    """Rotates pelvis, belly, chest and head."""
    pelvis = heading @ rotation_about_x(pose.pitch) @ rotation_about_z(-pose.roll)
    yaw = rng.normal(0, 0.2)
    bend = rotation_about_y(yaw / 2) @ rotation_about_x(pose.bend / 2) @ rotation_about_z(-pose.lean / 2)
    rotations[Limb.PELVIS], rotations[Limb.ABDOMEN] = pelvis, pelvis @ bend
    rotations[Limb.CHEST] = pelvis @ bend @ bend
    head = (
        rotation_about_y(rng.normal(0, 0.45))
        @ rotation_about_x(rng.normal(0.05, 0.3))
        @ rotation_about_z(rng.normal(0, 0.15))
    )
    rotations[Limb.SKULL] = rotations[Limb.CHEST] @ head


def _turn_leg(rotations: Float, heading: Float, leg: LegPose, side: int) -> None:
    """Rotates one leg; ``side`` 0 is the left."""
    sign = 1.0 - 2.0 * side
    thigh = (
        heading
        @ rotation_about_z(sign * leg.abduct)
        @ rotation_about_x(-leg.flex)
        @ rotation_about_y(sign * leg.twist)
    )
    shank = thigh @ rotation_about_x(leg.knee)
    rotations[Limb.THIGH_LEFT + side], rotations[Limb.SHANK_LEFT + side] = thigh, shank
    rotations[Limb.FOOT_LEFT + side] = shank @ rotation_about_x(-float(np.clip(leg.ankle, -0.9, 0.7)))


_SOLE = np.array([[0.0, -0.08, -0.06], [0.0, -0.08, 0.15], [0.0, -0.06, 0.19]])
"""Heel, ball and toe-cap of a sole in metres, for a person of 1.75 m, foot's frame."""


def _compute_lowest_height(figure: Figure, scale: float) -> float:
    """Returns the height in metres of the lowest point of soles, knees, hands and seat."""
    low = []
    for limb in (Limb.FOOT_LEFT, Limb.FOOT_RIGHT):
        frame = figure.frames[limb]
        low.append((frame[:, 3] + _SOLE * scale @ frame[:, :3].T)[:, 1].min())
    for limbs, thick in (
        ((Limb.SHANK_LEFT, Limb.SHANK_RIGHT), 0.06),
        ((Limb.HAND_LEFT, Limb.HAND_RIGHT), 0.05),
        ((Limb.PELVIS,), 0.17),
    ):
        low += [figure.frames[limb, 1, 3] - thick * scale for limb in limbs]
    return float(min(low))
