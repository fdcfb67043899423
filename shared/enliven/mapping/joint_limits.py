"""Joint limits: keeps the joints of a model that is not built like a person within their ranges of motion.

limit_joints(project, shape_id, clip, plan, clips)      # limits joints, and returns the names of the limited
ones

A performer's arm swings by half a turn, but a horse's foreleg does not. The range of each joint is its range
in the model's own clips, plus a margin (the free angle). Without clips it is a wide cone around the rest
pose. See :mod:`enliven.motion.kinematics.ranges`. A body with a chain of mode "pose" is not limited, since it
is built like the performer.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, RiggedCharacter, Skeleton, unused
from enliven.mapping.ground import sample_times
from enliven.mapping.model_clips import is_own_take
from enliven.mapping.plan import Plan
from enliven.motion.kinematics.ranges import JointRange, fit_joint_range, limit_turns
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, clear_chain
from enliven.rotation import IDENTITY, conjugate, multiply
from enliven.skeletons.anatomy import find_anatomy
from enliven.skeletons.facing import rotate_about_y

_MAX_RATE_HZ = 60.0
"""Maximum rate at which limits are applied: the frame rate of common displays."""
_CLIP_FRAMES = 120
"""Maximum number of frames of a clip that define a joint's range. Extreme poses last several frames."""
_MIN_CHANGE = np.radians(1.0)
"""Minimum change of a joint (radians) that is applied and reported. Smaller changes are not visible."""
_MIN_ANGLE_FRACTION = 0.05
"""Minimum fraction of the free angle that each bone of a chain gets, so that short bones are not stiff."""
_MIN_BONE_LENGTH = 1e-6
"""Minimum length of a bone with a defined direction, as a fraction of the skeleton's size."""


def limit_joints(
    project: Project,
    shape_id: str,
    clip: Clip,
    plan: Plan,
    clips: Sequence[Clip] = (),
    without: Collection[int] = (),
) -> tuple[Project, tuple[str, ...]]:
    """Returns the project with a shape's joints limited to their ranges, and the names of the corrected
    joints.

    Corrected bones play a new take. Human skeletons, and takes of the shape's own skeleton, are not limited.

    Args:
        project: the project, in which the plan moves the shape.
        shape_id: id of the shape.
        clip: the performer's take.
        plan: the mapping.
        clips: the model's own clips. Takes of other skeletons among them are ignored.
        without: bones that are not limited.
    """
    shape = project.shape(shape_id)
    fractions = {
        j: fraction for j, fraction in _bone_fractions(project, shape, clip, plan).items() if j not in without
    }
    if not fractions:
        return project, ()
    times = (
        sample_times(clip.duration, min(_MAX_RATE_HZ, 1.0 / clip.step))
        if clip.duration > 0.0
        else np.zeros(1)
    )
    turns, joints = Player(project, shape_id).sample(times)
    own_clips = [candidate for candidate in clips if is_own_take(candidate, shape)]
    ranges, followers = (
        joint_ranges(shape.skeleton, own_clips, fractions),
        _find_following_bones(shape, fractions),
    )
    limited_turns, limited_bones = limit_pose(shape.skeleton, turns, ranges, followers)
    if not limited_bones:
        return project, ()
    step = float(times[1]) if len(times) > 1 else clip.step
    take = Clip(
        unused(f"{clip.id}: limits", project.takes), shape.skeleton, limited_turns, joints[:, 0], step
    )
    project = project.with_takes(take)
    changed_bones = {*fractions, *followers}
    for chain in _group_chains(
        shape.skeleton, {j for j in changed_bones if _is_different(limited_turns[:, j], turns[:, j])}
    ):
        project = clear_chain(project, shape_id, chain)
        name = unused(f"{take.id} of {shape.skeleton.names[chain[-1]]}", project.layer_names)
        project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY, layer_id=name)
    names, parents = shape.skeleton.names, shape.skeleton.parents
    return project, tuple(dict.fromkeys(names[int(parents[j])] for j in sorted(limited_bones)))


def joint_ranges(
    skeleton: Skeleton, clips: Sequence[Clip], fractions: Mapping[int, float]
) -> dict[int, JointRange]:
    """Returns the range of each bone that has a direction.

    The left and the right bone of a pair both get the combined motion of the two.

    Args:
        skeleton: the skeleton.
        clips: takes of the same skeleton.
        fractions: for each bone, its fraction of the free angle of its chain. For example, the bones of a
            spine share one free angle.
    """
    sampled = [clip.turns[:: max(1, -(-len(clip.turns) // _CLIP_FRAMES))] for clip in clips]
    local = _local_rotations(skeleton, np.concatenate(sampled)) if sampled else None
    size, partners = float(np.ptp(skeleton.positions, axis=0).max()), _bone_partners(skeleton)
    facing, ranges = find_anatomy(skeleton).facing, dict[int, JointRange]()
    for j, fraction in fractions.items():
        if skeleton.lengths[j] <= _MIN_BONE_LENGTH * size:
            continue
        turns = None if local is None else local[:, j]
        if local is not None and j in partners:
            turns = np.concatenate([local[:, j], _mirror_rotations(local[:, partners[j]], facing)])
        ranges[j] = fit_joint_range(skeleton.vectors[j], turns, max(fraction, _MIN_ANGLE_FRACTION))
    return ranges


def limit_pose(
    skeleton: Skeleton, turns: Float, ranges: dict[int, JointRange], followers: dict[int, int]
) -> tuple[Float, set[int]]:
    """Returns world rotations (T, N, 4) with each bone in its range, and the bones that were outside their
    range.

    The descendants of a limited bone move with it: their rotations relative to their parents do not change.

    Args:
        skeleton: the skeleton.
        turns: (T, N, 4) world rotations.
        ranges: the range of each bone.
        followers: for each bone that copies another bone's rotation, the copied bone.
    """
    local, limited_turns, limited_bones = _local_rotations(skeleton, turns), turns.copy(), set[int]()
    for j, joint_range in ranges.items():
        limited = limit_turns(joint_range, local[:, j])
        if _is_different(limited, local[:, j]):
            local[:, j] = limited
            limited_bones.add(j)
    for j, copied_bone in followers.items():
        local[:, j] = local[:, copied_bone]
    for j in range(1, len(skeleton)):
        parent = int(skeleton.parents[j])
        if followers.get(j, j) in limited_bones or _is_different(limited_turns[:, parent], turns[:, parent]):
            limited_turns[:, j] = multiply(limited_turns[:, parent], local[:, j])
    return limited_turns, limited_bones


def _bone_fractions(project: Project, shape: RiggedCharacter, clip: Clip, plan: Plan) -> dict[int, float]:
    """Returns the bones that may be limited, each with its length as a fraction of its chain's length.

    These are the bones that chains of mode "move" drive at the take's own speed. The result is empty for
    human skeletons, for bodies with a chain of mode "pose", and if the plan disables limits.
    """
    stretched = plan.stretch and bool(clip.tracks)
    if not plan.limits or stretched or (shape.modeling != IDENTITY).any() or is_own_take(clip, shape):
        return {}
    if _is_person(shape.skeleton) or any(chain.mode == "pose" for chain in plan.chains):
        return {}
    skeleton, fractions = shape.skeleton, dict[int, float]()
    for chain in plan.chains:
        ends = [skeleton.names.index(name) for name in chain.target if name in skeleton.names]
        if len(ends) < 2:
            continue
        path = skeleton.path(ends[0], ends[-1])[1:]
        chain_length = max(float(skeleton.lengths[list(path)].sum()), 1e-9)
        for j in path:
            fractions[j] = max(fractions.get(j, 0.0), float(skeleton.lengths[j]) / chain_length)
    layers = {layer.id: layer for layer in shape.layers}
    moving = {j: [layers[ref.layer] for span in shape.spans[j] for ref in span.refs] for j in fractions}
    return {
        j: fractions[j]
        for j in sorted(fractions)
        if j > 0 and moving[j] and all(map(_is_played_once, moving[j]))
    }


def _is_person(skeleton: Skeleton) -> bool:
    """Returns True if the limbs of a skeleton have the joint names of a person."""
    return any(limb.knots for pair in find_anatomy(skeleton).pairs for limb in pair)


def _is_played_once(layer: Layer) -> bool:
    """Returns True if a layer plays its take once, at the take's own speed."""
    return (layer.offset, layer.speed, layer.loop) == (0.0, 1.0, False)


def _find_following_bones(shape: RiggedCharacter, bones: Collection[int]) -> dict[int, int]:
    """Returns the bones that copy the motion of a sibling in ``bones``, such as twist bones.

    Each bone is mapped to the sibling that it copies.
    """
    followers, parents = dict[int, int](), shape.skeleton.parents
    for j in bones:
        for sibling in shape.skeleton.children[int(parents[j])]:
            if sibling not in bones and shape.spans[sibling] == shape.spans[j]:
                followers.setdefault(sibling, j)
    return followers


def _bone_partners(skeleton: Skeleton) -> dict[int, int]:
    """Returns for each bone of a pair of limbs the corresponding bone on the other side."""
    partners = dict[int, int]()
    for left, right in find_anatomy(skeleton).pairs:
        if len(left.chain) == len(right.chain):
            partners |= dict(zip(left.chain[1:], right.chain[1:], strict=True))
            partners |= dict(zip(right.chain[1:], left.chain[1:], strict=True))
    return partners


def _mirror_rotations(turns: Float, facing: float) -> Float:
    """Returns rotations (T, 4) mirrored in the sagittal plane of a body with ``facing`` in radians."""
    mirrored = rotate_about_y(turns[:, 1:], -facing) * [1.0, -1.0, -1.0]
    return np.concatenate([turns[:, :1], rotate_about_y(mirrored, facing)], axis=1)


def _local_rotations(skeleton: Skeleton, turns: Float) -> Float:
    """Returns rotations (T, N, 4) of bones relative to their parents, from world rotations (T, N, 4)."""
    parent_turns = turns[:, np.maximum(skeleton.parents, 0)]
    local = multiply(conjugate(parent_turns), turns)
    local[:, 0] = turns[:, 0]
    return np.asarray(local)


def _is_different(first: Float, second: Float) -> bool:
    """Returns True if rotations (T, 4) differ by a visible angle at any moment."""
    cosine = np.abs(np.sum(first * second, axis=-1)).min()
    return bool(2.0 * np.arccos(min(float(cosine), 1.0)) > _MIN_CHANGE)


def _group_chains(skeleton: Skeleton, bones: set[int]) -> list[tuple[int, ...]]:
    """Groups bones into chains of joints. Each chain begins with the joint that stays in place."""
    chains, remaining = list[tuple[int, ...]](), sorted(bones)
    while remaining:
        chain = [int(skeleton.parents[remaining[0]]), remaining[0]]
        while next_bones := [j for j in skeleton.children[chain[-1]] if j in remaining]:
            chain.append(next_bones[0])
        remaining = [j for j in remaining if j not in chain[1:]]
        chains.append(tuple(chain))
    return chains
