"""Steps: the feet of what is of another build go as the performer's feet go, in its own size.

stepped(project, shape_id, clip, based, plan)      # its legs bend so; a take of their own plays them

A leg that is swung by a performer's angles neither reaches the floor nor stays on it: it is of other bones.
Where its foot is, is told by where the performer's is beside their hips; so it stands while theirs stands. An
animal with more legs than the performer takes theirs again, each pair in turn with the one behind it. A
foreleg that the performer's arm drives steps while they walk with hanging arms, and is the arm's else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Project, Shape, Skeleton, joint_places, unused
from enliven.mapping.anatomy import Anatomy, Pair, SkeletonLimb, anatomy_of
from enliven.mapping.applying import facings, source_anatomy
from enliven.mapping.facing import turned_about_y
from enliven.mapping.plan import Plan
from enliven.mapping.resting import first_heading, heading_of
from enliven.motion.contact import bend_of, pin_limb
from enliven.motion.layers import Player, bind_chain, clear_chain, travel_scale
from enliven.rotation import IDENTITY, conjugate, multiply, rotate, slerp

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
_LOWEST = 5.0
"""Per cent of a take in which a foot is as low as when it stands."""


@dataclass(frozen=True, eq=False)
class _Step:
    """One leg of the model.

    Attributes:
        limb: the model's.
        by: the performer's leg that it goes with.
        arm: the performer's arm that it obeys while they stand or raise it, or None.
    """

    limb: SkeletonLimb
    by: SkeletonLimb
    arm: SkeletonLimb | None


def stepped(project: Project, shape_id: str, clip: Clip, based: Clip, plan: Plan) -> Project:
    """A project in which the legs of a shape that is not posed as the performer step as they do.

    Args:
        clip: the take as it was given.
        based: the same against the rest pose that the shape moves by.
    """
    shape = project.shape(shape_id)
    steps, duration = _steps(shape, clip, plan), clip.duration
    if not steps or duration <= 0.0:
        return project
    times = np.linspace(0.0, duration, int(np.ceil(duration * min(_RATE, 1.0 / clip.step))) + 1)
    turns, joints = Player(project, shape_id).sample(times)
    performer = _Performer(shape, clip, plan, times, _scale(shape, based, plan))
    for step in steps:
        _bend(shape.skeleton, step, performer, turns, joints)
    take = Clip(unused(f"{clip.id}: steps", project.takes), shape.skeleton, turns, joints[:, 0], times[1])
    project = project.with_takes(take)
    for chain in (chain for step in steps for chain in _played(shape.skeleton, step.limb)):
        project = clear_chain(project, shape_id, chain)
        name = unused(f"{take.id} of {shape.skeleton.names[chain[-1]]}", project.layer_names)
        project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY, layer_id=name)
    return project


def legs_that_step(shape: Shape, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """The legs of a shape that step as the performer's feet do, and are not swung by their angles."""
    return tuple(step.limb for step in _steps(shape, clip, plan))


def step_sizes(shape: Shape, clip: Clip, based: Clip, plan: Plan) -> dict[SkeletonLimb, float]:
    """The legs that step, and metres of a performer's leg in the size of the model's steps.

    A model with long legs that takes short steps lifts its feet by little of their length.
    """
    scale = _scale(shape, based, plan)
    return {step.limb: scale * _length(clip.skeleton, step.by) for step in _steps(shape, clip, plan)}


def _scale(shape: Shape, based: Clip, plan: Plan) -> float:
    """Metres that a foot of a shape goes for one of the performer's."""
    return plan.stride * travel_scale(shape.with_changes(travel_scale=None), based)


def _length(skeleton: Skeleton, limb: SkeletonLimb) -> float:
    """Metres of a limb without its girdle."""
    return max(float(skeleton.lengths[list(limb.proper[1:])].sum()), 1e-9)


def _steps(shape: Shape, clip: Clip, plan: Plan) -> list[_Step]:
    ours, theirs = anatomy_of(shape.skeleton), source_anatomy(clip)
    if not (plan.steps and plan.floor and theirs.legs) or (shape.modeling != IDENTITY).any():
        return []
    driven, made = _driven(shape.skeleton, plan), list[_Step]()
    for number, pair in enumerate(reversed(ours.legs)):
        fore = 0 < number == len(ours.legs) - 1 >= len(theirs.legs) and theirs.arms
        arms = theirs.arms[0] if fore else (None, None)
        for limb, by, arm in zip(pair, _legs_of(theirs, number), arms, strict=True):
            if len(leg_of(limb)) > 2 and set(leg_of(limb)[1:]) <= driven:
                made.append(_Step(limb, by, arm))
    return made


def _driven(skeleton: Skeleton, plan: Plan) -> set[int]:
    """The bones that chains move from the model's own rest pose, at the take's own pace."""
    found = set[int]()
    for chain in plan.chains:
        plain = (chain.mode, chain.offset, chain.speed) == ("move", 0.0, 1.0)
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
    return limb.proper[:-1] if len(limb.proper) > 3 else limb.proper


def _played(skeleton: Skeleton, limb: SkeletonLimb) -> list[tuple[int, ...]]:
    """The chains that hold the turns of a leg: itself, and each other toe that begins at its foot."""
    foot = leg_of(limb)[-1]
    return [limb.proper, *((foot, toe) for toe in skeleton.children[foot] if toe not in limb.proper)]


class _Performer:
    """A performer at the times of the model, in the model's axes.

    Attributes:
        skeleton: at rest.
        beside: (T, N, 3) metres from the root to the joints; without the turning of the whole where the model
            does not turn.
        tall: (T,) metres from the root to the floor that they stood on.
        scale: the model's metres over the floor for one of theirs.
        step: seconds between two times.
    """

    def __init__(self, shape: Shape, clip: Clip, plan: Plan, times: Float, scale: float) -> None:
        theirs, ours = facings(clip, shape, plan)
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


def _bend(skeleton: Skeleton, step: _Step, performer: _Performer, turns: Float, joints: Float) -> None:
    """Lets a leg reach where its foot is to be; changes turns (T, N, 4) and joints (T, N, 3) in place."""
    chain = leg_of(step.limb)
    heading, foot = heading_of(turns[:, 0]), performer.foot(step.by)
    beside = performer.beside[:, foot]
    home = performer.home(foot, heading)
    rest = skeleton.positions[chain[-1]] - skeleton.positions[0]
    even = _even(heading, round(_STRIDE / performer.step))
    goals = joints[:, 0] + performer.scale * beside + rotate(even, rest - performer.scale * home)
    weights = np.ones(len(turns)) if step.arm is None else performer.walks(step.arm)
    moved = {bone for path in _played(skeleton, step.limb) for bone in path[1:]}
    for j in sorted(moved | _below(skeleton, chain[-1])):
        if j in moved:
            turns[:, j] = slerp(turns[:, j], heading, weights)
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])
    middle, side = bend_of(skeleton, chain)
    kept, none = skeleton.parents == chain[-1], np.zeros(len(turns))
    tree, bones = (skeleton.parents, skeleton.vectors[None]), (np.array(chain, np.int32), middle, side, kept)
    pin_limb(*tree, *bones, 0.0, 0.0, weights, goals, none, turns, joints)


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
