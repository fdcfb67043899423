"""Exercises that are hard to track: arms overhead, crouching, kneeling, turning, hands to the floor.

Each exercise takes a seed. Seed 0 is the exercise as defined here. Any other seed varies the angles, the
depth of the bends and the tempo, so that a tracker can be tuned on some seeds and evaluated on others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from enliven.errors import InputError
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.motion.dance import START_Z_M, Choreography
from enliven_synthesis.motion.footwork import Footwork
from enliven_synthesis.motion.tracks import Step, ease

T = TypeVar("T")
_HANGING = ArmPose(flex=0.03, abduct=0.13, twist=0.25, elbow=0.22, wrist=0.1)
_OUT = ArmPose(flex=0.0, abduct=1.50, twist=0.0, elbow=0.10)
_FORWARD = ArmPose(flex=1.50, abduct=0.05, elbow=0.12)
_UP = ArmPose(flex=2.95, abduct=0.10, elbow=0.12, shrug=0.30)
_ON_HIP = ArmPose(flex=-0.35, abduct=0.75, twist=0.9, elbow=1.75, wrist=0.3)
_FOLDED = ArmPose(flex=0.45, abduct=0.12, twist=1.10, elbow=1.75)
_AT_FACE = ArmPose(flex=1.05, abduct=0.15, twist=0.6, elbow=2.25)
_BEHIND_HEAD = ArmPose(flex=2.0, abduct=0.75, twist=0.3, elbow=2.35, shrug=0.25)
_DOWN = ArmPose(flex=1.75, abduct=0.08, elbow=0.10)


def _stand(**changes: Any) -> PerformerPosture:
    """Returns a relaxed standing posture with the given fields replaced."""
    values: dict[str, Any] = {"left_arm": _HANGING, "right_arm": _HANGING, "z": START_Z_M, "pitch": 0.02}
    values |= {
        "left_foot": FootPose(0.13, START_Z_M, yaw=0.12),
        "right_foot": FootPose(-0.13, START_Z_M, yaw=-0.12),
    }
    return PerformerPosture(**(values | {"spine_pitch": 0.04} | changes))


class _Variation:
    """Random variations of the defined numbers. With seed 0 nothing varies."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed) if seed else None

    def vary(self, value: float, spread: float) -> float:
        return value if self._random is None else value + spread * float(self._random.uniform(-1.0, 1.0))

    def arm(self, arm: ArmPose) -> ArmPose:
        return replace(
            arm,
            flex=self.vary(arm.flex, 0.15),
            abduct=max(self.vary(arm.abduct, 0.15), 0.0),
            twist=self.vary(arm.twist, 0.25),
            elbow=min(max(self.vary(arm.elbow, 0.2), 0.02), 2.4),
            pronate=self.vary(arm.pronate, 0.5),
        )

    def posture(self, posture: PerformerPosture) -> PerformerPosture:
        return replace(
            posture,
            left_arm=self.arm(posture.left_arm),
            right_arm=self.arm(posture.right_arm),
            spine_yaw=self.vary(posture.spine_yaw, 0.12),
            spine_pitch=self.vary(posture.spine_pitch, 0.08),
            spine_roll=self.vary(posture.spine_roll, 0.08),
            head_yaw=self.vary(posture.head_yaw, 0.3),
            head_pitch=self.vary(posture.head_pitch, 0.12),
        )


def _choreography_from_keys(
    name: str, vary: _Variation, *keys: tuple[float, PerformerPosture]
) -> Choreography:
    """Returns a choreography of keyed postures, with eased interpolation. The times are in seconds."""
    tempo = vary.vary(1.0, 0.2)
    times = [tempo * time for time, _ in keys]
    postures = [keys[0][1], *(vary.posture(p) for _, p in keys[1:-1]), keys[-1][1]]

    def posture(time: float) -> PerformerPosture:
        k = max(0, min(int(np.searchsorted(times, time, side="right")) - 1, len(times) - 2))
        return interpolate_fields(
            postures[k], postures[k + 1], ease((time - times[k]) / (times[k + 1] - times[k]))
        )

    def planted(side: int, time: float) -> bool:
        pose = posture(time)
        return (pose.left_foot, pose.right_foot)[side].lift == 0.0

    return Choreography(name, times[-1], posture, planted)


def interpolate_fields(a: T, b: T, part: float) -> T:
    """Interpolates all numbers of two dataclasses of the same type by ``part``."""
    first, second = vars(a), vars(b)
    mixed = {
        name: interpolate_fields(value, second[name], part)
        if is_dataclass(value)
        else (1.0 - part) * value + part * second[name]
        for name, value in first.items()
    }
    return type(a)(**mixed)


def _arms(left: ArmPose, right: ArmPose | None = None, **changes: Any) -> PerformerPosture:
    return _stand(left_arm=left, right_arm=right or left, **changes)


def _make_still_exercise(vary: _Variation) -> Choreography:
    home = _stand()
    breath = replace(home, spine_pitch=0.05, head_pitch=0.02, head_yaw=0.04)
    steps = [(2.0 * n, home if n % 2 == 0 else breath) for n in range(5)]
    return _choreography_from_keys("still", vary, *steps)


def _make_overhead_exercise(vary: _Variation) -> Choreography:
    return _choreography_from_keys(
        "overhead", vary, (0.0, _stand()), (0.8, _stand()), (1.5, _arms(_OUT)), (1.8, _arms(_OUT)),
        (2.5, _arms(_UP)), (3.2, _arms(_UP, spine_roll=0.2)), (3.9, _arms(_UP, spine_roll=-0.2)),
        (4.7, _arms(_BEHIND_HEAD)), (5.2, _arms(_BEHIND_HEAD, spine_yaw=0.3)),
        (5.9, _arms(_UP, _HANGING)), (6.8, _stand()),
    )  # fmt: skip


def _make_crouch_exercise(vary: _Variation) -> Choreography:
    low = vary.vary(-0.42, 0.06)
    deep = _arms(_FORWARD, rise=low, pitch=0.45, spine_pitch=0.35, head_pitch=-0.3)
    raised = _arms(replace(_DOWN, flex=0.9), rise=low - 0.05, pitch=0.55, spine_pitch=0.45, head_pitch=-0.2)
    return _choreography_from_keys(
        "crouch", vary, (0.0, _stand()), (0.8, _stand()), (1.8, deep), (2.4, deep),
        (3.2, raised), (3.8, raised),
        (4.8, _arms(_ON_HIP)), (5.5, _arms(_ON_HIP, rise=-0.25, pitch=0.2)), (6.4, _stand()),
    )  # fmt: skip


def _make_kneel_exercise(vary: _Variation) -> Choreography:
    back = FootPose(-0.13, START_Z_M - 0.52, pitch=-1.1, yaw=-0.05)
    moving_foot = FootPose(-0.13, START_Z_M - 0.30, lift=0.06, pitch=-0.4)
    front = FootPose(0.13, START_Z_M + 0.10, yaw=0.1)
    start = replace(_stand(), left_foot=front)
    down = replace(start, right_foot=back, rise=vary.vary(-0.44, 0.02), z=START_Z_M - 0.24, pitch=0.08)
    busy = replace(down, left_arm=_FORWARD, right_arm=_AT_FACE, spine_pitch=0.15, spine_yaw=0.2)
    half = replace(start, right_foot=moving_foot, rise=-0.10, z=START_Z_M - 0.05)
    return _choreography_from_keys(
        "kneel", vary, (0.0, start), (0.8, start), (1.3, half), (2.1, down), (2.8, down), (3.6, busy),
        (4.4, replace(busy, spine_pitch=0.5)), (5.2, down), (6.0, half), (6.6, start),
    )  # fmt: skip


def _make_floor_exercise(vary: _Variation) -> Choreography:
    bent = _arms(
        _DOWN, rise=-0.12, z=START_Z_M - 0.10, pitch=1.05, spine_pitch=vary.vary(0.85, 0.1), head_pitch=0.1
    )
    low = _arms(_DOWN, rise=-0.34, z=START_Z_M - 0.06, pitch=0.95, spine_pitch=0.70, head_pitch=-0.3)
    twisted = replace(low, left_arm=_OUT, spine_yaw=0.5)
    return _choreography_from_keys(
        "floor", vary, (0.0, _stand()), (0.6, _stand()), (1.8, bent), (2.5, bent), (3.4, low), (4.0, low),
        (4.8, twisted), (5.3, twisted), (6.8, _stand()),
    )  # fmt: skip


def _make_one_leg_exercise(vary: _Variation) -> Choreography:
    shifted: dict[str, Any] = {"x": -0.11, "roll": -0.04}
    knee = _arms(
        _OUT, left_foot=FootPose(0.10, START_Z_M + 0.10, lift=vary.vary(0.42, 0.08), pitch=-0.5), **shifted
    )
    kick = _arms(
        _ON_HIP, left_foot=FootPose(0.12, START_Z_M + 0.55, lift=0.45, pitch=0.2), pitch=-0.1, **shifted
    )
    side = _arms(_HANGING, left_foot=FootPose(0.62, START_Z_M, lift=0.28, yaw=0.3), roll=-0.2, x=-0.12)
    shift = _stand(**shifted)
    return _choreography_from_keys(
        "one leg", vary, (0.0, _stand()), (0.6, shift), (1.3, knee), (2.2, knee), (2.9, kick), (3.4, kick),
        (4.2, shift), (4.9, side), (5.4, side), (6.2, shift), (6.8, _stand()),
    )  # fmt: skip


def _make_signals_exercise(vary: _Variation) -> Choreography:
    stop = replace(_OUT, flex=0.5, elbow=1.5, pronate=0.4, twist=-1.2)
    come = replace(_FORWARD, elbow=1.4)
    return _choreography_from_keys(
        "signals", vary, (0.0, _stand()), (0.6, _stand()), (1.1, _arms(_OUT, _HANGING)),
        (1.5, _arms(_OUT, stop)),
        (2.0, _arms(_FORWARD, stop, spine_yaw=0.3)), (2.5, _arms(come, _OUT)), (2.9, _arms(_FORWARD, _OUT)),
        (3.3, _arms(come, _OUT)), (3.8, _arms(stop, _FORWARD, spine_yaw=-0.4)), (4.3, _arms(_UP, _OUT)),
        (4.8, _arms(_HANGING, come)), (5.2, _arms(_HANGING, _FORWARD)), (6.0, _stand()),
    )  # fmt: skip


def _make_crossed_exercise(vary: _Variation) -> Choreography:
    return _choreography_from_keys(
        "crossed", vary, (0.0, _stand()), (0.6, _stand()), (1.3, _arms(_FOLDED)), (2.1, _arms(_FOLDED)),
        (2.8, _arms(_ON_HIP)), (3.4, _arms(_ON_HIP, spine_yaw=0.4)), (4.0, _arms(_AT_FACE, _ON_HIP)),
        (4.6, _arms(_AT_FACE)), (5.2, _arms(_FORWARD, _FOLDED)), (6.2, _stand()),
    )  # fmt: skip


def _turn_exercise(vary: _Variation) -> Choreography:
    """Turns all the way round on the spot. Each step of both feet turns by 60 degrees."""
    beat = vary.vary(0.55, 0.08)
    steps = 12
    duration = 1.0 + beat * (steps + 1) + 0.6

    def heading(side: int, time: float) -> tuple[float, float]:
        """Returns a foot's current rotation in radians, and its height in metres."""
        yaw = lift = 0.0
        for n in range(side, steps + 1, 2):
            span = 2 * math.pi / steps * (1 if n in (0, steps) else 2)
            s = (time - 0.6 - n * beat) / (0.8 * beat)
            yaw += span * ease(s)
            lift += 0.05 * (4 * s * (1 - s)) ** 2 if 0.0 < s < 1.0 else 0.0
        return yaw, lift

    def posture(time: float) -> PerformerPosture:
        feet, turned = [], []
        for side, x in ((0, 0.12), (1, -0.12)):
            yaw, lift = heading(side, time)
            turned.append(yaw)
            out = 0.12 * (1 - 2 * side)
            feet.append(FootPose(x * math.cos(yaw), START_Z_M - x * math.sin(yaw), lift, yaw + out))
        yaw = (turned[0] + turned[1]) / 2
        swing = 0.25 * math.sin(turned[0] - turned[1])
        left, right = replace(_HANGING, flex=0.03 + swing), replace(_HANGING, flex=0.03 - swing)
        return PerformerPosture(
            feet[0], feet[1], left, right, 0.0, START_Z_M, yaw=yaw, pitch=0.02, spine_pitch=0.04
        )

    return Choreography("turn", duration, posture, lambda side, time: heading(side, time)[1] == 0.0)


def _make_stroll_exercise(vary: _Variation) -> Choreography:
    """Walks nine steps straight ahead, about 3.5 m."""
    stride, beat = vary.vary(0.42, 0.05), vary.vary(0.52, 0.05)
    steps = [Step(1, 0.4, 0.4 + 0.8 * beat, dz=stride, lift=0.07)]
    for n in range(1, 8):
        start = 0.4 + n * beat
        steps.append(Step((n + 1) % 2, start, start + 0.8 * beat, dz=2 * stride, lift=0.07))
    start = 0.4 + 8 * beat
    steps.append(Step(1, start, start + 0.8 * beat, dz=stride, lift=0.07))
    feet = Footwork(((0.09, START_Z_M, 0.1), (-0.09, START_Z_M, -0.1)), steps, carry=0.6)

    def posture(time: float) -> PerformerPosture:
        x, _ = feet.pelvis(time)
        left, right = feet.foot(0, time), feet.foot(1, time)
        foot_distance = left.z - right.z

        def arm(forward: float) -> ArmPose:
            return replace(_HANGING, flex=0.03 + forward, elbow=0.28 + 0.6 * max(forward, 0.0))

        return PerformerPosture(
            left, right, arm(-0.7 * foot_distance), arm(0.7 * foot_distance), x,
            (left.z + right.z) / 2, yaw=-0.2 * foot_distance,
            roll=-0.04 * feet.weight_balance(time), pitch=0.04,
            spine_yaw=0.4 * foot_distance, spine_pitch=0.04,
        )  # fmt: skip

    return Choreography("stroll", start + beat + 0.3, posture, feet.is_planted)


def _make_touch_exercise(vary: _Variation) -> Choreography:
    """Holds out a hand to a person on the performer's left."""
    give = replace(_OUT, abduct=vary.vary(1.2, 0.1), elbow=0.15)
    return _choreography_from_keys(
        "touch", vary, (0.0, _stand()), (1.2, _stand()), (2.2, _arms(give, _HANGING, head_yaw=0.5)),
        (3.4, _arms(give, _HANGING, head_yaw=0.5)), (4.2, _arms(give, _ON_HIP)), (5.4, _stand()),
    )  # fmt: skip


_EXERCISES: dict[str, Callable[[_Variation], Choreography]] = {
    "still": _make_still_exercise,
    "overhead": _make_overhead_exercise,
    "crouch": _make_crouch_exercise,
    "kneel": _make_kneel_exercise,
    "floor": _make_floor_exercise,
    "one leg": _make_one_leg_exercise,
    "signals": _make_signals_exercise,
    "crossed": _make_crossed_exercise,
    "turn": _turn_exercise,
    "stroll": _make_stroll_exercise,
    "touch": _make_touch_exercise,
}


def get_exercise(name: str, seed: int = 0) -> Choreography:
    """Returns the exercise of that name, varied by ``seed``.

    Raises:
        InputError: for an unknown name, listing the known ones.
    """
    if name not in _EXERCISES:
        names = ", ".join(_EXERCISES)
        raise InputError(f"unknown exercise {name!r}", where="synthetic performer", remedy=f"Known: {names}.")
    return _EXERCISES[name](_Variation(seed))


def exercise_names() -> list[str]:
    """Returns the names that :func:`get_exercise` accepts."""
    return list(_EXERCISES)
