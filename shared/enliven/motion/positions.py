"""The turns of bones of which only the joints' places are known: swings of least twist.

turns_of(skeleton, positions (F, N, 3), known=None) -> (F, N, 4)
rest_of(parents, at_rest, positions) -> (N, 3)           # the bones' own lengths at rest
filled(parents, positions, seen) -> (F, N, 3)            # joints that were not seen, from before and after
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Bool, Float
from enliven.rotation import from_matrix, from_rotation_vector, multiply, rotate, swing
from enliven.skeleton import Skeleton

_SHORT = 1e-6
"""Metres below which a bone points nowhere."""


def turns_of(skeleton: Skeleton, positions: Float, known: Float | None = None) -> Float:
    """(F, N, 4) world turns since rest that point every bone along its joints.

    A bone swings on the shortest way from where the bone before carries it. The root, and a bone after which
    several others begin, turn about themselves to what fits those best: hips turn the pelvis, shoulders the
    chest.

    Args:
        positions: (F, N, 3) metres.
        known: (F, N, 4) turns that are known in another way (orientations since rest), which are kept but for
            the swing that points the bone along its joints.
    """
    turns = np.empty((len(positions), len(skeleton), 4))
    for j, parent in enumerate(skeleton.parents):
        if parent < 0:
            turns[:, j] = _root_turn(skeleton, positions) if known is None else known[:, j]
            continue
        before = turns[:, parent] if known is None else known[:, j]
        turns[:, j] = _swung(before, skeleton.vectors[j], positions[:, j] - positions[:, parent])
        if known is None and len(skeleton.children[j]) > 1:
            turns[:, j] = _twisted(skeleton, j, turns[:, j], positions)
    return turns


def rest_of(parents: AnyArray, at_rest: Float, positions: Float) -> Float:
    """(N, 3) the joints at rest with every bone as long as it is in the middle of the frames (F, N, 3)."""
    made = np.array(at_rest, np.float64)
    for j, parent in enumerate(parents):
        if parent < 0:
            continue
        length = float(np.median(np.linalg.norm(positions[:, j] - positions[:, parent], axis=1)))
        made[j] = made[parent] + _direction(at_rest[j] - at_rest[parent]) * length
    return made


def filled(parents: AnyArray, positions: Float, seen: Bool) -> Float:
    """(F, N, 3) with joints that were not seen put where their parent and the frames beside say.

    The link to the parent is interpolated in time; one that was never seen stays as it was given.
    """
    made = np.array(positions, np.float64)
    frames = np.arange(len(positions))
    for j, parent in enumerate(parents):
        sure = seen[:, j] if parent < 0 else seen[:, j] & seen[:, parent]
        base = np.zeros_like(made[:, j]) if parent < 0 else made[:, parent]
        raw = positions[:, j] if parent < 0 else positions[:, j] - positions[:, parent]
        link = raw.copy()
        if sure.any() and not sure.all():
            for axis in range(3):
                link[~sure, axis] = np.interp(frames[~sure], frames[sure], raw[sure, axis])
        made[:, j] = base + link
    return made


def _root_turn(skeleton: Skeleton, positions: Float) -> Float:
    """(F, 4) the rotation that fits the root's own bones best (Kabsch); one bone alone is a swing."""
    below = [j for j in skeleton.children[0] if skeleton.lengths[j] > _SHORT]
    if len(below) < 2:
        still = np.tile([1.0, 0.0, 0.0, 0.0], (len(positions), 1))
        return (
            _swung(still, skeleton.vectors[below[0]], positions[:, below[0]] - positions[:, 0])
            if below
            else still
        )
    rest, now = skeleton.vectors[below], positions[:, below] - positions[:, :1]
    return from_matrix(np.einsum("fni,nj->fij", now, rest))


def _swung(before: Float, rest: Float, now: Float) -> Float:
    """(F, 4) ``before`` and then the shortest way that points ``rest`` along ``now`` (F, 3)."""
    if np.linalg.norm(rest) < _SHORT:
        return before
    carried, wanted = rotate(before, _direction(rest)), _direction(now)
    # A joint on top of its parent says nothing: the bone stays as it is carried.
    wanted = np.where(np.linalg.norm(now, axis=-1, keepdims=True) < _SHORT, carried, wanted)
    return multiply(swing(carried, wanted), before)


def _twisted(skeleton: Skeleton, joint: int, turns: Float, positions: Float) -> Float:
    """(F, 4) turned about the bone itself so that the bones after it fit best.

    With a and b the parts at right angles to the bone of a child as carried and as it is, the angle is
    atan2(sum (a x b).n, sum a.b): the least squares fit of one angle.
    """
    axis = rotate(turns, _direction(skeleton.vectors[joint]))
    sine, cosine = np.zeros(len(turns)), np.zeros(len(turns))
    for child in skeleton.children[joint]:
        a = rotate(turns, skeleton.vectors[child])
        b = positions[:, child] - positions[:, joint]
        a, b = (v - (v * axis).sum(-1, keepdims=True) * axis for v in (a, b))
        sine += (np.cross(a, b) * axis).sum(-1)
        cosine += (a * b).sum(-1)
    angle = np.arctan2(sine, cosine)
    return multiply(from_rotation_vector(axis * angle[:, None]), turns)


def _direction(v: Float) -> Float:
    """Unit vectors; up for one without length."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.where(length > _SHORT, v / np.where(length > _SHORT, length, 1.0), [0.0, 1.0, 0.0]))
