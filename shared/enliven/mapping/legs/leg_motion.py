"""Motion of legs over time: bends a leg so that its foot reaches its targets, and measures its sole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import RiggedCharacter, Skeleton
from enliven.mapping.legs.gait import LegStep, PerformerGait, leg_length
from enliven.mapping.legs.planting import PosedLeg, Spans, compute_remaining_offsets, contact_clearance
from enliven.mapping.legs.sole import Sole
from enliven.mapping.resting import heading_from_rotation
from enliven.motion.contact.pin import find_bend, pin_limb
from enliven.rotation import rotate, slerp

SOLE_PASSES = 3
"""Number of passes that correct the soles after the legs have been bent. Each pass leaves 40 % of the error
if the shin has 40 % of the sole's skin weight."""
EASING_S = 0.05
"""Half width in seconds of the filters that smooth the lowering of the body and the tilt of a foot."""
_HOLD_S = 0.034
"""Time in seconds before and after a contact in which a foot moves straight down or up: two frames of common
displays. A foot that moved forward as well would scuff."""
_MIN_CORRECTION = 1e-4
"""The passes that correct the soles end if all corrections are below this fraction of the leg's length: 0.1
mm on an adult."""


def list_rotation_chains(skeleton: Skeleton, step: LegStep) -> list[tuple[int, ...]]:
    """Returns the chains that play the rotations of a leg. The first is the leg with one toe, and the others
    are the other toes."""
    foot, proper = step.leg[-1], step.limb.proper
    return [proper, *((foot, toe) for toe in skeleton.children[foot] if toe not in proper)]


def make_foot_sole(shape: RiggedCharacter, step: LegStep) -> Sole:
    """Returns the part of a leg that may touch the floor: its foot, or the end of its shin if it has no
    foot."""
    ankle = step.leg[-1]
    return Sole(shape, shape.skeleton.list_subtree(ankle)[1:] or [ankle], None if step.posed else ankle)


def bend_leg(
    skeleton: Skeleton,
    step: LegStep,
    performer: PerformerGait,
    targets: Float,
    turns: Float,
    joints: Float,
    foot_heading: Float | None = None,
) -> None:
    """Bends a leg so that its end reaches ``targets`` (T, 3) in metres. Changes ``turns`` and ``joints`` in
    place.

    Args:
        skeleton: the model's skeleton.
        step: the leg.
        performer: the performer's gait.
        targets: (T, 3) metres, the target positions of the leg's end.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.
        foot_heading: (T, 4) rotations about +Y of a foot that steps. If None, the foot has the heading of the
            body.
    """
    chain, heading = step.leg, heading_from_rotation(turns[:, 0])
    weights = np.ones(len(turns)) if step.arm is None else performer.walking_weights(step.arm)
    bones = {bone for path in list_rotation_chains(skeleton, step) for bone in path[1:]}
    foot_bones = skeleton.list_subtree(chain[-1])[1:]
    for j in sorted(bones.union(foot_bones)):
        if j in bones and not step.posed:
            bone_heading = heading if foot_heading is None or j not in foot_bones else foot_heading
            turns[:, j] = slerp(turns[:, j], bone_heading, weights)
        joints[:, j] = joints[:, skeleton.parents[j]] + rotate(turns[:, j], skeleton.vectors[j])
    bend_limb(skeleton, chain, weights, targets, turns, joints)


def bend_limb(
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


def measure_leg(
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
    rolling, length = sole.compute_rolling(turns, joints), leg_length(skeleton, step.leg)
    return PosedLeg(*rolling, clearance, length, spans, round(_HOLD_S / performer.step))


def update_rolling(
    legs: Sequence[PosedLeg], soles: Sequence[Sole], turns: Float, joints: Float
) -> list[PosedLeg]:
    """Returns the legs with the current motion of their soles, given the current ``turns`` and ``joints``."""
    motions = [sole.compute_rolling(turns, joints) for sole in soles]
    return [
        replace(leg, rolled=rolled, sole=lowest) for leg, (rolled, lowest) in zip(legs, motions, strict=True)
    ]


def compute_sole_offsets(
    legs: Sequence[PosedLeg], soles: Sequence[Sole], step_s: float, floor: float, turns: Float, joints: Float
) -> list[Float]:
    """Returns the offset (T, 3) in metres that each sole still has from its place, after the legs were bent.

    The list is empty if all offsets are negligible.
    """
    bent_legs = update_rolling(legs, soles, turns, joints)
    offsets = compute_remaining_offsets(bent_legs, np.zeros_like(joints[:, 0]), step_s, floor)
    are_small = all(
        np.abs(d).max() < _MIN_CORRECTION * leg.length for d, leg in zip(offsets, legs, strict=True)
    )
    return [] if are_small else offsets


def smooth_drops(drops: Float, step: float, easing_s: float = EASING_S) -> Float:
    """Returns smooth distances (T,) in metres that are never smaller than ``drops`` (T,)."""
    radius = max(round(easing_s / step), 1)
    maxima = scipy.ndimage.maximum_filter1d(drops, 2 * radius + 1, mode="nearest")
    return np.asarray(scipy.ndimage.uniform_filter1d(maxima, 2 * radius + 1, mode="nearest"))
