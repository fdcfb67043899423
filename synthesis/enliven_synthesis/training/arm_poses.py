"""Random arm poses: hanging, out, overhead, folded, on the hips, at the face, or at any position."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from enliven.arrays import Float
from enliven.person import Limb
from enliven_synthesis.body.arm_ik import solve_arm
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.body.rotations import rotation_about_x, rotation_about_y, rotation_about_z
from enliven_synthesis.training.close_arms import CLOSE_HOLDS, draw_close_wrists, reach_close

_ANGLES: dict[str, tuple[tuple[float, float], ...]] = {
    "hang": ((-0.25, 0.3), (0.05, 0.35), (-0.4, 0.6), (0.05, 0.6)),
    "out": ((-0.3, 0.3), (1.0, 1.9), (-1.2, 0.6), (0.0, 1.0)),
    "overhead": ((-0.3, 0.5), (2.2, 2.9), (-0.8, 0.8), (0.0, 1.0)),
    "forward": ((1.0, 2.0), (-0.1, 0.5), (-0.5, 0.8), (0.0, 0.7)),
    "armrest": ((-0.3, 0.4), (0.05, 0.5), (-0.3, 0.8), (1.0, 2.0)),
    "wave": ((-0.2, 0.4), (0.8, 1.7), (-2.0, -1.2), (0.8, 2.1)),
    "back": ((-0.8, -0.3), (0.1, 0.5), (0.0, 1.2), (0.1, 1.4)),
}
"""Ranges of flex, abduct, twist and elbow in radians, as defined in
:class:`enliven_synthesis.body.posture.ArmPose`."""
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
"""Positions of the left wrist in metres for a person of 1.75 m, chest's frame."""
_HOLDS = (*_ANGLES, *_TARGETS)
"""Names of the holds (arm poses) that each arm can have independently of the other."""
HOLDS = (*_HOLDS, *CLOSE_HOLDS, "anywhere")
"""Names of all holds of the arms."""
_CLOSE_ARMS_FRACTION = 0.4
"""Fraction of people who hold both arms close in front of the trunk. Performers often do this, and such arms
are hard to detect."""
_MAX_TRIES = 12
"""Maximum number of random attempts to find an arm pose that does not intersect trunk or head. If all fail,
the arm is held outward. Nearly every hold succeeds within these attempts."""

_OUTWARD_STEP_M = 0.01
"""Distance in metres that arms held close move away from the trunk with each attempt."""


def random_arms(performer: Performer, rotations: Float, rng: Generator, hold: str | None = None) -> None:
    """Poses both arms in (16, 3, 3) world_from_limb rotations, in place.

    Args:
        hold: a name of :data:`HOLDS` for both arms; None draws one at random, often the same for both.
    """
    if hold in CLOSE_HOLDS or (hold is None and rng.random() < _CLOSE_ARMS_FRACTION):
        _hold_close(performer, rotations, rng, hold)
        return
    left = hold or _draw_hold(rng)
    right = left if hold is not None or rng.random() < 0.4 else _draw_hold(rng)
    for side, name in enumerate((left, right)):
        for _ in range(_MAX_TRIES):
            _turn_arm(performer, rotations, rng, name, side)
            if not is_inside_trunk(performer, rotations, side):
                break
        else:
            _turn_arm(performer, rotations, rng, "out", side)


def _hold_close(performer: Performer, rotations: Float, rng: Generator, hold: str | None) -> None:
    """Holds both arms close in front of the trunk, in place. An arm for which this fails is held outward."""
    for n in range(_MAX_TRIES):
        for side, wrist in enumerate(draw_close_wrists(performer, rng, hold, n * _OUTWARD_STEP_M)):
            _place_arm(rotations, rng, *reach_close(performer, rotations, wrist, side), side)
        inside = [is_inside_trunk(performer, rotations, side) for side in (0, 1)]
        if not any(inside):
            return
    for side in np.flatnonzero(inside):
        _turn_arm(performer, rotations, rng, "out", int(side))


def _draw_hold(rng: Generator) -> str:
    """Returns a random hold of an arm. "anywhere" has a probability of a quarter."""
    if rng.random() < 0.25:
        return "anywhere"
    return _HOLDS[int(rng.integers(len(_HOLDS)))]


def _turn_arm(performer: Performer, rotations: Float, rng: Generator, name: str, side: int) -> None:
    """Rotates upper arm, forearm and hand of one side. ``side`` 0 is the left."""
    chest, sign = rotations[Limb.CHEST], 1.0 - 2.0 * side
    if name in _TARGETS:
        upper, elbow = _arm_towards(performer, chest, rng, _TARGETS[name], side)
    else:
        if name == "anywhere":
            flex, abduct, twist = rng.uniform(-0.8, 3.0), rng.uniform(-0.4, 2.6), rng.uniform(-1.6, 1.2)
            elbow = rng.uniform(0.0, 2.4)
        else:
            flex, abduct, twist, elbow = (rng.uniform(*r) for r in _ANGLES[name])
        upper = (
            chest
            @ rotation_about_z(sign * abduct)
            @ rotation_about_x(-flex)
            @ rotation_about_y(-sign * twist)
        )
    _place_arm(rotations, rng, upper, elbow, side)


def _place_arm(rotations: Float, rng: Generator, upper: Float, elbow: float, side: int) -> None:
    """Writes the rotations of upper arm, forearm and hand.

    The elbow's bend is in radians. The rotation of the hand is random.
    """
    sign = 1.0 - 2.0 * side
    fore = upper @ rotation_about_x(-elbow)
    palm = rotation_about_y(-sign * rng.uniform(-0.8, 1.6)) @ rotation_about_z(-sign * rng.normal(0, 0.3))
    rotations[Limb.UPPER_ARM_LEFT + side] = upper
    rotations[Limb.FOREARM_LEFT + side] = fore
    rotations[Limb.HAND_LEFT + side] = fore @ palm @ rotation_about_x(rng.normal(0, 0.3))


def _arm_towards(
    performer: Performer, chest: Float, rng: Generator, target: tuple[float, float, float], side: int
) -> tuple[Float, float]:
    """Returns the (3, 3) rotation of the upper arm and the bend of the elbow in radians.

    They bring the wrist near a target.
    """
    sign = np.array([1.0 - 2.0 * side, 1.0, 1.0])
    wrist_target = (np.array(target) * performer.scale + rng.normal(0, 0.05, 3)) * sign
    # Point the elbow down, outward and back, because most people hold it this way most of the time.
    out = np.array([0.7 * sign[0], -0.7, -0.35]) + rng.normal(0, 0.3, 3)
    return solve_arm(performer, chest, wrist_target, out, side)


def is_inside_trunk(performer: Performer, rotations: Float, side: int) -> bool:
    """Returns True if the forearm or the hand is inside the trunk or the head."""
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
