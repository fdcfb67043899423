"""Posed legs: moves the body, and bends legs in the performer's pose, so that standing feet are still.

    plant_feet(shape, steps, performer, turns, joints)      # changes turns and joints in place

The path of the body is that of :mod:`enliven.mapping.legs.planting`. The pelvis, the feet and the knees then
close the distances that remain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import RiggedCharacter, Skeleton
from enliven.mapping.ground import floor_height_under
from enliven.mapping.legs.gait import LegStep, PerformerGait, leg_length
from enliven.mapping.legs.leg_motion import (
    EASING_S,
    SOLE_PASSES,
    bend_leg,
    compute_sole_offsets,
    make_foot_sole,
    measure_leg,
    smooth_drops,
    update_rolling,
)
from enliven.mapping.legs.planting import (
    PosedLeg,
    Spans,
    find_standing_spans,
    hip_shift,
    plant_body,
    remove_spin,
)
from enliven.mapping.legs.sole import Sole
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
_TOE_SMOOTH_S = 0.1
"""Time in seconds over which the bend of toes is averaged. Toes are short, so in captures their angle jumps
by several degrees from frame to frame. A real push-off takes longer."""
_MIN_SHIN_SLOPE = 0.5
"""Smallest vertical part of a shin's direction, as a fraction of its length, that determines how far the shin
twists. A twist of a flatter shin hardly rotates its sole about the vertical."""
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
        measure_leg(shape.skeleton, step, sole, spans, performer, turns, joints - root[:, None])
        for step, sole, spans in zip(steps, soles, contacts, strict=True)
    ]
    if _turn_pelvis(shape.skeleton, steps, legs, performer, turns, joints):
        legs = update_rolling(legs, soles, turns, joints - root[:, None])
    _, offsets = plant_body(legs, corrected_root, performer.step, floor)
    for step, sole, offset in zip(steps, soles, offsets, strict=True):
        _tilt_foot(shape.skeleton, step, sole, offset[:, 1], performer.step, turns, joints)
    legs = update_rolling(legs, soles, turns, joints - root[:, None])
    corrected_root, offsets = plant_body(legs, corrected_root, performer.step, floor)
    joints += (corrected_root - root)[:, None]
    targets = [joints[:, step.leg[-1]] + offset for step, offset in zip(steps, offsets, strict=True)]
    drops = [
        _compute_required_lowering(shape.skeleton, step, target, joints)
        for step, target in zip(steps, targets, strict=True)
    ]
    # Lower the body for feet that would not reach the floor. Swinging feet keep their positions.
    joints -= (smooth_drops(np.max(drops, axis=0), performer.step)[:, None] * [0.0, 1.0, 0.0])[:, None]
    for step, target in zip(steps, targets, strict=True):
        bend_leg(shape.skeleton, step, performer, target, turns, joints)
    _correct_soles(shape, steps, soles, legs, spins, performer, turns, joints)


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
    for _ in range(SOLE_PASSES):
        for step, sole, leg, spin in zip(steps, soles, legs, spins, strict=True):
            excess = remove_spin(
                sole.compute_accumulated_rotation(turns, joints) - spin, leg.spans, performer.step
            )
            _turn_sole(skeleton, step, excess, turns, joints)
        offsets = compute_sole_offsets(legs, soles, performer.step, floor, turns, joints)
        if not offsets:
            break
        for step, offset in zip(steps, offsets, strict=True):
            bend_leg(skeleton, step, performer, joints[:, step.leg[-1]] + offset, turns, joints)


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
    angles = scipy.ndimage.uniform_filter1d(angles, 2 * max(round(EASING_S / step_s), 1) + 1, mode="nearest")
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
