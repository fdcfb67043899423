"""Motions with limbs close in front of the trunk.

Examples are folded arms, hands on the hips, a boxer's guard, hands on the belly, and sitting.

The wrists reach for targets in the chest's frame, so that forearms lie in front of the trunk for every build.
Each motion takes a seed. Seed 0 is the motion as defined here. Any other seed varies targets, elbows and
tempo.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.person import Limb
from enliven_synthesis.body.arm_ik import solve_arm
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.body.posture import FootPose, PerformerPosture
from enliven_synthesis.body.rotations import rotation_about_x
from enliven_synthesis.motion.dance import START_Z_M
from enliven_synthesis.motion.exercises import interpolate_fields
from enliven_synthesis.motion.motion import place_figure
from enliven_synthesis.motion.tracks import ease

_TARGET_SPREAD_M = 0.025
"""Standard deviation in metres of the random variation of a wrist target. It is less than a hand's
thickness."""
_TEMPO_VARIATION = 0.2
"""Maximum random variation of the tempo, as a fraction of the tempo."""
_DOWN = (0.7, -0.7, -0.35)
"""Direction of a hanging elbow in the chest's frame: outward, down and back."""


@dataclass(frozen=True)
class Wrist:
    """A wrist position in metres for a person of 1.75 m, in the chest's frame. X points to the arm's own
    side.

    Attributes:
        out: the direction in which the elbow points.
    """

    x: float
    y: float
    z: float
    out: tuple[float, float, float] = _DOWN


@dataclass(frozen=True)
class Key:
    """One keyframe.

    It consists of the time in seconds, the wrists, the trunk's forward shift, and the trunk's angles in
    radians.
    """

    time: float
    left: Wrist
    right: Wrist
    trunk: dict[str, Any] = field(default_factory=dict)


_HANG = Wrist(0.25, -0.52, 0.05, (0.5, -0.2, -0.8))
_FOLD_OVER, _FOLD_UNDER = Wrist(-0.12, -0.20, 0.20), Wrist(-0.10, -0.25, 0.165)
_HIP = Wrist(0.17, -0.43, 0.06, (1.0, 0.0, -0.3))
_BELLY, _BELLY_UNDER = Wrist(0.0, -0.34, 0.20), Wrist(0.02, -0.38, 0.185)
_CHIN = Wrist(0.03, -0.01, 0.17, (0.3, -1.0, 0.1))
_GUARD = Wrist(0.07, 0.0, 0.25, (0.2, -1.0, 0.0))
_JAB = Wrist(0.03, 0.0, 0.52, (0.4, -0.8, 0.0))
_ARMREST, _LENS = Wrist(0.14, -0.27, 0.30, (0.3, -0.5, -0.8)), Wrist(0.10, -0.10, 0.52)
_LAP = Wrist(0.12, -0.36, 0.33, (0.8, -0.3, -0.5))
_RUN_FORE = Wrist(0.06, -0.20, 0.28, (0.4, -0.6, -0.8))
_RUN_BACK = Wrist(0.15, -0.32, 0.10, (0.4, 0.0, -1.0))
"""Wrist positions of arm poses.

In order: hanging, folded, on the hips, on the belly, at the chin, in a guard, on an armrest, towards the
sensor, on the lap, and of a runner."""
_PALMS, _PALMS_APART = Wrist(0.02, -0.13, 0.30), Wrist(0.20, -0.13, 0.28)
_BOOK, _WATCH = Wrist(0.11, -0.20, 0.34, (0.6, -0.8, -0.2)), Wrist(-0.06, -0.08, 0.25, (1.0, -0.2, 0.1))
_SHOULDER = Wrist(-0.15, -0.06, 0.14, (0.2, -0.8, 0.6))
_FRETS, _STRINGS = Wrist(0.36, -0.16, 0.22, (0.5, -0.9, 0.0)), Wrist(0.03, -0.33, 0.21, (1.0, -0.3, -0.5))
_EAR, _POCKET = Wrist(0.13, 0.10, 0.06, (0.8, -0.7, 0.2)), Wrist(0.17, -0.52, 0.08, (0.9, 0.0, -0.6))
"""Wrist positions of hand poses.

In order: clapping, holding a book, reading a watch, on the other shoulder, playing the guitar, holding a
telephone at the ear, and in a pocket."""


def _make_standing_keys() -> dict[str, tuple[Key, ...]]:
    """Returns the keyframes of every standing motion, by name."""

    def both(wrist: Wrist, other: Wrist | None = None, **bent: float) -> tuple[Key, ...]:
        right = other or wrist
        return (
            Key(0.0, _HANG, _HANG), Key(0.6, _HANG, _HANG), Key(1.2, wrist, right, bent),
            Key(2.1, wrist, right, bent | {"spine_yaw": 0.35}),
            Key(3.2, wrist, right, bent | {"spine_yaw": -0.35}),
            Key(4.2, wrist, right, bent), Key(5.0, _HANG, _HANG),
        )  # fmt: skip

    bow = {"pitch": 0.45, "spine_pitch": 0.5, "z": -0.06}
    return {
        "folded": both(_FOLD_OVER, _FOLD_UNDER),
        "akimbo": both(_HIP),
        "belly": (
            Key(0.0, _HANG, _HANG), Key(0.7, _BELLY, _BELLY_UNDER), Key(1.3, _BELLY, _BELLY_UNDER),
            Key(2.2, _BELLY, _BELLY_UNDER, bow), Key(2.9, _BELLY, _BELLY_UNDER, bow),
            Key(3.8, _BELLY, _BELLY_UNDER), Key(4.8, _HANG, _HANG),
        ),
        "guard": (
            Key(0.0, _HANG, _HANG), Key(0.7, _GUARD, _GUARD, {"spine_yaw": -0.3}),
            Key(1.4, _GUARD, _GUARD, {"spine_yaw": -0.3}), Key(1.65, _JAB, _GUARD, {"spine_yaw": -0.5}),
            Key(1.95, _GUARD, _GUARD, {"spine_yaw": -0.2}), Key(2.5, _GUARD, _GUARD, {"spine_pitch": 0.25}),
            Key(2.8, _GUARD, _JAB, {"spine_yaw": 0.4}), Key(3.1, _GUARD, _GUARD), Key(4.2, _GUARD, _GUARD),
            Key(5.0, _HANG, _HANG),
        ),
        "lens": (
            Key(0.0, _HANG, _HANG), Key(0.7, _ARMREST, _HANG), Key(1.5, _ARMREST, _ARMREST),
            Key(2.2, _LENS, _ARMREST), Key(3.0, _LENS, _LENS), Key(3.6, _ARMREST, _LENS),
            Key(4.3, _ARMREST, _ARMREST), Key(5.0, _HANG, _HANG),
        ),
        "chin": both(_CHIN, spine_pitch=0.12, head_pitch=0.1),
        "chin and belly": both(_CHIN, _BELLY, head_pitch=0.1),
        "clap": (
            Key(0.0, _HANG, _HANG), Key(0.7, _PALMS_APART, _PALMS_APART), Key(1.1, _PALMS, _PALMS),
            Key(1.5, _PALMS_APART, _PALMS_APART), Key(1.9, _PALMS, _PALMS, {"spine_yaw": 0.2}),
            Key(2.3, _PALMS_APART, _PALMS_APART), Key(2.7, _PALMS, _PALMS, {"spine_yaw": -0.2}),
            Key(3.6, _PALMS, _PALMS, {"spine_pitch": 0.2}), Key(4.6, _HANG, _HANG),
        ),
        "book": both(_BOOK, head_pitch=0.3, spine_pitch=0.1),
        "watch": both(_WATCH, _POCKET, head_pitch=0.25),
        "hug": both(_SHOULDER, spine_pitch=0.1),
        "guitar": both(_FRETS, _STRINGS, head_pitch=0.15),
        "telephone": both(_EAR, _POCKET, spine_pitch=0.05),
    }  # fmt: skip


_SIT = {"rise": -0.40, "z": -0.30, "pitch": 0.1, "spine_pitch": 0.15}
"""A sitting trunk: the pelvis' offset down and behind the feet in metres, and angles in radians."""
_LEAN = {"rise": -0.22, "z": -0.16, "pitch": 0.6, "spine_pitch": 0.4}
"""A trunk between standing and sitting, bent forward for balance."""
_KEYS: dict[str, tuple[Key, ...]] = _make_standing_keys() | {
    "seat": (
        Key(0.0, _HANG, _HANG), Key(0.6, _HANG, _HANG), Key(1.2, _ARMREST, _ARMREST, _LEAN),
        Key(1.9, _LAP, _LAP, _SIT), Key(2.8, _LAP, _LAP, _SIT | {"spine_yaw": 0.25}),
        Key(3.5, _FOLD_OVER, _FOLD_UNDER, _SIT), Key(4.3, _LAP, _LAP, _SIT),
        Key(5.2, _ARMREST, _ARMREST, _LEAN), Key(6.0, _HANG, _HANG),
    ),
    "jog": (Key(0.0, _RUN_FORE, _RUN_BACK), Key(6.0, _RUN_FORE, _RUN_BACK)),
}  # fmt: skip
_STRIDE_RATE_HZ = 1.35
"""Frequency of jogging on the spot in strides per second."""


class CloseLimbs:
    """A motion with limbs close to the trunk, for a performer. It begins at the world's origin, facing +Z.

    Args:
        name: one of :func:`close_limb_names`.

    Attributes:
        duration: duration in seconds.

    Raises:
        InputError: for an unknown name, listing the known ones.
    """

    def __init__(self, performer: Performer, name: str, seed: int = 0) -> None:
        if name not in _KEYS:
            names = ", ".join(_KEYS)
            raise InputError(
                f"unknown motion {name!r}", where="synthetic performer", remedy=f"Known: {names}."
            )
        rng = np.random.default_rng(seed) if seed else None
        tempo = 1.0 if rng is None else 1.0 + _TEMPO_VARIATION * float(rng.uniform(-1.0, 1.0))
        self._performer, self._jogs = performer, name == "jog"
        self._keys = [replace(_vary_key(key, rng), time=tempo * key.time) for key in _KEYS[name]]
        self._pace = 2.0 * math.pi * _STRIDE_RATE_HZ / tempo
        self.duration = self._keys[-1].time

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds. Before the start and after the end it stands still."""
        time = min(max(time, 0.0), self.duration)
        k = max(0, min(sum(key.time <= time for key in self._keys) - 1, len(self._keys) - 2))
        start_key, end_key = self._keys[k], self._keys[k + 1]
        part = ease((time - start_key.time) / (end_key.time - start_key.time))
        posture = interpolate_fields(
            _make_standing_posture(start_key.trunk), _make_standing_posture(end_key.trunk), part
        )
        wrists = [
            _interpolate_wrists(start_key.left, end_key.left, part),
            _interpolate_wrists(start_key.right, end_key.right, part),
        ]
        if self._jogs:
            posture, wrists = _make_jogging_posture(
                self._pace * time, posture, start_key.left, start_key.right
            )
        return place_figure(self._figure_with_wrists(posture, wrists), (0.0, -START_Z_M), 0.0)

    def _figure_with_wrists(self, posture: PerformerPosture, wrists: list[Float]) -> Figure:
        """Returns the figure of a posture with wrists at the given (6,) positions and elbow directions."""
        figure, performer = self._performer.pose(posture), self._performer
        rotations = figure.frames[:, :, :3].copy()
        stout = np.array([1.0, 1.0, max(1.0, performer.proportions.girth)])
        for side, wrist in enumerate(wrists):
            mirror = np.array([1.0 - 2.0 * side, 1.0, 1.0])
            place, out = wrist[:3] * stout * performer.scale * mirror, wrist[3:] * mirror
            upper, bend = solve_arm(performer, rotations[Limb.CHEST], place, out, side)
            rotations[Limb.UPPER_ARM_LEFT + side] = upper
            rotations[Limb.FOREARM_LEFT + side] = upper @ rotation_about_x(-bend)
            rotations[Limb.HAND_LEFT + side] = upper @ rotation_about_x(-bend)
        return performer.figure(rotations, figure.joints[0])


def _interpolate_wrists(a: Wrist, b: Wrist, part: float) -> Float:
    """Returns (6,) the position and the elbow direction, interpolated between two wrists."""
    first, second = (np.array([w.x, w.y, w.z, *w.out]) for w in (a, b))
    return np.asarray((1.0 - part) * first + part * second)


def _make_jogging_posture(
    phase: float, posture: PerformerPosture, fore: Wrist, back: Wrist
) -> tuple[PerformerPosture, list[Float]]:
    """Returns a posture jogging on the spot, and its wrists.

    ``phase`` is in radians. One stride is 2 pi.
    """
    swing = 0.5 + 0.5 * math.sin(phase)
    feet = [
        replace(
            foot,
            lift=0.22 * max(0.0, up) ** 2,
            z=foot.z - 0.16 * max(0.0, up) ** 2,
            pitch=-0.7 * max(0.0, up),
        )
        for foot, up in zip(
            (posture.left_foot, posture.right_foot), (math.sin(phase), -math.sin(phase)), strict=True
        )
    ]
    jogging = replace(
        posture,
        left_foot=feet[0],
        right_foot=feet[1],
        rise=-0.04 + 0.02 * math.cos(2.0 * phase),
        pitch=0.06,
        spine_yaw=0.18 * math.sin(phase),
    )
    return jogging, [_interpolate_wrists(fore, back, swing), _interpolate_wrists(back, fore, swing)]


def _make_standing_posture(trunk: dict[str, Any]) -> PerformerPosture:
    """Returns a standing posture with the trunk bent and moved.

    ``z`` in ``trunk`` is in metres in front of the feet.
    """
    feet = FootPose(0.13, START_Z_M, yaw=0.12), FootPose(-0.13, START_Z_M, yaw=-0.12)
    upright = PerformerPosture(*feet, z=START_Z_M, pitch=0.02, spine_pitch=0.04)
    return replace(upright, **(trunk | {"z": START_Z_M + trunk.get("z", 0.0)}))


def _vary_key(key: Key, rng: Generator | None) -> Key:
    """Returns the key with random variations of its wrists and its trunk."""
    if rng is None:
        return key
    left, right = (
        replace(w, x=w.x + dx, y=w.y + dy, z=w.z + abs(dz))
        for w, (dx, dy, dz) in zip(
            (key.left, key.right), rng.normal(0.0, _TARGET_SPREAD_M, (2, 3)), strict=True
        )
    )
    bent = {name: value * float(rng.uniform(0.8, 1.2)) for name, value in key.trunk.items()}
    if "rise" in bent:  # Do not vary the height of a seat.
        bent["rise"] = key.trunk["rise"]
    return replace(key, left=left, right=right, trunk=bent)


def close_limb_names() -> list[str]:
    """Returns the names that :class:`CloseLimbs` accepts."""
    return list(_KEYS)
