"""A motion of a person that sits down on the floor, with the lowest part of the body always on the floor.

The older sitting motion in :mod:`tracking_motions` lowers the pelvis by the same height for every build. Hips
are therefore up to 7 cm too low there, and knees up to 20 cm. It stays unchanged, because films of it were
already opened.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from tracking_motions import Seed

from enliven.arrays import Float
from enliven.person import Joint, Limb
from enliven.rotation import from_matrix, slerp, to_matrix
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.body.rotations import rotation_about_x, rotation_about_y, rotation_about_z
from enliven_synthesis.motion.motion import place_figure
from enliven_synthesis.motion.tracks import ease

_SEAT = 0.165
"""Distance from the hip centre to the seat of a person of 1.75 m, metres."""
_KNEE = 0.06
"""Distance from a knee joint to its skin, metres."""
_HAND = 0.03
"""Height above the floor of a hand that rests on it, metres."""
_HANGING = ArmPose(flex=0.05, abduct=0.16, twist=0.25, elbow=0.3)
_KNEES = ArmPose(flex=1.0, abduct=0.1, elbow=0.5)
_LAP = ArmPose(flex=0.5, abduct=0.1, twist=0.5, elbow=1.0)
_BACK = ArmPose(flex=-0.7, abduct=0.25, elbow=0.1)
_STANDING = PerformerPosture(
    FootPose(0.13, 0.0, yaw=0.12), FootPose(-0.13, 0.0, yaw=-0.12), _HANGING, _HANGING
)


@dataclass(frozen=True)
class Leg:
    """The angles of a leg: thigh outward from the heading, knee bend, and lift of the toes, radians."""

    abduct: float
    knee: float
    toes: float = 0.0


_STRAIGHT, _DRAWN, _CROSSED = Leg(0.18, 0.06, -0.35), Leg(0.12, 1.75, 0.4), Leg(0.8, 2.1, -0.4)
_SQUAT = ((1.3, Leg(0.25, 1.9, 0.55)), (1.3, Leg(0.25, 1.9, 0.55)))

Legs = tuple[Leg, Leg]
"""The left and the right leg."""
SettledLegs = tuple[tuple[float, Leg], tuple[float, Leg]]
"""The angle by which each thigh is lifted forward, radians, and the other angles of the leg."""
_BEHIND = -0.25
"""Offset of the pelvis along the heading from the standing position, metres. It is behind the performer."""


class SittingDown:
    """A motion: a person sits down on the floor with legs forward, leans back on the hands, and then pulls
    the knees up or crosses the legs.

    Args:
        seed: 0 uses the written numbers. Any other seed varies the angles, the tempo, and the choice in
            the last third.
    """

    def __init__(self, performer: Performer, seed: int = 0) -> None:
        vary = Seed(seed)
        self._performer = performer
        lap, back, knees = vary.arm(_LAP), vary.arm(_BACK), vary.arm(_KNEES)
        straight, drawn, crossed = (_pair(vary, leg) for leg in (_STRAIGHT, _DRAWN, _CROSSED))
        standing = performer.pose(_STANDING).frames[:, :, :3]
        squat = _rotations(0.5, 0.4, _SQUAT, vary.arm(_HANGING))

        def seat(pitch: float, bend: float, legs: Legs, arm: ArmPose) -> Float:
            settled = _settled(performer, legs)
            return _rotations(pitch, bend, settled, _above_floor(performer, pitch, bend, settled, arm))

        keys: list[tuple[float, Float, float]] = [
            (0.0, standing, 0.0),
            (0.5, standing, 0.0),
            (1.3, squat, -0.1),
            (2.1, seat(-0.1, 0.25, straight, lap), _BEHIND),
            (2.8, seat(-0.1, 0.3, straight, lap), _BEHIND),
            (3.3, seat(-0.35, 0.05, straight, back), _BEHIND),
        ]
        if vary.way > 0.0:
            last = (drawn, knees), ((drawn[0], straight[1]), knees)
        else:
            last = ((straight[0], drawn[1]), lap), (crossed, lap)
        keys += [(at, seat(-0.15, 0.4, *held), _BEHIND) for at, held in zip((3.9, 4.5), last, strict=True)]
        tempo = vary.near(1.0, 0.15)
        self._times = [tempo * at for at, _, _ in keys]
        self._turns = [from_matrix(rotations) for _, rotations, _ in keys]
        self._back = [z for _, _, z in keys]
        self.duration = self._times[-1] + 0.5

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds."""
        at = min(max(time, 0.0), self._times[-1])
        k = max(0, min(int(np.searchsorted(self._times, at, side="right")) - 1, len(self._times) - 2))
        part = ease((at - self._times[k]) / (self._times[k + 1] - self._times[k]))
        rotations = to_matrix(slerp(self._turns[k], self._turns[k + 1], np.full(16, part)))
        back = (1.0 - part) * self._back[k] + part * self._back[k + 1]
        figure = self._performer.figure(rotations, np.zeros(3))
        pelvis = np.array([0.0, -lowest_point(self._performer, figure), back])
        return place_figure(self._performer.figure(rotations, pelvis), (0.0, 0.0), 0.0)


def lowest_point(performer: Performer, figure: Figure) -> float:
    """Returns the height of the lowest point of soles, knees and seat, metres."""
    seat = figure.frames[Limb.PELVIS, 1, 3] - _SEAT * performer.scale
    return min(float(seat), _lowest_of_legs(performer, figure))


def _lowest_of_legs(performer: Performer, figure: Figure) -> float:
    """Returns the height of the lowest point of soles and knees, metres."""
    knees = figure.frames[[Limb.SHANK_LEFT, Limb.SHANK_RIGHT], 1, 3] - _KNEE * performer.scale
    return float(min(knees.min(), performer.soles(figure).min()))


def _pair(vary: Seed, leg: Leg) -> Legs:
    """Returns two legs with angles close to the written ones."""

    def near() -> Leg:
        return Leg(vary.near(leg.abduct, 0.1), max(0.02, vary.near(leg.knee, 0.08)), leg.toes)

    return near(), near()


def _settled(performer: Performer, legs: Legs) -> SettledLegs:
    """Returns the legs, each with the lift of its thigh in radians at which seat and leg are on the floor."""

    def lifted(side: int) -> float:
        low, high = 0.8, 2.8
        for _ in range(20):
            middle = 0.5 * (low + high)
            rotations = _rotations(0.0, 0.0, ((middle, legs[side]), (middle, legs[side])), _LAP)
            figure = performer.figure(rotations, np.array([0.0, _SEAT * performer.scale, 0.0]))
            low, high = (middle, high) if _lowest_of_legs(performer, figure) < 0.0 else (low, middle)
        return high

    return (lifted(0), legs[0]), (lifted(1), legs[1])


def _above_floor(performer: Performer, pitch: float, bend: float, legs: SettledLegs, arm: ArmPose) -> ArmPose:
    """Returns the arm with the elbow bent until the hands of a sitting person are above the floor."""
    hands, seat = [Joint.HAND_LEFT, Joint.HAND_RIGHT], np.array([0.0, _SEAT * performer.scale, 0.0])
    for elbow in np.arange(arm.elbow, 2.0, 0.1):
        bent = replace(arm, elbow=float(elbow))
        if performer.figure(_rotations(pitch, bend, legs, bent), seat).joints[hands, 1].min() > _HAND:
            return bent
    return arm


def _rotations(pitch: float, bend: float, legs: SettledLegs, arm: ArmPose) -> Float:
    """Returns the (16, 3, 3) world_from_limb of a posture that faces +Z.

    Args:
        pitch, bend: forward lean of the pelvis, and of the chest relative to the pelvis, radians.
        arm: pose of both arms.
    """
    rotations = np.tile(np.eye(3), (len(Limb), 1, 1))
    rotations[Limb.PELVIS], rotations[Limb.ABDOMEN] = (
        rotation_about_x(pitch),
        rotation_about_x(pitch + bend / 3.0),
    )
    rotations[Limb.CHEST] = rotations[Limb.SKULL] = rotation_about_x(pitch + bend)
    for side, (flex, leg) in enumerate(legs):
        sign = 1.0 - 2.0 * side
        thigh = rotation_about_y(sign * leg.abduct) @ rotation_about_x(-flex)
        rotations[Limb.THIGH_LEFT + side], shank = thigh, thigh @ rotation_about_x(leg.knee)
        rotations[Limb.SHANK_LEFT + side] = shank
        rotations[Limb.FOOT_LEFT + side] = shank @ rotation_about_x(-leg.toes)
        upper = rotations[Limb.CHEST] @ rotation_about_z(sign * arm.abduct) @ rotation_about_x(-arm.flex)
        upper = upper @ rotation_about_y(-sign * arm.twist)
        rotations[Limb.UPPER_ARM_LEFT + side], fore = upper, upper @ rotation_about_x(-arm.elbow)
        rotations[Limb.FOREARM_LEFT + side] = rotations[Limb.HAND_LEFT + side] = fore
    return rotations
