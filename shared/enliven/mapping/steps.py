"""Steps: the feet of a model follow the performer's feet, scaled to the model's size.

apply_steps(project, shape_id, clip, rebased_clip, plan)      # returns a project with a new take for the legs

A model's leg has other proportions than the performer's. If it copied the performer's angles, its foot would
not stay on the floor. So the foot follows the performer's foot relative to the hips, and stands still while
the performer's foot stands. If an animal has more legs than the performer, the performer's legs drive several
pairs of legs, and neighbouring pairs step alternately. A foreleg that the performer's arm drives steps while
the performer walks with hanging arms. Otherwise it follows the arm.

The legs of a model that is built like a person have the performer's pose. With ``pin`` their feet step too: a
leg keeps its pose, and bends only as far as is needed for its foot to stand still. So feet do not slide for
any proportions of the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Project, RiggedCharacter, Skeleton, unused
from enliven.mapping.gait import (
    STRIDE_S,
    LegStep,
    PerformerGait,
    choose_standing_on_feet,
    find_stepping_legs,
    leg_length,
    step_scale,
)
from enliven.mapping.ground import floor_height_under, follow_path, sample_times
from enliven.mapping.plan import Plan
from enliven.mapping.planting import (
    PosedLeg,
    Sole,
    Spans,
    compute_remaining_offsets,
    contact_clearance,
    find_standing_spans,
    hip_shift,
    hold_heading,
    plant_body,
    remove_spin,
)
from enliven.mapping.resting import heading_from_rotation
from enliven.motion.contact.pin import find_bend, pin_limb
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, clear_chain
from enliven.rotation import (
    IDENTITY,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    remove_sign_jumps,
    rotate,
    slerp,
    swing,
    to_rotation_vector,
    unit,
)

_MAX_RATE_HZ = 60.0
"""Maximum rate at which steps are computed: the frame rate of common displays."""
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
_MAX_PELVIS_TURN = np.radians(8.0)
"""Largest rotation (radians) of the bones from the pelvis to the hips, relative to the performer's. Such a
rotation is invisible even if the hips are wide."""
_MIN_BULGE = 0.05
"""A knee that is nearer to the line from hip to foot than this fraction of its length turns less about this
line. The knee of a straight leg would twist its skin and rise little."""
_MAX_LIFT_PASSES = 3
"""Maximum number of passes that lift a foreleg. Several are needed, since its lowest point changes as it
bends."""


def apply_steps(project: Project, shape_id: str, clip: Clip, rebased_clip: Clip, plan: Plan) -> Project:
    """Returns a project in which the feet of a shape follow the performer's steps; see the module.

    Args:
        project: the project, in which the plan moves the shape.
        shape_id: id of the shape.
        clip: the original take.
        rebased_clip: the take relative to the rest pose that the mapping uses.
        plan: the mapping.
    """
    shape = project.shape(shape_id)
    steps, duration = find_stepping_legs(shape, clip, plan), clip.duration
    if not steps or duration <= 0.0:
        return project
    has_posed_leg = any(step.posed for step in steps)
    times = sample_times(
        duration, max(_MAX_RATE_HZ, 1.0 / clip.step) if has_posed_leg else min(_MAX_RATE_HZ, 1.0 / clip.step)
    )
    turns, joints = Player(project, shape_id).sample(times)
    performer = PerformerGait(
        shape, clip, rebased_clip, plan, times, step_scale(shape, clip, rebased_clip, plan)
    )
    posed_steps = [step for step in steps if step.posed]
    if posed_steps:
        _plant_feet(shape, posed_steps, performer, turns, joints)
        project = follow_path(project, shape_id, clip.id, joints[:, 0].copy(), times[1])
    for step in steps:
        if not step.posed:
            targets = _end_targets(shape, step, performer, turns, joints)
            _bend_leg(shape.skeleton, step, performer, targets, turns, joints)
    _lift_forelegs(shape, clip, steps, performer, times, turns, joints)
    take = Clip(unused(f"{clip.id}: steps", project.takes), shape.skeleton, turns, joints[:, 0], times[1])
    project = project.with_takes(take)
    chains = [chain for step in steps for chain in _rotation_chains(shape.skeleton, step)]
    for chain in [*chains, *_pelvis_bones(shape.skeleton, steps)]:
        project = clear_chain(project, shape_id, chain)
        name = unused(f"{take.id} of {shape.skeleton.names[chain[-1]]}", project.layer_names)
        project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY, layer_id=name)
    new_shape = project.shape(shape_id)
    spans = list(new_shape.spans)
    for bone, sibling in _sibling_bones(shape, chains):
        spans[sibling] = spans[bone]
    return project.with_characters(new_shape.with_changes(spans=tuple(spans)))


def _sibling_bones(shape: RiggedCharacter, chains: Sequence[Sequence[int]]) -> Iterator[tuple[int, int]]:
    """Yields (bone of a chain, sibling bone) for each sibling that copies the bone's motion, such as a twist
    bone."""
    chain_bones = {bone for chain in chains for bone in chain}
    for bone in (bone for chain in chains for bone in chain[1:]):
        for sibling in shape.skeleton.children[int(shape.skeleton.parents[bone])]:
            is_driven = any(span.refs for span in shape.spans[sibling])
            if sibling not in chain_bones and is_driven and shape.spans[sibling] == shape.spans[bone]:
                yield bone, sibling


def _rotation_chains(skeleton: Skeleton, step: LegStep) -> list[tuple[int, ...]]:
    """Returns the chains that play the rotations of a leg. The first is the leg with one toe, and the others
    are the other toes."""
    foot, proper = step.leg[-1], step.limb.proper
    return [proper, *((foot, toe) for toe in skeleton.children[foot] if toe not in proper)]


def _plant_feet(
    shape: RiggedCharacter, steps: Sequence[LegStep], performer: PerformerGait, turns: Float, joints: Float
) -> None:
    """Moves the body and bends posed legs so that standing feet are still. Changes ``turns`` and ``joints``
    in place."""
    root, floor = joints[:, 0].copy(), floor_height_under(shape)
    # First put the performer's floor at the height of the model's floor. If no foot ever stands, this is the
    # final result.
    corrected_root = root.copy()
    corrected_root[:, 1] += floor - np.median(performer.compute_floor_height(shape, root[:, 1]))
    soles = [_foot_part(shape, step) for step in steps]
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
        _bend_leg(shape.skeleton, step, performer, target, turns, joints)
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
    bones = _pelvis_bones(skeleton, steps)
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


def _pelvis_bones(skeleton: Skeleton, steps: Sequence[LegStep]) -> list[tuple[int, ...]]:
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
            if step.toes:
                excess = remove_spin(
                    sole.compute_accumulated_rotation(turns, joints) - spin, leg.spans, performer.step
                )
                _turn_about_vertical(skeleton, step.leg[-1], excess, turns, joints)
        bent_legs = _update_rolling(legs, soles, turns, joints)
        offsets = compute_remaining_offsets(bent_legs, np.zeros_like(joints[:, 0]), performer.step, floor)
        if all(np.abs(d).max() < _MIN_CORRECTION * leg.length for d, leg in zip(offsets, legs, strict=True)):
            break
        for step, offset in zip(steps, offsets, strict=True):
            _bend_leg(skeleton, step, performer, joints[:, step.leg[-1]] + offset, turns, joints)


def _foot_part(shape: RiggedCharacter, step: LegStep) -> Sole:
    """Returns the part of a leg that may touch the floor: its foot, or the end of its shin if it has no
    foot."""
    return Sole(shape, shape.skeleton.list_subtree(step.leg[-1])[1:] or [step.leg[-1]])


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


def _find_performed_contacts(step: LegStep, performer: PerformerGait, root: Float) -> Spans:
    """Returns the contacts of the performer's foot for a leg that steps, given the path ``root`` (T, 3) of
    the body in metres."""
    foot = root[:, None] + performer.scale * performer.offsets[:, [step.source_leg[-1], *step.source_toes]]
    length = performer.scale * leg_length(performer.skeleton, step.source_leg)
    return find_standing_spans(foot, root, performer.step, length)


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
    if not step.toes:
        return spin
    correction = remove_spin(spin, spans, step_s)
    _turn_about_vertical(skeleton, step.leg[-1], correction, turns, joints)
    return spin + correction


def _turn_about_vertical(skeleton: Skeleton, ankle: int, angles: Float, turns: Float, joints: Float) -> None:
    """Rotates all descendants of an ankle by ``angles`` (T,) radians about +Y. Changes ``turns`` and
    ``joints`` in place."""
    _turn_foot(skeleton, ankle, from_rotation_vector(angles[:, None] * [0.0, 1.0, 0.0]), turns, joints)


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


def _end_targets(
    shape: RiggedCharacter, step: LegStep, performer: PerformerGait, turns: Float, joints: Float
) -> Float:
    """Returns the target positions (T, 3) in metres for the end of a leg, in the current pose of the
    model.

    While the performer's foot stands, the end of the leg stands too, even if the body turns.
    """
    skeleton, ankle, foot = shape.skeleton, step.leg[-1], performer.find_foot_joint(step.source)
    heading, scale = heading_from_rotation(turns[:, 0]), performer.scale
    foot_mean = performer.compute_neutral_foot_position(foot, heading)
    rest = skeleton.positions[ankle] - skeleton.positions[0]
    angles = _smooth_headings(heading, round(STRIDE_S / performer.step))
    if shape.travel is not None:
        angles = hold_heading(angles, _find_performed_contacts(step, performer, joints[:, 0]), performer.step)
    foot_heading = from_rotation_vector(angles[:, None] * [0.0, 1.0, 0.0])
    return np.asarray(
        joints[:, 0] + scale * performer.offsets[:, foot] + rotate(foot_heading, rest - scale * foot_mean)
    )


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


def _bend_leg(
    skeleton: Skeleton, step: LegStep, performer: PerformerGait, targets: Float, turns: Float, joints: Float
) -> None:
    """Bends a leg so that its end reaches ``targets`` (T, 3) in metres. Changes ``turns`` and ``joints`` in
    place."""
    chain, heading = step.leg, heading_from_rotation(turns[:, 0])
    weights = np.ones(len(turns)) if step.arm is None else performer.walking_weights(step.arm)
    bones = {bone for path in _rotation_chains(skeleton, step) for bone in path[1:]}
    for j in sorted(bones.union(skeleton.list_subtree(chain[-1])[1:])):
        if j in bones and not step.posed:
            turns[:, j] = slerp(turns[:, j], heading, weights)
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])
    _bend_limb(skeleton, chain, weights, targets, turns, joints)


def _bend_limb(
    skeleton: Skeleton, chain: Sequence[int], weights: Float, targets: Float, turns: Float, joints: Float
) -> None:
    """Bends a limb so that its end moves to ``targets`` (T, 3), by the fraction ``weights`` (T,) of the way.

    Changes ``turns`` (T, N, 4) and ``joints`` (T, N, 3) in place. The foot keeps its orientation.
    """
    middle, side = find_bend(skeleton, chain)
    below_end, no_release = skeleton.parents == chain[-1], np.zeros(len(turns))
    tree, bones = (
        (skeleton.parents, skeleton.vectors[None]),
        (np.array(chain, np.int32), middle, side, below_end),
    )
    pin_limb(*tree, *bones, 0.0, 0.0, weights, targets, no_release, turns, joints)


def _lift_forelegs(
    shape: RiggedCharacter,
    clip: Clip,
    steps: Sequence[LegStep],
    performer: PerformerGait,
    times: Float,
    turns: Float,
    joints: Float,
) -> None:
    """Bends the forelegs that an arm drives until they are above the floor.

    Changes ``turns`` and ``joints`` in place. An arm that hangs or punches can push a foreleg below the
    floor. A later step puts the lowest point of the body on the floor, so this foreleg would lift the other
    feet.

    Args:
        times: (T,) seconds.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.
    """
    supports = [_foot_part(shape, step) for step in steps if step.arm is None]
    forelegs = [step for step in steps if step.arm is not None]
    if not (supports and forelegs):
        return
    lowest = np.min([sole.compute_lowest_height(turns, joints) for sole in supports], axis=0)
    floor = _floor_under_feet(shape, clip, performer, times, joints, lowest)
    for step in forelegs:
        shank = Sole(shape, step.leg[1:-1])
        foreleg = Sole(shape, shape.skeleton.list_subtree(step.leg[0])[1:])
        for _ in range(_MAX_LIFT_PASSES):
            lift = np.maximum(floor - shank.compute_lowest_height(turns, joints), 0.0)
            if lift.any():
                _lift_knee(shape.skeleton, step.leg, lift, turns, joints)
            lift = np.maximum(floor - foreleg.compute_lowest_height(turns, joints), 0.0)
            if not lift.any():
                break
            targets = joints[:, step.leg[-1]] + lift[:, None] * [0.0, 1.0, 0.0]
            _bend_limb(shape.skeleton, step.leg, (lift > 0.0).astype(float), targets, turns, joints)


def _lift_knee(skeleton: Skeleton, chain: Sequence[int], lift: Float, turns: Float, joints: Float) -> None:
    """Lifts the knee of a leg as far as is possible while its foot stays where it is.

    The leg rotates about the line from its hip to its foot, by the smallest angle that suffices. Changes
    ``turns`` (T, N, 4) and ``joints`` (T, N, 3) in place.

    Args:
        chain: the joints from the hip to the foot.
        lift: (T,) metres, not negative.
    """
    bend = chain[find_bend(skeleton, chain)[0]]
    hip, knee, foot = (joints[:, j] for j in (chain[0], bend, chain[-1]))
    axis, length = unit(foot - hip), np.linalg.norm(foot - hip, axis=1)
    along = np.sum((knee - hip) * axis, axis=1)[:, None] * axis
    radial = knee - hip - along
    # Rotated by an angle, the knee is at the height: centre + radius cos(angle - highest).
    tangent = np.cross(axis, radial)
    radius, highest = np.hypot(radial[:, 1], tangent[:, 1]), np.arctan2(tangent[:, 1], radial[:, 1])
    cosine = np.clip((radial[:, 1] + lift) / np.maximum(radius, 1e-12), -1.0, 1.0)
    angle = np.sign(highest) * np.maximum(np.abs(highest) - np.arccos(cosine), 0.0)
    angle *= np.minimum(radius / np.maximum(_MIN_BULGE * length, 1e-12), 1.0)
    rotation = from_rotation_vector(np.where(lift > 0.0, angle, 0.0)[:, None] * axis)
    below_foot = skeleton.list_subtree(chain[-1])[1:]
    for j in skeleton.list_subtree(chain[0])[1:]:
        if j not in below_foot:
            turns[:, j] = multiply(rotation, turns[:, j])
            joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])


def _floor_under_feet(
    shape: RiggedCharacter, clip: Clip, performer: PerformerGait, times: Float, joints: Float, lowest: Float
) -> Float:
    """Returns the height (T,) in metres below which no foreleg may reach.

    While the performer stands on the feet, this is the lowest point of the model's other feet. A performer on
    hands or knees may have the feet in the air. In this case the result is the floor under the performer, if
    it is lower.

    Args:
        times: (T,) seconds.
        joints: (T, N, 3) metres.
        lowest: (T,) metres, the lowest point of the feet that no arm drives.
    """
    standing = np.interp(times, np.arange(len(clip.turns)) * clip.step, choose_standing_on_feet(clip))
    floor = performer.compute_floor_height(shape, joints[:, 0, 1])
    floor += np.median((lowest - floor)[standing >= min(0.5, standing.max())])
    return standing * lowest + (1.0 - standing) * np.minimum(lowest, floor)


def _smooth_drops(drops: Float, step: float) -> Float:
    """Returns smooth distances (T,) in metres that are never smaller than ``drops`` (T,)."""
    radius = max(round(_EASING_S / step), 1)
    maxima = scipy.ndimage.maximum_filter1d(drops, 2 * radius + 1, mode="nearest")
    return np.asarray(scipy.ndimage.uniform_filter1d(maxima, 2 * radius + 1, mode="nearest"))


def _smooth_headings(headings: Float, count: int) -> Float:
    """Returns heading angles (T,) in radians of rotations (T, 4) about +Y, averaged over ``count`` frames, so
    that feet do not turn while the body sways."""
    angles = np.unwrap(2.0 * np.arctan2(headings[:, 2], headings[:, 0]))
    return np.asarray(scipy.ndimage.uniform_filter1d(angles, max(count, 1), mode="nearest"))
