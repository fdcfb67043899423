"""Posed legs: moves the body, and bends legs in the performer's pose, so that standing feet are still.

    plant_feet(shape, steps, performer, turns, joints)      # changes turns and joints in place

The path of the body is that of :mod:`enliven.mapping.legs.planting`. The pelvis, the feet and the knees then
close the distances that remain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from enliven.arrays import Bool, Float
from enliven.document import RiggedCharacter, Skeleton
from enliven.mapping.ground import floor_height_under
from enliven.mapping.legs.gait import LegStep, PerformerGait, leg_length
from enliven.mapping.legs.leg_motion import bend_leg, bend_limb, make_foot_sole
from enliven.mapping.legs.planting import (
    PosedLeg,
    Spans,
    compute_remaining_offsets,
    contact_clearance,
    find_standing_spans,
    hip_shift,
    plant_body,
    remove_spin,
)
from enliven.mapping.legs.sole import Sole
from enliven.motion.contact.contacts import find_runs
from enliven.motion.contact.pin import find_bend
from enliven.rotation import (
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    remove_sign_jumps,
    rotate,
    swing,
    to_rotation_vector,
    unit,
)

_MAX_TILT = np.radians(30.0)
"""Largest tilt (radians) of a foot that is rotated to clear the floor. A human ankle allows 20 to 50
degrees."""
_TILT_ANGLES = 7
"""Number of angles from 0 to ``_MAX_TILT`` that are tried."""
_MIN_TOE_DISTANCE = 0.1
"""A foot is tilted only if its toes are at least this fraction of its length ahead of the ankle, measured
horizontally."""
_MAX_LEG_STRETCH = 0.99
"""Largest distance from hip to ankle as a fraction of the leg's length, because a fully stretched knee would
jerk. A larger distance in the performer's pose is kept."""
_MAX_LOWERING = 0.15
"""Maximum lowering of the body so that feet reach the floor, as a fraction of the leg length."""
_EASING_S = 0.05
"""Half width in seconds of the filters that smooth the lowering of the body and the tilt of a foot."""
_TOE_SMOOTH_S = 0.1
"""Time in seconds over which the bend of toes is averaged. Toes are short, so in captures their angle jumps
by several degrees from frame to frame. A real push-off takes longer."""
_SOLE_PASSES = 3
"""Number of passes that correct the soles after the legs have been bent. Each pass leaves 40 % of the error
if the shin has 40 % of the sole's skin weight."""
_MIN_CORRECTION = 1e-4
"""The passes that correct the soles end if all corrections are below this fraction of the leg's length: 0.1
mm on an adult."""
_MIN_SHIN_SLOPE = 0.5
"""Smallest vertical part of a shin's direction, as a fraction of its length, that determines how far the shin
twists. A twist of a flatter shin hardly rotates its sole about the vertical."""
_MIN_FLIGHT_HEIGHT = 0.4
"""Smallest height of the lowest foot of a stepping model in the air, as a fraction of the height of the
performer's lowest foot. With a smaller height, feet would drag over the floor between the contacts of a
run."""
_MAX_STEP_LOWERING = 0.06
"""Maximum lowering of a stepping model so that its standing feet reach the floor, as a fraction of the leg
length. An animal with straight legs takes long steps only if its body is lower. A much lower body would
stretch the skin of its legs."""
_MAX_STEP_STRETCH = 0.998
"""Largest distance from hip to ankle of a leg that steps, as a fraction of the length of the straight leg."""
_MAX_HORIZONTAL_REACH = 0.6
"""Horizontal distance from hip to foot, as a fraction of the leg's length, above which a lower body no longer
helps the foot to reach its place."""
_STEP_EASING_S = 0.15
"""Half width in seconds of the filters that smooth the lowering of a stepping model. With a shorter time, its
body would bob with each step."""
_MIN_STEPPING_WEIGHT = 0.5
"""Minimum walking weight of a foreleg. Below it the foreleg mainly follows the performer's arm, and its foot
is not planted."""
_MAX_PELVIS_TURN = np.radians(8.0)
"""Largest rotation (radians) of the bones from the pelvis to the hips, relative to the performer's. Such a
rotation is invisible even if the hips are wide."""


def plant_feet(
    shape: RiggedCharacter, steps: Sequence[LegStep], performer: PerformerGait, turns: Float, joints: Float
) -> None:
    """Moves the body and bends posed legs so that standing feet are still. Changes ``turns`` and ``joints``
    in place."""
    root, floor = joints[:, 0].copy(), floor_height_under(shape)
    # First put the performer's floor at the height of the model's floor. If no foot ever stands, this is the
    # final result.
    corrected_root = root.copy()
    corrected_root[:, 1] += floor - np.median(performer.compute_floor_height(shape, root[:, 1]))
    soles = [make_foot_sole(shape, step) for step in steps]
    contacts = [_contact_spans(shape.skeleton, step, performer, root) for step in steps]
    for step in steps:
        _smooth_toes(shape.skeleton, step, performer.step, turns, joints)
    spins = [
        _hold_heading(shape.skeleton, step, sole, spans, performer.step, turns, joints)
        for step, sole, spans in zip(steps, soles, contacts, strict=True)
    ]
    legs = [
        _leg_in_pose(shape.skeleton, step, sole, spans, performer, turns, joints - root[:, None])
        for step, sole, spans in zip(steps, soles, contacts, strict=True)
    ]
    if _turn_pelvis(shape.skeleton, steps, legs, performer, turns, joints):
        legs = _update_rolling(legs, soles, turns, joints - root[:, None])
    _, offsets = plant_body(legs, corrected_root, performer.step, floor)
    for step, sole, offset in zip(steps, soles, offsets, strict=True):
        _tilt_foot(shape.skeleton, step, sole, offset[:, 1], performer.step, turns, joints)
    legs = _update_rolling(legs, soles, turns, joints - root[:, None])
    corrected_root, offsets = plant_body(legs, corrected_root, performer.step, floor)
    joints += (corrected_root - root)[:, None]
    targets = [joints[:, step.leg[-1]] + offset for step, offset in zip(steps, offsets, strict=True)]
    drops = [
        _compute_required_lowering(shape.skeleton, step, target, joints)
        for step, target in zip(steps, targets, strict=True)
    ]
    # Lower the body for feet that would not reach the floor. Swinging feet keep their positions.
    joints -= (_smooth_drops(np.max(drops, axis=0), performer.step)[:, None] * [0.0, 1.0, 0.0])[:, None]
    for step, target in zip(steps, targets, strict=True):
        bend_leg(shape.skeleton, step, performer, target, turns, joints)
    _correct_soles(shape, steps, soles, legs, spins, performer, turns, joints)


def plant_stepping_feet(
    shape: RiggedCharacter,
    steps: Sequence[LegStep],
    contacts: Sequence[Spans],
    performer: PerformerGait,
    turns: Float,
    joints: Float,
) -> None:
    """Moves the body, and bends legs that step, so that standing feet are still. Changes ``turns`` and
    ``joints`` in place.

    A foreleg that an arm drives does not affect the body. While the foreleg follows the arm, its foot is not
    planted.

    Args:
        shape: the model.
        steps: the legs. Their feet follow the performer's feet already.
        contacts: the contacts of the performer's foot, for each leg.
        performer: the performer's gait.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.
    """
    skeleton, floor = shape.skeleton, floor_height_under(shape)
    root = joints[:, 0].copy()
    soles = [make_foot_sole(shape, step) for step in steps]
    legs = [
        _stepping_leg(skeleton, step, sole, spans, performer, turns, joints - root[:, None])
        for step, sole, spans in zip(steps, soles, contacts, strict=True)
    ]
    supports = [leg for step, leg in zip(steps, legs, strict=True) if step.arm is None]
    if not any(leg.spans for leg in supports):
        root[:, 1] += floor - np.median(root[:, 1] + np.min([leg.sole for leg in supports], axis=0))
    # In the air the model is as high as the performer leaps. In the short flights of a run it is lower.
    clearance = np.min([leg.clearance for leg in supports], axis=0)
    air_height = np.maximum(performer.compute_leap_heights(), _MIN_FLIGHT_HEIGHT * clearance)
    corrected_root, _ = plant_body(supports, root, performer.step, floor, air_height)
    joints += (corrected_root - joints[:, 0])[:, None]
    offsets = compute_remaining_offsets(legs, corrected_root, performer.step, floor)
    targets = [joints[:, step.leg[-1]] + offset for step, offset in zip(steps, offsets, strict=True)]
    drops = [
        _compute_helpful_lowering(skeleton, step, leg, target, joints)
        for step, leg, target in zip(steps, legs, targets, strict=True)
    ]
    drop = _smooth_drops(np.max(drops, axis=0), performer.step, _STEP_EASING_S)
    joints -= (drop[:, None] * [0.0, 1.0, 0.0])[:, None]
    for step, target in zip(steps, targets, strict=True):
        bend_limb(skeleton, step.leg, np.ones(len(turns)), target, turns, joints)
    for _ in range(_SOLE_PASSES):
        offsets = _compute_sole_offsets(legs, soles, performer.step, floor, turns, joints)
        if not offsets:
            break
        for step, offset in zip(steps, offsets, strict=True):
            target = joints[:, step.leg[-1]] + offset
            bend_limb(skeleton, step.leg, np.ones(len(turns)), target, turns, joints)


def _compute_sole_offsets(
    legs: Sequence[PosedLeg], soles: Sequence[Sole], step_s: float, floor: float, turns: Float, joints: Float
) -> list[Float]:
    """Returns the offset (T, 3) in metres that each sole still has from its place, after the legs were bent.

    The list is empty if all offsets are negligible.
    """
    bent_legs = _update_rolling(legs, soles, turns, joints)
    offsets = compute_remaining_offsets(bent_legs, np.zeros_like(joints[:, 0]), step_s, floor)
    are_small = all(
        np.abs(d).max() < _MIN_CORRECTION * leg.length for d, leg in zip(offsets, legs, strict=True)
    )
    return [] if are_small else offsets


def _mark_standing_frames(spans: Spans, count: int) -> Bool:
    """Returns (T,) True for the frames within the spans, of ``count`` frames."""
    stands = np.zeros(count, np.bool_)
    for first, last in spans:
        stands[first : last + 1] = True
    return stands


def _compute_helpful_lowering(
    skeleton: Skeleton, step: LegStep, leg: PosedLeg, targets: Float, joints: Float
) -> Float:
    """Returns how far (T,), metres, the body must be lowered for a standing foot of a leg that steps to reach
    its targets (T, 3).

    A foot that is far to the side of its hip, as a spider's, would hardly reach farther if the body was
    lower. So for a larger horizontal distance the body is not lowered farther.
    """
    chain = step.leg
    hip, knee, foot = skeleton.positions[[chain[0], chain[find_bend(skeleton, chain)[0]], chain[-1]]]
    max_distance = _MAX_STEP_STRETCH * (np.linalg.norm(knee - hip) + np.linalg.norm(foot - knee))
    offset = targets - joints[:, chain[0]]
    horizontal = np.minimum(np.hypot(offset[:, 0], offset[:, 2]), _MAX_HORIZONTAL_REACH * max_distance)
    reach = -np.sqrt(max_distance**2 - horizontal**2)
    drops = np.clip(reach - offset[:, 1], 0.0, _MAX_STEP_LOWERING * leg.length)
    return np.asarray(_mark_standing_frames(leg.spans, len(drops)) * drops)


def _stepping_leg(
    skeleton: Skeleton,
    step: LegStep,
    sole: Sole,
    spans: Spans,
    performer: PerformerGait,
    turns: Float,
    joints: Float,
) -> PosedLeg:
    """Returns a leg that steps, with its contacts ``spans``, given joints (T, N, 3) in metres relative to the
    root.

    For a foreleg that an arm drives, only the contacts during which it steps are used.
    """
    leg = _leg_in_pose(skeleton, step, sole, spans, performer, turns, joints)
    if step.arm is None:
        return leg
    is_stepping = performer.walking_weights(step.arm) >= _MIN_STEPPING_WEIGHT
    stands = _mark_standing_frames(spans, len(turns))
    return replace(
        leg,
        clearance=np.where(is_stepping, leg.clearance, 0.0),
        spans=tuple(find_runs(stands & is_stepping)),
    )


def _turn_pelvis(
    skeleton: Skeleton,
    steps: Sequence[LegStep],
    legs: Sequence[PosedLeg],
    performer: PerformerGait,
    turns: Float,
    joints: Float,
) -> bool:
    """Rotates the bones from the pelvis to the hips so that legs need not bend while both feet stand.

    Changes ``turns`` and ``joints`` in place. Trunk, thighs, shins and feet keep their rotations.

    Returns:
        True if the bones were rotated.
    """
    bones = find_pelvis_bones(skeleton, steps)
    if not bones:
        return False
    left, right = (step.leg[0] for step in steps)
    apart = joints[:, left] - joints[:, right]
    # If a model's legs differ in length, its hips differ in height at rest.
    heights = [
        performer.scale * performer.offsets[:, step.source_leg[0], 1] + skeleton.positions[step.leg[0], 1]
        for step in steps
    ]
    shift = hip_shift(legs[0], legs[1], heights[0] - heights[1] - apart[:, 1], performer.step)
    angles = to_rotation_vector(swing(unit(apart), unit(apart + shift)))
    angle = np.linalg.norm(angles, axis=1, keepdims=True)
    angles *= np.tanh(angle / _MAX_PELVIS_TURN) * _MAX_PELVIS_TURN / np.maximum(angle, 1e-12)
    turning = from_rotation_vector(angles)
    for path in bones:
        for j in path[1:]:
            turns[:, j] = multiply(turning, turns[:, j])
    for j in sorted(j for path in bones for j in skeleton.list_subtree(path[1])):
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])
    return True


def find_pelvis_bones(skeleton: Skeleton, steps: Sequence[LegStep]) -> list[tuple[int, ...]]:
    """Returns the joints from the pelvis to each hip of two posed legs, or nothing for other numbers of
    legs."""
    hips = [step.leg[0] for step in steps if step.posed]
    if len(hips) != 2:
        return []
    paths = [skeleton.path(0, hip) for hip in hips]
    pelvis = max(set(paths[0]).intersection(paths[1]), key=paths[0].index)
    if pelvis in hips:
        return []
    return [path[path.index(pelvis) :] for path in paths]


def _correct_soles(
    shape: RiggedCharacter,
    steps: Sequence[LegStep],
    soles: Sequence[Sole],
    legs: Sequence[PosedLeg],
    spins: Sequence[Float],
    performer: PerformerGait,
    turns: Float,
    joints: Float,
) -> None:
    """Corrects the feet for the motion of their soles with the bent legs. Changes ``turns`` and ``joints`` in
    place.

    If some skin of the sole is also weighted to the shin, the sole moves when its leg bends, even if the foot
    does not.

    Args:
        legs: the legs before they were bent.
        spins: (T,) radians for each leg, the rotation of the sole about +Y that is intended.
    """
    skeleton, floor = shape.skeleton, floor_height_under(shape)
    for _ in range(_SOLE_PASSES):
        for step, sole, leg, spin in zip(steps, soles, legs, spins, strict=True):
            excess = remove_spin(
                sole.compute_accumulated_rotation(turns, joints) - spin, leg.spans, performer.step
            )
            _turn_sole(skeleton, step, excess, turns, joints)
        offsets = _compute_sole_offsets(legs, soles, performer.step, floor, turns, joints)
        if not offsets:
            break
        for step, offset in zip(steps, offsets, strict=True):
            bend_leg(skeleton, step, performer, joints[:, step.leg[-1]] + offset, turns, joints)


def _leg_in_pose(
    skeleton: Skeleton,
    step: LegStep,
    sole: Sole,
    spans: Spans,
    performer: PerformerGait,
    turns: Float,
    joints: Float,
) -> PosedLeg:
    """Returns a leg in the performer's pose over time, given joints (T, N, 3) in metres relative to the
    root."""
    heights = (
        performer.offsets[:, list(step.source.proper[len(step.source_leg) - 1 :]), 1]
        + performer.root_height[:, None]
    )
    clearance = performer.scale * contact_clearance(heights, spans)
    return PosedLeg(*sole.compute_rolling(turns, joints), clearance, leg_length(skeleton, step.leg), spans)


def _update_rolling(
    legs: Sequence[PosedLeg], soles: Sequence[Sole], turns: Float, joints: Float
) -> list[PosedLeg]:
    """Returns the legs with the current motion of their soles, given the current ``turns`` and ``joints``."""
    motions = [sole.compute_rolling(turns, joints) for sole in soles]
    return [
        replace(leg, rolled=rolled, sole=lowest) for leg, (rolled, lowest) in zip(legs, motions, strict=True)
    ]


def _contact_spans(skeleton: Skeleton, step: LegStep, performer: PerformerGait, root: Float) -> Spans:
    """Returns the contacts of the performer's foot, given the path ``root`` (T, 3) of the body in metres."""
    # The foot of a model without toes leaves the floor together with the ball of the performer's foot.
    ball, *tip = step.source_toes or step.source.chain[-1:]
    joints = [step.source_leg[-1], ball, *tip] if step.toes else [ball]
    foot = root[:, None] + performer.scale * performer.offsets[:, joints]
    return find_standing_spans(foot, root, performer.step, leg_length(skeleton, step.leg))


def _smooth_toes(skeleton: Skeleton, step: LegStep, step_s: float, turns: Float, joints: Float) -> None:
    """Smooths the rotation of toes relative to their foot over time. Changes ``turns`` and ``joints`` in
    place.

    A sole with toes that tremble cannot stand still.

    Args:
        step_s: seconds from one frame to the next.
    """
    ankle, width = step.leg[-1], 2 * round(0.5 * _TOE_SMOOTH_S / step_s) + 1
    foot = turns.copy()
    for j in skeleton.list_subtree(ankle)[1:]:
        parent = int(skeleton.parents[j])
        if parent != ankle:
            bend = remove_sign_jumps(multiply(conjugate(foot[:, parent]), foot[:, j])[:, None])[:, 0]
            bend = normalized(scipy.ndimage.uniform_filter1d(bend, width, axis=0, mode="nearest"))
            turns[:, j] = multiply(turns[:, parent], bend)
        joints[:, j] = joints[:, parent] + rotate(turns[:, j], skeleton.vectors[j])


def _hold_heading(
    skeleton: Skeleton, step: LegStep, sole: Sole, spans: Spans, step_s: float, turns: Float, joints: Float
) -> Float:
    """Stops a standing foot from spinning about the vertical. Changes ``turns`` and ``joints`` in place.

    Args:
        spans: the contacts of the foot.
        step_s: seconds from one frame to the next.

    Returns:
        (T,) radians, the intended rotation of the sole about +Y.
    """
    spin = sole.compute_accumulated_rotation(turns, joints)
    correction = remove_spin(spin, spans, step_s)
    _turn_sole(skeleton, step, correction, turns, joints)
    return spin + correction


def _turn_sole(skeleton: Skeleton, step: LegStep, angles: Float, turns: Float, joints: Float) -> None:
    """Rotates the sole of a leg by ``angles`` (T,) radians about +Y. Changes ``turns`` and ``joints`` in
    place.

    A foot rotates about its ankle. If the leg has no foot, its sole is the end of the shin, so the shin
    twists about its own axis. Knee and ankle stay where they are.
    """
    ankle = step.leg[-1]
    if step.toes:
        vertical = from_rotation_vector(angles[:, None] * [0.0, 1.0, 0.0])
        _turn_foot(skeleton, ankle, vertical, turns, joints)
        return
    axes = unit(joints[:, step.leg[-2]] - joints[:, ankle])
    slopes = np.where(axes[:, 1] < 0.0, -1.0, 1.0) * np.maximum(np.abs(axes[:, 1]), _MIN_SHIN_SLOPE)
    twist = from_rotation_vector((angles / slopes)[:, None] * axes)
    turns[:, ankle] = multiply(twist, turns[:, ankle])


def _turn_foot(skeleton: Skeleton, ankle: int, turning: Float, turns: Float, joints: Float) -> None:
    """Rotates all descendants of an ankle about the ankle by ``turning`` (T, 4).

    Changes ``turns`` and ``joints`` in place.
    """
    for j in skeleton.list_subtree(ankle)[1:]:
        turns[:, j] = multiply(turning, turns[:, j])
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])


def _tilt_foot(
    skeleton: Skeleton, step: LegStep, sole: Sole, lift: Float, step_s: float, turns: Float, joints: Float
) -> None:
    """Rotates a foot about its ankle to raise its toes or heel by ``lift`` (T,) metres, as far as the ankle
    allows.

    Changes ``turns`` (T, N, 4) and ``joints`` (T, N, 3) in place. The remaining lift is left to the leg.

    Args:
        step_s: seconds from one frame to the next.
    """
    ankle, frames = step.leg[-1], np.flatnonzero(lift > 0.0)
    forward = skeleton.positions[step.limb.proper[-1]] - skeleton.positions[ankle]
    lateral = np.cross(forward, [0.0, 1.0, 0.0])
    if not (len(frames) and np.linalg.norm(lateral) > _MIN_TOE_DISTANCE * np.linalg.norm(forward)):
        return
    axes = rotate(turns[:, step.toes[0]], lateral / np.linalg.norm(lateral))
    # If a foot points down, its toes are its lowest part, so they are tilted up. Otherwise its heel is the
    # lowest part.
    sign = np.where(rotate(turns[:, step.toes[0]], forward)[:, 1] < forward[1], 1.0, -1.0)
    candidates, angles = np.linspace(0.0, _MAX_TILT, _TILT_ANGLES), np.zeros(len(turns))
    turnings = [from_rotation_vector((angle * sign * axes.T).T[frames]) for angle in candidates]
    lift_by_angle = sole.compute_turned_heights(turns[frames], joints[frames], turnings, ankle)
    lift_by_angle -= lift_by_angle[0].copy()
    # Choose the smallest tilt that gives the required lift. If there is none, choose the tilt with the
    # largest lift.
    is_enough = lift_by_angle >= np.minimum(lift[frames], lift_by_angle.max(0))
    angles[frames] = candidates[is_enough.argmax(0)] * sign[frames]
    angles = scipy.ndimage.uniform_filter1d(angles, 2 * max(round(_EASING_S / step_s), 1) + 1, mode="nearest")
    _turn_foot(skeleton, ankle, from_rotation_vector(angles[:, None] * axes), turns, joints)


def _compute_required_lowering(skeleton: Skeleton, step: LegStep, targets: Float, joints: Float) -> Float:
    """Returns how far (T,), metres, the body must be lowered for a leg to reach its targets (T, 3)."""
    chain = step.leg
    hip, full_length = joints[:, chain[0]], leg_length(skeleton, chain)
    max_distance = np.maximum(
        np.linalg.norm(joints[:, chain[-1]] - hip, axis=1), _MAX_LEG_STRETCH * full_length
    )
    offset = targets - hip
    horizontal = np.hypot(offset[:, 0], offset[:, 2])
    reach = -np.sqrt(np.maximum(max_distance**2 - horizontal**2, 0.0))
    return np.asarray(np.clip(reach - offset[:, 1], 0.0, _MAX_LOWERING * full_length))


def _smooth_drops(drops: Float, step: float, easing_s: float = _EASING_S) -> Float:
    """Returns smooth distances (T,) in metres that are never smaller than ``drops`` (T,)."""
    radius = max(round(easing_s / step), 1)
    maxima = scipy.ndimage.maximum_filter1d(drops, 2 * radius + 1, mode="nearest")
    return np.asarray(scipy.ndimage.uniform_filter1d(maxima, 2 * radius + 1, mode="nearest"))
