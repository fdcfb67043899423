"""Applies a mapping: chooses rest poses, gives each chain a basis, and binds layers.

Motion is relative to a rest pose of the take, and any pose can be one. For chains of mode "pose" it is the
pose in which the performer's bones point as the model's bones do at rest. Then they point alike at all times.
For chains of mode "move" it is the mean pose of the take, and the model moves about its own rest pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, Shape, Skeleton, unused
from enliven.errors import InputError
from enliven.mapping.anatomy import Anatomy, anatomy_of
from enliven.mapping.ground import level_root
from enliven.mapping.plan import ChainPlan, Plan, Rest
from enliven.mapping.resting import (
    first_heading,
    hanging_pose,
    mean_pose,
    pose_at,
    pose_skeleton,
    rebase,
    standing_turns,
)
from enliven.motion.layers import arc_lengths, bind_chain, branch, set_travel, travel_scale
from enliven.rotation import IDENTITY, conjugate, from_rotation_vector, multiply, normalized, rotate, swing

_MAX_OPPOSITE_COSINE = -0.94
"""Cosine below which two directions count as opposite."""
_MAX_SPINE_OFFSET = 0.1
"""Maximum distance of a spine or a neck from the middle plane, as a fraction of its length."""
_MAX_FOOT_HEIGHT = 0.15
"""Maximum height of a foot's joints above the lowest joint, as a fraction of body height."""
_MIRROR_SIGNS = np.array([-1.0, 1.0, 1.0])


def source_anatomy(clip: Clip) -> Anatomy:
    """Returns the anatomy of the performer, with their heading in the first frames as its facing.

    It is found in the rest pose, or in the mean pose of the take if that gives more pairs of limbs.
    """
    at_rest = anatomy_of(clip.skeleton)
    amid = anatomy_of(pose_skeleton(clip.skeleton, mean_pose(clip)))
    if len(amid.pairs) > len(at_rest.pairs):
        return amid
    heading = first_heading(clip)
    return replace(at_rest, facing=at_rest.facing + 2.0 * float(np.arctan2(heading[2], heading[0])))


def facings(clip: Clip, shape: Shape, plan: Plan) -> tuple[float, float]:
    """Returns the initial facing of the performer and that of the model, in radians about +Y from +Z."""
    first, ours = plan.take_facing, plan.model_facing
    theirs = source_anatomy(clip).facing if first is None else math.radians(first)
    return theirs, anatomy_of(shape.skeleton).facing if ours is None else math.radians(ours)


@dataclass(frozen=True, eq=False)
class _Line:
    """A chain of the plan, with its joints in the take and in the model."""

    plan: ChainPlan
    source_joints: tuple[int, ...]
    target_joints: tuple[int, ...]

    @property
    def bones(self) -> set[int]:
        """The bones of the take with the rotations that the model's chain plays."""
        return set(self.source_joints[1:] or self.source_joints)


class _Turns:
    """The rotations from the performer's axes to the model's, for plain and mirrored chains.

    A layer mirrors in the plane x = 0 of the take. An additional rotation by twice the performer's facing
    turns that into mirroring in the plane between their left and right.
    """

    def __init__(self, theirs: float, ours: float) -> None:
        self.plain, self.mirrored = _yaw_rotation(ours - theirs), _yaw_rotation(ours + theirs)
        self.across = rotate(_yaw_rotation(ours), np.array([1.0, 0.0, 0.0]))
        self._side = rotate(_yaw_rotation(theirs), np.array([1.0, 0.0, 0.0]))

    def middle(self, source: Skeleton, line: _Line) -> bool:
        """Returns True if a chain of the take lies in the plane between the performer's left and right."""
        off = (source.positions[list(line.source_joints)] - source.positions[0]) @ self._side
        return bool(
            np.abs(off).max() < _MAX_SPINE_OFFSET * source.lengths[list(line.source_joints[1:])].sum()
        )

    def of(self, line: _Line) -> Float:
        """Returns the rotation model_from_take (4,) of a chain, to be applied after mirroring."""
        return self.mirrored if line.plan.mirrored else self.plain

    def to_model(self, line: _Line, directions: Float) -> Float:
        """Returns directions (..., 3) of the take in the model's axes."""
        return rotate(self.of(line), directions * _MIRROR_SIGNS if line.plan.mirrored else directions)

    def to_take(self, line: _Line, directions: Float) -> Float:
        """Returns directions (..., 3) of the model in the take's axes."""
        directions = rotate(conjugate(self.of(line)), directions)
        return directions * _MIRROR_SIGNS if line.plan.mirrored else directions


def apply_plan(project: Project, shape: Shape, clip: Clip, plan: Plan) -> tuple[Project, Clip]:
    """Returns a project in which the take moves the shape, and the take relative to its new rest pose.

    Raises:
        InputError: if the mapping names a joint that does not exist. The message lists the joints.
    """
    source, target = clip.skeleton, shape.skeleton
    lines = [
        _Line(chain, _joint_path(source, chain.source, "the take"), _target_joints(target, chain))
        for chain in plan.chains
    ]
    turns = _Turns(*facings(clip, shape, plan))
    clip = level_root(clip, source_anatomy(clip).trunk[-1]) if plan.level else clip
    lines = [line for line in lines if plan.turn or line.target_joints != (0,)]
    project = project.with_characters(shape)
    first: Clip | None = None
    for since, group in _rest_poses(lines, clip, plan.rest, target, turns):
        take = replace(rebase(clip, since), id=unused(clip.id, project.takes))
        first = first or take
        project = project.with_takes(take)
        for line in group:
            basis = _layer_basis(lines, line, take.skeleton, target, turns)
            project = _bind_line(project, shape, take, line, basis, plan.stretch)
    assert first is not None
    project = carried(project, shape.id, [line.target_joints for line in lines if line.plan.carries])
    if plan.travel:
        project = _follow_take_root(project, shape.id, first, turns, plan.stride)
    return project, first


def _rest_poses(
    lines: list[_Line], clip: Clip, rest: Rest | float, target: Skeleton, turns: _Turns
) -> list[tuple[Float, list[_Line]]]:
    """Returns the rest poses (N, 4) of the take, with the chains of the plan that each serves.

    One rest pose is enough unless a bone of the performer needs two: a leg that drives two legs. Then the
    project contains the take again, relative to another rest pose.
    """
    plain = _rest_rotations(clip, rest)
    since, claimed = plain.copy(), set[int]()
    group, conflicting = list[_Line](), list[_Line]()
    for line in sorted(lines, key=lambda line: line.plan.mode != "pose"):
        if claimed & line.bones:
            conflicting.append(line)
            continue
        group.append(line)
        if line.plan.mode == "pose":
            claimed |= line.bones
            _match_pose(since, clip, line, group, target, turns)
    for line in group:
        arm = _posed_bone_above(group, line, clip.skeleton)
        if line.plan.mode != "move" or arm is None:
            continue
        if _lies_on_floor(target, line.target_joints):
            # The foot is flat in the rest pose, at any slope of the shin.
            since[list(line.source_joints[1:])] = standing_turns(clip, line.source_joints)
        else:
            # A hand keeps the rotation relative to its forearm that it has in the take's rest pose.
            carried = multiply(since[arm], conjugate(plain[arm]))
            since[list(line.bones)] = multiply(carried, plain[list(line.bones)])
    rests = [(since, [line for line in lines if line in group])]
    for line in conflicting:
        other = since.copy()
        if line.plan.mode == "pose":
            _match_pose(other, clip, line, [line], target, turns)
        else:
            other[list(line.bones)] = plain[list(line.bones)]
        rests.append((other, [line]))
    return rests


def _posed_bone_above(lines: list[_Line], line: _Line, source: Skeleton) -> int | None:
    """Returns the last bone of the nearest chain of mode "pose" above a chain in the take, or None."""
    path = source.path(0, line.source_joints[0])
    above = [
        candidate.source_joints[-1]
        for candidate in lines
        if candidate.plan.mode == "pose" and candidate.source_joints[-1] in path and candidate is not line
    ]
    return max(above, key=path.index, default=None)


def carried(project: Project, shape_id: str, chains: Sequence[Sequence[int]]) -> Project:
    """Returns a project in which bones that share a parent joint with a chain's bone copy its motion.

    A joint of a rig rotates all of its children: fingers with a hand, hair with a head, a twist bone with its
    forearm. Bones that move already, or have a descendant that moves, are not changed.
    """
    shape = project.shape(shape_id)
    skeleton, spans = shape.skeleton, list(shape.spans)
    moving = {up for j, some in enumerate(spans) if any(s.refs for s in some) for up in skeleton.path(0, j)}
    for bone in (bone for chain in chains for bone in chain[1:]):
        for other in skeleton.children[int(skeleton.parents[bone])]:
            if other not in moving:
                spans[other] = spans[bone]
    return project.with_characters(shape.with_changes(spans=tuple(spans)))


def _lies_on_floor(skeleton: Skeleton, chain: tuple[int, ...]) -> bool:
    """Returns True if a chain lies along the floor at rest, as a foot does."""
    height = skeleton.positions[:, 1]
    return bool(height[list(chain)].max() < height.min() + _MAX_FOOT_HEIGHT * np.ptp(height))


def _bind_line(
    project: Project, shape: Shape, take: Clip, line: _Line, basis: Float, stretch: bool
) -> Project:
    chain = line.plan
    stretches: dict[str, Any] = {"stretch": True} if stretch and take.tracks else {}
    return bind_chain(
        project,
        shape.id,
        line.target_joints,
        take.id,
        line.source_joints,
        basis=basis,
        layer_id=unused(f"{take.id}: {chain.role or chain.target[-1]}", project.layer_names),
        weight=chain.weight,
        offset=chain.offset,
        speed=chain.speed,
        loop=chain.loop,
        mirrored=chain.mirrored,
        **stretches,
    )


def _rest_rotations(clip: Clip, rest: Rest | float) -> Float:
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
            return hanging_pose(clip, limbs)
    return mean_pose(clip)


def _match_pose(
    since: Float, clip: Clip, line: _Line, lines: list[_Line], target: Skeleton, turns: _Turns
) -> None:
    """Sets the rest rotations of a source chain, in ``since`` (N, 4), so that its bones point in the target's
    directions.

    The pose starts from the take's zero pose in its first heading. Each bone gets the smallest rotation that
    makes it point in the target's direction, so the twist about a bone remains the performer's. A limb is
    bent bone by bone from its root, and each bone carries the next one. So a forearm that is bent at rest is
    straightened at the elbow. A spine or a neck is rotated as a whole and keeps the model's own curve.
    """
    heading, skeleton = first_heading(clip), clip.skeleton
    since[list(line.bones)] = heading
    if len(line.source_joints) == 1:
        return
    arc, ends = arc_lengths(skeleton, line.source_joints), target.positions[list(line.target_joints)]
    at = np.stack([np.interp(arc, arc_lengths(target, line.target_joints), ends[:, k]) for k in range(3)], 1)
    directions, bones = (
        turns.to_take(line, np.diff(at, axis=0)),
        skeleton.vectors[list(line.source_joints[1:])],
    )
    middle = turns.middle(skeleton, line)
    if middle:
        directions[:], bones[:] = directions.sum(0), bones.sum(0)
    goes_on = any(
        other_line.plan.mode == "pose"
        and other_line.plan.role == line.plan.role
        and _is_continuation(other_line, line)
        for other_line in lines
    )
    before = since[line.source_joints[0]] if goes_on and not middle else heading
    for joint, direction, bone in zip(line.source_joints[1:], directions, bones, strict=True):
        bone = rotate(before, bone)
        if np.linalg.norm(bone) > 1e-6 and np.linalg.norm(direction) > 1e-6:
            bent = swing(bone / np.linalg.norm(bone), direction / np.linalg.norm(direction))
            since[joint] = multiply(bent, before)
        else:
            since[joint] = before
        before = heading if middle else since[joint]


def _layer_basis(lines: list[_Line], line: _Line, source: Skeleton, target: Skeleton, turns: _Turns) -> Float:
    """Returns the rotation target_from_source (4,) of a chain's layer."""
    basis = turns.of(line)
    if line.plan.mode == "move" and len(line.source_joints) > 1 < len(line.target_joints):
        mine, theirs = _whole_limb_ends(lines, line)
        direction = turns.to_model(line, source.positions[mine[1]] - source.positions[mine[0]])
        target_direction = target.positions[theirs[1]] - target.positions[theirs[0]]
        # Below a chain that has the performer's pose, this chain rotates about the performer's axes. Other
        # axes would change the pose of the limbs below. A tail that a spine drives points the opposite way,
        # so it gets axes of its own.
        carries = _leads_to_posed(lines, line) or float(direction @ target_direction) > 0.0
        same = carries and _posed_bone_above(lines, line, source) is not None
        basis = (
            basis if same else multiply(_smallest_rotation(direction, target_direction, turns.across), basis)
        )
    return multiply(_half_turn(target, line.target_joints), basis) if line.plan.flip else basis


def _leads_to_posed(lines: list[_Line], line: _Line) -> bool:
    """Returns True if a chain of mode "pose" continues this one, as a limb continues its girdle."""
    after = [follower for follower in lines if _is_continuation(line, follower)]
    return any(follower.plan.mode == "pose" or _leads_to_posed(lines, follower) for follower in after)


def _whole_limb_ends(lines: list[_Line], line: _Line) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns the first and last joint, in take and model, of a limb's consecutive chains of mode "move".

    A limb that is driven in pieces has one set of axes, even if its thigh and shin point in different
    directions at rest.
    """
    role = line.plan.role
    same_limb = [piece for piece in lines if piece.plan.role == role and piece.plan.mode == "move"]
    first = last = line
    while role and (before := [piece for piece in same_limb if _is_continuation(piece, first)]):
        first = before[0]
    while role and (after := [piece for piece in same_limb if _is_continuation(last, piece)]):
        last = after[0]
    return (first.source_joints[0], last.source_joints[-1]), (first.target_joints[0], last.target_joints[-1])


def _is_continuation(one: _Line, other: _Line) -> bool:
    """Returns True if the second chain begins where the first ends, in the take and in the model."""
    return one.source_joints[-1] == other.source_joints[0] and one.target_joints[-1] == other.target_joints[0]


def _smallest_rotation(direction: Float, target_direction: Float, across: Float) -> Float:
    """Returns the smallest rotation (4,) from one direction (3,) to another.

    Between opposite directions, the rotation begins with half a turn about the lateral axis of the body, as
    from a hanging limb to a raised one. For limbs that lie along that axis it is the vertical one.
    """
    lengths = float(np.linalg.norm(direction)), float(np.linalg.norm(target_direction))
    if min(lengths) < 1e-6:
        return IDENTITY
    a, b = direction / lengths[0], target_direction / lengths[1]
    if a @ b >= _MAX_OPPOSITE_COSINE:
        return swing(a, b)
    axis = across if abs(a @ across) < 0.7 else np.array([0.0, 1.0, 0.0])
    half = from_rotation_vector(np.pi * axis)
    return multiply(swing(rotate(half, a), b), half)


def _half_turn(target: Skeleton, chain: tuple[int, ...]) -> Float:
    """Returns half a turn (4,) about the first bone of a chain."""
    along = target.positions[chain[min(1, len(chain) - 1)]] - target.positions[chain[0]]
    return normalized(np.concatenate([[0.0], along]))


def _yaw_rotation(angle: float) -> Float:
    """Returns the rotation (4,) by an angle in radians about +Y."""
    return from_rotation_vector(np.array([0.0, angle, 0.0]))


def _follow_take_root(project: Project, shape_id: str, take: Clip, turns: _Turns, stride: float) -> Project:
    """Returns the project in which the shape's root follows the path of the take's root."""
    shape, name = project.shape(shape_id), unused(f"{take.id}: way", project.layer_names)
    layers = (*shape.layers, Layer(name, take.id, (0,), turns.plain))
    project = project.with_characters(shape.with_changes(layers=layers, travel=name))
    scale = stride * travel_scale(shape.with_changes(travel_scale=None), take)
    return set_travel(project, shape_id, name, scale)


def _joint_path(skeleton: Skeleton, names: tuple[str, ...], owner: str) -> tuple[int, ...]:
    """Returns the joints of a chain, given the names of its two ends or of all of its joints."""
    if not names:
        raise InputError(
            f"a chain of {owner} names no joint", where="mapping", mend=_describe_joints(skeleton)
        )
    unknown = [name for name in names if name not in skeleton.names]
    if unknown:
        raise InputError(
            f"{owner} has no joint {unknown[0]!r}", where="mapping", mend=_describe_joints(skeleton)
        )
    joints = [skeleton.names.index(name) for name in names]
    path = [joints[0]]
    for joint in joints[1:]:
        path.extend(skeleton.path(path[-1], joint)[1:])
    return tuple(path)


def _target_joints(skeleton: Skeleton, chain: ChainPlan) -> tuple[int, ...]:
    path = _joint_path(skeleton, chain.target, "the model")
    return branch(skeleton, path[0], path[-1]) if chain.extend else path


def _describe_joints(skeleton: Skeleton) -> str:
    return f"Its joints are: {', '.join(skeleton.names)}."
