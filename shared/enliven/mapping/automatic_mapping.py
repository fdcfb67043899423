"""A mapping found automatically, and a shape that moves by it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, ContactSettings, Project, Shape, Skeleton
from enliven.errors import InputError
from enliven.formats.rig import playing
from enliven.mapping.anatomy import Anatomy, SkeletonLimb, anatomy_of, begins_tip
from enliven.mapping.applying import apply_plan, facings, source_anatomy
from enliven.mapping.assignment import Drive, assigned, matching_joints, split
from enliven.mapping.facing import turned_about_y
from enliven.mapping.gait import (
    bones_that_only_step,
    leg_of,
    legs_that_step,
    on_feet,
    posed_legs_that_step,
    step_scale,
    step_sizes,
)
from enliven.mapping.ground import kept_on_floor, stands
from enliven.mapping.human_names import finger_joints
from enliven.mapping.joint_limits import limited
from enliven.mapping.model_clips import is_own_take
from enliven.mapping.plan import ChainPlan, Mode, Plan
from enliven.mapping.resting import mean_turn
from enliven.mapping.steps import stepped
from enliven.motion.contact import pin_feet
from enliven.motion.layers import arc_of, set_travel
from enliven.rotation import conjugate, multiply


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A shape that moves by a take.

    Attributes:
        project: with the shape, the take against its new rest pose, and the layers between them.
        shape_id: of the shape.
        clip: the take as it was given.
        plan: the mapping that was used.
        duration: seconds from the start to the end of the last chain's movement.
        model_facing, take_facing: radians about +Y from +Z, of the model and of the performer's first frame.
        clips: the model's own, which its joint limits were taken from.
        limited: the joints that were beyond their limits, by name.
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


_ALIKE = np.radians(50.0)
"""How far the trunks of two bodies may point apart and the bodies still be posed alike."""
_TWINS = 0.02
"""Share of the size by which joints of twins are apart at most."""
_BENDS = np.radians(5.0)
"""Radians that a finger turns from its mean at least, to count as moving."""
_STANDS = np.radians(45.0)
"""Radians from the vertical to the line from root to head within which a body counts as upright."""


def automatic(clip: Clip, shape: Shape) -> Plan:
    """The mapping of a whole body.

    Upright bodies of one build (as many pairs of legs and of arms) are posed alike; others keep their own
    rest pose and are moved from it.
    """
    source, target = source_anatomy(clip), anatomy_of(shape.skeleton)
    mode = _mode(clip.skeleton, source, shape.skeleton, target)
    twins = _twins(clip.skeleton, shape.skeleton)
    level = mode == "move" and len(target.legs) > 1
    chains = _whole(clip.skeleton, source, shape.skeleton, mode, level)
    drives = assigned(source, target)
    for drive in drives:
        # Where a shoulder or a hip sits is the model's own affair: pointed like the performer's, it would
        # come off the trunk. So is how a hand or a foot sits.
        own = not twins and drive.role.endswith((" girdle", " end"))
        for piece in _pieces(drive, drives, clip.skeleton, shape.skeleton):
            moved = own or (not twins and _is_end(piece, drive, target, shape.skeleton))
            chains.append(
                ChainPlan(
                    _named(clip.skeleton, piece.source),
                    _named(shape.skeleton, piece.target),
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
    """The chains of the fingers that move in a take and have names on both sides; others follow the hand."""
    made, source = list[ChainPlan](), clip.skeleton
    for side, by, limb in _named_arms(theirs, ours):
        wrist, hand = by.main[-1], finger_joints(target, limb.main[-1])
        for finger, chain in finger_joints(source, wrist).items():
            if finger not in hand or not _bends(clip, chain):
                continue
            pairs = zip(pairwise(chain), pairwise(hand[finger]), strict=False)
            for number, (mine, other) in enumerate(pairs):
                # The first link of a finger lies in the palm, which sits in the model's own way.
                how: Mode = "pose" if number else "move"
                names = _named(source, mine), _named(target, other)
                made.append(ChainPlan(*names, f"{side} {finger}", how))
    return made


def _named_arms(theirs: Anatomy, ours: Anatomy) -> Iterator[tuple[str, SkeletonLimb, SkeletonLimb]]:
    """Yields the side and the arms, of take and model, of each side if both are known by name."""
    for by, pair in zip(theirs.arms[:1], ours.arms[:1], strict=False):
        for side, arm, limb in zip(("left", "right"), by, pair, strict=True):
            if arm.knots and limb.knots:
                yield side, arm, limb


def _bends(clip: Clip, finger: Sequence[int]) -> bool:
    """Whether a finger moves against its hand; many takes have fingers that never do."""
    if len(finger) < 3:
        return False
    local = multiply(conjugate(clip.turns[:, finger[1]]), clip.turns[:, finger[2]])
    apart = np.abs(np.sum(local * mean_turn(local), axis=1)).min()
    return bool(2.0 * np.arccos(min(float(apart), 1.0)) > _BENDS)


def idle_limbs(clip: Clip, plan: Plan) -> tuple[str, ...]:
    """The performer's arms and legs that drive nothing, such as "left arm"."""
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


def _whole(source: Skeleton, theirs: Anatomy, target: Skeleton, mode: Mode, level: bool) -> list[ChainPlan]:
    """The chain that turns the whole body: the performer's pelvis.

    A walker's pelvis and chest turn to and fro against one another; between them is where the body goes. What
    is of another build, with its trunk level, would swing it about with the pelvis alone: it takes half of
    the turn from pelvis to chest as well. What stands on four legs and more heads there and stays level.
    """
    root, hips = (target.names[0],), (source.names[0],)
    chains = [ChainPlan(hips, root, "whole", mode)]
    if mode == "move" and len(theirs.trunk) > 1 and not level:
        chains.append(ChainPlan(_named(source, theirs.trunk), root, "whole, towards the chest", weight=0.5))
    return chains


def _mode(source: Skeleton, theirs: Anatomy, target: Skeleton, ours: Anatomy) -> Mode:
    same = len(theirs.legs) == len(ours.legs) and len(theirs.arms) == len(ours.arms) and bool(ours.pairs)
    a, b = _upright(source, theirs), _upright(target, ours)
    # People stand alike. Two that go on all fours differ in where their spines begin and how they slope: to
    # point one's bones as the other's do would crush it, unless they are twins.
    alike = min(a[1], b[1]) > np.cos(_STANDS) or _twins(source, target)
    return "pose" if same and alike and float(a @ b) > np.cos(_ALIKE) else "move"


def _twins(source: Skeleton, target: Skeleton) -> bool:
    """Whether two skeletons are one but for their size, place and heading."""
    if source.names != target.names or (source.parents != target.parents).any():
        return False
    a, b = (np.linalg.norm(s.positions[:, None] - s.positions, axis=2) for s in (source, target))
    a, b = (apart / max(float(apart.max()), 1e-9) for apart in (a, b))
    return bool(np.abs(a - b).max() < _TWINS)


def _upright(skeleton: Skeleton, anatomy: Anatomy) -> Float:
    """(3,) from the root to the end of the head, seen with the front at +Z; zero where there is none."""
    end = anatomy.head.chain[-1] if anatomy.head else anatomy.trunk[-1]
    way = turned_about_y(skeleton.positions[end] - skeleton.positions[0], -anatomy.facing)
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-9))


def with_feet_pinned(
    project: Project,
    shape: Shape,
    steps: Mapping[SkeletonLimb, float] | None = None,
    level: bool = False,
    above: bool = False,
    without: Collection[SkeletonLimb] = (),
) -> Project:
    """The project with the last joint but one of every leg, where its foot begins, held while it stands.

    Legs that step reach the floor already: the body does not come down for them.

    Args:
        steps: the legs that step, and metres that tell how large their steps are: a foot counts as lifted,
            or on its way, in this measure and not in its leg's length. See :func:`step_sizes`.
        level: the shape is kept on the floor. Feet keep their height and are held in their place along the
            floor only: an ankle sinks as its foot rolls, and a foot that were held above would be off it.
        above: feet that would go below the floor are brought up to it.
        without: legs that are not held by their feet.
    """
    steps, usual = steps or {}, ContactSettings(sink=float(level), above=above)
    for limb in (limb for pair in anatomy_of(shape.skeleton).legs for limb in pair if limb not in without):
        leg = leg_of(limb)
        if len(leg) > 2:
            how = _short_steps(usual, shape.skeleton, leg, steps[limb]) if limb in steps else usual
            project = pin_feet(project, shape.id, [leg[-1]], start=leg[0], settings=how)
    return project


def _short_steps(
    usual: ContactSettings, skeleton: Skeleton, leg: Sequence[int], size: float
) -> ContactSettings:
    """When a foot stands that steps as a leg of ``size`` metres does; the body does not come down for it."""
    share = min(1.0, size / float(skeleton.lengths[list(leg[1:])].sum()))
    return replace(usual, drop=0.0, height=share * usual.height, speed=share * usual.speed)


def _pieces(drive: Drive, drives: list[Drive], source: Skeleton, target: Skeleton) -> list[Drive]:
    """A limb cut where its joints correspond, on both sides at the same ones; a spine stays whole."""
    if "trunk" in drive.role or (drive.role == "head" and not drive.knots):
        return [drive]
    there = {"left": "right", "right": "left"}.get(drive.role.split()[0], "")
    role = " ".join([there, *drive.role.split()[1:]])
    pair = [drive, *(one for one in drives if one.role == role)]
    arcs = [(arc_of(source, one.source), arc_of(target, one.target)) for one in pair]
    if any(len(a) != len(arcs[0][0]) or len(b) != len(arcs[0][1]) for a, b in arcs):
        arcs = arcs[:1]
    mine, theirs = (np.mean(side, axis=0).tolist() for side in zip(*arcs, strict=True))
    pieces = split(drive, matching_joints(drive, mine, theirs))
    if not drive.knots or drive.role == "head":
        return pieces
    # A segment of several bones (Rigify splits them for their twist) is straight: its first bone turns it.
    return [replace(piece, target=piece.target[:2]) for piece in pieces]


def _is_end(piece: Drive, drive: Drive, body: Anatomy, target: Skeleton) -> bool:
    """Whether a piece of a limb is its hand or foot, in a limb that has none of its own."""
    limb = next((limb for pair in body.pairs for limb in pair if limb.main == drive.target), None)
    return limb is not None and begins_tip(target, limb, piece.target[0])


def _named(skeleton: Skeleton, chain: tuple[int, ...]) -> tuple[str, ...]:
    """First and last, which is enough where the chain is the way between them."""
    return (skeleton.names[chain[0]], skeleton.names[chain[-1]])


def play_own_take(shape: Shape, clip: Clip, project: Project | None = None) -> Retargeted:
    """A shape that plays a take of its own, joint by joint and wherever the take goes.

    Args:
        project: where the shape is; None for one of its own.

    Raises:
        InputError: if the take was made for another skeleton; see :func:`is_own_take`.
    """
    if not is_own_take(clip, shape):
        raise InputError("it is of another skeleton", where=f"clip {clip.id!r}", mend="Retarget it.")
    plan = replace(automatic(clip, shape), travel=True, floor=False)
    played, _ = playing(project or Project(), shape, clip)
    theirs, ours = facings(clip, shape, plan)
    return Retargeted(played, shape.id, clip, plan, clip.duration, ours, theirs)


def retarget(
    shape: Shape,
    clip: Clip,
    plan: Plan | None = None,
    project: Project | None = None,
    clips: Sequence[Clip] = (),
) -> Retargeted:
    """A shape that moves by a take.

    Args:
        plan: None finds one.
        project: where the shape is, with what moves it already; None for one of its own.
        clips: the model's own, which show how far its joints go.

    Raises:
        InputError: as :func:`apply_plan`, or where nothing of the shape can be driven.
    """
    plan = automatic(clip, shape) if plan is None else plan
    if not plan.chains:
        mend = "Write a mapping: --write-map gives one to begin with."
        raise InputError("no chain of the take suits a chain of the model", where="mapping", mend=mend)
    stepping, posed = legs_that_step(shape, clip, plan), posed_legs_that_step(shape, clip, plan)
    # A body with the performer's skeleton moves exactly as the take does, unless its feet are to be planted.
    itself = plan.travel and not posed and _twins(clip.skeleton, shape.skeleton)
    upright = stands(shape) and not itself
    level = plan.floor and upright
    project, based = apply_plan(project or Project(), shape, clip, plan)
    if posed and plan.travel:
        scale = step_scale(shape, clip, based, plan)
        project = set_travel(project, shape.id, project.shape(shape.id).travel, scale)
    # What begins again at its end has none of its own: it plays as long as the take.
    layers = [replace(layer, speed=1.0) if layer.loop else layer for layer in project.shape(shape.id).layers]
    duration = max(layer.end(based.duration) for layer in layers)
    stepping_bones = bones_that_only_step(shape, clip, plan) if level else ()
    project, names = limited(project, shape.id, clip, plan, clips, stepping_bones)
    if level:
        project = stepped(project, shape.id, clip, based, plan)
        feet = on_feet(clip) if posed and plan.travel else None
        project = kept_on_floor(project, shape.id, based, duration, not stepping, feet)
    if plan.pin:
        steps = step_sizes(shape, clip, based, plan)
        project = with_feet_pinned(project, shape, steps, level, above=upright and not level, without=posed)
    theirs, ours = facings(clip, shape, plan)
    return Retargeted(project, shape.id, clip, plan, duration, ours, theirs, tuple(clips), names)
