"""Root motion: the displacement of a take's root since rest, scaled to the size of the shape.

    skeleton_heights(skeleton)           # metres: the sizes that define the travel scale
    travel_scale(shape, clip)            # the shape's own, or the ratio of the heights
    Travel(project, shape).evaluate(times)     # (T, 3) the position of the root joint

Each loop of a take continues at the position at which the previous loop ended. So a looped walk of two steps
keeps moving over the ground, at constant height.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Project, RiggedCharacter, Skeleton, smooth_take
from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import turn
from enliven.motion.layers.timing import LayerClocks

_MIN_ROOT_HEIGHT_FRACTION = 0.15
"""Minimum height of the root above the lowest joint of a skeleton that stands on legs, as a fraction of the
whole extent."""


def skeleton_heights(skeleton: Skeleton) -> tuple[float, float]:
    """Returns two sizes at rest, metres: the height of the root above the lowest joint (leg length), and the
    whole extent.

    The extent does not depend on the rotation about the vertical.
    """
    positions, height = skeleton.positions, skeleton.positions[:, 1]
    # Use the two joints that are farthest apart horizontally. Their distance is invariant to rotations about
    # the vertical, and to new nodes within bones.
    horizontal = positions[:, None, [0, 2]] - positions[None, :, [0, 2]]
    extent = float(np.linalg.norm(horizontal, axis=2).max())
    return float(height[0] - height.min()), float(np.hypot(np.ptp(height), extent))


def travel_scale(shape: RiggedCharacter, clip: Clip) -> float:
    """Returns the ratio of the distances that the shape's root and the take's root travel.

    It is the shape's own ``travel_scale`` if it is set. Otherwise it is the ratio of the leg lengths, because
    the step length is proportional to the leg length at equal joint angles. If one of the two skeletons does
    not stand on legs, it is the ratio of the whole extents.
    """
    if shape.travel_scale is not None:
        return shape.travel_scale
    (legs, extent), (their_legs, their_extent) = (
        skeleton_heights(shape.skeleton),
        skeleton_heights(clip.skeleton),
    )
    if legs > _MIN_ROOT_HEIGHT_FRACTION * extent and their_legs > _MIN_ROOT_HEIGHT_FRACTION * their_extent:
        return legs / their_legs
    return extent / their_extent if their_extent > 0.0 else 1.0


class Travel:
    """The path of a shape's root over time."""

    def __init__(self, project: Project, shape: RiggedCharacter) -> None:
        self._still = np.array(shape.skeleton.positions[0] + shape.place)
        layer = None if shape.travel is None else shape.layer(shape.travel)
        self.layer = None if layer is None or layer.muted else layer
        if self.layer is not None:
            clip = smooth_take(project.takes[self.layer.take], self.layer.smooth)
            self._clip, self._root = clip, clip.finest_motion.root
            self._clocks = LayerClocks.from_layers([self.layer], [clip])
            self._factor = self.layer.weight * travel_scale(shape, clip)
            begin, end = (_root_position(clip, second) for second in self.layer.compute_ends(clip.duration))
            self._round = (end - begin) * [1.0, 0.0, 1.0]
            self._fed = False

    def evaluate(self, times: Float) -> Float:
        """Returns the position (T, 3) of the root joint at times (T,), metres: the sum of its rest position,
        the shape's displacement and the take's path.

        The path is the displacement of the take's root from its rest position, mirrored, rotated by the
        basis, scaled and weighted.
        """
        root_positions = np.empty((len(times), 3))
        if self.layer is None:
            root_positions[:] = self._still
            return root_positions
        rest_position, layer = self._clip.skeleton.positions[0], self.layer
        parameters = (layer.basis, layer.mirrored, self._factor, self._still)
        if self._fed:
            compute_root_path(
                self._root,
                rest_position,
                self._round,
                *np.zeros((2, len(times), 1)),
                *parameters,
                root_positions,
            )
            return root_positions
        played_frames = self._clocks.frames_at(times)
        compute_root_path(
            self._root,
            rest_position,
            self._round,
            played_frames.frame,
            played_frames.rounds,
            *parameters,
            root_positions,
        )
        if not played_frames.is_plain or layer.weights:
            other, weights = (
                np.empty_like(root_positions),
                played_frames.weight * self._clocks.weight_curves(times),
            )
            compute_root_path(
                self._root,
                rest_position,
                self._round,
                played_frames.other,
                played_frames.rounds,
                *parameters,
                other,
            )
            root_positions = self._still + weights * (
                (1.0 - played_frames.share) * root_positions + played_frames.share * other - self._still
            )
        return root_positions

    def feed(self, take: str, root: Float) -> None:
        """Replaces the root positions of a take by the live position ``root`` (1, 3) at all times."""
        if self.layer is not None and self._clip.id == take:
            self._root, self._fed = root, True


def _root_position(clip: Clip, second: float) -> Float:
    """Returns the position (3,) of a take's root at a time of the take, metres."""
    frames = np.arange(len(clip.root)) * clip.step
    return np.array([np.interp(second, frames, clip.root[:, axis]) for axis in range(3)])


@njit(cache=True, nogil=True)
def compute_root_path(root, rest, each, frames, rounds, basis, mirrored, factor, still, out):
    """Computes the positions ``out`` (T, 3): ``still`` plus the path, which is the displacement of
    ``root`` (F, 3) from ``rest`` at frames (T, 1).

    ``rounds`` (T, 1) is the number of earlier loops. Each loop adds the displacement ``each`` (3,) over the
    ground.
    """
    turned = (basis[0], basis[1], basis[2], basis[3])
    for t in range(len(frames)):
        frame = max(min(int(frames[t, 0]), len(root) - 2), 0)
        after, part = min(frame + 1, len(root) - 1), frames[t, 0] - frame
        x = (1.0 - part) * root[frame, 0] + part * root[after, 0] - rest[0] + rounds[t, 0] * each[0]
        y = (1.0 - part) * root[frame, 1] + part * root[after, 1] - rest[1]
        z = (1.0 - part) * root[frame, 2] + part * root[after, 2] - rest[2] + rounds[t, 0] * each[2]
        x, y, z = turn(turned, -x if mirrored else x, y, z)
        out[t, 0] = still[0] + factor * x
        out[t, 1] = still[1] + factor * y
        out[t, 2] = still[2] + factor * z
