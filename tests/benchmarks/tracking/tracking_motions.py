"""Motions on which trackers fail: half turns on the spot, turns with bent knees, and work on the floor.

Each takes a seed. Seed 0 is the motion as written; any other seed varies angles, tempo and direction.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.motion.dance import START_Z_M, Choreography
from enliven_synthesis.motion.exercises import interpolate_fields
from enliven_synthesis.motion.tracks import ease

NAMES = ("half turns", "bent turns", "kneeling kick", "sitting", "hidden leg")
_HANGING = ArmPose(flex=0.05, abduct=0.16, twist=0.25, elbow=0.3, wrist=0.1)
_OUT = ArmPose(flex=0.2, abduct=1.2, elbow=0.3)
_GUARD = ArmPose(flex=0.7, abduct=0.25, twist=0.5, elbow=1.7)
_BACK = ArmPose(flex=-0.7, abduct=0.25, elbow=0.1)
_KNEES = ArmPose(flex=1.0, abduct=0.1, elbow=0.5)
_SWEEP = 1.0 / 3.0
"""Duration of a quick half turn, seconds."""
_STEP_LIFT = 0.04
"""Height by which feet leave the floor in a turn, metres."""


class Seed:
    """Random variations of a motion's numbers. Seed 0 varies nothing."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed) if seed else None
        self.way = 1.0 if self._random is None or self._random.random() < 0.5 else -1.0

    def near(self, value: float, spread: float) -> float:
        return value if self._random is None else value + spread * float(self._random.uniform(-1.0, 1.0))

    def arm(self, arm: ArmPose) -> ArmPose:
        return replace(
            arm,
            flex=self.near(arm.flex, 0.2),
            abduct=max(0.05, self.near(arm.abduct, 0.15)),
            elbow=max(0.05, self.near(arm.elbow, 0.25)),
        )


def motion_named(name: str, seed: int = 0) -> Choreography:
    """Returns the motion with that name, one of :data:`NAMES`."""
    vary = Seed(seed)
    match name:
        case "half turns":
            return _turning(name, vary, _SWEEP, pause=0.75, low=0.0)
        case "bent turns":
            return _turning(name, vary, vary.near(0.7, 0.2), pause=0.5, low=vary.near(-0.24, 0.04))
        case "kneeling kick":
            return _keyed(name, vary, *_kneeling_kick(vary))
        case "sitting":
            return _keyed(name, vary, *_sitting(vary))
        case "hidden leg":
            return _keyed(name, vary, *_hidden_leg(vary))
    raise ValueError(name)


def _turning(name: str, vary: Seed, sweep: float, pause: float, low: float) -> Choreography:
    """Returns a motion of four half turns with pauses. Both feet swing around while the pelvis turns."""
    starts, time = [], 0.8
    ways = [vary.way, vary.way, -vary.way, vary.way]
    for _ in ways:
        starts.append(time)
        time += sweep + max(0.3, vary.near(pause, 0.2))
    arms = vary.arm(_GUARD if low else _HANGING), vary.arm(_HANGING)
    lean = 0.45 if low else 0.04

    def heading(time: float) -> tuple[float, float]:
        """Returns the angle turned so far in radians, and the progress of the current turn (0 between two
        turns).
        """
        yaw, moving = 0.0, 0.0
        for start, way in zip(starts, ways, strict=True):
            share = (time - start) / sweep
            yaw += way * math.pi * ease(share)
            moving = share if 0.0 < share < 1.0 else moving
        return yaw, moving

    def posture(time: float) -> PerformerPosture:
        yaw, moving = heading(time)
        lead = 0.35 * vary.way * math.sin(math.pi * moving) if moving else 0.0
        lift = _STEP_LIFT * math.sin(math.pi * moving) if moving else 0.0
        feet = [
            FootPose(x * math.cos(yaw), START_Z_M - x * math.sin(yaw), lift, yaw + out)
            for x, out in ((0.14, 0.12), (-0.14, -0.12))
        ]
        swing = 0.5 * math.sin(math.pi * moving) if moving else 0.0
        left, right = (replace(arm, abduct=arm.abduct + swing) for arm in arms)
        return PerformerPosture(
            feet[0], feet[1], left, right, 0.0, START_Z_M, low, yaw, lean, spine_yaw=lead, spine_pitch=lean
        )

    return Choreography(name, time + 0.3, posture, lambda _, at: heading(at)[1] == 0.0)


def _home(**changes: Any) -> PerformerPosture:
    values: dict[str, Any] = {"left_arm": _HANGING, "right_arm": _HANGING, "z": START_Z_M, "pitch": 0.03}
    values |= {
        "left_foot": FootPose(0.13, START_Z_M, yaw=0.12),
        "right_foot": FootPose(-0.13, START_Z_M, yaw=-0.12),
    }
    return PerformerPosture(**(values | {"spine_pitch": 0.05} | changes))


_Keys = tuple[tuple[float, PerformerPosture], ...]


def _kneeling_kick(vary: Seed) -> _Keys:
    """Returns a motion: down on one knee and both hands, then a kick with the other leg, up behind and then
    forward.
    """
    back = FootPose(-0.13, START_Z_M - 0.50, pitch=-1.1, yaw=-0.05)
    start = _home(left_foot=FootPose(0.13, START_Z_M + 0.08, yaw=0.1))
    down = replace(start, right_foot=back, rise=vary.near(-0.44, 0.02), z=START_Z_M - 0.22, pitch=0.1)
    high = vary.near(0.38, 0.08)
    kick = replace(
        down,
        left_foot=FootPose(0.16, START_Z_M + 0.50, lift=high, pitch=0.3),
        left_arm=vary.arm(_OUT), right_arm=vary.arm(_OUT), pitch=-0.15, spine_pitch=0.1,
    )  # fmt: skip
    side = replace(kick, left_foot=FootPose(0.75, START_Z_M - 0.05, lift=high - 0.1, yaw=0.5), roll=-0.15)
    return (
        (0.0, start), (0.6, start), (1.5, down), (2.0, kick), (2.6, kick), (3.1, down), (3.6, side),
        (4.1, side), (4.6, down),
    )  # fmt: skip


def _sitting(vary: Seed) -> _Keys:
    """Returns a motion: sitting down with legs forward, leaning back on the hands, pulling the knees up."""
    half = _home(rise=-0.4, pitch=0.5, spine_pitch=0.4, z=START_Z_M - 0.1)
    low = vary.near(-0.80, 0.02)

    def legs(forward: float, up: float) -> dict[str, Any]:
        return {
            "left_foot": FootPose(0.15, START_Z_M + forward, lift=0.02, pitch=up, yaw=0.15),
            "right_foot": FootPose(-0.15, START_Z_M + forward, lift=0.02, pitch=up, yaw=-0.15),
        }

    straight = _home(rise=low, pitch=-0.1, z=START_Z_M - 0.25, **legs(0.52, 0.9))
    straight = replace(straight, left_arm=vary.arm(_KNEES), right_arm=vary.arm(_KNEES), spine_pitch=0.25)
    leant = replace(straight, left_arm=_BACK, right_arm=_BACK, pitch=-0.35, spine_pitch=0.05)
    drawn = replace(straight, **legs(0.22, 0.1), spine_pitch=0.35, left_arm=vary.arm(_KNEES))
    stretched = replace(drawn, left_foot=straight.left_foot)
    return (
        (0.0, _home()), (0.5, _home()), (1.3, half), (2.1, straight), (2.8, straight), (3.5, leant),
        (4.2, drawn), (4.9, stretched), (5.4, stretched),
    )  # fmt: skip


def _hidden_leg(vary: Seed) -> _Keys:
    """Returns a motion on one leg, with the other shank raised behind the standing leg."""
    over: dict[str, Any] = {"x": -0.10, "roll": -0.04}
    shift = _home(**over)
    behind = _home(
        left_foot=FootPose(-0.02, START_Z_M - 0.35, lift=vary.near(0.35, 0.08), pitch=-1.0, yaw=0.1),
        left_arm=vary.arm(_OUT), right_arm=vary.arm(_OUT), **over,
    )  # fmt: skip
    crossed = replace(behind, left_foot=FootPose(-0.16, START_Z_M - 0.28, lift=0.18, pitch=-0.8))
    return ((0.0, _home()), (0.5, shift), (1.2, behind), (2.2, behind), (3.0, crossed), (3.6, shift))


def _keyed(name: str, vary: Seed, *keys: tuple[float, PerformerPosture]) -> Choreography:
    """Returns a motion through keyed postures, given with times in seconds, with eased interpolation."""
    tempo = vary.near(1.0, 0.2)
    times, postures = [tempo * at for at, _ in keys], [posture for _, posture in keys]

    def posture(time: float) -> PerformerPosture:
        k = max(0, min(int(np.searchsorted(times, time, side="right")) - 1, len(times) - 2))
        return interpolate_fields(
            postures[k], postures[k + 1], ease((time - times[k]) / (times[k + 1] - times[k]))
        )

    def planted(side: int, time: float) -> bool:
        now = posture(time)
        return (now.left_foot, now.right_foot)[side].lift == 0.0

    return Choreography(name, times[-1], posture, planted)
