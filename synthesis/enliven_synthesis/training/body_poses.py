"""Plausible postures by dice: how people stand, walk, crouch, kneel, sit, bend, lunge, crawl, lie and leap.

Angles are radians. A posture is the world orientation of every limb of the synthetic performer; the feet (or
knees, hands, seat) touch the floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import Limb
from enliven_synthesis.body import Figure, Performer, about_x, about_y, about_z
from enliven_synthesis.training.arm_poses import dice_arms

Dice = np.random.Generator


@dataclass(frozen=True)
class Leg:
    """One leg against the direction the pelvis faces.

    Attributes:
        flex: the thigh forward (backward where negative).
        abduct: the thigh outward.
        twist: the thigh about its length, the toes outward.
        knee: bend of the knee.
        ankle: the toes lifted; negative points them.
    """

    flex: float
    abduct: float
    twist: float
    knee: float
    ankle: float


@dataclass(frozen=True)
class Stance:
    """What a family of postures says of legs and trunk: pelvis pitch and roll, bend of the spine."""

    left: Leg
    right: Leg
    pitch: float = 0.0
    roll: float = 0.0
    bend: float = 0.0
    lean: float = 0.0


def _planted(flex: float, knee: float, dice: Dice, spread: float = 0.14) -> Leg:
    """A leg whose sole is flat: the ankle makes up for thigh and shank."""
    return Leg(flex, abs(dice.normal(0.04, spread)), dice.normal(0.12, 0.2), knee, knee - flex)


def _stand(dice: Dice) -> Stance:
    spread = dice.choice([0.06, 0.2])
    knees = np.abs(dice.normal(0.0, 0.12, 2))
    left, right = (_planted(0.5 * k + dice.normal(0, 0.05), k, dice, spread) for k in knees)
    return Stance(left, right, dice.normal(0.03, 0.08), dice.normal(0, 0.05), dice.normal(0.08, 0.12),
                  dice.normal(0, 0.1))  # fmt: skip


def _lean(dice: Dice) -> Stance:
    base = _stand(dice)
    side = dice.uniform(-0.5, 0.5)
    return Stance(base.left, base.right, dice.normal(0.1, 0.15), 0.4 * side, dice.uniform(-0.3, 0.7), side)


def _walk(dice: Dice) -> Stance:
    stride = dice.uniform(-0.6, 0.6)
    behind = np.array([max(0.0, -stride), max(0.0, stride)])
    knees = np.abs(dice.normal(0.15, 0.2, 2)) + 0.8 * behind
    left, right = (
        _planted(s + 0.3 * k, k, dice, 0.05) for s, k in zip((stride, -stride), knees, strict=True)
    )
    return Stance(left, right, dice.normal(0.06, 0.06), dice.normal(0, 0.04), dice.normal(0.05, 0.08),
                  dice.normal(0, 0.05))  # fmt: skip


def _crouch(dice: Dice) -> Stance:
    depth = dice.uniform(0.6, 2.3)
    legs = []
    for _ in range(2):
        knee = np.clip(depth + dice.normal(0, 0.15), 0.3, 2.5)
        legs.append(_planted(0.55 * knee + dice.uniform(-0.1, 0.5), knee, dice, 0.35))
    pitch = 0.15 * depth + dice.normal(0.05, 0.15)
    return Stance(legs[0], legs[1], pitch, dice.normal(0, 0.05), dice.uniform(0.0, 0.7), dice.normal(0, 0.1))


def _kneeling_leg(dice: Dice) -> Leg:
    flex = dice.normal(0.05, 0.2)
    knee = np.clip(flex + 1.55 + dice.normal(0, 0.15), 1.2, 2.5)
    return Leg(flex, abs(dice.normal(0.08, 0.12)), dice.normal(0, 0.15), knee, dice.uniform(-0.9, 0.4))


def _kneel(dice: Dice) -> Stance:
    left, right = _kneeling_leg(dice), _kneeling_leg(dice)
    if dice.random() < 0.25:  # sitting on the heels
        flex = dice.uniform(0.7, 1.4)
        left = right = Leg(flex, abs(dice.normal(0.1, 0.1)), 0.0, min(2.5, flex + 1.5), -0.9)
    elif dice.random() < 0.55:  # on one knee
        front = _planted(dice.uniform(1.1, 1.7), dice.uniform(1.2, 1.8), dice, 0.15)
        left, right = (front, right) if dice.random() < 0.5 else (left, front)
    return Stance(left, right, dice.normal(0.05, 0.15), dice.normal(0, 0.05), dice.uniform(-0.1, 0.6),
                  dice.normal(0, 0.15))  # fmt: skip


def _sit(dice: Dice) -> Stance:
    legs = []
    for _ in range(2):
        flex = dice.uniform(1.2, 1.75)
        legs.append(_planted(flex, flex + dice.uniform(-0.5, 0.4), dice, 0.2))
    return Stance(legs[0], legs[1], dice.normal(-0.05, 0.15), 0.0, dice.uniform(-0.1, 0.6),
                  dice.normal(0, 0.12))  # fmt: skip


def _bow(dice: Dice) -> Stance:
    """Bending to the floor, more or less."""
    depth = dice.uniform(0.4, 1.0)
    legs = []
    for _ in range(2):
        knee = abs(dice.normal(0.1, 0.3))
        legs.append(_planted(0.5 * knee - 0.15 * depth + dice.normal(0, 0.06), knee, dice, 0.2))
    return Stance(legs[0], legs[1], 1.3 * depth + dice.normal(0, 0.1), dice.normal(0, 0.08),
                  0.9 * depth + dice.normal(0, 0.15), dice.normal(0, 0.2))  # fmt: skip


def _one_leg(dice: Dice) -> Stance:
    knee = abs(dice.normal(0.05, 0.1))
    ground = _planted(0.5 * knee, knee, dice, 0.06)
    flex = dice.uniform(-0.7, 2.0)
    bend = dice.uniform(0.0, 2.2) if flex > 0 else dice.uniform(0.0, 1.8)
    up = Leg(flex, max(-0.1, dice.normal(0.2, 0.35)), dice.normal(0.1, 0.3), bend, dice.normal(-0.2, 0.3))
    left, right = (ground, up) if dice.random() < 0.5 else (up, ground)
    return Stance(left, right, dice.normal(0.0, 0.15), dice.normal(0, 0.1), dice.normal(0.1, 0.2),
                  dice.normal(0, 0.15))  # fmt: skip


def _lunge(dice: Dice) -> Stance:
    knee = dice.uniform(0.4, 1.6)
    front = _planted(dice.uniform(0.4, 1.4), knee, dice, 0.15)
    back = Leg(dice.uniform(-0.9, -0.1), abs(dice.normal(0.1, 0.2)), dice.normal(0.2, 0.2),
               dice.uniform(0.0, 1.3), dice.uniform(-0.3, 0.5))  # fmt: skip
    left, right = (front, back) if dice.random() < 0.5 else (back, front)
    return Stance(left, right, dice.normal(0.1, 0.15), 0.0, dice.normal(0.15, 0.2), dice.normal(0, 0.15))


def _sideways_lunge(dice: Dice) -> Stance:
    knee = dice.uniform(0.2, 1.6)
    bent = Leg(0.6 * knee, dice.uniform(0.2, 0.7), dice.uniform(0, 0.6), knee, 0.4 * knee)
    straight = Leg(0.1, dice.uniform(0.2, 0.8), 0.1, 0.05, 0.0)
    left, right = (bent, straight) if dice.random() < 0.5 else (straight, bent)
    return Stance(left, right, dice.normal(0.15, 0.2), 0.0, dice.normal(0.15, 0.2), dice.normal(0, 0.2))


def _on_all_fours(dice: Dice) -> Stance:
    """Crawling, or rising from the floor."""
    legs = [_kneeling_leg(dice) for _ in range(2)]
    legs = [
        Leg(leg.flex + dice.uniform(-0.2, 0.5), leg.abduct, leg.twist, leg.knee, leg.ankle) for leg in legs
    ]
    return Stance(legs[0], legs[1], dice.uniform(0.8, 1.6), dice.normal(0, 0.15), dice.uniform(-0.2, 0.5),
                  dice.normal(0, 0.2))  # fmt: skip


def _lie(dice: Dice) -> Stance:
    """On the back, on the belly, or falling there."""
    on_back = dice.random() < 0.5
    legs = [
        Leg(dice.uniform(-0.1, 1.2) if on_back else dice.normal(0.0, 0.15), abs(dice.normal(0.1, 0.2)),
            dice.normal(0.1, 0.3), abs(dice.normal(0.2, 0.7)), dice.normal(-0.3, 0.3))
        for _ in range(2)
    ]  # fmt: skip
    pitch = dice.uniform(0.9, 1.7)
    return Stance(legs[0], legs[1], -pitch if on_back else pitch, dice.normal(0, 0.4), dice.normal(0.1, 0.25),
                  dice.normal(0, 0.2))  # fmt: skip


def _leap(dice: Dice) -> Stance:
    """Legs anywhere, as they are in the air or in a dance."""
    legs = [
        Leg(dice.uniform(-0.7, 1.9), dice.uniform(-0.1, 0.9), dice.normal(0.1, 0.3), dice.uniform(0.0, 2.2),
            dice.normal(-0.2, 0.3))
        for _ in range(2)
    ]  # fmt: skip
    return Stance(legs[0], legs[1], dice.normal(0.1, 0.3), dice.normal(0, 0.2), dice.normal(0.15, 0.3),
                  dice.normal(0, 0.25))  # fmt: skip


def _high_leg(dice: Dice) -> Stance:
    """A leg raised to the side or ahead, as far as dancers and kickers do; the trunk leans away from it."""
    knee = abs(dice.normal(0.05, 0.1))
    ground = _planted(0.5 * knee, knee, dice, 0.06)
    aside = dice.uniform(0.3, 1.7)
    up = Leg(dice.normal(0.2, 0.35), aside, dice.normal(0.3, 0.4), abs(dice.normal(0.0, 0.4)),
             dice.normal(-0.2, 0.3))  # fmt: skip
    left = dice.random() < 0.5
    roll = (-1.0 if left else 1.0) * dice.uniform(0.1, 0.4) * aside
    return Stance(up if left else ground, ground if left else up, dice.normal(0.0, 0.12), roll,
                  dice.normal(0.1, 0.15), dice.uniform(-0.6, 0.6) * roll)  # fmt: skip


_FAMILIES: dict[str, tuple[float, Callable[[Dice], Stance]]] = {
    "stand": (0.30, _stand),
    "lean": (0.08, _lean),
    "walk": (0.10, _walk),
    "crouch": (0.12, _crouch),
    "kneel": (0.09, _kneel),
    "sit": (0.06, _sit),
    "bow": (0.08, _bow),
    "one leg": (0.08, _one_leg),
    "high leg": (0.05, _high_leg),
    "lunge": (0.05, _lunge),
    "side lunge": (0.03, _sideways_lunge),
    "all fours": (0.02, _on_all_fours),
    "lie": (0.02, _lie),
    "leap": (0.05, _leap),
}
"""Every family with its share of the postures."""
FAMILIES = tuple(_FAMILIES)


def random_figure(
    performer: Performer, dice: Dice, yaw: float, family: str | None = None, arms: str | None = None
) -> Figure:
    """A performer somewhere over the world's origin, touching the floor.

    Args:
        yaw: radians about +Y that the pelvis faces, 0 for +Z.
        family: of :data:`FAMILIES`; by its share where None.
        arms: of :data:`enliven_synthesis.training.arm_poses.HOLDS`; by dice where None.
    """
    if family is None:
        shares = np.array([share for share, _ in _FAMILIES.values()])
        family = FAMILIES[int(dice.choice(len(FAMILIES), p=shares / shares.sum()))]
    stance = _FAMILIES[family][1](dice)
    rotations = np.tile(np.eye(3), (len(Limb), 1, 1))
    heading = about_y(yaw)
    _turn_trunk(rotations, heading, stance, dice)
    for side, leg in enumerate((stance.left, stance.right)):
        _turn_leg(rotations, heading @ about_x(0.15 * stance.pitch), leg, side)
    dice_arms(performer, rotations, dice, "hang" if arms is None and _hangs(family, dice) else arms)
    figure = performer.figure(rotations, np.zeros(3))
    return performer.figure(rotations, np.array([0.0, -_lowest(figure, performer.scale), 0.0]))


def _hangs(family: str, dice: Dice) -> bool:
    """Whether the arms hang, as they do when somebody reaches for the floor."""
    return family == "bow" and dice.random() < 0.6


def _turn_trunk(rotations: Float, heading: Float, stance: Stance, dice: Dice) -> None:
    """Pelvis, belly, chest and head."""
    pelvis = heading @ about_x(stance.pitch) @ about_z(-stance.roll)
    yaw = dice.normal(0, 0.2)
    bend = about_y(yaw / 2) @ about_x(stance.bend / 2) @ about_z(-stance.lean / 2)
    rotations[Limb.PELVIS], rotations[Limb.ABDOMEN] = pelvis, pelvis @ bend
    rotations[Limb.CHEST] = pelvis @ bend @ bend
    head = about_y(dice.normal(0, 0.45)) @ about_x(dice.normal(0.05, 0.3)) @ about_z(dice.normal(0, 0.15))
    rotations[Limb.SKULL] = rotations[Limb.CHEST] @ head


def _turn_leg(rotations: Float, heading: Float, leg: Leg, side: int) -> None:
    """One leg; ``side`` 0 is the left."""
    sign = 1.0 - 2.0 * side
    thigh = heading @ about_z(sign * leg.abduct) @ about_x(-leg.flex) @ about_y(sign * leg.twist)
    shank = thigh @ about_x(leg.knee)
    rotations[Limb.THIGH_LEFT + side], rotations[Limb.SHANK_LEFT + side] = thigh, shank
    rotations[Limb.FOOT_LEFT + side] = shank @ about_x(-float(np.clip(leg.ankle, -0.9, 0.7)))


_SOLE = np.array([[0.0, -0.08, -0.06], [0.0, -0.08, 0.15], [0.0, -0.06, 0.19]])


def _lowest(figure: Figure, scale: float) -> float:
    """Metres: the height of the lowest of soles, knees, hands and seat."""
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
