"""Steps: the feet of a model follow the performer's feet, scaled to the model's size.

stepped(project, shape_id, clip, based, plan)      # a project with a take that plays the legs

A model's leg has other proportions than the performer's. If it copied the performer's angles, its foot would
not stay on the floor. So the foot follows the performer's foot relative to the hips, and stands while the
performer's foot stands. On an animal with more legs than the performer, the performer's legs drive several
pairs. Neighbouring pairs step alternately. A foreleg that the performer's arm drives steps while the
performer walks with hanging arms. Otherwise it follows the arm.

The legs of a person have the performer's pose. With ``pin`` their feet step too: each leg keeps its pose, and
bends as far as its foot needs to stand still. So feet stand still at any proportions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Project, Shape, Skeleton, unused
from enliven.mapping.gait import (
    STRIDE_S,
    LegStep,
    PerformerGait,
    leg_length,
    standing_on_feet,
    step_scale,
    steps_of,
)
from enliven.mapping.ground import floor_of, follow_path, moments_of
from enliven.mapping.plan import Plan
from enliven.mapping.planting import (
    PosedLeg,
    Sole,
    Spans,
    contact_clearance,
    plant_body,
    remove_spin,
    standing_spans,
)
from enliven.mapping.resting import heading_of
from enliven.motion.contact import find_bend, pin_limb
from enliven.motion.layers import Player, bind_chain, clear_chain
from enliven.rotation import IDENTITY, from_rotation_vector, multiply, rotate, slerp

_MAX_RATE_HZ = 60.0
"""Maximum number of moments a second at which steps are computed: the rate of common displays."""
_MAX_TILT = np.radians(30.0)
"""Largest tilt of a foot (radians) to clear the floor. An ankle allows 20 to 50 degrees."""
_TILT_ANGLES = 7
"""Number of angles from 0 to ``_MAX_TILT`` that are tried."""
_MIN_TOE_DISTANCE = 0.1
"""Smallest distance of the toes ahead of the ankle, as a fraction of the foot's length, for a foot that can
tilt."""
_MAX_LEG_STRETCH = 0.99
"""Largest distance from hip to ankle as a fraction of the leg's length, unless it is larger in the pose
itself. A fully stretched knee would jerk."""
_MAX_LOWERING = 0.15
"""Maximum distance that the body is lowered so that feet reach the floor, as a fraction of a leg."""
_EASING_S = 0.05
"""Time in seconds over which the body is lowered before a foot that would not reach the floor."""
_MAX_LIFT_PASSES = 3
"""Largest number of passes that lift a foreleg. Its lowest point changes as it bends."""


def stepped(project: Project, shape_id: str, clip: Clip, based: Clip, plan: Plan) -> Project:
    """Returns a project in which the legs of a shape step as the performer's do; see the module.

    Args:
        project: contains the shape, moved by the plan.
        shape_id: ID of the shape.
        clip: the original take.
        based: the take relative to the rest pose that the mapping uses.
        plan: the mapping.
    """
    shape = project.shape(shape_id)
    steps, duration = steps_of(shape, clip, plan), clip.duration
    if not steps or duration <= 0.0:
        return project
    posed = any(step.posed for step in steps)
    times = moments_of(
        duration, max(_MAX_RATE_HZ, 1.0 / clip.step) if posed else min(_MAX_RATE_HZ, 1.0 / clip.step)
    )
    turns, joints = Player(project, shape_id).sample(times)
    performer = PerformerGait(shape, clip, based, plan, times, step_scale(shape, clip, based, plan))
    chosen = [step for step in steps if step.posed]
    if chosen:
        offsets = _plant_feet(shape, chosen, performer, turns, joints)
        project = follow_path(project, shape_id, clip.id, joints[:, 0].copy(), times[1])
        for step, offset in zip(chosen, offsets, strict=True):
            goals = joints[:, step.leg[-1]] + offset
            _bend_leg(shape.skeleton, step, performer, goals, turns, joints)
    for step in steps:
        if not step.posed:
            goals = _end_targets(shape, step, performer, turns, joints)
            _bend_leg(shape.skeleton, step, performer, goals, turns, joints)
    _lift_forelegs(shape, clip, steps, performer, times, turns, joints)
    take = Clip(unused(f"{clip.id}: steps", project.takes), shape.skeleton, turns, joints[:, 0], times[1])
    project = project.with_takes(take)
    chains = [chain for step in steps for chain in _rotation_chains(shape.skeleton, step)]
    for chain in chains:
        project = clear_chain(project, shape_id, chain)
        name = unused(f"{take.id} of {shape.skeleton.names[chain[-1]]}", project.layer_names)
        project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY, layer_id=name)
    moved = project.shape(shape_id)
    spans = list(moved.spans)
    for bone, other in _sibling_bones(shape, chains):
        spans[other] = spans[bone]
    return project.with_characters(moved.with_changes(spans=tuple(spans)))


def _sibling_bones(shape: Shape, chains: Sequence[Sequence[int]]) -> Iterator[tuple[int, int]]:
    """Yields (bone of a chain, sibling bone) for sibling bones that copy a bone's motion, such as twist
    bones."""
    driven = {bone for chain in chains for bone in chain}
    for bone in (bone for chain in chains for bone in chain[1:]):
        for other in shape.skeleton.children[int(shape.skeleton.parents[bone])]:
            moves = any(span.refs for span in shape.spans[other])
            if other not in driven and moves and shape.spans[other] == shape.spans[bone]:
                yield bone, other


def _rotation_chains(skeleton: Skeleton, step: LegStep) -> list[tuple[int, ...]]:
    """Returns the chains that play the rotations of a leg: the leg itself, and each other toe."""
    foot, proper = step.leg[-1], step.limb.proper
    return [proper, *((foot, toe) for toe in skeleton.children[foot] if toe not in proper)]


def _plant_feet(
    shape: Shape, steps: Sequence[LegStep], performer: PerformerGait, turns: Float, joints: Float
) -> list[Float]:
    """Moves the body of posed legs so that their feet stand still; changes ``turns`` and ``joints`` in place.

    Returns:
        For each leg, the offset (T, 3) in metres that remains for its foot.
    """
    root, floor = joints[:, 0].copy(), floor_of(shape)
    # Begin with the performer's floor at the model's floor. It remains if no foot ever stands.
    way = root.copy()
    way[:, 1] += floor - np.median(performer.floor(shape, root[:, 1]))
    soles = [_foot_part(shape, step) for step in steps]
    posed = partial(_leg_in_pose, shape.skeleton, performer=performer, root=root, turns=turns, joints=joints)
    for step, sole in zip(steps, soles, strict=True):
        _hold_heading(shape.skeleton, step, sole, performer, root, turns, joints)
    legs = [posed(step, sole) for step, sole in zip(steps, soles, strict=True)]
    _, offsets = plant_body(legs, way, performer.step, floor)
    for step, sole, offset in zip(steps, soles, offsets, strict=True):
        _tilt_foot(shape.skeleton, step, sole, offset[:, 1], performer.step, turns, joints)
    legs = [posed(step, sole) for step, sole in zip(steps, soles, strict=True)]
    way, offsets = plant_body(legs, way, performer.step, floor)
    joints += (way - root)[:, None]
    goals = [joints[:, step.leg[-1]] + offset for step, offset in zip(steps, offsets, strict=True)]
    drops = [
        _required_lowering(shape.skeleton, step, at, joints) for step, at in zip(steps, goals, strict=True)
    ]
    # Lower the body for feet that would not reach the floor. Swinging feet keep their positions.
    down = _smooth_drops(np.max(drops, axis=0), performer.step)[:, None] * [0.0, 1.0, 0.0]
    joints -= down[:, None]
    return [offset + down for offset in offsets]


def _foot_part(shape: Shape, step: LegStep) -> Sole:
    """Returns the part of a leg that may touch the floor: its foot, or without one the end of its shin."""
    return Sole(shape, shape.skeleton.below(step.leg[-1])[1:] or [step.leg[-1]])


def _leg_in_pose(
    skeleton: Skeleton,
    step: LegStep,
    sole: Sole,
    performer: PerformerGait,
    root: Float,
    turns: Float,
    joints: Float,
) -> PosedLeg:
    """Returns a leg in the performer's pose over time, for a path ``root`` (T, 3) of the body in metres."""
    length, spans = leg_length(skeleton, step.leg), _contact_spans(skeleton, step, performer, root)
    heights = (
        performer.beside[:, list(step.by.proper[len(step.by_leg) - 1 :]), 1] + performer.root_height[:, None]
    )
    clear = performer.scale * contact_clearance(heights, spans)
    return PosedLeg(*sole.rolling(turns, joints - root[:, None], length), clear, length, spans)


def _contact_spans(skeleton: Skeleton, step: LegStep, performer: PerformerGait, root: Float) -> Spans:
    """Returns the contacts of the performer's foot, for a path ``root`` (T, 3) of the body in metres."""
    # A model without toes leaves the floor together with the ball of the performer's foot.
    ball, *tip = step.by_toes or step.by.chain[-1:]
    rolls_on = [step.by_leg[-1], ball, *tip] if step.toes else [ball]
    foot = root[:, None] + performer.scale * performer.beside[:, rolls_on]
    return standing_spans(foot, root, performer.step, leg_length(skeleton, step.leg))


def _hold_heading(
    skeleton: Skeleton,
    step: LegStep,
    sole: Sole,
    performer: PerformerGait,
    root: Float,
    turns: Float,
    joints: Float,
) -> None:
    """Keeps a standing foot from spinning about the vertical; changes ``turns`` and ``joints`` in place."""
    if not step.toes:
        return
    ankle, length = step.leg[-1], leg_length(skeleton, step.leg)
    spin = sole.spin(turns, joints, length)
    back = remove_spin(spin, _contact_spans(skeleton, step, performer, root), performer.step)
    _turn_foot(skeleton, ankle, from_rotation_vector(back[:, None] * [0.0, 1.0, 0.0]), turns, joints)


def _turn_foot(skeleton: Skeleton, ankle: int, turning: Float, turns: Float, joints: Float) -> None:
    """Rotates all bones below an ankle about it by ``turning`` (T, 4).

    Changes ``turns`` and ``joints`` in place.
    """
    for j in skeleton.below(ankle)[1:]:
        turns[:, j] = multiply(turning, turns[:, j])
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])


def _tilt_foot(
    skeleton: Skeleton, step: LegStep, sole: Sole, lift: Float, pace: float, turns: Float, joints: Float
) -> None:
    """Rotates a foot about its ankle to raise its toes or heel by ``lift`` (T,) metres, as far as it can.

    Changes ``turns`` (T, N, 4) and ``joints`` (T, N, 3) in place. Any remaining lift is left to the leg.

    Args:
        pace: seconds between two moments.
    """
    ankle, low = step.leg[-1], np.flatnonzero(lift > 0.0)
    ahead = skeleton.positions[step.limb.proper[-1]] - skeleton.positions[ankle]
    across = np.cross(ahead, [0.0, 1.0, 0.0])
    if not (len(low) and np.linalg.norm(across) > _MIN_TOE_DISTANCE * np.linalg.norm(ahead)):
        return
    axes = rotate(turns[:, step.toes[0]], across / np.linalg.norm(across))
    # If a foot points down, its toes are lowest and rise as it tilts up. Otherwise its heel is lowest.
    up = np.where(rotate(turns[:, step.toes[0]], ahead)[:, 1] < ahead[1], 1.0, -1.0)
    tried, angles = np.linspace(0.0, _MAX_TILT, _TILT_ANGLES), np.zeros(len(turns))
    risen = np.stack(
        [
            sole.lowest_turned(turns[low], joints[low], from_rotation_vector((a * up * axes.T).T[low]), ankle)
            for a in tried
        ]
    )
    risen -= risen[0].copy()
    # Choose the smallest tilt that gives the required lift, or else the one with the largest lift.
    enough = risen >= np.minimum(lift[low], risen.max(0))
    angles[low] = tried[enough.argmax(0)] * up[low]
    angles = scipy.ndimage.uniform_filter1d(angles, 2 * max(round(_EASING_S / pace), 1) + 1, mode="nearest")
    _turn_foot(skeleton, ankle, from_rotation_vector(angles[:, None] * axes), turns, joints)


def _end_targets(shape: Shape, step: LegStep, performer: PerformerGait, turns: Float, joints: Float) -> Float:
    """Returns the target positions (T, 3) in metres for the end of a leg, for the pose of the model."""
    skeleton, ankle, foot = shape.skeleton, step.leg[-1], performer.foot(step.by)
    heading, scale = heading_of(turns[:, 0]), performer.scale
    home = performer.home(foot, heading)
    rest = skeleton.positions[ankle] - skeleton.positions[0]
    even = _smooth_headings(heading, round(STRIDE_S / performer.step))
    return np.asarray(joints[:, 0] + scale * performer.beside[:, foot] + rotate(even, rest - scale * home))


def _required_lowering(skeleton: Skeleton, step: LegStep, goals: Float, joints: Float) -> Float:
    """Returns the distance (T,) in metres to lower the body so that a leg reaches its goals (T, 3)."""
    chain = step.leg
    hip, full_length = joints[:, chain[0]], leg_length(skeleton, chain)
    far = np.maximum(np.linalg.norm(joints[:, chain[-1]] - hip, axis=1), _MAX_LEG_STRETCH * full_length)
    way = goals - hip
    level = np.hypot(way[:, 0], way[:, 2])
    reach = -np.sqrt(np.maximum(far**2 - level**2, 0.0))
    return np.asarray(np.clip(reach - way[:, 1], 0.0, _MAX_LOWERING * full_length))


def _bend_leg(
    skeleton: Skeleton, step: LegStep, performer: PerformerGait, goals: Float, turns: Float, joints: Float
) -> None:
    """Bends a leg so that its end reaches ``goals`` (T, 3); changes ``turns`` and ``joints`` in place."""
    chain, heading = step.leg, heading_of(turns[:, 0])
    weights = np.ones(len(turns)) if step.arm is None else performer.walking_weights(step.arm)
    moved = {bone for path in _rotation_chains(skeleton, step) for bone in path[1:]}
    for j in sorted(moved.union(skeleton.below(chain[-1])[1:])):
        if j in moved and not step.posed:
            turns[:, j] = slerp(turns[:, j], heading, weights)
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])
    _bend_limb(skeleton, chain, weights, goals, turns, joints)


def _bend_limb(
    skeleton: Skeleton, chain: Sequence[int], weights: Float, goals: Float, turns: Float, joints: Float
) -> None:
    """Bends a limb so that its end moves to ``goals`` (T, 3), by the fraction ``weights`` (T,) of the way.

    Changes ``turns`` (T, N, 4) and ``joints`` (T, N, 3) in place. The foot keeps its orientation.
    """
    middle, side = find_bend(skeleton, chain)
    below_end, none = skeleton.parents == chain[-1], np.zeros(len(turns))
    tree, bones = (
        (skeleton.parents, skeleton.vectors[None]),
        (np.array(chain, np.int32), middle, side, below_end),
    )
    pin_limb(*tree, *bones, 0.0, 0.0, weights, goals, none, turns, joints)


def _lift_forelegs(
    shape: Shape,
    clip: Clip,
    steps: Sequence[LegStep],
    performer: PerformerGait,
    times: Float,
    turns: Float,
    joints: Float,
) -> None:
    """Bends forelegs that an arm drives until they are above the floor.

    Changes ``turns`` and ``joints`` in place. An arm that hangs or punches can push a foreleg below the
    floor. The lowest point of the body is put on the floor later, so that foreleg would lift the other feet.

    Args:
        times: (T,) seconds.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.
    """
    supports = [_foot_part(shape, step) for step in steps if step.arm is None]
    forelegs = [step for step in steps if step.arm is not None]
    if not (supports and forelegs):
        return
    low = np.min([sole.lowest(turns, joints) for sole in supports], axis=0)
    floor = _floor_under_feet(shape, clip, performer, times, joints, low)
    for step in forelegs:
        limb = Sole(shape, shape.skeleton.below(step.leg[0])[1:])
        for _ in range(_MAX_LIFT_PASSES):
            lift = np.maximum(floor - limb.lowest(turns, joints), 0.0)
            if not lift.any():
                break
            goals = joints[:, step.leg[-1]] + lift[:, None] * [0.0, 1.0, 0.0]
            _bend_limb(shape.skeleton, step.leg, (lift > 0.0).astype(float), goals, turns, joints)


def _floor_under_feet(
    shape: Shape, clip: Clip, performer: PerformerGait, times: Float, joints: Float, low: Float
) -> Float:
    """Returns the height (T,) in metres below which no foreleg may reach.

    While the performer is on their feet, that is the lowest point of the model's other feet. A performer on
    their hands or knees may have their feet in the air. Then it is the floor under them, if that is lower.

    Args:
        times: (T,) seconds.
        joints: (T, N, 3) metres.
        low: (T,) metres, the lowest point of the feet that no arm drives.
    """
    stands = np.interp(times, np.arange(len(clip.turns)) * clip.step, standing_on_feet(clip))
    floor = performer.floor(shape, joints[:, 0, 1])
    floor += np.median((low - floor)[stands >= min(0.5, stands.max())])
    return stands * low + (1.0 - stands) * np.minimum(low, floor)


def _smooth_drops(drops: Float, step: float) -> Float:
    """Returns smooth drops (T,) in metres that are never smaller than the given ones."""
    wide = max(round(_EASING_S / step), 1)
    widest = scipy.ndimage.maximum_filter1d(drops, 2 * wide + 1, mode="nearest")
    return np.asarray(scipy.ndimage.uniform_filter1d(widest, 2 * wide + 1, mode="nearest"))


def _smooth_headings(headings: Float, count: int) -> Float:
    """Returns headings (T, 4) averaged over ``count`` moments, so that feet do not turn as the body sways."""
    angles = np.unwrap(2.0 * np.arctan2(headings[:, 2], headings[:, 0]))
    even = scipy.ndimage.uniform_filter1d(angles, max(count, 1), mode="nearest") / 2.0
    return np.stack([np.cos(even), 0.0 * even, np.sin(even), 0.0 * even], axis=1)
