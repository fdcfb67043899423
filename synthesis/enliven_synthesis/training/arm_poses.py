"""How arms are held, by dice: hanging, out, overhead, folded, on the hips, at the face, or anywhere."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import Limb
from enliven_synthesis.body import Performer, about_x, about_y, about_z

Dice = np.random.Generator

_ANGLES: dict[str, tuple[tuple[float, float], ...]] = {
    "hang": ((-0.25, 0.3), (0.05, 0.35), (-0.4, 0.6), (0.05, 0.6)),
    "out": ((-0.3, 0.3), (1.0, 1.9), (-1.2, 0.6), (0.0, 1.0)),
    "overhead": ((-0.3, 0.5), (2.2, 2.9), (-0.8, 0.8), (0.0, 1.0)),
    "forward": ((1.0, 2.0), (-0.1, 0.5), (-0.5, 0.8), (0.0, 0.7)),
    "armrest": ((-0.3, 0.4), (0.05, 0.5), (-0.3, 0.8), (1.0, 2.0)),
    "wave": ((-0.2, 0.4), (0.8, 1.7), (-2.0, -1.2), (0.8, 2.1)),
    "back": ((-0.8, -0.3), (0.1, 0.5), (0.0, 1.2), (0.1, 1.4)),
}
"""Ranges of flex, abduct, twist and elbow, radians, as in :class:`enliven_synthesis.body.posture.Arm`."""
_TARGETS: dict[str, tuple[float, float, float]] = {
    "hip": (0.16, -0.48, 0.03),
    "face": (0.04, 0.14, 0.16),
    "crown": (0.06, 0.36, 0.0),
    "folded": (-0.13, -0.20, 0.17),
    "chest": (0.02, -0.16, 0.2),
    "belly": (0.05, -0.36, 0.2),
    "ahead": (0.1, -0.1, 0.45),
    "nape": (0.03, 0.1, -0.13),
    "knee": (0.13, -0.75, 0.3),
    "small of the back": (0.03, -0.42, -0.17),
    "other shoulder": (-0.16, -0.05, 0.1),
}
"""Metres in the chest's frame, of the left wrist of a person of 1.75 m."""
HOLDS = (*_ANGLES, *_TARGETS, "anywhere")
_TRIES = 12


def dice_arms(performer: Performer, rotations: Float, dice: Dice, hold: str | None = None) -> None:
    """Turns both arms of (16, 3, 3) world_from_limb rotations, in place.

    Args:
        hold: of :data:`HOLDS`, for both arms; by dice where None (often both alike).
    """
    left = hold or _hold(dice)
    right = left if hold is not None or dice.random() < 0.4 else _hold(dice)
    for side, name in enumerate((left, right)):
        for _ in range(_TRIES):
            _turn_arm(performer, rotations, dice, name, side)
            if not _inside_trunk(performer, rotations, side):
                break
        else:
            _turn_arm(performer, rotations, dice, "out", side)


def _hold(dice: Dice) -> str:
    """A way to hold an arm; "anywhere" counts for a quarter."""
    if dice.random() < 0.25:
        return "anywhere"
    return HOLDS[int(dice.integers(len(HOLDS) - 1))]


def _turn_arm(performer: Performer, rotations: Float, dice: Dice, name: str, side: int) -> None:
    """Upper arm, forearm and hand of one side; 0 is the left."""
    chest, sign = rotations[Limb.CHEST], 1.0 - 2.0 * side
    if name in _TARGETS:
        upper, elbow = _reach(performer, chest, dice, _TARGETS[name], side)
    else:
        if name == "anywhere":
            flex, abduct, twist = dice.uniform(-0.8, 3.0), dice.uniform(-0.4, 2.6), dice.uniform(-1.6, 1.2)
            elbow = dice.uniform(0.0, 2.4)
        else:
            flex, abduct, twist, elbow = (dice.uniform(*r) for r in _ANGLES[name])
        upper = chest @ about_z(sign * abduct) @ about_x(-flex) @ about_y(-sign * twist)
    fore = upper @ about_x(-elbow)
    palm = about_y(-sign * dice.uniform(-0.8, 1.6)) @ about_z(-sign * dice.normal(0, 0.3))
    rotations[Limb.UPPER_ARM_LEFT + side] = upper
    rotations[Limb.FOREARM_LEFT + side] = fore
    rotations[Limb.HAND_LEFT + side] = fore @ palm @ about_x(dice.normal(0, 0.3))


def _reach(
    performer: Performer, chest: Float, dice: Dice, target: tuple[float, float, float], side: int
) -> tuple[Float, float]:
    """(3, 3) the upper arm and the bend of the elbow that bring the wrist near a target (two bones)."""
    sign = np.array([1.0 - 2.0 * side, 1.0, 1.0])
    shoulder = performer.shoulder * sign
    wanted = (np.array(target) * performer.scale + dice.normal(0, 0.05, 3)) * sign - shoulder
    a, b = performer.upper_arm, performer.forearm
    distance = float(np.clip(np.linalg.norm(wanted), 0.35 * (a + b), 0.995 * (a + b)))
    along = wanted / (float(np.linalg.norm(wanted)) + 1e-9)
    bend = float(np.arccos(np.clip((distance**2 - a**2 - b**2) / (2 * a * b), -1, 1)))
    inner = float(np.arccos(np.clip((distance**2 + a**2 - b**2) / (2 * a * distance), -1, 1)))
    # The elbow points down, outward and back, as it does in most people most of the time.
    outward = np.array([0.7 * sign[0], -0.7, -0.35]) + dice.normal(0, 0.3, 3)
    outward -= (outward @ along) * along
    outward /= float(np.linalg.norm(outward)) + 1e-9
    upper_way = np.cos(inner) * along + np.sin(inner) * outward
    fore_way = (distance * along - a * upper_way) / b
    y = -upper_way
    z = fore_way - (fore_way @ upper_way) * upper_way
    z /= float(np.linalg.norm(z)) + 1e-9
    return chest @ np.stack([np.cross(y, z), y, z], 1), bend


def _inside_trunk(performer: Performer, rotations: Float, side: int) -> bool:
    """Whether forearm or hand would be within the trunk or the head."""
    s = performer.scale
    chest = rotations[Limb.CHEST]
    sign, down = np.array([1.0 - 2.0 * side, 1.0, 1.0]), np.array([0.0, -1.0, 0.0])
    elbow = performer.shoulder * sign + chest.T @ (
        performer.upper_arm * (rotations[Limb.UPPER_ARM_LEFT + side] @ down)
    )
    fore = chest.T @ (rotations[Limb.FOREARM_LEFT + side] @ down)
    points = elbow + performer.forearm * np.array([[0.0], [0.5], [1.0], [1.3]]) * fore
    trunk = np.array([0.155 * performer.proportions.shoulders, 1.0, 0.12 * performer.proportions.girth]) * s
    flat = (points / trunk)[:, [0, 2]]
    level = (points[:, 1] > -0.55 * s) & (points[:, 1] < 0.03 * s)
    in_trunk = level & ((flat**2).sum(1) < 1.0)
    head = np.array([0.0, 0.18, 0.02]) * s
    in_head = np.linalg.norm(points - head, axis=1) < 0.11 * s
    return bool(np.any(in_trunk | in_head))
