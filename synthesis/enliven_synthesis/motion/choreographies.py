"""Choreographies by name. Each is a deterministic function from a time to the performer's posture."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from enliven.errors import InputError
from enliven_synthesis.body.posture import ArmPose, PerformerPosture
from enliven_synthesis.motion.dance import START_Z_M, Choreography
from enliven_synthesis.motion.footwork import Footwork, Stance
from enliven_synthesis.motion.tracks import Step, Track, sway


def get_choreography(name: str) -> Choreography:
    """Returns the choreography of that name.

    Raises:
        InputError: for an unknown name, listing the known ones.
    """
    if name not in _CHOREOGRAPHIES:
        raise InputError(
            f"unknown choreography {name!r}",
            where="synthetic performer",
            remedy=f"Known: {', '.join(_CHOREOGRAPHIES)}.",
        )
    return _CHOREOGRAPHIES[name]()


def choreography_names() -> list[str]:
    """Returns the names that :func:`get_choreography` accepts."""
    return list(_CHOREOGRAPHIES)


def _make_stance(width: float, z: float = START_Z_M, toes: float = 0.16) -> Stance:
    """Returns feet ``width`` metres apart, with the toes turned out by ``toes`` radians."""
    return (width / 2, z, toes), (-width / 2, z, -toes)


_ARMREST = ArmPose(flex=-0.16, abduct=0.24, twist=0.14, elbow=1.80, pronate=1.15, wrist=0.02)
"""An arm with the forearm level and pointing forward, as on the armrest of a chair."""


def _add_breathing(
    posture: PerformerPosture, time: float, duration: float, amount: float = 1.0
) -> PerformerPosture:
    """Adds breathing and the small sway of a standing person to a posture."""
    breath = amount * sway(time, duration, max(2, round(duration / 3.4)), 0.1)
    slow, slower = sway(time, duration, 3, 0.37) * amount, sway(time, duration, 2, 0.0) * amount
    left = replace(
        posture.left_arm,
        shrug=posture.left_arm.shrug + 0.012 * breath,
        flex=posture.left_arm.flex + 0.012 * slow,
    )
    right = replace(
        posture.right_arm,
        shrug=posture.right_arm.shrug + 0.012 * breath,
        flex=posture.right_arm.flex - 0.014 * slower,
    )
    return replace(
        posture,
        left_arm=left,
        right_arm=right,
        x=posture.x + 0.006 * slow,
        z=posture.z + 0.004 * slower,
        spine_pitch=posture.spine_pitch - 0.010 * breath,
        spine_roll=posture.spine_roll - 0.010 * slow,
        head_pitch=posture.head_pitch + 0.012 * slower,
        head_yaw=posture.head_yaw + 0.030 * slow,
    )


# --- the chair -------------------------------------------------------------------------------------------

_CHAIR_SECONDS = 9.0
"""Length of the shipped recording in seconds."""
_CHAIR_STEPS = [
    Step(1, 2.85, 3.25, lift=0.33, toe=0.50, arc=(0.09, 0.20)),  # The performer marches with the right knee,
    Step(0, 3.38, 3.78, lift=0.33, toe=0.50, arc=(-0.09, 0.20)),  # and with the left knee.
    Step(0, 3.95, 4.27, dx=0.24, lift=0.10),  # The performer steps sideways to the left.
    Step(1, 4.37, 4.68, dx=0.24, lift=0.10),
    Step(0, 4.82, 5.12, dz=0.24, lift=0.12),  # The performer steps forward.
    Step(1, 5.24, 5.54, dz=0.24, lift=0.12),
    Step(0, 7.04, 7.38, dx=-0.24, dz=-0.24, lift=0.14, toe=0.5, both=True),  # It hops back to the start.
    Step(1, 7.04, 7.38, dx=-0.24, dz=-0.24, lift=0.14, toe=0.5, both=True),
]
_CHAIR_TRACKS = {
    # The performer leans slightly to the right, then far to the left, then slightly farther to the right,
    # and then stands upright.
    "lean": Track(
        (1.55, 0), (1.70, -0.06), (2.02, 0.34), (2.10, 0.34), (2.50, -0.36), (2.56, -0.36), (2.86, 0)
    ),
    "head": Track((1.62, 0), (1.80, 0.05), (2.12, -0.14), (2.58, 0.15), (2.95, 0)),
    "arms": Track((5.50, 0), (5.64, -0.10), (5.96, 1), (6.16, 0.42), (6.40, 1.0), (6.74, 0)),
    "crouch": Track(
        (5.50, 0),
        (5.64, -0.02),
        (5.96, 0.01),
        (6.50, 0),
        (6.84, -0.22),
        (7.04, 0),
        (7.38, -0.03),
        (7.52, -0.16),
        (7.82, 0),
    ),
    "tuck": Track((6.50, 0), (6.84, 0.55), (7.06, 0.05), (7.36, 0.16), (7.52, 0.40), (7.84, 0)),
    "turn": Track(
        (7.62, 0), (7.70, -0.05), (7.98, 0.62), (8.04, 0.62), (8.37, -0.60), (8.40, -0.60), (8.67, 0)
    ),
    "look": Track((7.58, 0), (7.86, 0.30), (8.00, 0.16), (8.22, -0.28), (8.38, -0.14), (8.64, 0)),
    "bow": Track((8.34, 0), (8.42, -0.05), (8.67, 0.52), (8.70, 0.52), (8.97, 0)),
    "nod": Track((8.37, 0), (8.60, 0.20), (8.76, 0.26), (8.99, 0)),
}


def _make_chair_choreography() -> Choreography:
    feet = Footwork(_make_stance(0.45), _CHAIR_STEPS)

    def posture(time: float) -> PerformerPosture:
        value = {name: track(time) for name, track in _CHAIR_TRACKS.items()}
        x, z = feet.pelvis(time)
        balance, behind = feet.weight_balance(time), feet.weight_balance(time - 0.07)
        flap, bow, tuck = value["arms"], value["bow"], value["tuck"]
        base_posture = PerformerPosture(
            left_foot=feet.foot(0, time),
            right_foot=feet.foot(1, time),
            left_arm=_flap_arm(flap, tuck, -0.10 * behind + 0.08 * value["turn"]),
            right_arm=_flap_arm(
                _CHAIR_TRACKS["arms"](time - 0.03), tuck, 0.10 * behind - 0.08 * value["turn"]
            ),
            x=x - 0.10 * value["lean"],
            z=z - 0.16 * bow - 0.20 * tuck * (value["crouch"] < 0) * -value["crouch"],
            rise=value["crouch"] + feet.compute_hop_height(time) - 0.008,
            yaw=0.22 * value["turn"] + 0.05 * balance,
            pitch=0.03 + 0.55 * tuck * 0.7 + 0.5 * bow,
            roll=-0.045 * balance + 0.2 * value["lean"],
            spine_yaw=0.78 * value["turn"] - 0.10 * behind,
            spine_pitch=0.05 + 0.25 * tuck + 0.6 * bow - 0.06 * max(flap, 0.0),
            spine_roll=0.85 * value["lean"] + 0.085 * behind,
            head_yaw=value["look"],
            head_pitch=-0.04 - 0.45 * tuck + value["nod"],
            head_roll=value["head"] - 0.03 * behind,
        )
        return _add_breathing(base_posture, time, _CHAIR_SECONDS)

    return Choreography("chair", _CHAIR_SECONDS, posture, feet.is_planted)


def _flap_arm(flap: float, tuck: float, swing: float) -> ArmPose:
    """Returns an arm between resting (``flap`` 0) and raised like a wing (``flap`` 1).

    ``tuck`` pulls the arm towards the body in a crouch.
    """
    rest = _ARMREST
    return ArmPose(
        flex=rest.flex + 0.20 * flap + 0.30 * tuck + swing,
        abduct=rest.abduct + 1.12 * flap + 0.10 * tuck,
        twist=rest.twist - 0.25 * flap,
        elbow=rest.elbow - 0.75 * flap + 0.15 * tuck,
        pronate=rest.pronate,
        wrist=rest.wrist - 0.30 * flap,
        shrug=0.02 + 0.22 * max(flap, 0.0),
    )


# --- the others ------------------------------------------------------------------------------------------


def _make_idle_choreography() -> Choreography:
    feet = Footwork(_make_stance(0.30), [])
    arm = ArmPose(flex=0.03, abduct=0.13, twist=0.25, elbow=0.22, wrist=0.1)

    def posture(time: float) -> PerformerPosture:
        x, z = feet.pelvis(time)
        base_posture = PerformerPosture(
            feet.foot(0, time), feet.foot(1, time), arm, arm, x, z, pitch=0.02, spine_pitch=0.04
        )
        return _add_breathing(base_posture, time, 6.0, 1.6)

    return Choreography("idle", 6.0, posture, feet.is_planted)


def _make_wave_choreography() -> Choreography:
    feet = Footwork(_make_stance(0.30), [])
    hanging = ArmPose(flex=0.03, abduct=0.13, twist=0.25, elbow=0.22, wrist=0.1)
    up = Track((0.4, 0), (0.55, -0.04), (1.05, 1), (3.9, 1), (4.5, 0))

    def posture(time: float) -> PerformerPosture:
        x, z = feet.pelvis(time)
        raised = up(time)
        beat = raised * math.sin(2 * math.pi * 1.6 * (time - 1.05)) if 1.05 < time < 4.0 else 0.0
        arm = ArmPose(
            flex=0.03 + 0.15 * raised,
            abduct=0.13 + 1.35 * raised,
            twist=0.25 - 1.75 * raised,
            elbow=0.22 + 1.35 * raised + 0.28 * beat,
            pronate=0.3 * raised,
            wrist=0.1 - 0.2 * beat,
            shrug=0.2 * max(raised, 0.0),
        )
        base_posture = PerformerPosture(
            feet.foot(0, time), feet.foot(1, time), hanging, arm, x + 0.02 * raised, z, roll=0.02 * raised,
            spine_pitch=0.04, spine_roll=0.10 * raised, head_roll=-0.06 * raised,
        )  # fmt: skip
        return _add_breathing(base_posture, time, 5.0)

    return Choreography("wave", 5.0, posture, feet.is_planted)


def _walk() -> Choreography:
    """Makes four steps towards the camera, and the same four backwards."""
    steps = [Step(1, 0.4, 0.82, dz=0.18, lift=0.06)]
    for n in range(3):
        steps.append(Step(n % 2, 0.98 + 0.58 * n, 1.40 + 0.58 * n, dz=0.18 if n == 2 else 0.36, lift=0.06))
    steps[-1] = replace(steps[-1], dz=0.18)
    for n, step in enumerate(steps[::-1]):
        steps.append(replace(step, start=3.0 + 0.58 * n, stop=3.42 + 0.58 * n, dz=-step.dz))
    feet = Footwork(_make_stance(0.20, START_Z_M - 0.35), steps, carry=0.8)

    def posture(time: float) -> PerformerPosture:
        x, z = feet.pelvis(time)
        left, right = feet.foot(0, time), feet.foot(1, time)
        stride = left.z - right.z
        swing, balance = feet.weight_balance(time - 0.05), feet.weight_balance(time)

        def arm(forward: float) -> ArmPose:
            return ArmPose(
                flex=0.03 + forward, abduct=0.12, twist=0.25, elbow=0.28 + 0.6 * max(forward, 0.0), wrist=0.1
            )

        base_posture = PerformerPosture(
            left, right, arm(-0.9 * stride), arm(0.9 * stride), x, z,
            yaw=-0.25 * stride, roll=-0.04 * balance, pitch=0.03, spine_yaw=0.55 * stride,
            spine_pitch=0.05, spine_roll=0.05 * swing,
        )  # fmt: skip
        return _add_breathing(base_posture, time, 5.6)

    return Choreography("walk", 5.6, posture, feet.is_planted)


def _wander_choreography() -> Choreography:
    from enliven_synthesis.motion.wander import wander  # Import here, because that module imports this one.

    return wander()


_CHOREOGRAPHIES: dict[str, Callable[[], Choreography]] = {
    "chair": _make_chair_choreography,
    "walk": _walk,
    "wave": _make_wave_choreography,
    "idle": _make_idle_choreography,
    "wander": _wander_choreography,
}
