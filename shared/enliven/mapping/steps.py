"""Steps: the feet of a model go where the performer's feet go, in the model's own size.

stepped(project, shape_id, clip, based, plan)      # its legs bend so; a take of their own plays them

A leg of another build that is swung by a performer's angles neither reaches the floor nor stays on it. So its
foot goes where the performer's foot goes, relative to their hips: it stands while theirs stands. An animal
with more legs than the performer takes theirs again, each pair in turn with the one behind it. A foreleg that
the performer's arm drives steps while they walk with hanging arms, and follows the arm otherwise.

The legs of a person are posed as the performer's. With ``pin`` their feet step too: each leg keeps its pose,
and bends by as much as its foot needs to be where the performer's is. So feet stand still at any proportions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Project, Shape, Skeleton, joint_places, unused
from enliven.mapping.anatomy import Anatomy, Pair, SkeletonLimb, anatomy_of
from enliven.mapping.applying import facings, source_anatomy
from enliven.mapping.facing import turned_about_y
from enliven.mapping.ground import along_way, floor_of, moments_of, standing_on_feet
from enliven.mapping.plan import Mode, Plan
from enliven.mapping.planting import PosedLeg, Sole, Spans, clearance_of, planted, standing_spans, unspun
from enliven.mapping.resting import first_heading, heading_of
from enliven.motion.contact import bend_of, pin_limb
from enliven.motion.layers import Player, bind_chain, clear_chain, travel_scale
from enliven.rotation import IDENTITY, conjugate, from_rotation_vector, multiply, rotate, slerp

_RATE = 60.0
"""Moments a second at most at which steps are made: the rate of common displays."""
_RAISED = 0.0
"""Share of the arm's length that a hand is below the shoulder at most while the arm is raised."""
_HANGS = 0.4
"""Share of the arm's length that a hand is below the shoulder at least while the arm hangs."""
_SHUFFLE = 0.1
"""Lengths of a leg a second at which a performer's feet pass one another at most while they stand."""
_WALKS = 0.4
"""Lengths of a leg a second at which a performer's feet pass one another at least while they walk."""
_SMOOTH = 0.3
"""Seconds over which a foreleg goes from the performer's arm to the steps."""
_STRIDE = 1.0
"""Seconds of a stride: where a body heads is the mean over one."""
_FOOT = 0.15
"""Share of the performer's height within which a joint of a leg is part of the foot."""
_STANDING = 25.0
"""Per cent of a take in which a foot stands at least: the joint of it that is slowest then is its place."""
_TILT = np.radians(30.0)
"""Radians that a foot turns up or down at most so that it does not scuff: an ankle has 20 up and 50 down."""
_TRIED = 7
"""Angles from none to that which are tried."""
_POINTS = 0.1
"""Share of a foot's length that its toes lie ahead of the ankle at least, so that it can turn up and down."""
_STRETCHED = 0.99
"""Share of its length that a leg is stretched to at most beyond its pose: a knee that locks jerks."""
_LOWERED = 0.15
"""Share of a leg's length that the body comes down by at most, to reach where feet stand."""
_EASING = 0.05
"""Seconds over which the body comes down before a foot that it would not reach."""
_LIFTS = 3
"""Times that a foreleg below the floor is bent at most: its lowest point changes as it bends."""
_LOWEST = 5.0
"""Per cent of a take in which a foot is as low as when it stands."""


@dataclass(frozen=True, eq=False)
class _Step:
    """One leg of the model.

    Attributes:
        limb: the model's.
        by: the performer's leg that it goes with.
        arm: the performer's arm that it obeys while they stand or raise it, or None.
        posed: it keeps the performer's pose, as nearly as its foot allows.
        leg: the joints of the limb down to where its foot begins.
        by_leg: the same of the performer's.
    """

    limb: SkeletonLimb
    by: SkeletonLimb
    arm: SkeletonLimb | None
    posed: bool
    leg: tuple[int, ...]
    by_leg: tuple[int, ...]

    @property
    def toes(self) -> tuple[int, ...]:
        """The joints of the limb beyond its ankle."""
        return self.limb.proper[len(self.leg) :]

    @property
    def by_toes(self) -> tuple[int, ...]:
        """The same of the performer's."""
        return self.by.proper[len(self.by_leg) :]


def stepped(project: Project, shape_id: str, clip: Clip, based: Clip, plan: Plan) -> Project:
    """A project in which the legs of a shape step as the performer's do: see the module.

    Args:
        clip: the take as it was given.
        based: the same against the rest pose that the shape moves by.
    """
    shape = project.shape(shape_id)
    steps, duration = _steps(shape, clip, plan), clip.duration
    if not steps or duration <= 0.0:
        return project
    posed = any(step.posed for step in steps)
    times = moments_of(duration, max(_RATE, 1.0 / clip.step) if posed else min(_RATE, 1.0 / clip.step))
    turns, joints = Player(project, shape_id).sample(times)
    performer = _Performer(shape, clip, based, plan, times, step_scale(shape, clip, based, plan))
    chosen = [step for step in steps if step.posed]
    if chosen:
        offsets = _planted(shape, chosen, performer, turns, joints)
        project = along_way(project, shape_id, clip.id, joints[:, 0].copy(), times[1])
        for step, offset in zip(chosen, offsets, strict=True):
            goals = joints[:, step.leg[-1]] + offset
            _bend(shape.skeleton, step, performer, goals, turns, joints)
    for step in steps:
        if not step.posed:
            goals = _goals(shape, step, performer, turns, joints)
            _bend(shape.skeleton, step, performer, goals, turns, joints)
    _lift_forelegs(shape, clip, steps, performer, times, turns, joints)
    take = Clip(unused(f"{clip.id}: steps", project.takes), shape.skeleton, turns, joints[:, 0], times[1])
    project = project.with_takes(take)
    chains = [chain for step in steps for chain in _played(shape.skeleton, step)]
    for chain in chains:
        project = clear_chain(project, shape_id, chain)
        name = unused(f"{take.id} of {shape.skeleton.names[chain[-1]]}", project.layer_names)
        project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY, layer_id=name)
    moved = project.shape(shape_id)
    spans = list(moved.spans)
    for bone, other in _carried_along(shape, chains):
        spans[other] = spans[bone]
    return project.with_characters(moved.with_changes(spans=tuple(spans)))


def _carried_along(shape: Shape, chains: Sequence[Sequence[int]]) -> Iterator[tuple[int, int]]:
    """Yields (bone of a chain, other bone) for others that move as the first does, such as twist bones."""
    driven = {bone for chain in chains for bone in chain}
    for bone in (bone for chain in chains for bone in chain[1:]):
        for other in shape.skeleton.children[int(shape.skeleton.parents[bone])]:
            moves = any(span.refs for span in shape.spans[other])
            if other not in driven and moves and shape.spans[other] == shape.spans[bone]:
                yield bone, other


def legs_that_step(shape: Shape, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """The legs of a shape that step as the performer's feet do, and are not swung by their angles."""
    return tuple(step.limb for step in _steps(shape, clip, plan))


def posed_legs_that_step(shape: Shape, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """Those of them that keep the performer's pose as well."""
    return tuple(step.limb for step in _steps(shape, clip, plan) if step.posed)


def bones_that_only_step(shape: Shape, clip: Clip, plan: Plan) -> set[int]:
    """The bones of the legs that step and never obey an arm."""
    return {bone for step in _steps(shape, clip, plan) if step.arm is None for bone in step.limb.proper[1:]}


def _leg_length(skeleton: Skeleton, leg: Sequence[int]) -> float:
    """Metres along a leg."""
    return max(float(skeleton.lengths[list(leg[1:])].sum()), 1e-9)


def step_sizes(shape: Shape, clip: Clip, based: Clip, plan: Plan) -> dict[SkeletonLimb, float]:
    """The legs that step, and metres of a performer's leg in the size of the model's steps.

    A model with long legs that takes short steps lifts its feet by little of their length.
    """
    scale = step_scale(shape, clip, based, plan)
    return {step.limb: scale * _length(clip.skeleton, step.by) for step in _steps(shape, clip, plan)}


def step_scale(shape: Shape, clip: Clip, based: Clip, plan: Plan) -> float:
    """Metres that a foot of a shape goes for one of the performer's.

    For posed legs it is the ratio of their lengths, which leaves them the performer's angles.
    """
    posed = [step for step in _steps(shape, clip, plan) if step.posed]
    ours = sum(_leg_length(shape.skeleton, step.leg) for step in posed)
    theirs = sum(_leg_length(clip.skeleton, step.by_leg) for step in posed)
    return plan.stride * (
        ours / theirs if posed else travel_scale(shape.with_changes(travel_scale=None), based)
    )


def _length(skeleton: Skeleton, limb: SkeletonLimb) -> float:
    """Metres of a limb without its girdle."""
    return max(float(skeleton.lengths[list(limb.proper[1:])].sum()), 1e-9)


def _steps(shape: Shape, clip: Clip, plan: Plan) -> list[_Step]:
    ours, theirs = anatomy_of(shape.skeleton), source_anatomy(clip)
    if not (plan.steps and plan.floor and theirs.legs) or (shape.modeling != IDENTITY).any():
        return []
    driven, made = _driven(shape.skeleton, plan, "move"), list[_Step]()
    posed = _driven(shape.skeleton, plan, "pose") if plan.pin and plan.travel else set[int]()
    for number, pair in enumerate(reversed(ours.legs)):
        fore = 0 < number == len(ours.legs) - 1 >= len(theirs.legs) and theirs.arms
        arms = theirs.arms[0] if fore else (None, None)
        for limb, by, arm in zip(pair, _legs_of(theirs, number), arms, strict=True):
            leg, bones = _posed_leg(limb, posed), set(leg_of(limb)[1:])
            if len(leg) > 2:
                made.append(_Step(limb, by, arm, True, leg, _performed_leg(shape, clip, plan, leg, by)))
            elif len(bones) > 1 and bones <= driven:
                made.append(_Step(limb, by, arm, False, leg_of(limb), leg_of(by)))
    return made


def _posed_leg(limb: SkeletonLimb, posed: Collection[int]) -> tuple[int, ...]:
    """The joints of a leg down to its ankle, or to the last before it that is posed as the performer's."""
    leg = limb.proper[:1]
    for joint in leg_of(limb)[1:]:
        if joint not in posed:
            break
        leg = (*leg, joint)
    return leg


def _performed_leg(
    shape: Shape, clip: Clip, plan: Plan, leg: tuple[int, ...], by: SkeletonLimb
) -> tuple[int, ...]:
    """The joints of the performer's leg down to the one that drives the end of a posed leg."""
    end = shape.skeleton.names[leg[-1]]
    ankles = [chain.source[-1] for chain in plan.chains if chain.target[-1] == end and chain.mode == "pose"]
    joints = [clip.skeleton.index(name) for name in ankles if name in clip.skeleton.names]
    last = next((by.proper.index(joint) for joint in joints if joint in by.proper), len(leg_of(by)) - 1)
    # A limb without names may be driven by all of the leg, down to the toes: it ends at the ankle.
    height = clip.skeleton.positions[:, 1]
    low = height[list(by.proper)] < height.min() + _FOOT * np.ptp(height)
    ankle = int(np.argmax(low)) if low.any() else last
    return by.proper[: max(min(last, ankle), 2) + 1]


def _driven(skeleton: Skeleton, plan: Plan, mode: Mode) -> set[int]:
    """The bones that chains of a mode move at the take's own pace."""
    found = set[int]()
    for chain in plan.chains:
        plain = (chain.mode, chain.offset, chain.speed) == (mode, 0.0, 1.0)
        plain = plain and not (chain.loop or chain.flip)
        ends = [skeleton.names.index(name) for name in chain.target if name in skeleton.names]
        if plain and ends and chain.weight > 0.0:
            found |= set(skeleton.path(ends[0], ends[-1])[1:])
    return found


def _legs_of(theirs: Anatomy, number: int) -> Pair:
    """The performer's legs for a pair of the model's, counted from behind."""
    own = len(theirs.legs)
    if number < own:
        return theirs.legs[own - 1 - number]
    left, right = theirs.legs[0]
    return (right, left) if (number - own) % 2 == 0 else (left, right)


def leg_of(limb: SkeletonLimb) -> tuple[int, ...]:
    """The joints of a leg down to where its foot begins."""
    if limb.knots:
        return limb.main
    return limb.proper[:-1] if len(limb.proper) > 3 else limb.proper


def _played(skeleton: Skeleton, step: _Step) -> list[tuple[int, ...]]:
    """The chains that hold the turns of a leg: itself, and each other toe that begins at its foot."""
    foot, proper = step.leg[-1], step.limb.proper
    return [proper, *((foot, toe) for toe in skeleton.children[foot] if toe not in proper)]


class _Performer:
    """A performer at the times of the model, in the model's axes.

    Attributes:
        skeleton: at rest.
        posed: (N, 3) metres from the root to the joints, in the pose in which bones point as the model's.
        beside: (T, N, 3) metres from the root to the joints; without the turning of the whole where the model
            does not turn.
        tall: (T,) metres from the root to the floor that they stood on.
        scale: the model's metres over the floor for one of theirs.
        step: seconds between two times.
    """

    def __init__(self, shape: Shape, clip: Clip, based: Clip, plan: Plan, times: Float, scale: float) -> None:
        theirs, ours = facings(clip, shape, plan)
        rest = based.skeleton.positions
        self.posed = turned_about_y(rest - rest[0], ours - theirs)
        self._legs = source_anatomy(clip).legs[0]
        self.rest = plan.rest
        self.skeleton, self.step, self.scale = clip.skeleton, float(times[1]), scale
        places, number = joint_places(clip), np.arange(len(clip.turns)) * clip.step
        low = np.percentile(places[..., 1].min(1), _LOWEST)
        beside = places - clip.root[:, None]
        if not plan.turn:
            back = multiply(first_heading(clip), conjugate(heading_of(clip.turns[:, 0])))
            beside = rotate(back[:, None], beside)
        below = np.clip(np.searchsorted(number, times, side="right") - 1, 0, max(len(number) - 2, 0))
        part = np.clip(times / clip.step - below, 0.0, 1.0)[:, None, None]
        between = (1.0 - part) * beside[below] + part * beside[np.minimum(below + 1, len(beside) - 1)]
        self.beside = turned_about_y(between, ours - theirs)
        self.tall = np.interp(times, number, clip.root[:, 1]) - low

    def floor(self, shape: Shape, root: Float) -> Float:
        """(T,) metres: the height of the floor under a posed shape with its root at heights ``root``."""
        standing = shape.skeleton.positions[0, 1] + shape.place[1] - floor_of(shape)
        return np.asarray(root - standing - self.scale * (self.tall + self.posed[:, 1].min()))

    def foot(self, leg: SkeletonLimb) -> int:
        """The joint of a leg's foot that stands stillest while it stands."""
        height = self.skeleton.positions[:, 1]
        parts = [j for j in leg.chain if height[j] < height.min() + _FOOT * np.ptp(height)] or [leg.chain[-1]]
        still = np.abs(np.diff(self.beside[:, parts, 1] + self.tall[:, None], axis=0))
        return parts[int(np.percentile(still, 100.0 - _STANDING, axis=0).argmin())]

    def home(self, foot: int, heading: Float) -> Float:
        """(3,) metres from the root to where a foot stands, seen as the body heads (T, 4).

        That is in the pose that movement is counted from, or the middle of where it goes.
        """
        beside = rotate(conjugate(heading), self.beside[:, foot])
        if self.rest == "first" or isinstance(self.rest, int | float):
            seconds = 0.0 if self.rest == "first" else float(self.rest)
            return np.asarray(beside[int(np.clip(round(seconds / self.step), 0, len(beside) - 1))])
        home = np.median(beside, axis=0)
        home[1] = np.percentile(beside[:, 1] + self.tall, _LOWEST) - np.median(self.tall)
        return np.asarray(home)

    def walks(self, arm: SkeletonLimb) -> Float:
        """(T,) 1 while the performer walks and an arm hangs, 0 while they stand or raise it, smoothly."""
        below = (self.beside[:, arm.proper[0], 1] - self.beside[:, arm.proper[-1], 1]) / _length(
            self.skeleton, arm
        )
        left, right = (self.beside[:, self.foot(leg)] for leg in self._legs)
        passing = np.linalg.norm(np.gradient(left - right, self.step, axis=0), axis=1)
        passing /= _length(self.skeleton, self._legs[0])
        passing = scipy.ndimage.maximum_filter1d(passing, max(round(_STRIDE / self.step), 1), mode="nearest")
        hangs = np.clip((below - _RAISED) / (_HANGS - _RAISED), 0.0, 1.0)
        share = hangs * np.clip((passing - _SHUFFLE) / (_WALKS - _SHUFFLE), 0.0, 1.0)
        wide = max(round(_SMOOTH / self.step), 1)
        return np.asarray(scipy.ndimage.uniform_filter1d(share, wide, mode="nearest"))


def _planted(
    shape: Shape, steps: Sequence[_Step], performer: _Performer, turns: Float, joints: Float
) -> list[Float]:
    """Lets the body of posed legs go where their feet stand still; changes joints (T, N, 3) in place.

    Returns:
        For each leg, (T, 3) metres that its foot is to be moved by then.
    """
    root, floor = joints[:, 0].copy(), floor_of(shape)
    # Where no foot ever stands, the floor of the performer is the floor.
    way = root.copy()
    way[:, 1] += floor - np.median(performer.floor(shape, root[:, 1]))
    soles = [_sole(shape, step) for step in steps]
    posed = partial(_leg_in_pose, shape.skeleton, performer=performer, root=root, turns=turns, joints=joints)
    for step, sole in zip(steps, soles, strict=True):
        _hold_heading(shape.skeleton, step, sole, performer, root, turns, joints)
    legs = [posed(step, sole) for step, sole in zip(steps, soles, strict=True)]
    _, offsets = planted(legs, way, performer.step, floor)
    for step, sole, offset in zip(steps, soles, offsets, strict=True):
        _tilt_foot(shape.skeleton, step, sole, offset[:, 1], performer.step, turns, joints)
    legs = [posed(step, sole) for step, sole in zip(steps, soles, strict=True)]
    way, offsets = planted(legs, way, performer.step, floor)
    joints += (way - root)[:, None]
    goals = [joints[:, step.leg[-1]] + offset for step, offset in zip(steps, offsets, strict=True)]
    drops = [_out_of_reach(shape.skeleton, step, at, joints) for step, at in zip(steps, goals, strict=True)]
    # The body comes down to feet that it would not reach, and what swings stays where it was.
    down = _evenly(np.max(drops, axis=0), performer.step)[:, None] * [0.0, 1.0, 0.0]
    joints -= down[:, None]
    return [offset + down for offset in offsets]


def _sole(shape: Shape, step: _Step) -> Sole:
    """The part of a leg that may touch the floor: of a model without feet the end of its shin."""
    return Sole(shape, sorted(_below(shape.skeleton, step.leg[-1])) or [step.leg[-1]])


def _leg_in_pose(
    skeleton: Skeleton,
    step: _Step,
    sole: Sole,
    performer: _Performer,
    root: Float,
    turns: Float,
    joints: Float,
) -> PosedLeg:
    """A leg in the performer's pose, over time, with the root of the body at ``root`` (T, 3)."""
    length, spans = _leg_length(skeleton, step.leg), _spans(skeleton, step, performer, root)
    heights = performer.beside[:, list(step.by.proper[len(step.by_leg) - 1 :]), 1] + performer.tall[:, None]
    clear = performer.scale * clearance_of(heights, spans)
    return PosedLeg(*sole.rolling(turns, joints - root[:, None], length), clear, length, spans)


def _spans(skeleton: Skeleton, step: _Step, performer: _Performer, root: Float) -> Spans:
    """Returns when the performer's foot of a step stands, for a root of the body at (T, 3) metres."""
    # A model without feet has left the floor when the performer's ball has: it has no toes to stay on.
    ball, *tip = step.by_toes or step.by.chain[-1:]
    rolls_on = [step.by_leg[-1], ball, *tip] if step.toes else [ball]
    foot = root[:, None] + performer.scale * performer.beside[:, rolls_on]
    return standing_spans(foot, root, performer.step, _leg_length(skeleton, step.leg))


def _hold_heading(
    skeleton: Skeleton,
    step: _Step,
    sole: Sole,
    performer: _Performer,
    root: Float,
    turns: Float,
    joints: Float,
) -> None:
    """Keeps a foot from spinning about the vertical while it stands; changes turns and joints in place."""
    if not step.toes:
        return
    ankle, length = step.leg[-1], _leg_length(skeleton, step.leg)
    spin = sole.spin(turns, joints, length)
    back = unspun(spin, _spans(skeleton, step, performer, root), performer.step)
    _turn_foot(skeleton, ankle, from_rotation_vector(back[:, None] * [0.0, 1.0, 0.0]), turns, joints)


def _turn_foot(skeleton: Skeleton, ankle: int, turning: Float, turns: Float, joints: Float) -> None:
    """Turns all that hangs on an ankle about it by (T, 4); changes turns and joints in place."""
    for j in sorted(_below(skeleton, ankle)):
        turns[:, j] = multiply(turning, turns[:, j])
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])


def _tilt_foot(
    skeleton: Skeleton, step: _Step, sole: Sole, lift: Float, pace: float, turns: Float, joints: Float
) -> None:
    """Turns a foot about its ankle so that its toes or its heel rise by ``lift`` (T,) metres, if they can.

    Changes turns (T, N, 4) and joints (T, N, 3) in place. The leg bends by the rest.

    Args:
        pace: seconds between two moments.
    """
    ankle, low = step.leg[-1], np.flatnonzero(lift > 0.0)
    ahead = skeleton.positions[step.limb.proper[-1]] - skeleton.positions[ankle]
    across = np.cross(ahead, [0.0, 1.0, 0.0])
    if not (len(low) and np.linalg.norm(across) > _POINTS * np.linalg.norm(ahead)):
        return
    axes = rotate(turns[:, step.toes[0]], across / np.linalg.norm(across))
    # Of a foot that points down the toes are lowest and rise as it turns up, and of another the heel.
    up = np.where(rotate(turns[:, step.toes[0]], ahead)[:, 1] < ahead[1], 1.0, -1.0)
    tried, angles = np.linspace(0.0, _TILT, _TRIED), np.zeros(len(turns))
    risen = np.stack(
        [
            sole.lowest_turned(turns[low], joints[low], from_rotation_vector((a * up * axes.T).T[low]), ankle)
            for a in tried
        ]
    )
    risen -= risen[0].copy()
    # The first angle that is enough, or the best.
    enough = risen >= np.minimum(lift[low], risen.max(0))
    angles[low] = tried[enough.argmax(0)] * up[low]
    angles = scipy.ndimage.uniform_filter1d(angles, 2 * max(round(_EASING / pace), 1) + 1, mode="nearest")
    _turn_foot(skeleton, ankle, from_rotation_vector(angles[:, None] * axes), turns, joints)


def _goals(shape: Shape, step: _Step, performer: _Performer, turns: Float, joints: Float) -> Float:
    """(T, 3) metres where the end of a leg is to be; turns (T, N, 4) and joints (T, N, 3) are the model's."""
    skeleton, ankle, foot = shape.skeleton, step.leg[-1], performer.foot(step.by)
    heading, scale = heading_of(turns[:, 0]), performer.scale
    home = performer.home(foot, heading)
    rest = skeleton.positions[ankle] - skeleton.positions[0]
    even = _even(heading, round(_STRIDE / performer.step))
    return np.asarray(joints[:, 0] + scale * performer.beside[:, foot] + rotate(even, rest - scale * home))


def _out_of_reach(skeleton: Skeleton, step: _Step, goals: Float, joints: Float) -> Float:
    """(T,) metres that the body is to come down by, so that a leg is not stretched to its goals (T, 3)."""
    chain = step.leg
    hip, whole = joints[:, chain[0]], _leg_length(skeleton, chain)
    far = np.maximum(np.linalg.norm(joints[:, chain[-1]] - hip, axis=1), _STRETCHED * whole)
    way = goals - hip
    level = np.hypot(way[:, 0], way[:, 2])
    reach = -np.sqrt(np.maximum(far**2 - level**2, 0.0))
    return np.asarray(np.clip(reach - way[:, 1], 0.0, _LOWERED * whole))


def _bend(
    skeleton: Skeleton, step: _Step, performer: _Performer, goals: Float, turns: Float, joints: Float
) -> None:
    """Lets a leg reach its goals (T, 3); changes turns (T, N, 4) and joints (T, N, 3) in place."""
    chain, heading = step.leg, heading_of(turns[:, 0])
    weights = np.ones(len(turns)) if step.arm is None else performer.walks(step.arm)
    moved = {bone for path in _played(skeleton, step) for bone in path[1:]}
    for j in sorted(moved | _below(skeleton, chain[-1])):
        if j in moved and not step.posed:
            turns[:, j] = slerp(turns[:, j], heading, weights)
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])
    _reach(skeleton, chain, weights, goals, turns, joints)


def _reach(
    skeleton: Skeleton, chain: Sequence[int], weights: Float, goals: Float, turns: Float, joints: Float
) -> None:
    """Bends a limb so that its end reaches its goals (T, 3) by a share ``weights`` (T,) of the way.

    Changes turns (T, N, 4) and joints (T, N, 3) in place. The foot keeps its orientation.
    """
    middle, side = bend_of(skeleton, chain)
    kept, none = skeleton.parents == chain[-1], np.zeros(len(turns))
    tree, bones = (skeleton.parents, skeleton.vectors[None]), (np.array(chain, np.int32), middle, side, kept)
    pin_limb(*tree, *bones, 0.0, 0.0, weights, goals, none, turns, joints)


def _lift_forelegs(
    shape: Shape,
    clip: Clip,
    steps: Sequence[_Step],
    performer: _Performer,
    times: Float,
    turns: Float,
    joints: Float,
) -> None:
    """Bends forelegs that an arm drives until they are above the floor; changes turns and joints in place.

    An arm that hangs or punches can push a foreleg below the floor. The lowest point of the body is kept on
    the floor later, so such a foreleg would lift the other feet off it.

    Args:
        times: (T,) seconds.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.
    """
    supports = [_sole(shape, step) for step in steps if step.arm is None]
    forelegs = [step for step in steps if step.arm is not None]
    if not (supports and forelegs):
        return
    floor = _floor_under_feet(
        shape,
        clip,
        performer,
        times,
        joints,
        np.min([sole.lowest(turns, joints) for sole in supports], axis=0),
    )
    for step in forelegs:
        limb = Sole(shape, sorted(_below(shape.skeleton, step.leg[0])))
        for _ in range(_LIFTS):
            lift = np.maximum(floor - limb.lowest(turns, joints), 0.0)
            if not lift.any():
                break
            goals = joints[:, step.leg[-1]] + lift[:, None] * [0.0, 1.0, 0.0]
            _reach(shape.skeleton, step.leg, (lift > 0.0).astype(float), goals, turns, joints)


def _floor_under_feet(
    shape: Shape, clip: Clip, performer: _Performer, times: Float, joints: Float, low: Float
) -> Float:
    """Returns the height (T,) in metres below which no foreleg may reach.

    While the performer is on their feet, that is the lowest point of the model's other feet. A performer on
    their hands or knees may have their feet in the air. Then it is the floor under them, if that is lower.

    Args:
        times: (T,) seconds.
        joints: (T, N, 3) metres.
        low: (T,) metres, the lowest point of the feet that no arm drives.
    """
    legs = (limb for pair in source_anatomy(clip).legs for limb in pair)
    feet = {joint for leg in legs for joint in leg.proper[len(leg_of(leg)) - 1 :]}
    frames = np.arange(len(clip.turns)) * clip.step
    on_feet = np.interp(times, frames, standing_on_feet(clip, feet))
    floor = performer.floor(shape, joints[:, 0, 1])
    floor += np.median((low - floor)[on_feet >= min(0.5, on_feet.max())])
    return on_feet * low + (1.0 - on_feet) * np.minimum(low, floor)


def _evenly(drops: Float, step: float) -> Float:
    """(T,) drops (T,) that nowhere are less, without corners."""
    wide = max(round(_EASING / step), 1)
    widest = scipy.ndimage.maximum_filter1d(drops, 2 * wide + 1, mode="nearest")
    return np.asarray(scipy.ndimage.uniform_filter1d(widest, 2 * wide + 1, mode="nearest"))


def _even(headings: Float, count: int) -> Float:
    """(T, 4) headings without what sways within so many moments: feet do not turn to and fro with a body."""
    angles = np.unwrap(2.0 * np.arctan2(headings[:, 2], headings[:, 0]))
    even = scipy.ndimage.uniform_filter1d(angles, max(count, 1), mode="nearest") / 2.0
    return np.stack([np.cos(even), 0.0 * even, np.sin(even), 0.0 * even], axis=1)


def _below(skeleton: Skeleton, joint: int) -> set[int]:
    """All joints that hang on one."""
    found = {joint}
    for j in range(joint + 1, len(skeleton)):
        if int(skeleton.parents[j]) in found:
            found.add(j)
    return found - {joint}
