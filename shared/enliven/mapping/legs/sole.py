"""The sole of a foot: its outermost points, and how they roll over the floor.

rolled, lowest = Sole(shape, bones).compute_rolling(turns, joints)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import AnyArray, Float, Int
from enliven.document import RiggedCharacter
from enliven.rotation import rotate

_CONTACT_DECAY = 0.02
"""Decay length of contact weights above a foot's lowest point, in foot lengths: 5 mm on an adult."""
_MEDIAN_POINTS = 32
"""Maximum number of points for the median motion of a foot: those with the largest contact weights."""
_MEDIAN_ITERATIONS = 8
"""Number of iterations for the median motion."""
_MIN_MEDIAN_DISTANCE = 0.01
"""Distance from the median, in decay lengths of the contact weights, below which points count as equal: 50 µm
on an adult. In one frame, it is a speed of 3 mm/s."""
_MIN_PATCH_RADIUS = 0.01
"""Minimum radius of the touching part of a foot, in foot lengths, at which its rotation about the vertical
matters."""
_MIN_FOOT_LENGTH = 1e-3
"""Smallest length of a foot in metres, for feet that are a single point."""
_FOOT_WEIGHT = 0.5
"""Minimum total skin weight of a vertex on the foot's bones for the vertex to belong to the foot."""
_SOLE_THICKNESS = 0.05
"""Maximum height of a sole's points above its lowest point, in foot lengths: 12 mm on an adult."""
_SEARCH_DIRECTIONS = 128
"""Number of evenly distributed directions in which the outermost points of a foot are searched."""
_FRAMES_PER_BLOCK = 2048
"""Number of frames that are processed at once, to limit the memory for all points of a foot."""


def compute_rolling_motion(points: Float, contact_height: float) -> tuple[Float, Float]:
    """Computes the motion of a foot that rolls over a floor.

    A foot that rolls without sliding rotates about the points that touch the floor, first the heel and last
    the toes. So these points must have zero speed, not a joint of the foot. If toes bend while heel and toes
    touch the floor, not all points can have zero speed. Then the median has: one part stands still, and the
    other slides a little. With the mean, both would slide.

    Args:
        points: (T, P, 3) metres from the root to points of the sole.
        contact_height: decay length, in metres, of contact weights above the lowest point.

    Returns:
        (T, 2) metres along x and z, the accumulated motion of the touching points relative to the root, and
        (T,) metres from the root up to the lowest point.
    """
    weights = _compute_touching_weights(points[..., 1], contact_height)
    touching_steps = _median_motion(np.diff(points[..., [0, 2]], axis=0), weights, contact_height)
    rolled = np.concatenate([np.zeros((1, 2)), np.cumsum(touching_steps, axis=0)])
    return rolled, np.asarray(points[..., 1].min(1))


def _median_motion(moves: Float, weights: Float, contact_height: float) -> Float:
    """Returns the weighted geometric median (T - 1, 2) in metres of the motion of points in each step.

    Weiszfeld's method begins at the weighted mean. In each iteration, points get less weight the more they
    differ.

    Args:
        moves: (T - 1, P, 2) metres, the motion of the points along the floor.
        weights: (T - 1, P) contact weights with the sum 1.
        contact_height: decay length of the weights above the lowest point, in metres.
    """
    median = np.einsum("tp,tpc->tc", weights, moves)
    if weights.shape[1] > _MEDIAN_POINTS:
        heaviest = np.argpartition(weights, -_MEDIAN_POINTS, axis=1)[:, -_MEDIAN_POINTS:]
        weights = np.take_along_axis(weights, heaviest, axis=1)
        moves = np.take_along_axis(moves, heaviest[..., None], axis=1)
    for _ in range(_MEDIAN_ITERATIONS):
        distances = np.linalg.norm(moves - median[:, None], axis=2)
        median_weights = weights / np.maximum(distances, _MIN_MEDIAN_DISTANCE * contact_height)
        median_weights /= median_weights.sum(1, keepdims=True)
        median = np.einsum("tp,tpc->tc", median_weights, moves)
    return np.asarray(median)


def _compute_touching_weights(height: Float, contact_height: float) -> Float:
    """Returns the contact weights (T - 1, P) of points in each step, with the sum 1.

    Args:
        height: (T, P) metres, the heights of the points.
        contact_height: decay length of the weights above the lowest point, in metres.
    """
    mean_height = 0.5 * (height[1:] + height[:-1])
    weights = np.exp((mean_height.min(axis=1, keepdims=True) - mean_height) / contact_height)
    return np.asarray(weights / weights.sum(1, keepdims=True))


class Sole:
    """The outermost points of a foot's surface, with the bones that move them.

    Args:
        shape: the body, at rest.
        bones: the bones of the foot.
        shin: the bone above the foot, if its lowest points belong to the foot too, as the heel of some models
            does.
    """

    def __init__(self, shape: RiggedCharacter, bones: Sequence[int], shin: int | None = None) -> None:
        self._skeleton = shape.skeleton
        self._points, self._bones, self._weights = _foot_surface(shape, bones, shin)
        foot_length = max(float(np.ptp(self._points[:, [0, 2]], axis=0).max()), _MIN_FOOT_LENGTH)
        self._contact_height = _CONTACT_DECAY * foot_length
        self._min_patch_radius = _MIN_PATCH_RADIUS * foot_length

    def points(self, turns: Float, joints: Float) -> Float:
        """Returns the points (T, P, 3) in metres, for world rotations (T, N, 4) and joint positions (T, N,
        3)."""
        positions = np.zeros((len(turns), *self._points.shape))
        for bone in np.unique(self._bones[self._weights > 0.0]):
            weight = np.where(self._bones == bone, self._weights, 0.0).sum(1)
            moved = np.flatnonzero(weight)
            rotated = rotate(turns[:, bone, None], self._points[moved] - self._skeleton.positions[bone])
            positions[:, moved] += weight[moved, None] * (rotated + joints[:, bone, None])
        return positions

    def compute_rolling(self, turns: Float, joints: Float) -> tuple[Float, Float]:
        """Returns :func:`compute_rolling_motion` of the points, for world rotations (T, N, 4), and joint
        positions (T, N, 3) in metres relative to the root."""
        rolled, lowest, offset = [np.zeros((1, 2))], list[Float](), np.zeros(2)
        for start in range(0, max(len(turns) - 1, 1), _FRAMES_PER_BLOCK):
            frames = slice(start, start + _FRAMES_PER_BLOCK + 1)
            path, height = compute_rolling_motion(
                self.points(turns[frames], joints[frames]), self._contact_height
            )
            rolled.append(offset + path[1:])
            offset, lowest = offset + path[-1], [*lowest, height if not start else height[1:]]
        return np.concatenate(rolled), np.concatenate(lowest)

    def compute_accumulated_rotation(self, turns: Float, joints: Float) -> Float:
        """Returns the accumulated rotation (T,) of the touching part about +Y, in radians.

        A foot that rolls without sliding rotates about horizontal axes only. Rotation about +Y makes it
        slide. The rotation in each step is the best fit to the motion of the touching points. So it also
        contains the rotation of skin that foot and shin move together.
        """
        steps = [np.zeros(1)]
        for start in range(0, max(len(turns) - 1, 1), _FRAMES_PER_BLOCK):
            frames = slice(start, start + _FRAMES_PER_BLOCK + 1)
            points = self.points(turns[frames], joints[frames])
            weights = _compute_touching_weights(points[..., 1], self._contact_height)
            places, moves = (
                0.5 * (points[1:] + points[:-1])[..., [0, 2]],
                np.diff(points[..., [0, 2]], axis=0),
            )
            places, moves = (
                values - np.einsum("tp,tpc->tc", weights, values)[:, None] for values in (places, moves)
            )
            moments = places[..., 1] * moves[..., 0] - places[..., 0] * moves[..., 1]
            inertia = np.sum(weights * np.sum(places**2, axis=2), axis=1)
            steps.append(np.sum(weights * moments, axis=1) / (inertia + self._min_patch_radius**2))
        return np.cumsum(np.concatenate(steps))

    def compute_lowest_height(self, turns: Float, joints: Float) -> Float:
        """Returns the height (T,) in metres of the lowest point, for rotations (T, N, 4) and joints (T, N,
        3)."""
        blocks = (
            slice(start, start + _FRAMES_PER_BLOCK) for start in range(0, len(turns), _FRAMES_PER_BLOCK)
        )
        return np.concatenate(
            [self.points(turns[frames], joints[frames])[..., 1].min(1) for frames in blocks]
        )

    def compute_turned_heights(
        self, turns: Float, joints: Float, turnings: Sequence[Float], about: int
    ) -> Float:
        """Returns the height (A, T) in metres of the lowest point relative to a joint, after all points are
        rotated about this joint.

        Args:
            turns: (T, N, 4) world rotations.
            joints: (T, N, 3) metres.
            turnings: the A alternative sequences of rotations, (T, 4) each.
            about: the joint.
        """
        lowest = list[Float]()
        for start in range(0, len(turns), _FRAMES_PER_BLOCK):
            frames = slice(start, start + _FRAMES_PER_BLOCK)
            offsets = self.points(turns[frames], joints[frames] - joints[frames, about, None])
            lowest.append(
                np.stack([rotate(turning[frames, None], offsets)[..., 1].min(1) for turning in turnings])
            )
        return np.concatenate(lowest, axis=1)


def _foot_surface(
    shape: RiggedCharacter, bones: Sequence[int], shin: int | None
) -> tuple[Float, AnyArray, AnyArray]:
    """Returns the outermost points (P, 3) of a foot in metres, and the bones (P, K) that move them with their
    weights (P, K).

    If the bones move no skin, the points are the joints at the bones' ends.
    """
    joints = (shape.skeleton.positions[list(bones)], np.array(bones)[:, None], np.ones((len(bones), 1)))
    if shape.mesh is None or shape.skin is None:
        return joints
    foot_weights = np.where(np.isin(shape.skin.indices, bones), shape.skin.weights, 0.0)
    foot_vertices = np.flatnonzero(foot_weights.sum(1) > _FOOT_WEIGHT)
    if not len(foot_vertices):
        return joints
    if shin is not None:
        shin_weights = np.where(shape.skin.indices == shin, shape.skin.weights, 0.0)
        is_leg = (foot_weights + shin_weights).sum(1) > _FOOT_WEIGHT
        foot_vertices = np.union1d(
            foot_vertices, _find_low_vertices(shape.mesh.vertices, foot_vertices, np.flatnonzero(is_leg))
        )
    main_bone = shape.skin.indices[foot_vertices, foot_weights[foot_vertices].argmax(1)]
    groups = [foot_vertices[main_bone == bone] for bone in np.unique(main_bone)]
    outermost = np.concatenate(
        [group[_find_outermost_points(shape.mesh.vertices[group])] for group in groups]
    )
    return shape.mesh.vertices[outermost], shape.skin.indices[outermost], shape.skin.weights[outermost]


def _find_low_vertices(vertices: Float, foot_vertices: Int, leg_vertices: Int) -> Int:
    """Returns the vertices of a leg that are as low as the sole of its foot, such as a heel."""
    foot = vertices[foot_vertices]
    sole_height = foot[:, 1].min() + _SOLE_THICKNESS * float(np.ptp(foot[:, [0, 2]], axis=0).max())
    return np.asarray(leg_vertices[vertices[leg_vertices, 1] < sole_height])


def _find_outermost_points(points: Float) -> Int:
    """Returns the indices (P,) of the points (V, 3) that are farthest out in at least one direction."""
    if len(points) <= _SEARCH_DIRECTIONS:
        return np.arange(len(points))
    number = np.arange(_SEARCH_DIRECTIONS) + 0.5
    height, angle = 1.0 - 2.0 * number / _SEARCH_DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * number
    radius = np.sqrt(1.0 - height**2)
    directions = np.stack([radius * np.cos(angle), height, radius * np.sin(angle)])
    return np.unique((points @ directions).argmax(0))
