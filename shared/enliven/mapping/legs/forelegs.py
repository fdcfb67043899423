"""Forelegs: keeps the forelegs that an arm drives above the floor.

lift_forelegs(shape, clip, steps, performer, times, turns, joints)    # changes turns and joints
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, RiggedCharacter, Skeleton
from enliven.mapping.legs.gait import LegStep, PerformerGait, choose_standing_on_feet
from enliven.mapping.legs.leg_motion import bend_limb, make_foot_sole
from enliven.mapping.legs.sole import Sole
from enliven.motion.contact.pin import find_bend
from enliven.rotation import from_rotation_vector, multiply, rotate, unit

_MIN_BULGE = 0.05
"""A knee that is nearer to the line from hip to foot than this fraction of its length turns less about this
line. The knee of a straight leg would twist its skin and rise little."""
_MAX_LIFT_PASSES = 3
"""Maximum number of passes that lift a foreleg. Several are needed, since its lowest point changes as it
bends."""


def lift_forelegs(
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
    supports = [make_foot_sole(shape, step) for step in steps if step.arm is None]
    forelegs = [step for step in steps if step.arm is not None]
    if not (supports and forelegs):
        return
    lowest = np.min([sole.compute_lowest_height(turns, joints) for sole in supports], axis=0)
    floor = floor_under_feet(shape, clip, performer, times, joints, lowest)
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
            bend_limb(shape.skeleton, step.leg, (lift > 0.0).astype(float), targets, turns, joints)


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


def floor_under_feet(
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
