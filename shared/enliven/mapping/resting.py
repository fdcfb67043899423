"""Rest poses of a take: the pose that its turns are relative to; any pose can be one.

mean_pose(clip)            # (N, 4) the mean pose of the take, its heading the first
hanging_pose(clip, limbs)  # (N, 4) the mean of those frames in which the limbs hang most
rebased(clip, since)       # the take against another rest pose
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import Clip, Skeleton, joint_places
from enliven.rotation import conjugate, multiply, normalized, rotate, turned_strain

_STRIDE = 1.0
"""Seconds of a stride: the mean heading over one does not sway with the hips."""
_HANGING = 0.12
"""Share of a take's frames, an eighth, that the hanging pose is the mean of."""
_STANDING = 0.25
"""Share of a take's frames in which a foot stands at least."""


def heading_of(turns: Float) -> Float:
    """(..., 4) the part of turns (..., 4) that is about +Y: swing and twist, the twist."""
    twist = np.asarray(turns, np.float64).copy()
    twist[..., 1] = twist[..., 3] = 0.0
    return normalized(twist)


def mean_turn(turns: Float) -> Float:
    """(4,) the mean of rotations (F, 4): the largest eigenvector of sum q q^T (Markley et al. 2007)."""
    _, vectors = np.linalg.eigh(turns.T @ turns)
    mean = vectors[:, -1]
    return np.asarray(mean if mean[0] >= 0 else -mean)


def first_heading(clip: Clip) -> Float:
    """(4,) about +Y: where the performer heads at first, the mean of a second, which is a stride."""
    frames = max(round(_STRIDE / clip.step), 1)
    return heading_of(mean_turn(heading_of(clip.turns[: frames + 1, 0])))


def mean_pose(clip: Clip) -> Float:
    """(N, 4) world turns of a take's mean pose: the mean turn of each bone relative to its parent.

    The heading is the first frame's: a body that turns round in a take has no mean heading.
    """
    return _mean_pose(clip, np.ones(len(clip.turns), bool))


def hanging_pose(clip: Clip, limbs: Sequence[Sequence[int]]) -> Float:
    """(N, 4) world turns of an upright body with hanging arms and legs, from a take's own frames.

    The mean pose of a performer who waves all the time has raised arms. This is the mean of the eighth of the
    frames in which the bones of the limbs point down most. Its heading is the first frame's.

    Args:
        limbs: chains of joints.
    """
    bones = [joint for limb in limbs for joint in limb[1:]]
    height = rotate(clip.turns[:, bones], clip.skeleton.vectors[bones])[..., 1].sum(1)
    return _mean_pose(clip, height <= np.quantile(height, _HANGING))


def standing_turns(clip: Clip, foot: Sequence[int]) -> Float:
    """(K, 4) mean world turns of a foot's bones over the frames in which it stands flat.

    The pose in which limbs hang most has feet that point down. A foot stands in the frames in which its
    joints are slow and low, compared with the rest of the take. Its heading is the first frame's.

    Args:
        foot: joints from the ankle to the end of the foot; K is one less.
    """
    places = joint_places(clip, foot)[:, list(foot)]
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=2).max(1) if len(places) > 1 else np.zeros(1)
    height = places[..., 1].mean(1)
    low = height <= np.quantile(height, 2.0 * _STANDING)
    stands = low & (speed <= np.quantile(speed[low], 0.5))
    back = conjugate(heading_of(clip.turns[stands, 0]))
    turns = [mean_turn(multiply(back, clip.turns[stands, j])) for j in foot[1:]]
    return np.asarray(multiply(first_heading(clip), np.array(turns)))


def _mean_pose(clip: Clip, frames: Bool) -> Float:
    """(N, 4) of each bone the mean turn in the one before, over the (F,) frames."""
    parents, turns = clip.skeleton.parents, clip.turns[frames]
    heading = heading_of(turns[:, 0])
    since = np.empty((len(parents), 4))
    since[0] = multiply(first_heading(clip), mean_turn(multiply(conjugate(heading), turns[:, 0])))
    for j in range(1, len(parents)):
        local = multiply(conjugate(turns[:, parents[j]]), turns[:, j])
        since[j] = multiply(since[parents[j]], mean_turn(local))
    return since


def at_moment(clip: Clip, seconds: float) -> Float:
    """(N, 4) world turns of the pose at a time of the take."""
    frame = int(np.clip(round(seconds / clip.step), 0, len(clip.turns) - 1))
    return np.asarray(clip.turns[frame])


def posed(skeleton: Skeleton, turns: Float) -> Skeleton:
    """The skeleton in a pose of world turns (N, 4), its root where it is."""
    at = skeleton.positions.copy()
    vectors = rotate(turns, skeleton.vectors)
    for j in range(1, len(skeleton)):
        at[j] = at[skeleton.parents[j]] + vectors[j]
    return replace(skeleton, positions=at)


def rebased(clip: Clip, since: Float) -> Clip:
    """The same motion against another rest pose, of world turns ``since`` (N, 4) from the present one."""
    turns = multiply(clip.turns, conjugate(since))
    moved = replace(clip, skeleton=posed(clip.skeleton, since), turns=turns, fine=None)
    if clip.offsets is not None:
        moved = replace(moved, offsets=rotate(since, clip.offsets))
    if clip.strains is not None:
        moved = replace(moved, strains=turned_strain(since, clip.strains))
    return moved
