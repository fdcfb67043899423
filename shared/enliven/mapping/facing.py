"""The facing of a skeleton: its upright plane of symmetry, and the side of its front."""

from __future__ import annotations

import re

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton

_LEFT = re.compile(r"left|(?<![a-z])l(?![a-z])", re.IGNORECASE)
_RIGHT = re.compile(r"right|(?<![a-z])r(?![a-z])", re.IGNORECASE)
_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
"""Where one word of a name ends and the next begins without a sign between them."""
_SURE = 0.03
"""Share of the size that feet must point ahead by, all together, to say where the front is."""
_LOW = 0.12
"""Share of the height that a foot is above the floor at most."""


def facing_of(skeleton: Skeleton) -> float:
    """Radians that the skeleton's front is turned about +Y from +Z, at rest.

    Names that differ in left and right only say it; else the plane in which the joints mirror one another
    best does, and on which side the toes point. Where nothing says, it is +Z, as glTF has it.
    """
    left = _named_left(skeleton)
    if left is None:
        left = _mirrored_left(skeleton)
    # The left hand of what faces +Z is at +X.
    return float(np.arctan2(-left[2], left[0]))


def turned_about_y(vectors: Float, angles: Float | float) -> Float:
    """Vectors (..., 3) turned about +Y by angles (...,) that broadcast to them."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack(np.broadcast_arrays(cos * x + sin * z, y, cos * z - sin * x), axis=-1)


def side_of(name: str) -> int:
    """1 for the name of a left joint, -1 of a right one, 0 of others."""
    plain = _WORDS.sub(" ", name)
    left, right = bool(_LEFT.search(plain)), bool(_RIGHT.search(plain))
    return int(left) - int(right)


def _named_left(skeleton: Skeleton) -> Float | None:
    """(3,) horizontal, towards the left, by the names of joints; None where they do not say."""
    total = np.zeros(3)
    by_plain: dict[str, dict[int, int]] = {}
    for joint, name in enumerate(skeleton.names):
        side = side_of(name)
        if side:
            plain = _WORDS.sub(" ", name)
            by_plain.setdefault((_LEFT if side > 0 else _RIGHT).sub("*", plain), {})[side] = joint
    for sides in by_plain.values():
        if len(sides) == 2:
            total += skeleton.positions[sides[1]] - skeleton.positions[sides[-1]]
    total[1] = 0.0
    length = float(np.linalg.norm(total))
    return total / length if length > 1e-3 * _size(skeleton) else None


def _mirrored_left(skeleton: Skeleton) -> Float:
    """(3,) horizontal, towards the left, by symmetry and by the toes."""
    at = skeleton.positions - skeleton.positions[0]
    angles = np.arange(0.0, 180.0, 5.0)
    costs = [_off_mirror(at, angle) for angle in angles]
    best = angles[int(np.argmin(costs))]
    finer = best + np.arange(-4.0, 4.5, 0.5)
    angle = finer[int(np.argmin([_off_mirror(at, one) for one in finer]))]
    # +X across is what glTF has; another plane must be clearly better.
    if costs[0] <= 1.2 * min(costs) + 1e-3 * _size(skeleton):
        angle = 0.0
    angle = np.radians(angle)
    left = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    front = np.cross(left, [0.0, 1.0, 0.0])
    ahead = _toes(skeleton, left) @ front
    return -left if ahead < -_SURE * _size(skeleton) else left


def _off_mirror(at: Float, degrees: float) -> float:
    """Metres that joints (N, 3) about the root are off their mirror images, across an axis in the level."""
    across = np.array([np.cos(np.radians(degrees)), 0.0, -np.sin(np.radians(degrees))])
    seen = at - 2.0 * (at @ across)[:, None] * across
    apart = np.linalg.norm(seen[:, None] - at[None], axis=2)
    return float(apart.min(1).mean())


def _toes(skeleton: Skeleton, left: Float) -> Float:
    """(3,) the sum of the last bones of what stands on the floor, left and right of the middle."""
    height = skeleton.positions[:, 1]
    floor, tall = height.min(), float(np.ptp(height))
    aside = np.abs((skeleton.positions - skeleton.positions[0]) @ left) > _SURE * _size(skeleton)
    low = aside & (height < floor + _LOW * tall)
    ends = [j for j in range(1, len(skeleton)) if low[j] and not skeleton.children[j]]
    return np.asarray(sum((skeleton.vectors[j] for j in ends), np.zeros(3)))


def _size(skeleton: Skeleton) -> float:
    return float(np.ptp(skeleton.positions, axis=0).max())
