"""A mapping found by itself, and a mapping put to work."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.mapping.anatomy import Anatomy, anatomy_of
from enliven.mapping.assignment import Drive, assigned, split
from enliven.mapping.facing import turned_level
from enliven.mapping.plan import ChainPlan, Mode, Plan, Rest
from enliven.mapping.resting import about_itself, at_moment, heading_of, posed, rebased
from enliven.motion.clip import Clip
from enliven.motion.layers import Layer
from enliven.motion.polyline import arc_of
from enliven.motion.retarget import bind_chain, branch, set_travel
from enliven.project import Project, unused
from enliven.rotation import IDENTITY, conjugate, from_rotation_vector, multiply, normalized, rotate, swing
from enliven.shape import Shape
from enliven.skeleton import Skeleton


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
    """

    project: Project
    shape_id: str
    clip: Clip
    plan: Plan
    duration: float
    model_facing: float
    take_facing: float


_NEAR = 0.17
"""Arc length within which two joints of chains count as the same."""
_OPPOSITE = -0.94
"""Cosine below which two ways count as opposite."""
_Chain = tuple[int, ...]
_Way = tuple[ChainPlan, _Chain, _Chain]
_ALIKE = np.radians(50.0)
"""How far the trunks of two bodies may point apart and the bodies still be posed alike."""


def source_anatomy(clip: Clip) -> Anatomy:
    """The parts of the performer, looking where they look in the first frame.

    At rest, or in the pose that the take moves about, whichever says more.
    """
    at_rest = anatomy_of(clip.skeleton)
    amid = anatomy_of(posed(clip.skeleton, about_itself(clip)))
    if len(amid.pairs) > len(at_rest.pairs):
        return amid
    heading = heading_of(clip.turns[0, 0])
    return replace(at_rest, facing=at_rest.facing + 2.0 * float(np.arctan2(heading[2], heading[0])))


def automatic(clip: Clip, shape: Shape) -> Plan:
    """The mapping of a whole body.

    Bodies of one build (as many pairs of legs and of arms, trunks that point one way) are posed alike; others
    keep their own rest pose and are moved from it.
    """
    source, target = source_anatomy(clip), anatomy_of(shape.skeleton)
    mode = _mode(clip.skeleton, source, shape.skeleton, target)
    chains = []
    for drive in assigned(source, target):
        for piece in _pieces(drive, clip.skeleton, shape.skeleton):
            chains.append(
                ChainPlan(
                    _named(clip.skeleton, piece.source),
                    _named(shape.skeleton, piece.target),
                    piece.role,
                    mode,
                )
            )
    return Plan(chains=tuple(chains))


def _mode(source: Skeleton, theirs: Anatomy, target: Skeleton, ours: Anatomy) -> Mode:
    same = len(theirs.legs) == len(ours.legs) and len(theirs.arms) == len(ours.arms) and bool(ours.pairs)
    a, b = _upright(source, theirs), _upright(target, ours)
    return "pose" if same and float(a @ b) > np.cos(_ALIKE) else "move"


def _upright(skeleton: Skeleton, anatomy: Anatomy) -> Float:
    """(3,) from the root to the end of the head, seen with the front at +Z; zero where there is none."""
    end = anatomy.head.chain[-1] if anatomy.head else anatomy.trunk[-1]
    way = turned_level(skeleton.positions[end] - skeleton.positions[0], -anatomy.facing)
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-9))


def _pieces(drive: Drive, source: Skeleton, target: Skeleton) -> list[Drive]:
    return split(drive, list(arc_of(source, drive.source)), list(arc_of(target, drive.target)), _NEAR)


def _named(skeleton: Skeleton, chain: tuple[int, ...]) -> tuple[str, ...]:
    """First and last, which is enough where the chain is the way between them."""
    return (skeleton.names[chain[0]], skeleton.names[chain[-1]])


def retargeted(shape: Shape, clip: Clip, plan: Plan | None = None) -> Retargeted:
    """A shape that moves by a take.

    Args:
        plan: None finds one.

    Raises:
        InputError: as :func:`apply_plan`, or where nothing of the shape can be driven.
    """
    plan = automatic(clip, shape) if plan is None else plan
    if not plan.chains:
        mend = "Write a mapping: --write-map gives one to begin with."
        raise InputError("no chain of the take suits a chain of the model", where="mapping", mend=mend)
    project, based = apply_plan(Project(), shape, clip, plan)
    ends = [layer.offset + based.duration / abs(layer.speed) for layer in project.layers.values()]
    theirs, ours = _facings(clip, shape, plan)
    return Retargeted(project, shape.id, clip, plan, max(ends), ours, theirs)


def apply_plan(project: Project, shape: Shape, clip: Clip, plan: Plan) -> tuple[Project, Clip]:
    """A project in which the shape moves by the take, as a mapping says; and the take against its rest pose.

    Raises:
        InputError: where the mapping names a joint that is not there, with those that are.
    """
    source, target = clip.skeleton, shape.skeleton
    ways = [
        (chain, _way(source, chain.source, "the take"), _target_way(target, chain)) for chain in plan.chains
    ]
    turn = _facing(clip, shape, plan)
    since = _rest(clip, plan.rest)
    for chain, mine, theirs in ways:
        if chain.mode == "pose":
            _pose_like(since, clip, mine, target, theirs, turn)
    based = replace(rebased(clip, since), id=unused(clip.id, project.takes))
    project = project.with_takes(based).with_shapes(shape)
    project = _bound_root(project, shape.id, based, plan, turn)
    for chain, mine, theirs in ways:
        basis = turn
        if chain.mode == "move" and len(mine) > 1 < len(theirs):
            whole = _whole(ways, mine, theirs)
            basis = _across(_way_of(based.skeleton, whole[0]), _way_of(target, whole[1]), turn)
        if chain.flip:
            basis = multiply(_half_turn(target, theirs), basis)
        project = bind_chain(
            project,
            shape.id,
            theirs,
            based.id,
            mine,
            basis=basis,
            layer_id=unused(f"{based.id}: {chain.role or chain.target[-1]}", project.layers),
            weight=chain.weight,
            offset=chain.offset,
            speed=chain.speed,
            loop=chain.loop,
            mirrored=chain.mirrored,
        )
    return project, based


def _rest(clip: Clip, rest: Rest | float) -> Float:
    """(N, 4) world turns of the pose that movement is counted from."""
    if rest == "zero":
        return np.tile(IDENTITY, (len(clip.skeleton), 1))
    if rest == "first":
        return at_moment(clip, 0.0).copy()
    if isinstance(rest, int | float):
        return at_moment(clip, float(rest)).copy()
    return about_itself(clip)


def _facing(clip: Clip, shape: Shape, plan: Plan) -> Float:
    """(4,) the turn about +Y that brings the performer's first heading to the model's."""
    theirs, ours = _facings(clip, shape, plan)
    return from_rotation_vector(np.array([0.0, ours - theirs, 0.0]))


def _facings(clip: Clip, shape: Shape, plan: Plan) -> tuple[float, float]:
    """Radians about +Y from +Z: where the performer looks at first, and the model."""
    first, ours = plan.take_facing, plan.model_facing
    theirs = source_anatomy(clip).facing if first is None else math.radians(first)
    return theirs, anatomy_of(shape.skeleton).facing if ours is None else math.radians(ours)


def _pose_like(
    since: Float, clip: Clip, chain: tuple[int, ...], target: Skeleton, ours: tuple[int, ...], turn: Float
) -> None:
    """Let the bones of a source chain rest as the target's do: ``since`` (N, 4) is changed.

    The take's own zero pose, turned to its heading, is bent by the least there is to point the same way, so
    twist about a bone stays as the performer has it.
    """
    heading = heading_of(clip.turns[0, 0])
    if len(chain) == 1:
        since[chain[0]] = heading
        return
    arc, ends = arc_of(clip.skeleton, chain), target.positions[list(ours)]
    at = np.stack([np.interp(arc, arc_of(target, ours), ends[:, k]) for k in range(3)], 1)
    ways = rotate(conjugate(turn), np.diff(at, axis=0))
    for joint, way in zip(chain[1:], ways, strict=True):
        bone = rotate(heading, clip.skeleton.vectors[joint])
        if np.linalg.norm(bone) > 1e-6 and np.linalg.norm(way) > 1e-6:
            bent = swing(bone / np.linalg.norm(bone), way / np.linalg.norm(way))
            since[joint] = multiply(bent, heading)
        else:
            since[joint] = heading


def _whole(ways: list[_Way], mine: _Chain, theirs: _Chain) -> tuple[tuple[int, int], tuple[int, int]]:
    """First and last joint, in take and model, of all chains of a limb that go on from one another.

    A limb that is driven in pieces is one limb: a thigh and a shin that point two ways at rest must not turn
    about two sets of axes.
    """
    role = next(chain.role for chain, a, b in ways if a == mine and b == theirs)
    alike = [(a, b) for chain, a, b in ways if chain.role == role and chain.mode == "move"]
    first, last = (mine, theirs), (mine, theirs)
    while role and (before := [p for p in alike if p[0][-1] == first[0][0] and p[1][-1] == first[1][0]]):
        first = before[0]
    while role and (after := [p for p in alike if p[0][0] == last[0][-1] and p[1][0] == last[1][-1]]):
        last = after[0]
    return (first[0][0], last[0][-1]), (first[1][0], last[1][-1])


def _way_of(skeleton: Skeleton, ends: tuple[int, int]) -> Float:
    return np.asarray(skeleton.positions[ends[1]] - skeleton.positions[ends[0]])


def _across(mine: Float, theirs: Float, turn: Float) -> Float:
    """(4,) target_from_source of a limb: its heading, then the least turn from one way (3,) to the other."""
    a, b = rotate(turn, mine), theirs
    lengths = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if min(lengths) < 1e-6:
        return turn
    a, b = a / lengths[0], b / lengths[1]
    if a @ b < _OPPOSITE:
        # Half a turn about the axis across the body keeps left and right, where any axis is as short.
        half = from_rotation_vector(np.pi * rotate(turn, np.array([1.0, 0.0, 0.0])))
        return multiply(swing(rotate(half, a), b), multiply(half, turn))
    return multiply(swing(a, b), turn)


def _half_turn(target: Skeleton, chain: tuple[int, ...]) -> Float:
    """(4,) half a turn about the first bone of a chain."""
    along = target.positions[chain[min(1, len(chain) - 1)]] - target.positions[chain[0]]
    return normalized(np.concatenate([[0.0], along]))


def _bound_root(project: Project, shape_id: str, clip: Clip, plan: Plan, turn: Float) -> Project:
    """The turn and the way of the whole, as far as they are wanted."""
    driven = {chain.target[-1] for chain in plan.chains if len(set(chain.target)) == 1}
    if not (plan.turn or plan.travel) or project.shape(shape_id).skeleton.names[0] in driven:
        return project
    name = unused(f"{clip.id}: whole", project.layers)
    if plan.turn:
        project = bind_chain(project, shape_id, (0,), clip.id, (0,), basis=turn, layer_id=name)
    else:
        project = project.with_layers(Layer(name, clip.id, (0,), turn))
    return set_travel(project, shape_id, name) if plan.travel else project


def _way(skeleton: Skeleton, names: tuple[str, ...], what: str) -> tuple[int, ...]:
    """The joints of a chain that is given by its ends, or in full."""
    if not names:
        raise InputError(f"a chain of {what} names no joint", where="mapping", mend=_known(skeleton))
    unknown = [name for name in names if name not in skeleton.names]
    if unknown:
        raise InputError(f"{what} has no joint {unknown[0]!r}", where="mapping", mend=_known(skeleton))
    joints = [skeleton.names.index(name) for name in names]
    way = [joints[0]]
    for joint in joints[1:]:
        way.extend(skeleton.path(way[-1], joint)[1:])
    return tuple(way)


def _target_way(skeleton: Skeleton, chain: ChainPlan) -> tuple[int, ...]:
    way = _way(skeleton, chain.target, "the model")
    return branch(skeleton, way[0], way[-1]) if chain.extend else way


def _known(skeleton: Skeleton) -> str:
    return f"Its joints are: {', '.join(skeleton.names)}."
