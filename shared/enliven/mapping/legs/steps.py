"""Steps: the feet of a model follow the performer's feet, scaled to the model's size.

apply_steps(project, shape_id, clip, rebased_clip, plan)      # returns a project with a new take for the legs

A model's leg has other proportions than the performer's. If it copied the performer's angles, its foot would
not stay on the floor. So the foot follows the performer's foot relative to the hips, and stands still while
the performer's foot stands. If an animal has more legs than the performer, the performer's legs drive several
pairs of legs, and neighbouring pairs step alternately. A foreleg that the performer's arm drives steps while
the performer walks with hanging arms. Otherwise it follows the arm. A deep bow would push an animal's head
below the floor, so trunk and head bend less.

The legs of a model that is built like a person have the performer's pose. With ``pin`` their feet step too: a
leg keeps its pose, and bends only as far as is needed for its foot to stand still. So feet do not slide for
any proportions of the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Project, RiggedCharacter, unused
from enliven.mapping.ground import floor_height_under, follow_path, sample_times
from enliven.mapping.legs.forelegs import floor_under_feet, lift_forelegs
from enliven.mapping.legs.gait import (
    STRIDE_S,
    LegStep,
    PerformerGait,
    find_planted_legs,
    find_stepping_legs,
    leg_length,
    step_scale,
)
from enliven.mapping.legs.leg_motion import bend_leg, list_rotation_chains
from enliven.mapping.legs.planted_legs import find_pelvis_bones, plant_feet
from enliven.mapping.legs.planted_steps import plant_stepping_feet
from enliven.mapping.legs.planting import Spans, find_standing_spans, hold_heading
from enliven.mapping.legs.trunk import find_trunk_chains, raise_trunk
from enliven.mapping.plan import Plan
from enliven.mapping.resting import heading_from_rotation
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, clear_chain
from enliven.rotation import IDENTITY, from_rotation_vector, rotate

_MAX_RATE_HZ = 60.0
"""Maximum rate at which steps are computed: the frame rate of common displays."""


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
    is_planted = bool(find_planted_legs(shape, clip, plan))
    times = sample_times(
        duration, max(_MAX_RATE_HZ, 1.0 / clip.step) if is_planted else min(_MAX_RATE_HZ, 1.0 / clip.step)
    )
    turns, joints = Player(project, shape_id).sample(times)
    performer = PerformerGait(
        shape, clip, rebased_clip, plan, times, step_scale(shape, clip, rebased_clip, plan)
    )
    posed_steps = [step for step in steps if step.posed]
    if posed_steps:
        plant_feet(shape, posed_steps, performer, turns, joints)
    root = joints[:, 0].copy()
    contacts = [_find_performed_contacts(step, performer, root) for step in steps]
    stepping = list[tuple[LegStep, Float, Float]]()
    for step, spans in zip(steps, contacts, strict=True):
        if not step.posed:
            angles = _foot_heading_angles(shape, spans, performer, turns)
            heading = from_rotation_vector(angles[:, None] * [0.0, 1.0, 0.0])
            stepping.append((step, heading, _end_targets(shape, step, performer, heading, turns, joints)))
    # Forelegs that arms drive do not carry the body. Without other legs, nothing determines its height.
    feet = [(step, targets) for step, _, targets in stepping if step.arm is None]
    steps_carry = bool(feet) and not posed_steps
    trunk = _raise_trunk(shape, clip, steps, feet, performer, times, turns, joints) if steps_carry else []
    for step, heading, targets in stepping:
        bend_leg(shape.skeleton, step, performer, targets, turns, joints, heading if is_planted else None)
    if is_planted and steps_carry:
        plant_stepping_feet(shape, steps, contacts, performer, turns, joints)
    if is_planted:
        project = follow_path(project, shape_id, clip.id, joints[:, 0].copy(), times[1])
    lift_forelegs(shape, clip, steps, performer, times, turns, joints)
    take = Clip(unused(f"{clip.id}: steps", project.takes), shape.skeleton, turns, joints[:, 0], times[1])
    project = project.with_takes(take)
    chains = [chain for step in steps for chain in list_rotation_chains(shape.skeleton, step)]
    chains += trunk
    for chain in [*chains, *find_pelvis_bones(shape.skeleton, steps)]:
        project = clear_chain(project, shape_id, chain)
        name = unused(f"{take.id} of {shape.skeleton.names[chain[-1]]}", project.layer_names)
        project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY, layer_id=name)
    new_shape = project.shape(shape_id)
    spans = list(new_shape.spans)
    for bone, sibling in _sibling_bones(shape, chains):
        spans[sibling] = spans[bone]
    return project.with_characters(new_shape.with_changes(spans=tuple(spans)))


def _estimate_lowest_sole(
    shape: RiggedCharacter, feet: Sequence[tuple[LegStep, Float]], joints: Float
) -> Float:
    """Returns the height (T,) in metres of the lowest sole of legs with given targets (T, 3) of their
    ankles.

    A leg that is too short for its target is stretched towards it from its hip, given ``joints`` (T, N, 3).
    """
    rest_heights = shape.skeleton.positions[:, 1] + shape.place[1] - floor_height_under(shape)
    soles = []
    for step, targets in feet:
        hip = joints[:, step.leg[0]]
        distance = np.linalg.norm(targets - hip, axis=1)
        reached = np.minimum(leg_length(shape.skeleton, step.leg) / np.maximum(distance, 1e-12), 1.0)
        soles.append(hip[:, 1] + reached * (targets - hip)[:, 1] - rest_heights[step.leg[-1]])
    return np.asarray(np.min(soles, axis=0))


def _raise_trunk(
    shape: RiggedCharacter,
    clip: Clip,
    steps: Sequence[LegStep],
    feet: Sequence[tuple[LegStep, Float]],
    performer: PerformerGait,
    times: Float,
    turns: Float,
    joints: Float,
) -> list[tuple[int, ...]]:
    """Straightens the trunk until it is above the floor; see :func:`raise_trunk`. Returns the chains that
    changed.

    ``feet`` are the legs that carry the body, with the targets (T, 3) in metres of their ankles.
    """
    lowest = _estimate_lowest_sole(shape, feet, joints)
    floor = floor_under_feet(shape, clip, performer, times, joints, lowest)
    chains = find_trunk_chains(shape.skeleton)
    bones = {bone for chain in chains for bone in chain[1:]}
    bones.update(sibling for _, sibling in _sibling_bones(shape, chains))
    return chains if raise_trunk(shape, steps, bones, floor, performer.step, turns, joints) else []


def _sibling_bones(shape: RiggedCharacter, chains: Sequence[Sequence[int]]) -> Iterator[tuple[int, int]]:
    """Yields (bone of a chain, sibling bone) for each sibling that copies the bone's motion, such as a twist
    bone."""
    chain_bones = {bone for chain in chains for bone in chain}
    for bone in (bone for chain in chains for bone in chain[1:]):
        for sibling in shape.skeleton.children[int(shape.skeleton.parents[bone])]:
            is_driven = any(span.refs for span in shape.spans[sibling])
            if sibling not in chain_bones and is_driven and shape.spans[sibling] == shape.spans[bone]:
                yield bone, sibling


def _find_performed_contacts(step: LegStep, performer: PerformerGait, root: Float) -> Spans:
    """Returns the contacts of the performer's foot for a leg that steps, given the path ``root`` (T, 3) of
    the body in metres."""
    foot = root[:, None] + performer.scale * performer.offsets[:, [step.source_leg[-1], *step.source_toes]]
    length = performer.scale * leg_length(performer.skeleton, step.source_leg)
    return find_standing_spans(foot, root, performer.step, length)


def _foot_heading_angles(
    shape: RiggedCharacter, spans: Spans, performer: PerformerGait, turns: Float
) -> Float:
    """Returns the heading (T,) in radians of a foot that steps. If the model travels, the heading is constant
    during each of the contacts ``spans``."""
    angles = _smooth_headings(heading_from_rotation(turns[:, 0]), round(STRIDE_S / performer.step))
    return angles if shape.travel is None else hold_heading(angles, spans, performer.step)


def _end_targets(
    shape: RiggedCharacter,
    step: LegStep,
    performer: PerformerGait,
    foot_heading: Float,
    turns: Float,
    joints: Float,
) -> Float:
    """Returns the target positions (T, 3) in metres for the end of a leg, in the current pose of the
    model.

    While the performer's foot stands, the end of the leg stands too, even if the body turns.

    Args:
        shape: the model.
        step: the leg.
        performer: the performer's gait.
        foot_heading: (T, 4) rotations about +Y of the leg's foot.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.
    """
    skeleton, ankle, foot = shape.skeleton, step.leg[-1], performer.find_foot_joint(step.source)
    heading, scale = heading_from_rotation(turns[:, 0]), performer.scale
    foot_mean = performer.compute_neutral_foot_position(foot, heading)
    rest = skeleton.positions[ankle] - skeleton.positions[0]
    return np.asarray(
        joints[:, 0] + scale * performer.offsets[:, foot] + rotate(foot_heading, rest - scale * foot_mean)
    )


def _smooth_headings(headings: Float, count: int) -> Float:
    """Returns heading angles (T,) in radians of rotations (T, 4) about +Y, averaged over ``count`` frames, so
    that feet do not turn while the body sways."""
    angles = np.unwrap(2.0 * np.arctan2(headings[:, 2], headings[:, 0]))
    return np.asarray(scipy.ndimage.uniform_filter1d(angles, max(count, 1), mode="nearest"))
