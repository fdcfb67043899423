"""The motions shipped with the studio.

They are computed by formulas on chains of a few joints, for make_samples.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Skeleton
from enliven.rotation import IDENTITY, from_rotation_vector, multiply

STEP = 1 / 30
"""Seconds between two frames of a motion. It is the usual frame interval of cameras."""
_SIDE = np.array([0.0, 0.0, 1.0])
_FORTH = np.array([1.0, 0.0, 0.0])

Bends = Callable[[float], list[Float]]
"""A function of the phase in [0, 1] that returns a rotation vector for each bone, in the axes of its parent
bone."""


def make_library() -> tuple[Clip, ...]:
    """Returns every motion of the library."""
    return tuple(make() for make in _MAKERS)


def wave() -> Clip:
    """Returns a wave from side to side along a chain that points up. Its amplitude grows towards the end."""

    def bends(phase: float) -> list[Float]:
        return [_SIDE * (0.10 + 0.09 * k) * math.sin(2 * math.pi * (phase - 0.16 * k)) for k in range(6)]

    return make_clip("wave", make_chain(6, 0.2), 2.0, bends)


def curl() -> Clip:
    """Returns a chain pointing up that rolls up to one side and unrolls again."""

    def bends(phase: float) -> list[Float]:
        rolled = 0.5 - 0.5 * math.cos(2 * math.pi * phase)
        return [-_SIDE * rolled * (0.12 + 0.12 * k) for k in range(5)]

    return make_clip("curl", make_chain(5, 0.2), 2.4, bends)


def reach() -> Clip:
    """Returns a folded, hanging arm that stretches forward, snaps shut and folds again."""

    def bends(phase: float) -> list[Float]:
        out = _compute_bump(phase, 0.10, 0.42, 0.62)
        shut = _compute_bump(phase, 0.36, 0.52, 0.95)
        return [_SIDE * (-0.75 * out), _SIDE * (1.15 * out - 0.5 * shut), _SIDE * (-0.7 * out + 1.2 * shut)]

    return make_clip("reach", make_chain(3, 0.32), 1.8, bends)


def walk() -> Clip:
    """Returns a hanging leg that steps: it swings forward with its knee bent, and pushes back straight."""

    def bends(phase: float) -> list[Float]:
        swing = math.sin(2 * math.pi * phase)
        lifted = max(0.0, math.cos(2 * math.pi * phase)) ** 1.5
        return [_FORTH * (-0.42 * swing), _FORTH * (0.85 * lifted), _FORTH * (-0.35 * lifted + 0.12 * swing)]

    return make_clip("walk", make_chain(3, -0.3), 1.2, bends)


def sway() -> Clip:
    """Returns a body that breathes and leans gently from side to side."""

    def bends(phase: float) -> list[Float]:
        lean = math.sin(2 * math.pi * phase)
        breath = math.sin(4 * math.pi * phase)
        return [0.10 * lean * _SIDE + 0.04 * breath * _FORTH] * 2 + [-0.12 * lean * _SIDE]

    return make_clip("sway", make_chain(3, 0.25), 3.0, bends)


def quarter_turn() -> Clip:
    """Returns one bone that rotates by 90 degrees counter-clockwise and stays there.

    This is the motion of AniMesh's Figure 6.
    """

    def bends(phase: float) -> list[Float]:
        eased = phase * phase * (3 - 2 * phase)
        return [_SIDE * (math.pi / 2 * eased)]

    return make_clip("quarter turn", make_chain(1, 1.0), 1.0, bends)


_MAKERS = (wave, curl, reach, walk, sway, quarter_turn)


def make_chain(bones: int, length: float) -> Skeleton:
    """Returns a vertical chain of joints.

    ``length`` is metres per bone. If it is negative, the chain hangs down.
    """
    heights = length * np.arange(bones + 1) + (0.2 if length > 0 else 0.2 - bones * length)
    places = np.zeros((bones + 1, 3))
    places[:, 1] = heights
    names = tuple("root" if k == 0 else f"bone {k}" for k in range(bones + 1))
    return Skeleton(names, np.arange(-1, bones, dtype=np.int32), places)


def make_clip(name: str, skeleton: Skeleton, seconds: float, bends: Bends) -> Clip:
    """Returns a clip of a chain from the rotations of its bones, each in the axes of its parent bone."""
    frames = round(seconds / STEP) + 1
    bent = from_rotation_vector(np.array([bends(frame / (frames - 1)) for frame in range(frames)]))
    turns = np.tile(IDENTITY, (frames, len(skeleton), 1))
    for bone in range(bent.shape[1]):
        turns[:, bone + 1] = multiply(turns[:, bone], bent[:, bone])
    return Clip(name, skeleton, turns, np.tile(skeleton.positions[0], (frames, 1)), STEP)


def _compute_bump(phase: float, start: float, top: float, end: float) -> float:
    """Returns a smooth bump: 0 at ``start``, 1 at ``top``, and 0 again at ``end``."""
    if not start < phase < end:
        return 0.0
    share = (phase - start) / (top - start) if phase < top else (end - phase) / (end - top)
    return share * share * (3 - 2 * share)
