"""Automatic retargeting: finds a mapping from a take to a shape, and applies it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, ContactSettings, Project, Shape, Skeleton
from enliven.errors import InputError
from enliven.formats.rig import play_clip
from enliven.mapping.anatomy import Anatomy, SkeletonLimb, anatomy_of, is_tip_start
from enliven.mapping.applying import apply_plan, facings, source_anatomy
from enliven.mapping.assignment import Drive, assign_limbs, matching_joints, split_drive
from enliven.mapping.facing import rotate_about_y
from enliven.mapping.gait import (
    bones_that_only_step,
    leg_of,
    legs_that_step,
    posed_legs_that_step,
    standing_on_feet,
    step_scale,
    step_sizes,
)
from enliven.mapping.ground import keep_on_floor, stands_on_floor
from enliven.mapping.human_names import finger_joints
from enliven.mapping.joint_limits import limit_joints
from enliven.mapping.model_clips import is_own_take
from enliven.mapping.plan import ChainPlan, Mode, Plan
from enliven.mapping.resting import mean_turn
from enliven.mapping.steps import stepped
from enliven.motion.contact import pin_feet
from enliven.motion.layers import arc_lengths, set_travel
from enliven.rotation import conjugate, multiply


@dataclass(frozen=True, eq=False)
class RetargetedShape:
    """A shape that a take moves: the result of retargeting.

    Attributes:
        project: contains the shape, the take relative to its new rest pose, and the layers between them.
        shape_id: ID of the shape.
        clip: the original take.
        plan: the mapping that was used.
        duration: seconds from the start to the end of the last chain's movement.
        model_facing, take_facing: radians about +Y from +Z, of the model and of the performer's first frame.
        clips: the model's own clips, which define its joint limits.
        limited: names of the joints that exceeded their limits and were corrected.
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
"""Minimum rotation (radians) of a moving finger from its mean. Fingers that rotate less count as still."""
_MAX_UPRIGHT_ANGLE = np.radians(45.0)
"""Maximum angle (radians) between the vertical and the line from root to head of an upright body."""


def automatic(clip: Clip, shape: Shape) -> Plan:
    """Returns the automatic mapping of a whole body.

    The model gets the performer's pose (mode "pose") if both bodies have the same numbers of leg and arm
    pairs, point in similar directions, and are upright. Identical skeletons need not be upright. Other models
    keep their own rest pose and move from it (mode "move").
    """
    source, target = source_anatomy(clip), anatomy_of(shape.skeleton)
    mode = _choose_mode(clip.skeleton, source, shape.skeleton, target)
    twins = _is_twin(clip.skeleton, shape.skeleton)
    level = mode == "move" and len(target.legs) > 1
    chains = _body_chains(clip.skeleton, source, shape.skeleton, mode, level)
    drives = assign_limbs(source, target)
    for drive in drives:
        # Girdles keep the model's own directions: pointed like the performer's, a shoulder or hip would
        # leave the trunk. Hands and feet keep their own rest rotation too.
        keeps_directions = not twins and drive.role.endswith((" girdle", " end"))
        for piece in _limb_pieces(drive, drives, clip.skeleton, shape.skeleton):
            moved = keeps_directions or (not twins and _is_end(piece, drive, target, shape.skeleton))
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


def _finger_chains(clip: Clip, theirs: Anatomy, target: Skeleton, ours: Anatomy) -> list[ChainPlan]:
    """Returns the chains of fingers that move in the take and have names in take and model.

    Other fingers follow the hand.
    """
    chains, source = list[ChainPlan](), clip.skeleton
    for side, by, limb in _matching_arms(theirs, ours):
        wrist, hand = by.main[-1], finger_joints(target, limb.main[-1])
        for finger, chain in finger_joints(source, wrist).items():
            if finger not in hand or not _is_moving_finger(clip, chain):
                continue
            pairs = zip(pairwise(chain), pairwise(hand[finger]), strict=False)
            for number, (mine, other) in enumerate(pairs):
                # The first bone of a finger lies in the palm, which keeps the model's own rest rotation.
                how: Mode = "pose" if number else "move"
                names = _end_names(source, mine), _end_names(target, other)
                chains.append(ChainPlan(*names, f"{side} {finger}", how))
    return chains


def _matching_arms(theirs: Anatomy, ours: Anatomy) -> Iterator[tuple[str, SkeletonLimb, SkeletonLimb]]:
    """Yields (side, arm of the take, arm of the model) for each side on which both are known by name."""
    for by, pair in zip(theirs.arms[:1], ours.arms[:1], strict=False):
        for side, arm, limb in zip(("left", "right"), by, pair, strict=True):
            if arm.knots and limb.knots:
                yield side, arm, limb


def _is_moving_finger(clip: Clip, finger: Sequence[int]) -> bool:
    """Returns True if a finger moves relative to its hand. In many takes fingers never do."""
    if len(finger) < 3:
        return False
    local = multiply(conjugate(clip.turns[:, finger[1]]), clip.turns[:, finger[2]])
    cosine = np.abs(np.sum(local * mean_turn(local), axis=1)).min()
    return bool(2.0 * np.arccos(min(float(cosine), 1.0)) > _MIN_FINGER_BEND)


def idle_limbs(clip: Clip, plan: Plan) -> tuple[str, ...]:
    """Returns the names of the performer's arms and legs that drive nothing, such as "left arm"."""
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
    source: Skeleton, theirs: Anatomy, target: Skeleton, mode: Mode, level: bool
) -> list[ChainPlan]:
    """Returns the chains that rotate the whole body, driven by the performer's pelvis.

    In a walk, pelvis and chest rotate in opposite directions, and the heading of the body is between them. A
    model of another build would sway if the pelvis alone drove it. So it also gets half of the rotation from
    pelvis to chest. A model on four or more legs (``level``) follows that mean heading and stays level.
    """
    root, hips = (target.names[0],), (source.names[0],)
    chains = [ChainPlan(hips, root, "whole", mode)]
    if mode == "move" and len(theirs.trunk) > 1 and not level:
        chains.append(
            ChainPlan(_end_names(source, theirs.trunk), root, "whole, towards the chest", weight=0.5)
        )
    return chains


def _choose_mode(source: Skeleton, theirs: Anatomy, target: Skeleton, ours: Anatomy) -> Mode:
    same = len(theirs.legs) == len(ours.legs) and len(theirs.arms) == len(ours.arms) and bool(ours.pairs)
    a, b = _trunk_direction(source, theirs), _trunk_direction(target, ours)
    # All upright people stand alike. Animals on four legs differ in the beginning and slope of their spines.
    # Copying the directions of bones would crush the model, unless the skeletons are identical.
    same_stance = min(a[1], b[1]) > np.cos(_MAX_UPRIGHT_ANGLE) or _is_twin(source, target)
    return "pose" if same and same_stance and float(a @ b) > np.cos(_MAX_TRUNK_ANGLE) else "move"


def _is_twin(source: Skeleton, target: Skeleton) -> bool:
    """Returns True if two skeletons are identical except for size, position and heading."""
    if source.names != target.names or (source.parents != target.parents).any():
        return False
    a, b = (np.linalg.norm(s.positions[:, None] - s.positions, axis=2) for s in (source, target))
    a, b = (distances / max(float(distances.max()), 1e-9) for distances in (a, b))
    return bool(np.abs(a - b).max() < _MAX_TWIN_DIFFERENCE)


def _trunk_direction(skeleton: Skeleton, anatomy: Anatomy) -> Float:
    """Returns the unit vector (3,) from the root to the end of the head or trunk, with the front at +Z.

    It is zero if both ends coincide.
    """
    end = anatomy.head.chain[-1] if anatomy.head else anatomy.trunk[-1]
    way = rotate_about_y(skeleton.positions[end] - skeleton.positions[0], -anatomy.facing)
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-9))


def pin_all_feet(
    project: Project,
    shape: Shape,
    steps: Mapping[SkeletonLimb, float] | None = None,
    level: bool = False,
    above: bool = False,
    without: Collection[SkeletonLimb] = (),
) -> Project:
    """Returns the project with feet locked while they stand (foot lock).

    The locked joint is the ankle, at which the foot begins. Legs that step reach the floor already, so the
    body is not lowered for them.

    Args:
        project: contains the shape.
        shape: the shape.
        steps: the legs that step, each with its step size in metres. The thresholds for a lifted or moving
            foot are relative to this size instead of the leg's length. See :func:`step_sizes`.
        level: True if the shape is kept on the floor. Then feet are locked horizontally only. An ankle sinks
            while its foot rolls, so locking its height would lift the foot off the floor.
        above: True to raise feet that would go below the floor.
        without: legs with feet that are not locked.
    """
    steps, usual = steps or {}, ContactSettings(sink=float(level), above=above)
    for limb in (limb for pair in anatomy_of(shape.skeleton).legs for limb in pair if limb not in without):
        leg = leg_of(limb)
        if len(leg) > 2:
            how = _short_step_settings(usual, shape.skeleton, leg, steps[limb]) if limb in steps else usual
            project = pin_feet(project, shape.id, [leg[-1]], start=leg[0], settings=how)
    return project


def _short_step_settings(
    usual: ContactSettings, skeleton: Skeleton, leg: Sequence[int], size: float
) -> ContactSettings:
    """Returns contact settings for a foot with steps of a leg of ``size`` metres.

    The body is not lowered for it.
    """
    length_ratio = min(1.0, size / float(skeleton.lengths[list(leg[1:])].sum()))
    return replace(usual, drop=0.0, height=length_ratio * usual.height, speed=length_ratio * usual.speed)


def _limb_pieces(drive: Drive, drives: list[Drive], source: Skeleton, target: Skeleton) -> list[Drive]:
    """Returns a limb cut at corresponding joints, the same on both sides. A spine stays whole."""
    if "trunk" in drive.role or (drive.role == "head" and not drive.knots):
        return [drive]
    other_side = {"left": "right", "right": "left"}.get(drive.role.split()[0], "")
    role = " ".join([other_side, *drive.role.split()[1:]])
    pair = [drive, *(limb for limb in drives if limb.role == role)]
    arcs = [(arc_lengths(source, limb.source), arc_lengths(target, limb.target)) for limb in pair]
    if any(len(a) != len(arcs[0][0]) or len(b) != len(arcs[0][1]) for a, b in arcs):
        arcs = arcs[:1]
    mine, theirs = (np.mean(side, axis=0).tolist() for side in zip(*arcs, strict=True))
    pieces = split_drive(drive, matching_joints(drive, mine, theirs))
    if not drive.knots or drive.role == "head":
        return pieces
    # A segment of several bones is straight (Rigify splits bones for twist), so its first bone rotates it.
    return [replace(piece, target=piece.target[:2]) for piece in pieces]


def _is_end(piece: Drive, drive: Drive, body: Anatomy, target: Skeleton) -> bool:
    """Returns True if a piece is the hand or foot of a limb that has no separate one."""
    limb = next((limb for pair in body.pairs for limb in pair if limb.main == drive.target), None)
    return limb is not None and is_tip_start(target, limb, piece.target[0])


def _end_names(skeleton: Skeleton, chain: tuple[int, ...]) -> tuple[str, ...]:
    """Returns the names of the first and last joint, which is enough for a chain that is a path."""
    return (skeleton.names[chain[0]], skeleton.names[chain[-1]])


def play_own_take(shape: Shape, clip: Clip, project: Project | None = None) -> RetargetedShape:
    """Returns a shape that plays one of its own takes joint by joint, including travel through the world.

    Args:
        shape: the shape.
        clip: a take with the shape's own skeleton.
        project: contains the shape. If None, a new project is made.

    Raises:
        InputError: if the take was made for another skeleton; see :func:`is_own_take`.
    """
    if not is_own_take(clip, shape):
        raise InputError("it has another skeleton", where=f"clip {clip.id!r}", mend="Retarget it.")
    plan = replace(automatic(clip, shape), travel=True, floor=False)
    played, _ = play_clip(project or Project(), shape, clip)
    theirs, ours = facings(clip, shape, plan)
    return RetargetedShape(played, shape.id, clip, plan, clip.duration, ours, theirs)


def retarget(
    shape: Shape,
    clip: Clip,
    plan: Plan | None = None,
    project: Project | None = None,
    clips: Sequence[Clip] = (),
) -> RetargetedShape:
    """Returns a shape that a take moves.

    Args:
        shape: the shape.
        clip: the take.
        plan: the mapping. If None, it is found automatically.
        project: contains the shape and the takes that move it already. If None, a new project is made.
        clips: the model's own clips, which define the ranges of its joints.

    Raises:
        InputError: see :func:`apply_plan`; also if no part of the shape can be driven.
    """
    plan = automatic(clip, shape) if plan is None else plan
    if not plan.chains:
        mend = "Write a mapping: --write-map gives one to begin with."
        raise InputError("no chain of the take suits a chain of the model", where="mapping", mend=mend)
    stepping, posed = legs_that_step(shape, clip, plan), posed_legs_that_step(shape, clip, plan)
    # A body with the performer's skeleton moves exactly as the take does, unless its feet are planted.
    itself = plan.travel and not posed and _is_twin(clip.skeleton, shape.skeleton)
    upright = stands_on_floor(shape) and not itself
    level = plan.floor and upright
    project, based = apply_plan(project or Project(), shape, clip, plan)
    if posed and plan.travel:
        scale = step_scale(shape, clip, based, plan)
        project = set_travel(project, shape.id, project.shape(shape.id).travel, scale)
    # A looping layer has no end, so its duration is that of the take.
    layers = [replace(layer, speed=1.0) if layer.loop else layer for layer in project.shape(shape.id).layers]
    duration = max(layer.end(based.duration) for layer in layers)
    stepping_bones = bones_that_only_step(shape, clip, plan) if level else ()
    project, names = limit_joints(project, shape.id, clip, plan, clips, stepping_bones)
    if level:
        project = stepped(project, shape.id, clip, based, plan)
        feet = standing_on_feet(clip) if posed and plan.travel else None
        project = keep_on_floor(project, shape.id, based, duration, not stepping, feet)
    if plan.pin:
        steps = step_sizes(shape, clip, based, plan)
        project = pin_all_feet(project, shape, steps, level, above=upright and not level, without=posed)
    theirs, ours = facings(clip, shape, plan)
    return RetargetedShape(project, shape.id, clip, plan, duration, ours, theirs, tuple(clips), names)
