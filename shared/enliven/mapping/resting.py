"""Rest poses of a take. The take's rotations are relative to a rest pose.

mean_pose(clip)            # (N, 4) the mean pose of the take, with the heading of its beginning
compute_hanging_pose(clip, limbs)  # (N, 4) the mean of the frames in which the limbs hang most
rebase(clip, since)       # the take relative to another rest pose
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import Clip, Skeleton, joint_places
from enliven.rotation import conjugate, multiply, normalized, rotate, rotate_strain

_STRIDE_S = 1.0
"""Duration of a stride in seconds. The hips sway within a stride, but their mean heading does not."""
_HANGING_FRACTION = 0.12
"""Fraction of a take's frames that are averaged for the hanging pose: about an eighth."""
_MIN_STANDING_FRACTION = 0.25
"""Assumed minimum fraction of a take's frames in which a foot stands."""


def heading_from_rotation(turns: Float) -> Float:
    """Returns the twist (..., 4) about +Y of rotations (..., 4), by swing-twist decomposition."""
    twist = np.asarray(turns, np.float64).copy()
    twist[..., 1] = twist[..., 3] = 0.0
    return normalized(twist)


def mean_turn(turns: Float) -> Float:
    """Returns the mean (4,) of rotations (F, 4).

    The mean is the eigenvector of sum q q^T with the largest eigenvalue (Markley et al. 2007).
    """
    _, vectors = np.linalg.eigh(turns.T @ turns)
    mean = vectors[:, -1]
    return np.asarray(mean if mean[0] >= 0 else -mean)


def compute_first_heading(clip: Clip) -> Float:
    """Returns the performer's initial heading, a rotation (4,) about +Y: the mean over the first second."""
    frames = max(round(_STRIDE_S / clip.step), 1)
    return heading_from_rotation(mean_turn(heading_from_rotation(clip.turns[: frames + 1, 0])))


def mean_pose(clip: Clip) -> Float:
    """Returns the world rotations (N, 4) of a take's mean pose: the mean rotation of each bone relative to
    its parent.

    The heading is the mean over the first second, because a body that turns around in a take has no mean
    heading.
    """
    return _mean_pose(clip, np.ones(len(clip.turns), bool))


def compute_hanging_pose(clip: Clip, limbs: Sequence[Sequence[int]]) -> Float:
    """Returns the world rotations (N, 4) of a pose with hanging arms and legs, from the frames of a take.

    If a performer waves all the time, the arms of the mean pose are raised. So this is the mean over the
    eighth of the frames in which the bones of the limbs point down most. Its heading is that of the take's
    first second.

    Args:
        clip: the take.
        limbs: the chains of joints of the arms and legs.
    """
    bones = [joint for limb in limbs for joint in limb[1:]]
    height = rotate(clip.turns[:, bones], clip.skeleton.vectors[bones])[..., 1].sum(1)
    return _mean_pose(clip, height <= np.quantile(height, _HANGING_FRACTION))


def compute_standing_turns(clip: Clip, foot: Sequence[int]) -> Float:
    """Returns the mean world rotations (K, 4) of a foot's bones over the frames in which it stands flat.

    In the hanging pose the feet point down, so their rotations come from these frames. A foot stands in
    frames in which its joints are slow and low, compared with the rest of the take. The heading of the result
    is that of the take's first second.

    Args:
        clip: the take.
        foot: K + 1 joints from the ankle to the end of the foot.
    """
    positions = joint_places(clip, foot)[:, list(foot)]
    speed = (
        np.linalg.norm(np.gradient(positions, axis=0), axis=2).max(1) if len(positions) > 1 else np.zeros(1)
    )
    height = positions[..., 1].mean(1)
    is_low = height <= np.quantile(height, 2.0 * _MIN_STANDING_FRACTION)
    is_standing = is_low & (speed <= np.quantile(speed[is_low], 0.5))
    heading_change = conjugate(heading_from_rotation(clip.turns[is_standing, 0]))
    turns = [mean_turn(multiply(heading_change, clip.turns[is_standing, j])) for j in foot[1:]]
    return np.asarray(multiply(compute_first_heading(clip), np.array(turns)))


def _mean_pose(clip: Clip, frames: Bool) -> Float:
    """Returns the world rotations (N, 4) of the mean pose over some frames.

    The rotation of each bone is averaged relative to its parent. ``frames`` (F,) is True for the frames to
    use.
    """
    parents, turns = clip.skeleton.parents, clip.turns[frames]
    heading = heading_from_rotation(turns[:, 0])
    rest_rotations = np.empty((len(parents), 4))
    rest_rotations[0] = multiply(
        compute_first_heading(clip), mean_turn(multiply(conjugate(heading), turns[:, 0]))
    )
    for j in range(1, len(parents)):
        local = multiply(conjugate(turns[:, parents[j]]), turns[:, j])
        rest_rotations[j] = multiply(rest_rotations[parents[j]], mean_turn(local))
    return rest_rotations


def pose_at(clip: Clip, seconds: float) -> Float:
    """Returns the world rotations (N, 4) of the pose at a time of the take."""
    frame = int(np.clip(round(seconds / clip.step), 0, len(clip.turns) - 1))
    return np.asarray(clip.turns[frame])


def pose_skeleton(skeleton: Skeleton, turns: Float) -> Skeleton:
    """Returns the skeleton in a pose of world rotations (N, 4). Its root stays in place."""
    positions = skeleton.positions.copy()
    vectors = rotate(turns, skeleton.vectors)
    for j in range(1, len(skeleton)):
        positions[j] = positions[skeleton.parents[j]] + vectors[j]
    return replace(skeleton, positions=positions)


def change_rest_pose(clip: Clip, rest_rotations: Float) -> Clip:
    """Returns the same motion relative to another rest pose.

    ``rest_rotations`` (N, 4) contains the world rotations of the new rest pose relative to the current one.
    """
    turns = multiply(clip.turns, conjugate(rest_rotations))
    new_clip = replace(clip, skeleton=pose_skeleton(clip.skeleton, rest_rotations), turns=turns, fine=None)
    if clip.offsets is not None:
        new_clip = replace(new_clip, offsets=rotate(rest_rotations, clip.offsets))
    if clip.strains is not None:
        new_clip = replace(new_clip, strains=rotate_strain(rest_rotations, clip.strains))
    return new_clip
