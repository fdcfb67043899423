"""Rest poses of a take: the pose that its rotations are relative to. Any pose can be one.

mean_pose(clip)            # (N, 4) the mean pose of the take, with the heading of its beginning
hanging_pose(clip, limbs)  # (N, 4) the mean of the frames in which the limbs hang most
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
"""Duration of a stride in seconds. The mean heading over a stride does not sway with the hips."""
_HANGING_FRACTION = 0.12
"""Fraction of a take's frames that are averaged for the hanging pose: about an eighth."""
_MIN_STANDING_FRACTION = 0.25
"""Minimum fraction of a take's frames in which a foot stands."""


def heading_of(turns: Float) -> Float:
    """Returns the twist (..., 4) about +Y of rotations (..., 4), by swing-twist decomposition."""
    twist = np.asarray(turns, np.float64).copy()
    twist[..., 1] = twist[..., 3] = 0.0
    return normalized(twist)


def mean_turn(turns: Float) -> Float:
    """Returns the mean (4,) of rotations (F, 4).

    It is the eigenvector of sum q q^T with the largest eigenvalue (Markley et al. 2007).
    """
    _, vectors = np.linalg.eigh(turns.T @ turns)
    mean = vectors[:, -1]
    return np.asarray(mean if mean[0] >= 0 else -mean)


def first_heading(clip: Clip) -> Float:
    """Returns the performer's initial heading (4,) about +Y: the mean of the first second, a stride."""
    frames = max(round(_STRIDE_S / clip.step), 1)
    return heading_of(mean_turn(heading_of(clip.turns[: frames + 1, 0])))


def mean_pose(clip: Clip) -> Float:
    """Returns the world rotations (N, 4) of a take's mean pose: the mean of each bone relative to its parent.

    The heading is that of the take's first second. A body that turns around in a take has no mean heading.
    """
    return _mean_pose(clip, np.ones(len(clip.turns), bool))


def hanging_pose(clip: Clip, limbs: Sequence[Sequence[int]]) -> Float:
    """Returns the world rotations (N, 4) of an upright body with hanging arms and legs, from a take's frames.

    If a performer waves all the time, the mean pose has raised arms. So this is the mean of the eighth of the
    frames in which the bones of the limbs point down most. Its heading is that of the take's first second.

    Args:
        clip: the take.
        limbs: chains of joints.
    """
    bones = [joint for limb in limbs for joint in limb[1:]]
    height = rotate(clip.turns[:, bones], clip.skeleton.vectors[bones])[..., 1].sum(1)
    return _mean_pose(clip, height <= np.quantile(height, _HANGING_FRACTION))


def standing_turns(clip: Clip, foot: Sequence[int]) -> Float:
    """Returns the mean world rotations (K, 4) of a foot's bones over the frames in which it stands flat.

    This is needed because feet point down in the hanging pose. A foot counts as standing in frames in which
    its joints are slow and low, compared with the rest of the take. Its heading is that of the take's first
    second.

    Args:
        clip: the take.
        foot: K + 1 joints from the ankle to the end of the foot.
    """
    places = joint_places(clip, foot)[:, list(foot)]
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=2).max(1) if len(places) > 1 else np.zeros(1)
    height = places[..., 1].mean(1)
    low = height <= np.quantile(height, 2.0 * _MIN_STANDING_FRACTION)
    stands = low & (speed <= np.quantile(speed[low], 0.5))
    back = conjugate(heading_of(clip.turns[stands, 0]))
    turns = [mean_turn(multiply(back, clip.turns[stands, j])) for j in foot[1:]]
    return np.asarray(multiply(first_heading(clip), np.array(turns)))


def _mean_pose(clip: Clip, frames: Bool) -> Float:
    """Returns world rotations (N, 4) from each bone's mean rotation relative to its parent.

    Only frames with True in ``frames`` (F,) count.
    """
    parents, turns = clip.skeleton.parents, clip.turns[frames]
    heading = heading_of(turns[:, 0])
    since = np.empty((len(parents), 4))
    since[0] = multiply(first_heading(clip), mean_turn(multiply(conjugate(heading), turns[:, 0])))
    for j in range(1, len(parents)):
        local = multiply(conjugate(turns[:, parents[j]]), turns[:, j])
        since[j] = multiply(since[parents[j]], mean_turn(local))
    return since


def pose_at(clip: Clip, seconds: float) -> Float:
    """Returns the world rotations (N, 4) of the pose at a time of the take."""
    frame = int(np.clip(round(seconds / clip.step), 0, len(clip.turns) - 1))
    return np.asarray(clip.turns[frame])


def pose_skeleton(skeleton: Skeleton, turns: Float) -> Skeleton:
    """Returns the skeleton in a pose of world rotations (N, 4). Its root stays in place."""
    at = skeleton.positions.copy()
    vectors = rotate(turns, skeleton.vectors)
    for j in range(1, len(skeleton)):
        at[j] = at[skeleton.parents[j]] + vectors[j]
    return replace(skeleton, positions=at)


def rebase(clip: Clip, since: Float) -> Clip:
    """Returns the same motion relative to another rest pose.

    ``since`` (N, 4) contains the world rotations of the new rest pose relative to the current one.
    """
    turns = multiply(clip.turns, conjugate(since))
    moved = replace(clip, skeleton=pose_skeleton(clip.skeleton, since), turns=turns, fine=None)
    if clip.offsets is not None:
        moved = replace(moved, offsets=rotate(since, clip.offsets))
    if clip.strains is not None:
        moved = replace(moved, strains=rotate_strain(since, clip.strains))
    return moved
