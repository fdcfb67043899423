"""Random poses of both arms close in front of the trunk or towards the sensor, and all poses in between.

A hold is a named pose of both arms: folded, hands on the hips, on the belly, at the chin, in a boxer's guard,
on the lap, of a runner, or towards the lens. In a depth image these limbs are only centimetres in front of
the body, so the network needs many examples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from enliven.arrays import Float
from enliven.person import Limb
from enliven_synthesis.body.arm_ik import solve_arm
from enliven_synthesis.body.performer import Performer


@dataclass(frozen=True)
class WristPlace:
    """The position of a wrist for a person of 1.75 m: the left one, or the right one mirrored.

    Attributes:
        place: position in metres in the chest's frame: outward, up, ahead.
        elbow: direction in which the elbow points, chest's frame: outward, up, ahead.
    """

    place: tuple[float, float, float]
    elbow: tuple[float, float, float] = (0.7, -0.7, -0.35)


_HANGING = WristPlace((0.25, -0.53, 0.04), (0.5, -0.2, -0.8))
_HIP = WristPlace((0.17, -0.44, 0.04), (1.0, 0.0, -0.3))
_CHIN = WristPlace((0.04, 0.0, 0.18), (0.3, -1.0, 0.1))
_FISTS = WristPlace((0.08, -0.02, 0.26), (0.3, -1.0, 0.0))
_JAB = WristPlace((0.04, 0.0, 0.50), (0.4, -0.8, 0.0))
_LAP = WristPlace((0.12, -0.38, 0.30), (0.8, -0.3, -0.5))
_ELBOW_BENT = WristPlace((0.13, -0.25, 0.29), (0.3, -0.5, -0.8))
_POINTING = WristPlace((0.12, -0.08, 0.50))
_BELLY = WristPlace((0.01, -0.35, 0.20))
_RUN_AHEAD = WristPlace((0.06, -0.18, 0.27), (0.4, -0.6, -0.8))
_RUN_BEHIND = WristPlace((0.15, -0.34, 0.04), (0.4, 0.0, -1.0))
"""Wrist positions of arm poses.

In order: hanging, on the hips, at the chin, in a guard, striking, on the lap, bent, pointing ahead, on the
belly, and swinging in a run."""

_HOLDS: dict[str, tuple[WristPlace, WristPlace]] = {
    "folded": (WristPlace((-0.12, -0.20, 0.20)), WristPlace((-0.10, -0.26, 0.165))),
    "akimbo": (_HIP, _HIP),
    "belly": (_BELLY, WristPlace((0.03, -0.38, 0.185))),
    "chin": (_CHIN, _CHIN),
    "chin and belly": (_CHIN, _BELLY),
    "guard": (_FISTS, _FISTS),
    "jab": (_JAB, _FISTS),
    "run": (_RUN_AHEAD, _RUN_BEHIND),
    "lap": (_LAP, _LAP),
    "elbows bent": (_ELBOW_BENT, _ELBOW_BENT),
    "to the lens": (_POINTING, _ELBOW_BENT),
    "both to the lens": (_POINTING, _POINTING),
    "one hand at the chest": (WristPlace((-0.03, -0.12, 0.19)), _HANGING),
    "hanging": (_HANGING, _HANGING),
}  # fmt: skip
"""Every hold with the positions of both wrists. The arm with the first position is drawn at random."""
CLOSE_HOLDS = tuple(_HOLDS)
"""Names of all holds with both arms close to the trunk."""
_PURE_HOLD_FRACTION = 0.6
"""Fraction of the poses that are exactly one of the holds. The others are interpolated between two holds."""
_WRIST_SPREAD_M = 0.04
"""Standard deviation in metres of a wrist's position along each axis: about half a hand's length."""
_HEIGHT_SPREAD_M = 0.06
"""Standard deviation in metres of the common height of both wrists. People fold their arms at different
heights."""
_ELBOW_SPREAD = 0.3
"""Standard deviation of the elbow's direction along each axis."""


def draw_close_wrists(
    performer: Performer, rng: Generator, hold: str | None = None, ahead: float = 0.0
) -> Float:
    """Returns (2, 6): positions of both wrists in metres, and directions of both elbows, chest's frame.

    The axes are those of the arm's own side: outward, up, ahead. The left arm is first.

    Args:
        hold: a name of :data:`CLOSE_HOLDS`; None draws one at random, or a pose between two of them.
        ahead: additional distance in metres of both wrists from the trunk, for a person of 1.75 m.
    """
    wrists = _hold_wrists(hold or _draw_hold(rng), rng)
    if hold is None and rng.random() > _PURE_HOLD_FRACTION:
        part = rng.random()
        wrists = (1.0 - part) * wrists + part * _hold_wrists(_draw_hold(rng), rng)
    wrists[:, :3] += rng.normal(0.0, _WRIST_SPREAD_M, (2, 3))
    wrists[:, 1] += rng.normal(0.0, _HEIGHT_SPREAD_M)
    wrists[:, 2] += ahead
    wrists[:, 2] *= max(1.0, performer.proportions.girth)
    wrists[:, :3] *= performer.scale
    wrists[:, 3:] += rng.normal(0.0, _ELBOW_SPREAD, (2, 3))
    return wrists


def reach_close(performer: Performer, rotations: Float, wrist: Float, side: int) -> tuple[Float, float]:
    """Returns the (3, 3) rotation of the upper arm and the elbow's bend in radians for a close wrist.

    ``wrist`` is one row of the result of :func:`draw_close_wrists`.

    Args:
        rotations: (16, 3, 3) world_from_limb.
        side: 0 for the left arm, 1 for the right arm.
    """
    mirror = np.array([1.0 - 2.0 * side, 1.0, 1.0])
    return solve_arm(performer, rotations[Limb.CHEST], wrist[:3] * mirror, wrist[3:] * mirror, side)


def _draw_hold(rng: Generator) -> str:
    return CLOSE_HOLDS[int(rng.integers(len(CLOSE_HOLDS)))]


def _hold_wrists(hold: str, rng: Generator) -> Float:
    """Returns (2, 6) wrist positions and elbow directions of a hold.

    In half of the draws the arms are exchanged.
    """
    both = np.array([[*wrist.place, *wrist.elbow] for wrist in _HOLDS[hold]])
    return both[::-1].copy() if rng.random() < 0.5 else both
