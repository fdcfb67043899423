"""Motion of legs over time: bends a leg so that its foot reaches its targets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import RiggedCharacter, Skeleton
from enliven.mapping.legs.gait import LegStep, PerformerGait
from enliven.mapping.legs.sole import Sole
from enliven.mapping.resting import heading_from_rotation
from enliven.motion.contact.pin import find_bend, pin_limb
from enliven.rotation import rotate, slerp


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
