"""The gait of a performer: which leg of the performer each leg of a model follows, and the positions of the
feet.

steps_of(shape, clip, plan)     # a LegStep for each leg of the model that steps
performer.foot(leg)             # the joint of the performer's foot that stands
performer.home(foot, heading)   # the position of that joint below the body
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Shape, Skeleton, joint_places
from enliven.mapping.anatomy import Anatomy, Pair, SkeletonLimb, anatomy_of
from enliven.mapping.applying import facings, source_anatomy
from enliven.mapping.facing import rotate_about_y
from enliven.mapping.ground import floor_of, foot_contact_weights
from enliven.mapping.plan import Mode, Plan
from enliven.mapping.resting import first_heading, heading_of
from enliven.motion.layers import travel_scale
from enliven.rotation import IDENTITY, conjugate, multiply, rotate

STRIDE_S = 1.0
"""Duration of a stride in seconds. The heading of a body is averaged over a stride."""
_MAX_RAISED_DROP = 0.0
"""The arm is raised if its hand is less than this fraction of the arm's length below the shoulder."""
_MIN_HANGING_DROP = 0.4
"""The arm hangs if its hand is at least this fraction of the arm's length below the shoulder."""
_MAX_STANDING_SPEED = 0.1
"""Maximum speed of the feet relative to each other while the performer stands, in leg lengths a second."""
_MIN_WALKING_SPEED = 0.4
"""Minimum speed of the feet relative to each other in a full walk, in leg lengths a second."""
_WALK_BLEND_S = 0.3
"""Duration in seconds of the transition of a foreleg between following the performer's arm and stepping."""
_MAX_FOOT_HEIGHT = 0.15
"""Maximum height of the foot's joints above the lowest joint, as a fraction of the performer's height."""
_STANDING_PERCENT = 25.0
"""Minimum time that a foot stands, in per cent of a take. A foot that stands longer takes its position from
its slowest joint."""
_LOWEST_PERCENT = 5.0
"""Percentile of a foot's height over a take that counts as its height while it stands."""


@dataclass(frozen=True, eq=False)
class LegStep:
    """One leg of the model that steps.

    Attributes:
        limb: the model's leg.
        by: the performer's leg that it follows.
        arm: the performer's arm that drives the leg while the performer stands or raises that arm, or None.
        posed: True if the leg keeps the performer's pose as far as the position of its foot allows.
        leg: the joints of ``limb`` down to where the foot begins.
        by_leg: the joints of ``by`` down to where the foot begins.
    """

    limb: SkeletonLimb
    by: SkeletonLimb
    arm: SkeletonLimb | None
    posed: bool
    leg: tuple[int, ...]
    by_leg: tuple[int, ...]

    @property
    def toes(self) -> tuple[int, ...]:
        """The joints of ``limb`` beyond its ankle."""
        return self.limb.proper[len(self.leg) :]

    @property
    def by_toes(self) -> tuple[int, ...]:
        """The joints of ``by`` beyond its ankle."""
        return self.by.proper[len(self.by_leg) :]


def legs_that_step(shape: Shape, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """Returns the legs of a shape that step as the performer's feet do, instead of copying their angles."""
    return tuple(step.limb for step in steps_of(shape, clip, plan))


def posed_legs_that_step(shape: Shape, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """Returns the legs of a shape that step and keep the performer's pose."""
    return tuple(step.limb for step in steps_of(shape, clip, plan) if step.posed)


def bones_that_only_step(shape: Shape, clip: Clip, plan: Plan) -> set[int]:
    """Returns the bones of those stepping legs that no arm drives."""
    return {bone for step in steps_of(shape, clip, plan) if step.arm is None for bone in step.limb.proper[1:]}


def leg_length(skeleton: Skeleton, leg: Sequence[int]) -> float:
    """Returns the length of a leg in metres."""
    return max(float(skeleton.lengths[list(leg[1:])].sum()), 1e-9)


def step_sizes(shape: Shape, clip: Clip, based: Clip, plan: Plan) -> dict[SkeletonLimb, float]:
    """Returns the legs that step, each with its step size: the performer's leg length, scaled, in metres.

    A model with long legs that takes short steps lifts its feet by a small fraction of their length.
    """
    scale = step_scale(shape, clip, based, plan)
    return {step.limb: scale * _limb_length(clip.skeleton, step.by) for step in steps_of(shape, clip, plan)}


def step_scale(shape: Shape, clip: Clip, based: Clip, plan: Plan) -> float:
    """Returns the distance in metres that a foot of the shape moves when the performer's moves one metre.

    For posed legs it is the ratio of leg lengths, which keeps the performer's angles.
    """
    posed = [step for step in steps_of(shape, clip, plan) if step.posed]
    ours = sum(leg_length(shape.skeleton, step.leg) for step in posed)
    theirs = sum(leg_length(clip.skeleton, step.by_leg) for step in posed)
    return plan.stride * (
        ours / theirs if posed else travel_scale(shape.with_changes(travel_scale=None), based)
    )


def _limb_length(skeleton: Skeleton, limb: SkeletonLimb) -> float:
    """Returns the length of a limb in metres, without its girdle."""
    return max(float(skeleton.lengths[list(limb.proper[1:])].sum()), 1e-9)


def steps_of(shape: Shape, clip: Clip, plan: Plan) -> list[LegStep]:
    """Returns the legs of a shape that step, the hindmost first; none if the mapping turns steps off."""
    ours, theirs = anatomy_of(shape.skeleton), source_anatomy(clip)
    if not (plan.steps and plan.floor and theirs.legs) or (shape.modeling != IDENTITY).any():
        return []
    driven, steps = _driven_bones(shape.skeleton, plan, "move"), list[LegStep]()
    posed = _driven_bones(shape.skeleton, plan, "pose") if plan.pin and plan.travel else set[int]()
    for number, pair in enumerate(reversed(ours.legs)):
        fore = 0 < number == len(ours.legs) - 1 >= len(theirs.legs) and theirs.arms
        arms = theirs.arms[0] if fore else (None, None)
        for limb, by, arm in zip(pair, _legs_of(theirs, number), arms, strict=True):
            leg, bones = _posed_leg(limb, posed), set(leg_of(limb)[1:])
            if len(leg) > 2:
                steps.append(LegStep(limb, by, arm, True, leg, _performed_leg(shape, clip, plan, leg, by)))
            elif len(bones) > 1 and bones <= driven:
                steps.append(LegStep(limb, by, arm, False, leg_of(limb), leg_of(by)))
    return steps


def _posed_leg(limb: SkeletonLimb, posed: Collection[int]) -> tuple[int, ...]:
    """Returns the joints of a leg down to its ankle, or to the last one that has the performer's pose."""
    leg = limb.proper[:1]
    for joint in leg_of(limb)[1:]:
        if joint not in posed:
            break
        leg = (*leg, joint)
    return leg


def _performed_leg(
    shape: Shape, clip: Clip, plan: Plan, leg: tuple[int, ...], by: SkeletonLimb
) -> tuple[int, ...]:
    """Returns the joints of the performer's leg down to the one that drives the end of a posed leg."""
    end = shape.skeleton.names[leg[-1]]
    ankles = [chain.source[-1] for chain in plan.chains if chain.target[-1] == end and chain.mode == "pose"]
    joints = [clip.skeleton.index(name) for name in ankles if name in clip.skeleton.names]
    last = next((by.proper.index(joint) for joint in joints if joint in by.proper), len(leg_of(by)) - 1)
    # A limb without names may be driven by the whole leg down to the toes. It still ends at the ankle.
    height = clip.skeleton.positions[:, 1]
    low = height[list(by.proper)] < height.min() + _MAX_FOOT_HEIGHT * np.ptp(height)
    ankle = int(np.argmax(low)) if low.any() else last
    return by.proper[: max(min(last, ankle), 2) + 1]


def _driven_bones(skeleton: Skeleton, plan: Plan, mode: Mode) -> set[int]:
    """Returns the bones that chains of a mode move at the take's own speed."""
    bones = set[int]()
    for chain in plan.chains:
        plain = (chain.mode, chain.offset, chain.speed) == (mode, 0.0, 1.0)
        plain = plain and not (chain.loop or chain.flip)
        ends = [skeleton.names.index(name) for name in chain.target if name in skeleton.names]
        if plain and ends and chain.weight > 0.0:
            bones |= set(skeleton.path(ends[0], ends[-1])[1:])
    return bones


def _legs_of(theirs: Anatomy, number: int) -> Pair:
    """Returns the performer's legs for a pair of the model's, counted from behind."""
    leg_pairs = len(theirs.legs)
    if number < leg_pairs:
        return theirs.legs[leg_pairs - 1 - number]
    left, right = theirs.legs[0]
    return (right, left) if (number - leg_pairs) % 2 == 0 else (left, right)


def leg_of(limb: SkeletonLimb) -> tuple[int, ...]:
    """Returns the joints of a leg down to the one at which its foot begins."""
    if limb.knots:
        return limb.main
    return limb.proper[:-1] if len(limb.proper) > 3 else limb.proper


def standing_on_feet(clip: Clip) -> Float:
    """Returns (F,) 1 while the performer is on their feet, and 0 while on knees, hands or other parts."""
    legs = (limb for pair in source_anatomy(clip).legs for limb in pair)
    return foot_contact_weights(clip, {joint for leg in legs for joint in leg.proper[len(leg_of(leg)) - 1 :]})


class PerformerGait:
    """The performer's motion, sampled at the times of the model, in the model's axes.

    Attributes:
        skeleton: the performer's, at rest.
        posed: (N, 3) metres from the root to the joints, in the pose in which bones point as the model's do.
        beside: (T, N, 3) metres from the root to the joints. If the model does not turn, the rotation of the
            whole body is left out.
        root_height: (T,) metres from the floor up to the root.
        scale: distance in metres that the model moves when the performer moves one metre.
        step: seconds between two times.
    """

    def __init__(self, shape: Shape, clip: Clip, based: Clip, plan: Plan, times: Float, scale: float) -> None:
        theirs, ours = facings(clip, shape, plan)
        rest = based.skeleton.positions
        self.posed = rotate_about_y(rest - rest[0], ours - theirs)
        self._legs = source_anatomy(clip).legs[0]
        self.rest = plan.rest
        self.skeleton, self.step, self.scale = clip.skeleton, float(times[1]), scale
        places, number = joint_places(clip), np.arange(len(clip.turns)) * clip.step
        low = np.percentile(places[..., 1].min(1), _LOWEST_PERCENT)
        beside = places - clip.root[:, None]
        if not plan.turn:
            back = multiply(first_heading(clip), conjugate(heading_of(clip.turns[:, 0])))
            beside = rotate(back[:, None], beside)
        below = np.clip(np.searchsorted(number, times, side="right") - 1, 0, max(len(number) - 2, 0))
        part = np.clip(times / clip.step - below, 0.0, 1.0)[:, None, None]
        between = (1.0 - part) * beside[below] + part * beside[np.minimum(below + 1, len(beside) - 1)]
        self.beside = rotate_about_y(between, ours - theirs)
        self.root_height = np.interp(times, number, clip.root[:, 1]) - low

    def floor(self, shape: Shape, root: Float) -> Float:
        """Returns the height (T,) in metres of the floor under a posed shape, for heights ``root`` (T,)."""
        standing = shape.skeleton.positions[0, 1] + shape.place[1] - floor_of(shape)
        return np.asarray(root - standing - self.scale * (self.root_height + self.posed[:, 1].min()))

    def foot(self, leg: SkeletonLimb) -> int:
        """Returns the joint of a leg's foot that moves least up and down while the foot stands."""
        height = self.skeleton.positions[:, 1]
        low = height.min() + _MAX_FOOT_HEIGHT * np.ptp(height)
        parts = [j for j in leg.chain if height[j] < low] or [leg.chain[-1]]
        still = np.abs(np.diff(self.beside[:, parts, 1] + self.root_height[:, None], axis=0))
        return parts[int(np.percentile(still, 100.0 - _STANDING_PERCENT, axis=0).argmin())]

    def home(self, foot: int, heading: Float) -> Float:
        """Returns the position (3,) of a standing foot in metres from the root, for a body that faces +Z.

        It is the position in the reference pose of the motion, or the median over the take.

        Args:
            foot: a joint of the performer.
            heading: (T, 4) the headings of the model's body.
        """
        beside = rotate(conjugate(heading), self.beside[:, foot])
        if self.rest == "first" or isinstance(self.rest, int | float):
            seconds = 0.0 if self.rest == "first" else float(self.rest)
            return np.asarray(beside[int(np.clip(round(seconds / self.step), 0, len(beside) - 1))])
        home = np.median(beside, axis=0)
        home[1] = np.percentile(beside[:, 1] + self.root_height, _LOWEST_PERCENT) - np.median(
            self.root_height
        )
        return np.asarray(home)

    def walking_weights(self, arm: SkeletonLimb) -> Float:
        """Returns (T,) 1 while the performer walks with a hanging arm, and 0 while the performer stands or
        raises the arm."""
        below = self.beside[:, arm.proper[0], 1] - self.beside[:, arm.proper[-1], 1]
        below /= _limb_length(self.skeleton, arm)
        left, right = (self.beside[:, self.foot(leg)] for leg in self._legs)
        passing = np.linalg.norm(np.gradient(left - right, self.step, axis=0), axis=1)
        passing /= _limb_length(self.skeleton, self._legs[0])
        passing = scipy.ndimage.maximum_filter1d(passing, max(round(STRIDE_S / self.step), 1), mode="nearest")
        hangs = np.clip((below - _MAX_RAISED_DROP) / (_MIN_HANGING_DROP - _MAX_RAISED_DROP), 0.0, 1.0)
        walking = hangs * np.clip(
            (passing - _MAX_STANDING_SPEED) / (_MIN_WALKING_SPEED - _MAX_STANDING_SPEED), 0.0, 1.0
        )
        wide = max(round(_WALK_BLEND_S / self.step), 1)
        return np.asarray(scipy.ndimage.uniform_filter1d(walking, wide, mode="nearest"))
