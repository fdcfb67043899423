"""The gait of a performer. Selects the performer's leg that each leg of a model follows, and computes the
positions of the performer's feet.

find_stepping_legs(shape, clip, plan)     # a LegStep for each leg of the model that steps
performer.foot(leg)             # the joint of the performer's foot that stands
performer.home(foot, heading)   # the mean position of that joint below the body
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, RiggedCharacter, Skeleton, joint_places
from enliven.mapping.applying import initial_facings, source_anatomy
from enliven.mapping.ground import floor_height_under, foot_contact_weights, leap_heights_of_joints
from enliven.mapping.plan import Mode, Plan
from enliven.mapping.resting import compute_first_heading, heading_from_rotation
from enliven.motion.layers.travel import travel_scale
from enliven.rotation import IDENTITY, conjugate, multiply, rotate
from enliven.skeletons.anatomy import Anatomy, Pair, SkeletonLimb, find_anatomy
from enliven.skeletons.facing import rotate_about_y

STRIDE_S = 1.0
"""Duration of a stride in seconds. The heading of a body is averaged over a stride."""
_MAX_RAISED_DROP = 0.0
"""An arm is raised if its hand is less than this fraction of the arm's length below the shoulder. At 0 the
hand is at least as high as the shoulder."""
_MIN_HANGING_DROP = 0.4
"""An arm hangs if its hand is at least this fraction of the arm's length below the shoulder."""
_MAX_STANDING_SPEED = 0.1
"""Maximum speed of the feet relative to each other while the performer stands, in leg lengths per second."""
_MIN_WALKING_SPEED = 0.4
"""Minimum speed of the feet relative to each other in a full walk, in leg lengths per second."""
_WALK_BLEND_S = 0.3
"""Duration in seconds of the transition of a foreleg between following the performer's arm and stepping."""
_MAX_FOOT_HEIGHT = 0.15
"""Maximum height of the foot's joints above the lowest joint, as a fraction of the performer's height."""
_STANDING_PERCENT = 25.0
"""Minimum time that a foot stands, as a percentage of a take. The joint that moves least during this time
defines the position of the foot."""
_LOWEST_PERCENT = 5.0
"""This percentile of a foot's height over a take is its height while it stands."""


@dataclass(frozen=True, eq=False)
class LegStep:
    """A leg of the model that steps.

    Attributes:
        limb: the model's leg.
        source: the performer's leg that the model's leg follows.
        arm: the performer's arm that drives the leg while the performer stands or raises that arm, or None.
        posed: True if the leg keeps the performer's pose as far as possible with the given position of its
            foot.
        leg: the joints of ``limb`` down to the ankle, where the foot begins.
        source_leg: the joints of ``source`` down to the ankle, where the foot begins.
    """

    limb: SkeletonLimb
    source: SkeletonLimb
    arm: SkeletonLimb | None
    posed: bool
    leg: tuple[int, ...]
    source_leg: tuple[int, ...]

    @property
    def toes(self) -> tuple[int, ...]:
        """The joints of ``limb`` beyond its ankle."""
        return self.limb.proper[len(self.leg) :]

    @property
    def source_toes(self) -> tuple[int, ...]:
        """The joints of ``source`` beyond its ankle."""
        return self.source.proper[len(self.source_leg) :]


def legs_that_step(shape: RiggedCharacter, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """Returns the legs of a shape that follow the steps of the performer's feet, instead of copying leg
    angles."""
    return tuple(step.limb for step in find_stepping_legs(shape, clip, plan))


def find_posed_stepping_legs(shape: RiggedCharacter, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """Returns the legs of a shape that step and keep the performer's pose."""
    return tuple(step.limb for step in find_stepping_legs(shape, clip, plan) if step.posed)


def find_planted_legs(shape: RiggedCharacter, clip: Clip, plan: Plan) -> tuple[SkeletonLimb, ...]:
    """Returns the legs of a shape with feet that are planted while they stand: posed legs or, if there are
    none, all legs that step."""
    if not (plan.pin and plan.travel):
        return ()
    return find_posed_stepping_legs(shape, clip, plan) or legs_that_step(shape, clip, plan)


def bones_that_only_step(shape: RiggedCharacter, clip: Clip, plan: Plan) -> set[int]:
    """Returns the bones of the stepping legs, except legs that the performer's arm may drive."""
    return {
        bone
        for step in find_stepping_legs(shape, clip, plan)
        if step.arm is None
        for bone in step.limb.proper[1:]
    }


def leg_length(skeleton: Skeleton, leg: Sequence[int]) -> float:
    """Returns the length of a leg in metres."""
    return max(float(skeleton.lengths[list(leg[1:])].sum()), 1e-9)


def step_sizes(
    shape: RiggedCharacter, clip: Clip, rebased_clip: Clip, plan: Plan
) -> dict[SkeletonLimb, float]:
    """Returns the legs that step, each with the size of its steps in metres.

    The size is the performer's leg length, scaled to the model. A model with long legs that takes short steps
    lifts its feet by a small fraction of the length of its legs.
    """
    scale = step_scale(shape, clip, rebased_clip, plan)
    return {
        step.limb: scale * _limb_length(clip.skeleton, step.source)
        for step in find_stepping_legs(shape, clip, plan)
    }


def step_scale(shape: RiggedCharacter, clip: Clip, rebased_clip: Clip, plan: Plan) -> float:
    """Returns the step scale: the distance in metres that a foot of the shape moves per metre of the
    performer's foot.

    For posed legs the scale is the ratio of leg lengths, which keeps the performer's joint angles.
    """
    posed = [step for step in find_stepping_legs(shape, clip, plan) if step.posed]
    model_length = sum(leg_length(shape.skeleton, step.leg) for step in posed)
    performer_length = sum(leg_length(clip.skeleton, step.source_leg) for step in posed)
    return plan.stride * (
        model_length / performer_length
        if posed
        else travel_scale(shape.with_changes(travel_scale=None), rebased_clip)
    )


def _limb_length(skeleton: Skeleton, limb: SkeletonLimb) -> float:
    """Returns the length of a limb in metres, without its girdle."""
    return max(float(skeleton.lengths[list(limb.proper[1:])].sum()), 1e-9)


def find_stepping_legs(shape: RiggedCharacter, clip: Clip, plan: Plan) -> list[LegStep]:
    """Returns the legs of a shape that step, the rearmost first. The list is empty if the mapping disables
    steps."""
    model, performer = find_anatomy(shape.skeleton), source_anatomy(clip)
    if not (plan.steps and plan.floor and performer.legs) or (shape.modeling != IDENTITY).any():
        return []
    driven, steps = _find_driven_bones(shape.skeleton, plan, "move"), list[LegStep]()
    posed = _find_driven_bones(shape.skeleton, plan, "pose") if plan.pin and plan.travel else set[int]()
    for number, pair in enumerate(reversed(model.legs)):
        is_foreleg = 0 < number == len(model.legs) - 1 >= len(performer.legs) and performer.arms
        arms = performer.arms[0] if is_foreleg else (None, None)
        for limb, source, arm in zip(pair, _match_legs(performer, number), arms, strict=True):
            leg, bones = _make_posed_leg(limb, posed), set(leg_to_ankle(limb)[1:])
            if len(leg) > 2:
                steps.append(
                    LegStep(limb, source, arm, True, leg, _make_performed_leg(shape, clip, plan, leg, source))
                )
            elif len(bones) > 1 and bones <= driven:
                steps.append(LegStep(limb, source, arm, False, leg_to_ankle(limb), leg_to_ankle(source)))
    return steps


def _make_posed_leg(limb: SkeletonLimb, posed: Collection[int]) -> tuple[int, ...]:
    """Returns the joints of a leg down to its ankle, or to its last joint in ``posed`` if that is higher
    up."""
    leg = limb.proper[:1]
    for joint in leg_to_ankle(limb)[1:]:
        if joint not in posed:
            break
        leg = (*leg, joint)
    return leg


def _make_performed_leg(
    shape: RiggedCharacter, clip: Clip, plan: Plan, leg: tuple[int, ...], source: SkeletonLimb
) -> tuple[int, ...]:
    """Returns the joints of the performer's leg down to the joint that drives the end of a posed leg."""
    end_name = shape.skeleton.names[leg[-1]]
    ankles = [
        chain.source[-1] for chain in plan.chains if chain.target[-1] == end_name and chain.mode == "pose"
    ]
    joints = [clip.skeleton.index(name) for name in ankles if name in clip.skeleton.names]
    last_index = next(
        (source.proper.index(joint) for joint in joints if joint in source.proper),
        len(leg_to_ankle(source)) - 1,
    )
    # If a limb has no joint names, the performer's whole leg with its toes may drive it. The result still
    # ends at the ankle.
    height = clip.skeleton.positions[:, 1]
    is_low = height[list(source.proper)] < height.min() + _MAX_FOOT_HEIGHT * np.ptp(height)
    ankle = int(np.argmax(is_low)) if is_low.any() else last_index
    return source.proper[: max(min(last_index, ankle), 2) + 1]


def _find_driven_bones(skeleton: Skeleton, plan: Plan, mode: Mode) -> set[int]:
    """Returns the bones of the model that chains of ``mode`` drive at the take's own speed and without
    delay."""
    bones = set[int]()
    for chain in plan.chains:
        is_unchanged = (chain.mode, chain.offset, chain.speed) == (mode, 0.0, 1.0)
        is_unchanged = is_unchanged and not (chain.loop or chain.flip)
        ends = [skeleton.names.index(name) for name in chain.target if name in skeleton.names]
        if is_unchanged and ends and chain.weight > 0.0:
            bones |= set(skeleton.path(ends[0], ends[-1])[1:])
    return bones


def _match_legs(performer: Anatomy, number: int) -> Pair:
    """Returns the pair of the performer's legs that drives the model's pair ``number``, counted from the
    rear."""
    leg_pairs = len(performer.legs)
    if number < leg_pairs:
        return performer.legs[leg_pairs - 1 - number]
    left, right = performer.legs[0]
    return (right, left) if (number - leg_pairs) % 2 == 0 else (left, right)


def leg_to_ankle(limb: SkeletonLimb) -> tuple[int, ...]:
    """Returns the joints of a leg down to the ankle, where its foot begins."""
    if limb.knots:
        return limb.main
    return limb.proper[:-1] if len(limb.proper) > 3 else limb.proper


def choose_standing_on_feet(clip: Clip) -> Float:
    """Returns weights (F,) per frame: 1 while the performer stands on the feet, and 0 while on knees, hands
    or other body parts."""
    legs = (limb for pair in source_anatomy(clip).legs for limb in pair)
    return foot_contact_weights(
        clip, {joint for leg in legs for joint in leg.proper[len(leg_to_ankle(leg)) - 1 :]}
    )


class PerformerGait:
    """The performer's motion in the model's axes, sampled at the times (T,) of the model's motion.

    Attributes:
        skeleton: the performer's skeleton at rest.
        posed: (N, 3) metres from the root to the joints, in the pose in which the performer's bones have the
            directions of the model's bones.
        offsets: (T, N, 3) metres from the root to the joints. If the model does not turn with the performer,
            these offsets do not contain the rotation of the whole body.
        root_height: (T,) metres from the floor up to the root.
        scale: distance in metres that the model moves while the performer moves one metre.
        step: seconds between two successive times.
    """

    def __init__(
        self, shape: RiggedCharacter, clip: Clip, rebased_clip: Clip, plan: Plan, times: Float, scale: float
    ) -> None:
        take_facing, model_facing = initial_facings(clip, shape, plan)
        rest = rebased_clip.skeleton.positions
        self.posed = rotate_about_y(rest - rest[0], model_facing - take_facing)
        self._legs = source_anatomy(clip).legs[0]
        self.rest = plan.rest
        self.skeleton, self.step, self.scale = clip.skeleton, float(times[1]), scale
        places, frame_times = joint_places(clip), np.arange(len(clip.turns)) * clip.step
        floor_height = np.percentile(places[..., 1].min(1), _LOWEST_PERCENT)
        offsets = places - clip.root[:, None]
        if not plan.turn:
            heading_change = multiply(
                compute_first_heading(clip), conjugate(heading_from_rotation(clip.turns[:, 0]))
            )
            offsets = rotate(heading_change[:, None], offsets)
        frames_before = np.clip(
            np.searchsorted(frame_times, times, side="right") - 1, 0, max(len(frame_times) - 2, 0)
        )
        fractions = np.clip(times / clip.step - frames_before, 0.0, 1.0)[:, None, None]
        interpolated = (1.0 - fractions) * offsets[frames_before] + fractions * offsets[
            np.minimum(frames_before + 1, len(offsets) - 1)
        ]
        self.offsets = rotate_about_y(interpolated, model_facing - take_facing)
        self.root_height = np.interp(times, frame_times, clip.root[:, 1]) - floor_height

    def compute_floor_height(self, shape: RiggedCharacter, root: Float) -> Float:
        """Returns the height (T,) in metres of the floor under a posed shape with the root heights ``root``
        (T,)."""
        standing = shape.skeleton.positions[0, 1] + shape.place[1] - floor_height_under(shape)
        return np.asarray(root - standing - self.scale * (self.root_height + self.posed[:, 1].min()))

    def compute_leap_heights(self) -> Float:
        """Returns the height (T,) in metres of the performer's leaps, scaled to the model; see
        :func:`leap_heights`."""
        return self.scale * leap_heights_of_joints(self.offsets[..., 1] + self.root_height[:, None])

    def find_foot_joint(self, leg: SkeletonLimb) -> int:
        """Returns the joint of a leg's foot that moves least vertically while the foot stands."""
        height = self.skeleton.positions[:, 1]
        max_height = height.min() + _MAX_FOOT_HEIGHT * np.ptp(height)
        foot_joints = [j for j in leg.chain if height[j] < max_height] or [leg.chain[-1]]
        vertical_motion = np.abs(np.diff(self.offsets[:, foot_joints, 1] + self.root_height[:, None], axis=0))
        return foot_joints[int(np.percentile(vertical_motion, 100.0 - _STANDING_PERCENT, axis=0).argmin())]

    def compute_neutral_foot_position(self, foot: int, heading: Float) -> Float:
        """Returns the neutral position (3,) of a foot in metres from the root, for a body that faces +Z.

        If the mapping names a reference time in the take, the result is the position at this time. Otherwise
        it is the median over the take, with the height of the standing foot.

        Args:
            foot: a joint of the performer.
            heading: (T, 4) the headings of the model's body.
        """
        offsets = rotate(conjugate(heading), self.offsets[:, foot])
        if self.rest == "first" or isinstance(self.rest, int | float):
            seconds = 0.0 if self.rest == "first" else float(self.rest)
            return np.asarray(offsets[int(np.clip(round(seconds / self.step), 0, len(offsets) - 1))])
        home = np.median(offsets, axis=0)
        home[1] = np.percentile(offsets[:, 1] + self.root_height, _LOWEST_PERCENT) - np.median(
            self.root_height
        )
        return np.asarray(home)

    def walking_weights(self, arm: SkeletonLimb) -> Float:
        """Returns weights (T,): 1 while the performer walks with the arm hanging, and 0 while the performer
        stands or raises the arm."""
        drop = self.offsets[:, arm.proper[0], 1] - self.offsets[:, arm.proper[-1], 1]
        drop /= _limb_length(self.skeleton, arm)
        left, right = (self.offsets[:, self.find_foot_joint(leg)] for leg in self._legs)
        speed = np.linalg.norm(np.gradient(left - right, self.step, axis=0), axis=1)
        speed /= _limb_length(self.skeleton, self._legs[0])
        speed = scipy.ndimage.maximum_filter1d(speed, max(round(STRIDE_S / self.step), 1), mode="nearest")
        hanging = np.clip((drop - _MAX_RAISED_DROP) / (_MIN_HANGING_DROP - _MAX_RAISED_DROP), 0.0, 1.0)
        walking = hanging * np.clip(
            (speed - _MAX_STANDING_SPEED) / (_MIN_WALKING_SPEED - _MAX_STANDING_SPEED), 0.0, 1.0
        )
        window = max(round(_WALK_BLEND_S / self.step), 1)
        return np.asarray(scipy.ndimage.uniform_filter1d(walking, window, mode="nearest"))
