"""The trunk of a body that steps: keeps trunk, head and tail above the floor.

raise_trunk(shape, steps, bones, floor, step_s, turns, joints)    # changes turns and joints
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import RiggedCharacter, Skeleton
from enliven.mapping.legs.gait import LegStep
from enliven.mapping.legs.leg_motion import smooth_drops
from enliven.mapping.legs.sole import Sole
from enliven.rotation import conjugate, multiply, rotate, slerp
from enliven.skeletons.anatomy import find_anatomy

_WEIGHTS = np.linspace(0.0, 1.0, 17)
"""Fractions of the way to the rest pose that are tried. If a trunk is bent by 30 degrees, one step moves the
head by 3 % of its distance from the hips."""
_EASING_S = 0.1
"""Half width in seconds of the filters that smooth the fraction over time."""


def find_trunk_chains(skeleton: Skeleton) -> list[tuple[int, ...]]:
    """Returns the joints of trunk, head and tail. A part with a single joint is left out."""
    anatomy = find_anatomy(skeleton)
    limbs = [limb.chain for limb in (anatomy.head, anatomy.tail) if limb is not None]
    return [chain for chain in (anatomy.trunk, *limbs) if len(chain) > 1]


def raise_trunk(
    shape: RiggedCharacter,
    steps: Sequence[LegStep],
    bones: Collection[int],
    floor: Float,
    step_s: float,
    turns: Float,
    joints: Float,
) -> bool:
    """Straightens trunk, head and tail until they are above the floor. Changes ``turns`` and ``joints`` in
    place.

    A performer who bows or looks down bends the trunk of an animal that is already horizontal, so its head
    would go below the floor. The floor would then lift the body, and the feet would stand in the air.

    Args:
        shape: the model.
        steps: its legs. Their skin is ignored.
        bones: the bones that may turn.
        floor: (T,) metres, the height of the floor under the model's feet.
        step_s: seconds from one frame to the next.
        turns: (T, N, 4) world rotations.
        joints: (T, N, 3) metres.

    Returns:
        True if any bone was turned.
    """
    skeleton = shape.skeleton
    limbs = [step.leg[0] for step in steps]
    limbs += [arm.proper[0] for pair in find_anatomy(skeleton).arms for arm in pair]
    ignored = {j for joint in limbs for j in skeleton.list_subtree(joint)[1:]}
    body = sorted({j for bone in bones for j in skeleton.list_subtree(bone)} - ignored)
    if not body:
        return False
    surface = Sole(shape, body)
    frames = np.flatnonzero(surface.compute_lowest_height(turns, joints) < floor)
    if not len(frames):
        return False
    heights = np.empty((len(_WEIGHTS), len(frames)))
    for height, weight in zip(heights, _WEIGHTS, strict=True):
        posed = turns[frames], joints[frames]
        _straighten(skeleton, bones, np.full(len(frames), weight), *posed)
        height[:] = surface.compute_lowest_height(*posed)
    is_enough = heights >= np.minimum(floor[frames], heights.max(0))
    weights = np.zeros(len(turns))
    weights[frames] = _WEIGHTS[is_enough.argmax(0)]
    _straighten(skeleton, bones, smooth_drops(weights, step_s, _EASING_S), turns, joints)
    return True


def _straighten(
    skeleton: Skeleton, bones: Collection[int], weights: Float, turns: Float, joints: Float
) -> None:
    """Turns bones by the fractions ``weights`` (T,) of the way to their rest pose relative to the root.

    Changes ``turns`` (T, N, 4) and ``joints`` (T, N, 3) in place. All other bones keep their rotations
    relative to their parents.
    """
    old_turns = turns.copy()
    for j in skeleton.list_subtree(0)[1:]:
        parent = int(skeleton.parents[j])
        if j in bones:
            turns[:, j] = slerp(old_turns[:, j], turns[:, 0], weights)
        else:
            relative = multiply(conjugate(old_turns[:, parent]), old_turns[:, j])
            turns[:, j] = multiply(turns[:, parent], relative)
        joints[:, j] = joints[:, parent] + rotate(turns[:, j], skeleton.vectors[j])
