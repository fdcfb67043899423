"""Applies a mapping: chooses rest poses, computes a change of axes for each chain, and creates the layers
that play the take.

The motion of a chain is relative to a rest pose of the take. Any pose can be the rest pose. For chains of
mode "pose", the performer's bones in this pose point in the same directions as the model's bones at rest. So
the bones of both point in the same directions at all times. For chains of mode "move", the rest pose is the
mean pose of the take, and the model moves about its own rest pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, RiggedCharacter, Skeleton, unused
from enliven.errors import InputError
from enliven.mapping.ground import level_root
from enliven.mapping.plan import ChainPlan, Plan, Rest
from enliven.mapping.resting import (
    change_rest_pose,
    compute_first_heading,
    compute_hanging_pose,
    compute_standing_turns,
    mean_pose,
    pose_at,
    pose_skeleton,
)
from enliven.motion.layers.polyline import arc_lengths
from enliven.motion.layers.retarget import bind_chain, chain_between, set_travel
from enliven.motion.layers.travel import travel_scale
from enliven.rotation import IDENTITY, conjugate, from_rotation_vector, multiply, normalized, rotate, swing
from enliven.skeletons.anatomy import Anatomy, find_anatomy
from enliven.skeletons.weak_cache import cache_while_alive

_MAX_OPPOSITE_COSINE = -0.94
"""Maximum cosine of the angle between two directions that count as opposite."""
_MAX_SPINE_OFFSET = 0.1
"""Maximum distance of a spine or a neck from the middle plane, as a fraction of its length."""
_MAX_FOOT_HEIGHT = 0.15
"""Maximum height of a foot's joints above the lowest joint, as a fraction of body height."""
_MIRROR_SIGNS = np.array([-1.0, 1.0, 1.0])


@cache_while_alive
def source_anatomy(clip: Clip) -> Anatomy:
    """Returns the anatomy of the performer. Its facing is the performer's heading in the first frames.

    The limbs are found in the rest pose, or in the mean pose of the take if the mean pose gives more pairs of
    limbs.
    """
    at_rest = find_anatomy(clip.skeleton)
    amid = find_anatomy(pose_skeleton(clip.skeleton, mean_pose(clip)))
    if len(amid.pairs) > len(at_rest.pairs):
        return amid
    heading = compute_first_heading(clip)
    return replace(at_rest, facing=at_rest.facing + 2.0 * float(np.arctan2(heading[2], heading[0])))


def initial_facings(clip: Clip, shape: RiggedCharacter, plan: Plan) -> tuple[float, float]:
    """Returns the initial facing of the performer, and the facing of the model, in radians about +Y from
    +Z."""
    first, model_facing = plan.take_facing, plan.model_facing
    take_facing = source_anatomy(clip).facing if first is None else math.radians(first)
    return take_facing, find_anatomy(shape.skeleton).facing if model_facing is None else math.radians(
        model_facing
    )


@dataclass(frozen=True, eq=False)
class _ChainPair:
    """A chain of the take and the chain of the model that it drives, with their joints."""

    plan: ChainPlan
    source_joints: tuple[int, ...]
    target_joints: tuple[int, ...]

    @property
    def bones(self) -> set[int]:
        """The numbers of the take's bones with the rotations that the model's chain plays."""
        return set(self.source_joints[1:] or self.source_joints)


class _AxesConversion:
    """The rotations from the performer's axes to the model's, for unmirrored and mirrored chains.

    A mirrored layer reflects the take's motion in the plane x = 0. An additional rotation by twice the
    performer's facing turns this into a reflection in the plane between the performer's left and right.
    """

    def __init__(self, take_facing: float, model_facing: float) -> None:
        self.plain, self.mirrored = (
            _yaw_rotation(model_facing - take_facing),
            _yaw_rotation(model_facing + take_facing),
        )
        self.lateral_axis = rotate(_yaw_rotation(model_facing), np.array([1.0, 0.0, 0.0]))
        self._side = rotate(_yaw_rotation(take_facing), np.array([1.0, 0.0, 0.0]))

    def is_central(self, source: Skeleton, pair: _ChainPair) -> bool:
        """Returns True if a chain of the take lies in the plane between the performer's left and right."""
        lateral_offsets = (source.positions[list(pair.source_joints)] - source.positions[0]) @ self._side
        return bool(
            np.abs(lateral_offsets).max()
            < _MAX_SPINE_OFFSET * source.lengths[list(pair.source_joints[1:])].sum()
        )

    def rotation_of(self, pair: _ChainPair) -> Float:
        """Returns the rotation (4,) of a chain from the take's axes to the model's axes. It is applied after
        mirroring."""
        return self.mirrored if pair.plan.mirrored else self.plain

    def to_model(self, pair: _ChainPair, take_directions: Float) -> Float:
        """Returns directions (..., 3) of the take in the model's axes."""
        return rotate(
            self.rotation_of(pair), take_directions * _MIRROR_SIGNS if pair.plan.mirrored else take_directions
        )

    def to_take(self, pair: _ChainPair, model_directions: Float) -> Float:
        """Returns directions (..., 3) of the model in the take's axes."""
        model_directions = rotate(conjugate(self.rotation_of(pair)), model_directions)
        return model_directions * _MIRROR_SIGNS if pair.plan.mirrored else model_directions


def apply_plan(project: Project, shape: RiggedCharacter, clip: Clip, plan: Plan) -> tuple[Project, Clip]:
    """Returns a project in which the take moves the shape, and a copy of the take that is relative to its new
    rest pose.

    Raises:
        InputError: if the mapping names a joint that does not exist. The message lists the joints.
    """
    source, target = clip.skeleton, shape.skeleton
    pairs = [
        _ChainPair(chain, _joint_path(source, chain.source, "the take"), _target_joints(target, chain))
        for chain in plan.chains
    ]
    axes = _AxesConversion(*initial_facings(clip, shape, plan))
    clip = level_root(clip, source_anatomy(clip).trunk[-1]) if plan.level else clip
    pairs = [pair for pair in pairs if plan.turn or pair.target_joints != (0,)]
    project = project.with_characters(shape)
    first: Clip | None = None
    for rest_rotations, group in _compute_rest_poses(pairs, clip, plan.rest, target, axes):
        take = replace(change_rest_pose(clip, rest_rotations), id=unused(clip.id, project.takes))
        first = first or take
        project = project.with_takes(take)
        for pair in group:
            basis = _layer_basis(pairs, pair, take.skeleton, target, axes)
            project = _bind_pair(project, shape, take, pair, basis, plan.stretch)
    assert first is not None
    project = copy_motion_to_siblings(
        project, shape.id, [pair.target_joints for pair in pairs if pair.plan.carries]
    )
    if plan.travel:
        project = _make_root_follow_take(project, shape.id, first, axes, plan.stride)
    return project, first


def _compute_rest_poses(
    pairs: list[_ChainPair], clip: Clip, rest: Rest | float, target: Skeleton, axes: _AxesConversion
) -> list[tuple[Float, list[_ChainPair]]]:
    """Returns the rest poses of the take as world rotations (N, 4), each with the chains of the plan that use
    it.

    One rest pose is usually enough. But if a leg of the performer drives two legs, its bones need two rest
    rotations. Then the project contains a second copy of the take, relative to a second rest pose.
    """
    default_rotations = _compute_rest_rotations(clip, rest)
    rest_rotations, posed_bones = default_rotations.copy(), set[int]()
    group, conflicting_pairs = list[_ChainPair](), list[_ChainPair]()
    for pair in sorted(pairs, key=lambda pair: pair.plan.mode != "pose"):
        if posed_bones & pair.bones:
            conflicting_pairs.append(pair)
            continue
        group.append(pair)
        if pair.plan.mode == "pose":
            posed_bones |= pair.bones
            _match_pose(rest_rotations, clip, pair, group, target, axes)
    for pair in group:
        bone_above = _find_posed_bone_above(group, pair, clip.skeleton)
        if pair.plan.mode != "move" or bone_above is None:
            continue
        if _is_lying_on_floor(target, pair.target_joints):
            # In the rest pose the foot is flat on the floor, independent of the angle of the shin.
            rest_rotations[list(pair.source_joints[1:])] = compute_standing_turns(clip, pair.source_joints)
        else:
            # The hand's rotation relative to its forearm stays the same as in the take's rest pose.
            change = multiply(rest_rotations[bone_above], conjugate(default_rotations[bone_above]))
            rest_rotations[list(pair.bones)] = multiply(change, default_rotations[list(pair.bones)])
    rest_poses = [(rest_rotations, [pair for pair in pairs if pair in group])]
    for pair in conflicting_pairs:
        other_rotations = rest_rotations.copy()
        if pair.plan.mode == "pose":
            _match_pose(other_rotations, clip, pair, [pair], target, axes)
        else:
            other_rotations[list(pair.bones)] = default_rotations[list(pair.bones)]
        rest_poses.append((other_rotations, [pair]))
    return rest_poses


def _find_posed_bone_above(pairs: list[_ChainPair], pair: _ChainPair, source: Skeleton) -> int | None:
    """Returns the last bone of the nearest ancestor chain of mode "pose" in the take, or None if there is
    none."""
    path = source.path(0, pair.source_joints[0])
    ancestors = [
        candidate.source_joints[-1]
        for candidate in pairs
        if candidate.plan.mode == "pose" and candidate.source_joints[-1] in path and candidate is not pair
    ]
    return max(ancestors, key=path.index, default=None)


def copy_motion_to_siblings(project: Project, shape_id: str, chains: Sequence[Sequence[int]]) -> Project:
    """Returns a project in which the siblings of driven bones copy their motion.

    A joint of a rig rotates all of its children: fingers with a hand, hair with a head, a twist bone with its
    forearm. So each bone that shares its parent joint with a bone of ``chains`` moves like that bone. Bones
    are not changed if they or their descendants already move.
    """
    shape = project.shape(shape_id)
    skeleton, spans = shape.skeleton, list(shape.spans)
    moving = {
        ancestor
        for index, bone_spans in enumerate(spans)
        if any(span.refs for span in bone_spans)
        for ancestor in skeleton.path(0, index)
    }
    for bone in (bone for chain in chains for bone in chain[1:]):
        for sibling in skeleton.children[int(skeleton.parents[bone])]:
            if sibling not in moving:
                spans[sibling] = spans[bone]
    return project.with_characters(shape.with_changes(spans=tuple(spans)))


def _is_lying_on_floor(skeleton: Skeleton, chain: tuple[int, ...]) -> bool:
    """Returns True if a chain lies along the floor at rest, as a foot does."""
    height = skeleton.positions[:, 1]
    return bool(height[list(chain)].max() < height.min() + _MAX_FOOT_HEIGHT * np.ptp(height))


def _bind_pair(
    project: Project, shape: RiggedCharacter, take: Clip, pair: _ChainPair, basis: Float, stretch: bool
) -> Project:
    chain = pair.plan
    stretch_option: dict[str, Any] = {"stretch": True} if stretch and take.tracks else {}
    return bind_chain(
        project,
        shape.id,
        pair.target_joints,
        take.id,
        pair.source_joints,
        basis=basis,
        layer_id=unused(f"{take.id}: {chain.role or chain.target[-1]}", project.layer_names),
        weight=chain.weight,
        offset=chain.offset,
        speed=chain.speed,
        loop=chain.loop,
        mirrored=chain.mirrored,
        **stretch_option,
    )


def _compute_rest_rotations(clip: Clip, rest: Rest | float) -> Float:
    """Returns the world rotations (N, 4) of the reference pose that motion is relative to."""
    if rest == "zero":
        return np.tile(IDENTITY, (len(clip.skeleton), 1))
    if rest == "first":
        return pose_at(clip, 0.0).copy()
    if isinstance(rest, int | float):
        return pose_at(clip, float(rest)).copy()
    if rest == "auto":
        body = source_anatomy(clip)
        limbs = [limb.proper for pair in body.pairs for limb in pair]
        if len(body.legs) == 1 and body.arms:
            return compute_hanging_pose(clip, limbs)
    return mean_pose(clip)


def _match_pose(
    rest_rotations: Float,
    clip: Clip,
    pair: _ChainPair,
    pairs: list[_ChainPair],
    target: Skeleton,
    axes: _AxesConversion,
) -> None:
    """Sets the rest rotations of a source chain so that its bones point in the target's directions.

    Changes ``rest_rotations`` (N, 4), the rest rotations of all bones, in place.

    The pose starts from the take's zero pose, rotated to the take's first heading. Each bone gets the
    smallest rotation that makes it point in the target's direction, so the twist about a bone remains the
    performer's. A limb is bent bone by bone from its root, and each rotation also moves all following bones.
    So a forearm that is bent at rest is straightened at the elbow. A spine or a neck is rotated as a whole
    and keeps the curve of the model's spine or neck.
    """
    heading, skeleton = compute_first_heading(clip), clip.skeleton
    rest_rotations[list(pair.bones)] = heading
    if len(pair.source_joints) == 1:
        return
    arc, target_positions = (
        arc_lengths(skeleton, pair.source_joints),
        target.positions[list(pair.target_joints)],
    )
    target_points = np.stack(
        [np.interp(arc, arc_lengths(target, pair.target_joints), target_positions[:, k]) for k in range(3)], 1
    )
    directions, bones = (
        axes.to_take(pair, np.diff(target_points, axis=0)),
        skeleton.vectors[list(pair.source_joints[1:])],
    )
    is_central = axes.is_central(skeleton, pair)
    if is_central:
        directions[:], bones[:] = directions.sum(0), bones.sum(0)
    continues_limb = any(
        other_pair.plan.mode == "pose"
        and other_pair.plan.role == pair.plan.role
        and _is_continuation(other_pair, pair)
        for other_pair in pairs
    )
    parent_rotation = rest_rotations[pair.source_joints[0]] if continues_limb and not is_central else heading
    for joint, direction, bone in zip(pair.source_joints[1:], directions, bones, strict=True):
        bone = rotate(parent_rotation, bone)
        if np.linalg.norm(bone) > 1e-6 and np.linalg.norm(direction) > 1e-6:
            bend = swing(bone / np.linalg.norm(bone), direction / np.linalg.norm(direction))
            rest_rotations[joint] = multiply(bend, parent_rotation)
        else:
            rest_rotations[joint] = parent_rotation
        parent_rotation = heading if is_central else rest_rotations[joint]


def _layer_basis(
    pairs: list[_ChainPair], pair: _ChainPair, source: Skeleton, target: Skeleton, axes: _AxesConversion
) -> Float:
    """Returns the rotation target_from_source (4,) of a chain's layer."""
    basis = axes.rotation_of(pair)
    if pair.plan.mode == "move" and len(pair.source_joints) > 1 < len(pair.target_joints):
        source_ends, target_ends = _find_whole_limb_ends(pairs, pair)
        direction = axes.to_model(pair, source.positions[source_ends[1]] - source.positions[source_ends[0]])
        target_direction = target.positions[target_ends[1]] - target.positions[target_ends[0]]
        # If an ancestor chain has the performer's pose, this chain rotates about the performer's axes. Other
        # axes would change the pose of the limbs that are attached to this chain. A tail that a spine drives
        # points in the opposite direction, so it gets separate axes.
        is_same_direction = _leads_to_posed(pairs, pair) or float(direction @ target_direction) > 0.0
        keeps_performer_axes = is_same_direction and _find_posed_bone_above(pairs, pair, source) is not None
        basis = (
            basis
            if keeps_performer_axes
            else multiply(_compute_smallest_rotation(direction, target_direction, axes.lateral_axis), basis)
        )
    return multiply(_half_turn(target, pair.target_joints), basis) if pair.plan.flip else basis


def _leads_to_posed(pairs: list[_ChainPair], pair: _ChainPair) -> bool:
    """Returns True if a chain of mode "pose" continues the chain ``pair``, as a limb continues its girdle."""
    followers = [follower for follower in pairs if _is_continuation(pair, follower)]
    return any(follower.plan.mode == "pose" or _leads_to_posed(pairs, follower) for follower in followers)


def _find_whole_limb_ends(
    pairs: list[_ChainPair], pair: _ChainPair
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns (first joint, last joint) of a limb's consecutive chains of mode "move", for the take and for
    the model.

    A limb that is driven by several chains has one set of axes, even if its thigh and shin point in different
    directions at rest.
    """
    role = pair.plan.role
    same_limb = [piece for piece in pairs if piece.plan.role == role and piece.plan.mode == "move"]
    first_piece = last_piece = pair
    while role and (
        previous_pieces := [piece for piece in same_limb if _is_continuation(piece, first_piece)]
    ):
        first_piece = previous_pieces[0]
    while role and (next_pieces := [piece for piece in same_limb if _is_continuation(last_piece, piece)]):
        last_piece = next_pieces[0]
    return (first_piece.source_joints[0], last_piece.source_joints[-1]), (
        first_piece.target_joints[0],
        last_piece.target_joints[-1],
    )


def _is_continuation(first: _ChainPair, second: _ChainPair) -> bool:
    """Returns True if the second chain begins where the first ends, in the take and in the model."""
    return (
        first.source_joints[-1] == second.source_joints[0]
        and first.target_joints[-1] == second.target_joints[0]
    )


def _compute_smallest_rotation(direction: Float, target_direction: Float, lateral_axis: Float) -> Float:
    """Returns the smallest rotation (4,) from one direction (3,) to another.

    Between opposite directions the smallest rotation is ambiguous. In this case the result is half a turn
    about the body's lateral axis, as from a hanging limb to a raised limb, plus a small rotation. If the limb
    is parallel to the lateral axis, the half turn is about the vertical axis.
    """
    lengths = float(np.linalg.norm(direction)), float(np.linalg.norm(target_direction))
    if min(lengths) < 1e-6:
        return IDENTITY
    start, end = direction / lengths[0], target_direction / lengths[1]
    if start @ end >= _MAX_OPPOSITE_COSINE:
        return swing(start, end)
    axis = lateral_axis if abs(start @ lateral_axis) < 0.7 else np.array([0.0, 1.0, 0.0])
    half_turn = from_rotation_vector(np.pi * axis)
    return multiply(swing(rotate(half_turn, start), end), half_turn)


def _half_turn(target: Skeleton, chain: tuple[int, ...]) -> Float:
    """Returns the rotation (4,) by half a turn about the direction of a chain's first bone."""
    axis = target.positions[chain[min(1, len(chain) - 1)]] - target.positions[chain[0]]
    return normalized(np.concatenate([[0.0], axis]))


def _yaw_rotation(angle: float) -> Float:
    """Returns the rotation (4,) by an angle in radians about +Y."""
    return from_rotation_vector(np.array([0.0, angle, 0.0]))


def _make_root_follow_take(
    project: Project, shape_id: str, take: Clip, axes: _AxesConversion, stride: float
) -> Project:
    """Returns a project in which the shape's root follows the path of the take's root, scaled by
    ``stride``."""
    shape, name = project.shape(shape_id), unused(f"{take.id}: way", project.layer_names)
    layers = (*shape.layers, Layer(name, take.id, (0,), axes.plain))
    project = project.with_characters(shape.with_changes(layers=layers, travel=name))
    scale = stride * travel_scale(shape.with_changes(travel_scale=None), take)
    return set_travel(project, shape_id, name, scale)


def _joint_path(skeleton: Skeleton, names: tuple[str, ...], owner: str) -> tuple[int, ...]:
    """Returns the joints of a chain, given the names of its two ends or of all of its joints."""
    if not names:
        raise InputError(
            f"a chain of {owner} contains no joint name", where="mapping", remedy=_describe_joints(skeleton)
        )
    unknown = [name for name in names if name not in skeleton.names]
    if unknown:
        raise InputError(
            f"{owner} has no joint {unknown[0]!r}", where="mapping", remedy=_describe_joints(skeleton)
        )
    joints = [skeleton.names.index(name) for name in names]
    path = [joints[0]]
    for joint in joints[1:]:
        path.extend(skeleton.path(path[-1], joint)[1:])
    return tuple(path)


def _target_joints(skeleton: Skeleton, chain: ChainPlan) -> tuple[int, ...]:
    path = _joint_path(skeleton, chain.target, "the model")
    return chain_between(skeleton, path[0], path[-1]) if chain.extend else path


def _describe_joints(skeleton: Skeleton) -> str:
    return f"The joints are: {', '.join(skeleton.names)}."
