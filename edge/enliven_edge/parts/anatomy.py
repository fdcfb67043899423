"""What the forest's parts are on the tracker's model: anchors on its bones, and the capsules of each part."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven_edge.parts.labels import PARTS, Part
from enliven_edge.tracking import model


def _anchors() -> tuple[Int, Float, Float]:
    """(17,) frames, (17, 3, 12) offsets and (17,) depths of every part's middle below the seen surface."""
    frames, local, depth = (
        np.zeros(PARTS, np.int64),
        np.zeros((PARTS, 3, len(model.LENGTHS))),
        np.zeros(PARTS),
    )

    def put(part: int, frame: int, below: float, **at: tuple[int, float]) -> None:
        frames[part], depth[part] = frame, below
        for name, (length, factor) in at.items():
            local[part, "xyz".index(name[0]), length] = factor

    put(Part.HEAD, model.HEAD, 0.085, y=(model.NECK, 1.05))
    for right in (0, 1):
        side = 1.0 - 2.0 * right
        arm, leg = (model.UPPER_ARM_L, model.THIGH_L) if right == 0 else (model.UPPER_ARM_R, model.THIGH_R)
        put(
            Part.CHEST_LEFT + right,
            model.CHEST,
            0.10,
            x=(model.SHOULDER, 0.45 * side),
            y=(model.SPINE_UP, 0.62),
        )
        put(Part.BELLY_LEFT + right, model.PELVIS, 0.11, x=(model.HIP, 0.9 * side), y=(model.SPINE_LOW, 0.5))
        put(Part.UPPER_ARM_LEFT + right, arm, 0.05, y=(model.ARM, -0.5))
        put(Part.FOREARM_LEFT + right, arm + 1, 0.04, y=(model.FORE, -0.5))
        put(Part.HAND_LEFT + right, arm + 1, 0.03, y=(model.FORE, -1.0), y2=(model.HAND, -0.9))
        put(Part.THIGH_LEFT + right, leg, 0.07, y=(model.THIGH, -0.5))
        put(Part.SHANK_LEFT + right, leg + 1, 0.05, y=(model.SHIN, -0.5))
        put(Part.FOOT_LEFT + right, leg + 2, 0.03, y=(model.FOOT, -0.3), z=(model.FOOT, 0.4))
    return frames, local, depth


ANCHOR_FRAMES, ANCHORS, BELOW = _anchors()
USUAL_AREA = np.array([0.03, *np.repeat([0.04, 0.035, 0.025, 0.018, 0.009, 0.05, 0.035, 0.012], 2)])
"""(17,) square metres of each part that are seen when it is seen well."""


def _capsule_parts() -> Float:
    """(C, 17) 1 where a capsule carries a part."""
    carries = np.zeros((len(model.CAPSULES.frame), PARTS))
    for right in (0, 1):
        pelvis, chest, girdle = 3 * right, 3 * right + 1, 3 * right + 2
        arm, leg = 8 + 3 * right, 14 + 3 * right
        carries[pelvis, Part.BELLY_LEFT + right] = 1.0
        carries[chest, [Part.CHEST_LEFT + right, Part.BELLY_LEFT + right]] = 1.0
        carries[girdle, Part.CHEST_LEFT + right] = 1.0
        carries[6, [Part.CHEST_LEFT + right, Part.HEAD]] = 1.0
        for k, part in enumerate((Part.UPPER_ARM_LEFT, Part.FOREARM_LEFT, Part.HAND_LEFT)):
            carries[arm + k, part + right] = 1.0
        for k, part in enumerate((Part.THIGH_LEFT, Part.SHANK_LEFT, Part.FOOT_LEFT)):
            carries[leg + k, part + right] = 1.0
    carries[7, Part.HEAD] = 1.0
    return carries


CARRIES = _capsule_parts()
"""(20, 17) which parts each capsule of the model carries."""
