"""Automatic retargeting: finds a mapping from a take to a shape, and applies it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, ContactSettings, Project, RiggedCharacter, Skeleton
from enliven.errors import InputError
from enliven.formats.rig.rig import play_clip
from enliven.mapping.applying import apply_plan, initial_facings, source_anatomy
from enliven.mapping.assignment import (
    Drive,
    assign_limbs,
    match_joints,
    match_joints_of_poses,
    split_drive,
)
from enliven.mapping.ground import keep_on_floor, stands_on_floor
from enliven.mapping.joint_limits import limit_joints
from enliven.mapping.legs.gait import (
    bones_that_only_step,
    choose_standing_on_feet,
    find_planted_legs,
    find_posed_stepping_legs,
    leg_to_ankle,
    legs_that_step,
    step_scale,
    step_sizes,
)
from enliven.mapping.legs.steps import apply_steps
from enliven.mapping.model_clips import is_own_take
from enliven.mapping.plan import ChainPlan, Mode, Plan
from enliven.mapping.resting import mean_turn
from enliven.motion.contact.pin import pin_feet
from enliven.motion.layers.polyline import arc_lengths
from enliven.motion.layers.retarget import set_travel
from enliven.rotation import conjugate, multiply
from enliven.skeletons.anatomy import (
    Anatomy,
    SkeletonLimb,
    find_anatomy,
    has_parallel_fingers,
    is_tip_start,
    tip_number,
)
from enliven.skeletons.facing import rotate_about_y
from enliven.skeletons.human_names import finger_joints


@dataclass(frozen=True, eq=False)
class RetargetedShape:
    """A shape that a take moves: the result of retargeting.

    Attributes:
        project: contains the shape, the take relative to its new rest pose, and the layers between them.
        shape_id: ID of the shape.
        clip: the original take.
        plan: the mapping that was used.
        duration: seconds from the start of the motion to the end of its last layer.
        model_facing, take_facing: facing of the model, and of the performer in the first frame, radians about
            +Y from +Z.
        clips: the model's own clips, which define its joint limits.
        limited: names of the joints that exceeded their range of motion and were corrected.
    """

    project: Project
    shape_id: str
    clip: Clip
    plan: Plan
    duration: float
    model_facing: float
    take_facing: float
    clips: tuple[Clip, ...] = ()
    limited: tuple[str, ...] = ()


_MAX_TRUNK_ANGLE = np.radians(50.0)
"""Maximum angle (radians) between the trunks of two bodies for the model to get the performer's pose."""
_MAX_TWIN_DIFFERENCE = 0.02
"""Maximum difference of joint distances in identical skeletons, as a fraction of the size."""
_MIN_FINGER_BEND = np.radians(5.0)
"""Minimum rotation (radians) of a finger from its mean pose. Fingers that rotate less are not mapped."""
_MAX_UPRIGHT_ANGLE = np.radians(45.0)
"""Maximum angle (radians) between the vertical and the line from root to head of an upright body."""


def create_automatic_plan(clip: Clip, shape: RiggedCharacter) -> Plan:
    """Returns the automatic mapping of a whole body.

    The model gets the performer's pose (mode "pose") if both bodies have the same numbers of leg and arm
    pairs, point in similar directions, and are upright. Identical skeletons need not be upright. Other models
    keep their own rest pose and move from it (mode "move").
    """
    source, target = source_anatomy(clip), find_anatomy(shape.skeleton)
    mode = _choose_mode(clip.skeleton, source, shape.skeleton, target)
    twins = _is_twin(clip.skeleton, shape.skeleton)
    level = mode == "move" and len(target.legs) > 1
    chains = _body_chains(clip.skeleton, source, shape.skeleton, mode, level)
    drives = assign_limbs(source, target)
    tips = None
    if mode == "pose":
        tips = _tip_numbers(clip.skeleton, source), _tip_numbers(shape.skeleton, target)
    for drive in drives:
        # Girdles keep the model's own directions. If a shoulder's or hip's bone pointed in the performer's
        # direction, the joint would leave the trunk. Hands and feet keep their own rest rotation too.
        keeps_directions = not twins and drive.role.endswith((" girdle", " end"))
        for piece in _limb_pieces(drive, drives, clip.skeleton, shape.skeleton, tips):
            is_end = not twins and _is_end(piece, drive, target, shape.skeleton)
            if is_end and has_parallel_fingers(shape.skeleton, piece.target[0]):
                continue  # The rig has no wrist. All of its fingers move with the forearm.
            moved = keeps_directions or is_end
            chains.append(
                ChainPlan(
                    _end_names(clip.skeleton, piece.source),
                    _end_names(shape.skeleton, piece.target),
                    piece.role,
                    "move" if moved else mode,
                    mirrored=piece.mirrored,
                    carries="trunk" not in drive.role and "girdle" not in drive.role,
                )
            )
    if mode == "pose":
        chains += _finger_chains(clip, source, shape.skeleton, target)
    return Plan(level=level, chains=tuple(chains))


def _finger_chains(
    clip: Clip, performer_anatomy: Anatomy, target: Skeleton, target_anatomy: Anatomy
) -> list[ChainPlan]:
    """Returns chains for the fingers that move in the take, and that take and model both identify by name.

    Other fingers follow the hand.
    """
    chains, source = list[ChainPlan](), clip.skeleton
    for side, source_arm, target_arm in _match_arms(performer_anatomy, target_anatomy):
        wrist, target_fingers = source_arm.main[-1], finger_joints(target, target_arm.main[-1])
        for finger, chain in finger_joints(source, wrist).items():
            if finger not in target_fingers or not _is_moving_finger(clip, chain):
                continue
            pairs = zip(pairwise(chain), pairwise(target_fingers[finger]), strict=False)
            for number, (source_pair, target_pair) in enumerate(pairs):
                # The first bone of a finger is inside the palm. Mode "move" keeps the model's rest rotation
                # of this bone.
                mode: Mode = "pose" if number else "move"
                names = _end_names(source, source_pair), _end_names(target, target_pair)
                chains.append(ChainPlan(*names, f"{side} {finger}", mode))
    return chains


def _match_arms(source: Anatomy, target: Anatomy) -> Iterator[tuple[str, SkeletonLimb, SkeletonLimb]]:
    """Yields (side, arm of the take, arm of the model) for each side if both arms have known joint names."""
    for source_pair, target_pair in zip(source.arms[:1], target.arms[:1], strict=False):
        for side, source_arm, target_arm in zip(("left", "right"), source_pair, target_pair, strict=True):
            if source_arm.knots and target_arm.knots:
                yield side, source_arm, target_arm


def _is_moving_finger(clip: Clip, finger: Sequence[int]) -> bool:
    """Returns True if a finger moves relative to its hand. In many takes no finger does."""
    if len(finger) < 3:
        return False
    local = multiply(conjugate(clip.turns[:, finger[1]]), clip.turns[:, finger[2]])
    cosine = np.abs(np.sum(local * mean_turn(local), axis=1)).min()
    return bool(2.0 * np.arccos(min(float(cosine), 1.0)) > _MIN_FINGER_BEND)


def list_idle_limbs(clip: Clip, plan: Plan) -> tuple[str, ...]:
    """Returns the names of the performer's arms and legs that no chain of the plan uses, such as "left
    arm"."""
    skeleton, moving = clip.skeleton, set[int]()
    for chain in plan.chains:
        ends = [skeleton.index(name) for name in chain.source]
        moving |= set(skeleton.path(ends[0], ends[-1])[1:]) if chain.weight > 0.0 else set()
    idle = list[str]()
    body = source_anatomy(clip)
    for kind, pairs in (("arm", body.arms), ("leg", body.legs)):
        for pair in pairs:
            sides = zip(("left", "right"), pair, strict=True)
            idle += [f"{side} {kind}" for side, limb in sides if not moving & set(limb.main[1:])]
    return tuple(idle)


def _body_chains(
    source: Skeleton, performer_anatomy: Anatomy, target: Skeleton, mode: Mode, level: bool
) -> list[ChainPlan]:
    """Returns the chains that rotate the whole body, driven by the performer's pelvis.

    In a walk, pelvis and chest rotate in opposite directions, and the heading of the body is between their
    headings. A model with other proportions would sway if the pelvis alone drove it. So it also gets half of
    the rotation from pelvis to chest. A model on four or more legs (``level``) follows that mean heading and
    stays level.
    """
    root, hips = (target.names[0],), (source.names[0],)
    chains = [ChainPlan(hips, root, "whole", mode)]
    if mode == "move" and len(performer_anatomy.trunk) > 1 and not level:
        chains.append(
            ChainPlan(
                _end_names(source, performer_anatomy.trunk), root, "whole, towards the chest", weight=0.5
            )
        )
    return chains


def _choose_mode(
    source: Skeleton, performer_anatomy: Anatomy, target: Skeleton, target_anatomy: Anatomy
) -> Mode:
    has_same_limbs = (
        len(performer_anatomy.legs) == len(target_anatomy.legs)
        and len(performer_anatomy.arms) == len(target_anatomy.arms)
        and bool(target_anatomy.pairs)
    )
    source_direction, target_direction = (
        _trunk_direction(source, performer_anatomy),
        _trunk_direction(target, target_anatomy),
    )
    # The spines of all upright people have similar directions. The spines of animals on four legs differ in
    # their start and slope, so copying bone directions would crush the model, unless the skeletons are
    # identical.
    same_stance = min(source_direction[1], target_direction[1]) > np.cos(_MAX_UPRIGHT_ANGLE) or _is_twin(
        source, target
    )
    return (
        "pose"
        if has_same_limbs
        and same_stance
        and float(source_direction @ target_direction) > np.cos(_MAX_TRUNK_ANGLE)
        else "move"
    )


def _is_twin(source: Skeleton, target: Skeleton) -> bool:
    """Returns True if two skeletons are identical except for size, position and heading."""
    if source.names != target.names or (source.parents != target.parents).any():
        return False
    source_distances, target_distances = (
        np.linalg.norm(skeleton.positions[:, None] - skeleton.positions, axis=2)
        for skeleton in (source, target)
    )
    source_distances, target_distances = (
        matrix / max(float(matrix.max()), 1e-9) for matrix in (source_distances, target_distances)
    )
    return bool(np.abs(source_distances - target_distances).max() < _MAX_TWIN_DIFFERENCE)


def _trunk_direction(skeleton: Skeleton, anatomy: Anatomy) -> Float:
    """Returns the unit vector (3,) from the root to the end of the head or trunk, with the front at +Z.

    The vector is zero if both ends coincide.
    """
    end = anatomy.head.chain[-1] if anatomy.head else anatomy.trunk[-1]
    direction = rotate_about_y(skeleton.positions[end] - skeleton.positions[0], -anatomy.facing)
    return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-9))


def pin_all_feet(
    project: Project,
    shape: RiggedCharacter,
    steps: Mapping[SkeletonLimb, float] | None = None,
    level: bool = False,
    above: bool = False,
    without: Collection[SkeletonLimb] = (),
) -> Project:
    """Returns a project in which each foot of the shape is locked to the floor while it stands (foot lock).

    The locked joint is the ankle, where the foot begins. Legs that step reach the floor already, so the
    body is not lowered for them.

    Args:
        project: the project that contains the shape.
        shape: the shape.
        steps: the legs that step, each with its step size in metres. For these legs, the thresholds for a
            lifted or moving foot are relative to this size instead of the leg's length. See
            :func:`step_sizes`.
        level: True if the shape is kept on the floor. Then feet are locked horizontally only. While a foot
            rolls, its ankle rises and sinks, so locking its height would lift the foot off the floor.
        above: True to raise feet that would be below the floor.
        without: legs with feet that are not locked.
    """
    steps, default_settings = steps or {}, ContactSettings(sink=float(level), above=above)
    for limb in (limb for pair in find_anatomy(shape.skeleton).legs for limb in pair if limb not in without):
        leg = leg_to_ankle(limb)
        if len(leg) > 2:
            settings = (
                _short_step_settings(default_settings, shape.skeleton, leg, steps[limb])
                if limb in steps
                else default_settings
            )
            project = pin_feet(project, shape.id, [leg[-1]], start=leg[0], settings=settings)
    return project


def _short_step_settings(
    default_settings: ContactSettings, skeleton: Skeleton, leg: Sequence[int], size: float
) -> ContactSettings:
    """Returns contact settings for a foot with steps as large as those of a leg with a length of ``size``
    metres.

    With these settings the body is not lowered so that the foot reaches the floor.
    """
    length_ratio = min(1.0, size / float(skeleton.lengths[list(leg[1:])].sum()))
    return replace(
        default_settings,
        drop=0.0,
        height=length_ratio * default_settings.height,
        speed=length_ratio * default_settings.speed,
    )


def _limb_pieces(
    drive: Drive,
    drives: list[Drive],
    source: Skeleton,
    target: Skeleton,
    tips: tuple[dict[int, int], dict[int, int]] | None,
) -> list[Drive]:
    """Splits a limb at corresponding joints, and returns its pieces. The limb of the other side is split at
    the same joints.

    A spine is not split.

    Args:
        drive: the limb.
        drives: all limbs of the body.
        source, target: the skeletons of the take and of the model.
        tips: for the limbs of the take and of the model, see :func:`_tip_numbers`. None if the model does not
            get the performer's pose.
    """
    if "trunk" in drive.role or (drive.role == "head" and not drive.knots):
        return [drive]
    other_side = {"left": "right", "right": "left"}.get(drive.role.split()[0], "")
    role = " ".join([other_side, *drive.role.split()[1:]])
    pair = [drive, *(limb for limb in drives if limb.role == role)]
    arcs = [(arc_lengths(source, limb.source), arc_lengths(target, limb.target)) for limb in pair]
    if any(len(a) != len(arcs[0][0]) or len(b) != len(arcs[0][1]) for a, b in arcs):
        arcs = arcs[:1]
    source_arc, target_arc = (np.mean(side, axis=0).tolist() for side in zip(*arcs, strict=True))
    if tips is None or drive.knots or drive.source[0] not in tips[0] or drive.target[0] not in tips[1]:
        cuts = match_joints(drive, source_arc, target_arc)
    else:
        ends = zip(tips, (drive.source, drive.target), strict=True)
        source_tip, target_tip = (min(numbers[chain[0]], len(chain) - 1) for numbers, chain in ends)
        cuts = match_joints_of_poses(source_arc, target_arc, source_tip, target_tip)
    pieces = split_drive(drive, cuts)
    if not drive.knots or drive.role == "head":
        return pieces
    # A segment of several bones is straight (Rigify splits bones for twist), so rotating its first bone is
    # enough.
    return [replace(piece, target=piece.target[:2]) for piece in pieces]


def _tip_numbers(skeleton: Skeleton, body: Anatomy) -> dict[int, int]:
    """Returns the index at which the hand or foot begins, for each limb by its first joint after the girdle.

    The two limbs of a pair have the same index, also if the model is a little crooked.
    """
    tips = dict[int, int]()
    for pair in body.pairs:
        numbers = [tip_number(skeleton, limb) for limb in pair]
        if len(pair[0].main) == len(pair[1].main):
            numbers = [min(numbers)] * 2
        tips |= {limb.proper[0]: number for limb, number in zip(pair, numbers, strict=True)}
    return tips


def _is_end(piece: Drive, drive: Drive, body: Anatomy, target: Skeleton) -> bool:
    """Returns True if a piece is the hand or foot of a limb for which the anatomy has no separate hand or
    foot."""
    limb = next((limb for pair in body.pairs for limb in pair if limb.main == drive.target), None)
    return limb is not None and is_tip_start(target, limb, piece.target[0])


def _end_names(skeleton: Skeleton, chain: tuple[int, ...]) -> tuple[str, ...]:
    """Returns the names of the first and last joint of a chain. Two joints define the chain, since the path
    between them is unique."""
    return (skeleton.names[chain[0]], skeleton.names[chain[-1]])


def play_own_take(shape: RiggedCharacter, clip: Clip, project: Project | None = None) -> RetargetedShape:
    """Returns a shape that plays one of its own takes joint by joint, including travel through the world.

    Args:
        shape: the shape.
        clip: a take with the shape's own skeleton.
        project: the project to add the motion to. If None, a new project is created.

    Raises:
        InputError: if the take was made for another skeleton; see :func:`is_own_take`.
    """
    if not is_own_take(clip, shape):
        raise InputError(
            "the clip has another skeleton than the model",
            where=f"clip {clip.id!r}",
            remedy="Retarget the clip.",
        )
    plan = replace(create_automatic_plan(clip, shape), travel=True, floor=False)
    new_project, _ = play_clip(project or Project(), shape, clip)
    take_facing, model_facing = initial_facings(clip, shape, plan)
    return RetargetedShape(new_project, shape.id, clip, plan, clip.duration, model_facing, take_facing)


def retarget(
    shape: RiggedCharacter,
    clip: Clip,
    plan: Plan | None = None,
    project: Project | None = None,
    clips: Sequence[Clip] = (),
) -> RetargetedShape:
    """Returns a shape that a take moves.

    Args:
        shape: the shape.
        clip: the take.
        plan: the mapping. If None, :func:`create_automatic_plan` finds one.
        project: the project with the shape, and with takes that already move the shape. If None, a new
            project is created.
        clips: the model's own clips, which define the ranges of its joints.

    Raises:
        InputError: see :func:`apply_plan`; also if no part of the shape can be driven.
    """
    plan = create_automatic_plan(clip, shape) if plan is None else plan
    if not plan.chains:
        remedy = "Write a mapping file with --write-map, and edit it."
        raise InputError("no chain of the take matches a chain of the model", where="mapping", remedy=remedy)
    stepping, posed = legs_that_step(shape, clip, plan), find_posed_stepping_legs(shape, clip, plan)
    planted = find_planted_legs(shape, clip, plan)
    # A body with the performer's skeleton moves exactly as in the take, unless its feet are planted.
    is_same_skeleton = plan.travel and not posed and _is_twin(clip.skeleton, shape.skeleton)
    is_on_floor = stands_on_floor(shape) and not is_same_skeleton
    level = plan.floor and is_on_floor
    project, rebased_clip = apply_plan(project or Project(), shape, clip, plan)
    if posed and plan.travel:
        scale = step_scale(shape, clip, rebased_clip, plan)
        project = set_travel(project, shape.id, project.shape(shape.id).travel, scale)
    # A looping layer has no end, so its duration is that of the take.
    layers = [replace(layer, speed=1.0) if layer.loop else layer for layer in project.shape(shape.id).layers]
    duration = max(layer.end(rebased_clip.duration) for layer in layers)
    stepping_bones = bones_that_only_step(shape, clip, plan) if level else ()
    project, names = limit_joints(project, shape.id, clip, plan, clips, stepping_bones)
    if level:
        project = apply_steps(project, shape.id, clip, rebased_clip, plan)
        feet = choose_standing_on_feet(clip) if planted and clip.duration > 0.0 else None
        project = keep_on_floor(project, shape.id, rebased_clip, duration, not stepping, feet)
    if plan.pin:
        steps = step_sizes(shape, clip, rebased_clip, plan)
        project = pin_all_feet(project, shape, steps, level, above=is_on_floor and not level, without=planted)
    take_facing, model_facing = initial_facings(clip, shape, plan)
    return RetargetedShape(
        project, shape.id, clip, plan, duration, model_facing, take_facing, tuple(clips), names
    )
