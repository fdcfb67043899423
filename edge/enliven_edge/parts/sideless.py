"""Postures proposed by parts of which only the kind is believed: a forearm, be it the left or the right one.

From behind and from the side the forest takes left for right more often than not, while it still knows a
forearm from a shank. So a facing is supposed, and from the trunk outward each limb takes what is nearest.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32, Int
from enliven_edge.parts.anatomy import ANCHOR_FRAMES, ANCHORS, BELOW, USUAL_AREA
from enliven_edge.parts.labels import PARTS, Part
from enliven_edge.parts.modes import Modes
from enliven_edge.tracking import model, ranges
from enliven_edge.tracking.alignment import align
from enliven_edge.tracking.kinematics import exponential
from enliven_edge.tracking.posture import Posture, forward, rotation

KIND = (np.arange(PARTS) + 1) // 2
"""(17,) the kind of every part: head, chest, belly, upper arm, forearm, hand, thigh, shank, foot."""
_HEAD, _CHEST, _BELLY = 0, 1, 2
_LIMBS = ((3, 6), (4, 7), (5, 8))
"""Kinds from the trunk outward: upper arms and thighs, forearms and shanks, hands and feet."""
_STEPS = 8
"""Of each alignment: those on the way need not be exact, and after the last one comes the fit."""
_SECOND = 0.2
"""Share of the first mode's mass from which a second one is the other limb."""
_CENTRES = np.array([Part.HEAD, Part.CHEST_LEFT, Part.BELLY_LEFT])


def _trunk_anchors() -> Float:
    """(3, 3, 12) the middles of head, chest and belly: as their left halves, but without the way sideways."""
    local = ANCHORS[_CENTRES].copy()
    local[1:, 0] = 0.0
    return local


_TRUNK = _trunk_anchors()
_TRUNK_FRAMES = ANCHOR_FRAMES[_CENTRES]


def merged(probabilities: Float32) -> Float32:
    """(M, 9) the probabilities of the kinds from (M, 17) of the parts."""
    out = np.zeros((len(probabilities), 9), np.float32)
    for part in range(PARTS):
        out[:, KIND[part]] += probabilities[:, part]
    return out


def facing_proposals(modes: Modes, lengths: Float, eye: Float, yaws: tuple[float, ...]) -> list[Posture]:
    """A posture for each way that the person may face.

    Args:
        modes: of the 9 kinds.
        lengths: (12,) the person's, or an average person's.
        eye: (3,) the sensor, world frame.
        yaws: radians from facing the sensor.
    """
    targets = _below(modes, eye)
    sure = np.minimum(1.0, modes.mass / (0.4 * USUAL_AREA[[0, 1, 3, 5, 7, 9, 11, 13, 15], None]))
    middle = np.average(targets[:3, 0], axis=0, weights=modes.mass[:3, 0] + 1e-9)
    facing = float(np.arctan2(eye[0] - middle[0], eye[2] - middle[2]))
    return [_proposed(targets, sure, modes.mass, lengths, facing + yaw) for yaw in yaws]


def _below(modes: Modes, eye: Float) -> Float:
    """(9, 2, 3) the middles of what is seen, behind its surface."""
    away = modes.positions - eye
    away /= np.linalg.norm(away, axis=2, keepdims=True) + 1e-9
    below = BELOW[[0, 1, 3, 5, 7, 9, 11, 13, 15]]
    return np.asarray(modes.positions + below[:, None, None] * away)


def _proposed(targets: Float, sure: Float, mass: Float, lengths: Float, yaw: float) -> Posture:
    """One facing: the trunk first, then its limbs from the inside out."""
    posture = Posture(np.zeros(3), _upright(targets, mass, yaw), lengths.copy())
    posture.position = np.average(
        targets[:3, 0] - _points(posture, _TRUNK_FRAMES, _TRUNK), axis=0, weights=sure[:3, 0] + 1e-6
    )
    frames, local = [*_TRUNK_FRAMES], [*_TRUNK]
    wanted, weights = [*targets[:3, 0]], [*(2.0 * sure[:3, 0])]
    for kinds in _LIMBS:
        for kind in kinds:
            sides = [2 * kind - 1, 2 * kind]
            taken = _taken(_points(posture, ANCHOR_FRAMES[sides], ANCHORS[sides]), targets[kind], mass[kind])
            for side, mode in zip(sides, taken, strict=True):
                if mode >= 0:
                    frames.append(ANCHOR_FRAMES[side])
                    local.append(ANCHORS[side])
                    wanted.append(targets[kind, mode])
                    weights.append(sure[kind, mode])
        posture, _ = align(
            posture, np.array(frames), np.array(local), np.array(wanted), 0.05 * np.array(weights),
            width=0.6, iterations=_STEPS,
        )  # fmt: skip
    return posture


def _upright(targets: Float, mass: Float, yaw: float) -> Float:
    """(13, 3, 3) relaxed, the trunk along from belly to chest (and head), facing ``yaw``."""
    rotations = ranges.RELAXED.copy()
    along = np.array([0.0, 0.15, 0.0])
    if mass[_BELLY, 0] > 0.01 and mass[_CHEST, 0] > 0.01:
        along = along + targets[_CHEST, 0] - targets[_BELLY, 0]
    elif mass[_HEAD, 0] > 0.01:
        along = along + targets[_HEAD, 0] - targets[_CHEST if mass[_CHEST, 0] > 0.01 else _BELLY, 0]
    up = along / np.linalg.norm(along)
    turned = rotation(y=yaw)
    # The turn from upright to this axis: about (up cross it), by the angle between them.
    sine = float(np.hypot(up[0], up[2]))
    if sine > 1e-3:
        angle = float(np.arctan2(sine, up[1]))
        turned = exponential(np.array([up[2], 0.0, -up[0]]) * (angle / sine)) @ turned
    rotations[model.PELVIS] = turned
    return rotations


def _points(posture: Posture, frames: Int, local: Float) -> Float:
    """(A, 3) where a posture has its anchors, world frame."""
    world, pivots, _ = forward(posture.position, posture.rotations, posture.lengths)
    return np.asarray(pivots[frames] + np.einsum("aij,aj->ai", world[frames], local @ posture.lengths))


def _taken(anchors: Float, modes: Float, mass: Float) -> tuple[int, int]:
    """Which of two modes the left and the right limb take; -1 for none."""
    apart = np.linalg.norm(anchors[:, None] - modes[None], axis=2)
    if mass[0] <= 0.0:
        return -1, -1
    if mass[1] < _SECOND * mass[0]:
        return (0, -1) if apart[0, 0] < apart[1, 0] else (-1, 0)
    return (0, 1) if apart[0, 0] + apart[1, 1] < apart[0, 1] + apart[1, 0] else (1, 0)
