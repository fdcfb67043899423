"""Finds the facing direction of a skeleton from joint names, or from its vertical plane of symmetry and its
toes."""

from __future__ import annotations

import re

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton

_LEFT_WORDS = re.compile(r"left|(?<![a-z])l(?![a-z])", re.IGNORECASE)
_RIGHT_WORDS = re.compile(r"right|(?<![a-z])r(?![a-z])", re.IGNORECASE)
_WORD_BOUNDARY = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
"""Pattern of the boundaries between the words of a camel-case name."""
_MIN_FOOT_LENGTH = 0.03
"""Minimum forward length of both feet together at which they determine the front, as a fraction of the
size."""
_MIN_SIDE_DISTANCE = 0.01
"""Minimum distance between left and right joints at which they determine the left side, as a fraction of the
size."""
_MAX_FOOT_HEIGHT = 0.12
"""Maximum height of a foot above the floor, as a fraction of the skeleton's height."""


def find_facing(skeleton: Skeleton) -> float:
    """Returns the angle of the skeleton's front about +Y from +Z at rest, in radians.

    The front is computed from pairs of joint names that differ only in left and right. Without such names, it
    is computed from the best plane of mirror symmetry and the direction of the toes. If this fails too, the
    angle is 0 (+Z), as in glTF.
    """
    left = _left_from_names(skeleton)
    if left is None:
        left = _left_from_symmetry(skeleton)
    # A body that faces +Z has its left hand at +X.
    return float(np.arctan2(-left[2], left[0]))


def rotate_about_y(vectors: Float, angles: Float | float) -> Float:
    """Returns vectors (..., 3) rotated about +Y by angles (...,) in radians that broadcast to them."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack(np.broadcast_arrays(cos * x + sin * z, y, cos * z - sin * x), axis=-1)


def side_from_name(name: str) -> int:
    """Returns 1 for the name of a left joint, -1 for that of a right joint, and 0 for other names."""
    separated_name = separate_words(name)
    left, right = bool(_LEFT_WORDS.search(separated_name)), bool(_RIGHT_WORDS.search(separated_name))
    return int(left) - int(right)


def separate_words(name: str) -> str:
    """Returns a joint's name with a space between its words."""
    return _WORD_BOUNDARY.sub(" ", name)


def _left_from_names(skeleton: Skeleton) -> Float | None:
    """Returns the horizontal direction (3,) to the left from joint names, or None if the names do not define
    it.

    It is computed from pairs of joints with the same parent, such as hips and shoulders. Other pairs, such as
    hands and feet, are used only without such pairs. They are unreliable, because the rest pose may be a
    walking pose.
    """
    parents, total, roots = skeleton.parents, np.zeros(3), np.zeros(3)
    by_plain: dict[str, dict[int, int]] = {}
    for joint, name in enumerate(skeleton.names):
        side = side_from_name(name)
        if side:
            separated_name = separate_words(name)
            by_plain.setdefault((_LEFT_WORDS if side > 0 else _RIGHT_WORDS).sub("*", separated_name), {})[
                side
            ] = joint
    for sides in by_plain.values():
        if len(sides) == 2:
            right_to_left = (skeleton.positions[sides[1]] - skeleton.positions[sides[-1]]) * [1.0, 0.0, 1.0]
            total += right_to_left
            if parents[sides[1]] == parents[sides[-1]]:
                roots += right_to_left
    for direction_sum in (roots, total):
        length = float(np.linalg.norm(direction_sum))
        if length > _MIN_SIDE_DISTANCE * _skeleton_size(skeleton):
            return np.asarray(direction_sum / length)
    return None


def _left_from_symmetry(skeleton: Skeleton) -> Float:
    """Returns the horizontal direction (3,) to the left from mirror symmetry and the direction of the
    toes."""
    positions = skeleton.positions - skeleton.positions[0]
    angles = np.arange(0.0, 180.0, 5.0)
    costs = [_mirror_distance(positions, angle) for angle in angles]
    best_angle = angles[int(np.argmin(costs))]
    finer = best_angle + np.arange(-4.0, 4.5, 0.5)
    angle = finer[int(np.argmin([_mirror_distance(positions, candidate) for candidate in finer]))]
    # Models in glTF have their left side at +X, so use another plane only if it is clearly better.
    if costs[0] <= 1.2 * min(costs) + 1e-3 * _skeleton_size(skeleton):
        angle = 0.0
    angle = np.radians(angle)
    left = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    front = np.cross(left, [0.0, 1.0, 0.0])
    toes_ahead = _toe_directions(skeleton, left) @ front
    return -left if toes_ahead < -_MIN_FOOT_LENGTH * _skeleton_size(skeleton) else left


def _mirror_distance(at: Float, degrees: float) -> float:
    """Returns the mean distance in metres between joints (N, 3) and their mirror images.

    The mirror plane is vertical and contains the origin. Its normal is +X rotated by ``degrees`` about +Y.
    """
    plane_normal = np.array([np.cos(np.radians(degrees)), 0.0, -np.sin(np.radians(degrees))])
    mirrored = at - 2.0 * (at @ plane_normal)[:, None] * plane_normal
    distances = np.linalg.norm(mirrored[:, None] - at[None], axis=2)
    return float(distances.min(1).mean())


def _toe_directions(skeleton: Skeleton, left: Float) -> Float:
    """Returns the sum (3,) of the vectors of end bones near the floor, metres. Bones in the middle plane are
    excluded.
    """
    height = skeleton.positions[:, 1]
    floor, tall = height.min(), float(np.ptp(height))
    is_lateral = np.abs(
        (skeleton.positions - skeleton.positions[0]) @ left
    ) > _MIN_FOOT_LENGTH * _skeleton_size(skeleton)
    is_low = is_lateral & (height < floor + _MAX_FOOT_HEIGHT * tall)
    ends = [j for j in range(1, len(skeleton)) if is_low[j] and not skeleton.children[j]]
    return np.asarray(sum((skeleton.vectors[j] for j in ends), np.zeros(3)))


def _skeleton_size(skeleton: Skeleton) -> float:
    return float(np.ptp(skeleton.positions, axis=0).max())
