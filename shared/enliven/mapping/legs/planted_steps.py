"""Legs that step: moves the body, and bends the legs, so that standing feet are still.

    plant_stepping_feet(shape, steps, contacts, performer, turns, joints)  # changes turns and joints in place

The path of the body is that of :mod:`enliven.mapping.legs.planting`. The legs then close the distances that
remain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from enliven.arrays import Bool, Float
from enliven.document import RiggedCharacter, Skeleton
from enliven.mapping.ground import floor_height_under
from enliven.mapping.legs.gait import LegStep, PerformerGait
from enliven.mapping.legs.leg_motion import (
    SOLE_PASSES,
    bend_limb,
    compute_sole_offsets,
    make_foot_sole,
    measure_leg,
    smooth_drops,
)
from enliven.mapping.legs.planting import PosedLeg, Spans, compute_remaining_offsets, plant_body
from enliven.mapping.legs.sole import Sole
from enliven.motion.contact.contacts import find_runs
from enliven.motion.contact.pin import find_bend

_MAX_FLIGHT_HEIGHT = 0.016
"""Largest height of the lowest foot between two contacts if the performer does not leap, as a fraction of the
performer's height, scaled to the model. Higher feet would hover visibly."""
_MAX_TOUCHING_HEIGHT = 0.012
"""Largest height of a foot that is still or already planted just outside a contact of the performer's foot,
as a fraction of the performer's height, scaled to the model. Below this height a moving foot would scuff."""
_MAX_EXTENSION_S = 0.05
"""Largest extension of a contact at each end, in seconds. A longer extension would leave too little
time for a swing."""
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
    # In the air the model is as high as the performer leaps. In the short flights of a run its feet just
    # clear the floor.
    clearance = np.min([leg.clearance for leg in supports], axis=0)
    max_height = _MAX_FLIGHT_HEIGHT * _scaled_height(performer)
    air_height = performer.compute_leap_heights() + np.minimum(clearance, max_height)
    corrected_root, _ = plant_body(supports, root, performer.step, floor, air_height)
    joints += (corrected_root - joints[:, 0])[:, None]
    offsets = compute_remaining_offsets(legs, corrected_root, performer.step, floor)
    targets = [joints[:, step.leg[-1]] + offset for step, offset in zip(steps, offsets, strict=True)]
    drops = [
        _compute_helpful_lowering(skeleton, step, leg, target, joints)
        for step, leg, target in zip(steps, legs, targets, strict=True)
    ]
    drop = smooth_drops(np.max(drops, axis=0), performer.step, _STEP_EASING_S)
    joints -= (drop[:, None] * [0.0, 1.0, 0.0])[:, None]
    for step, target in zip(steps, targets, strict=True):
        bend_limb(skeleton, step.leg, np.ones(len(turns)), target, turns, joints)
    for _ in range(SOLE_PASSES):
        offsets = compute_sole_offsets(legs, soles, performer.step, floor, turns, joints)
        if not offsets:
            break
        for step, offset in zip(steps, offsets, strict=True):
            target = joints[:, step.leg[-1]] + offset
            bend_limb(skeleton, step.leg, np.ones(len(turns)), target, turns, joints)


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
    """Returns a leg that steps, with its contacts ``spans`` extended while the foot is low, given joints (T,
    N, 3) in metres relative to the root.

    For a foreleg that an arm drives, only the contacts during which it steps are used.
    """
    leg = measure_leg(skeleton, step, sole, spans, performer, turns, joints)
    is_low = leg.clearance < _MAX_TOUCHING_HEIGHT * _scaled_height(performer)
    stands = _mark_standing_frames(spans, len(turns))
    if stands.any():
        frames = max(round(_MAX_EXTENSION_S / performer.step), 1)
        stands = scipy.ndimage.binary_dilation(stands, iterations=frames, mask=is_low)
    if step.arm is None:
        return replace(leg, spans=tuple(find_runs(stands)))
    is_stepping = performer.walking_weights(step.arm) >= _MIN_STEPPING_WEIGHT
    return replace(
        leg,
        clearance=np.where(is_stepping, leg.clearance, 0.0),
        spans=tuple(find_runs(stands & is_stepping)),
    )


def _scaled_height(performer: PerformerGait) -> float:
    """Returns the performer's height in metres, scaled to the model."""
    return performer.scale * float(np.ptp(performer.offsets[..., 1], axis=1).max())
