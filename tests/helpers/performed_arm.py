"""A sketched limb, and an edge's messages while a performer moves some of its bones."""

from __future__ import annotations

import numpy as np
from strokes import limb

from enliven.document.character import Pose
from enliven.document.rigged import RiggedCharacter, character_of
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven.motion.layers.evaluate import ShapePose, pose_from
from enliven.overdub.performance import PerformedMotion
from enliven.rotation import from_rotation_vector, multiply, rotate

STEP = 33_333_333
FRAMES = 12
BEGIN = 7_000_000_000


def arm() -> RiggedCharacter:
    """Returns a sketched limb of several bones, slightly bent by hand."""
    shape = shape_from_stroke(limb(np.array([[0.0, 0.4], [0.0, 1.4]]), np.array([0.08, 0.05])), id="arm")
    bent = np.array(
        [from_rotation_vector(np.array([0.1 * k, 0.0, 0.05])) for k in range(len(shape.skeleton))]
    )
    return shape.with_changes(modeling=bent)


ARM = arm()
BONES = len(ARM.skeleton)


def create_performance(own: np.ndarray, name: str = "take 1", root: float = 0.0) -> PerformedMotion:
    """Returns an edge's recorded performance of the arm. The root moves sideways.

    Args:
        own: (F, N, 4) rotations of the bones.
    """
    parents = ARM.skeleton.parents
    poses = []
    for frame, turned in enumerate(own):
        turns, joints = np.empty((BONES, 4)), np.empty((BONES, 3))
        for j, parent in enumerate(parents):
            local = multiply(ARM.modeling[j], turned[j])
            turns[j] = local if parent < 0 else multiply(turns[parent], local)
            rest = ARM.skeleton.positions
            step = np.zeros(3) if parent < 0 else rotate(turns[j], rest[j] - rest[parent])
            joints[j] = (rest[0] + [2.0 + root * frame, 0.0, 0.0]) if parent < 0 else joints[parent] + step
        seen = pose_from(ARM, ShapePose(turns, joints), 0.0)
        poses.append(Pose("arm", BEGIN + frame * STEP, seen.linear, seen.positions))
    key = ("arm", 3)
    return PerformedMotion(name, BEGIN, characters={key: character_of(ARM)}, poses={key: poses})


def create_waving_rotations(bones: dict[int, float]) -> np.ndarray:
    """Returns (F, N, 4) rotations in which some bones swing by the given angles, radians."""
    own = np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, BONES, 1))
    for bone, size in bones.items():
        for frame in range(FRAMES):
            own[frame, bone] = from_rotation_vector(np.array([0.0, 0.3, 1.0]) * size * np.sin(frame))
    return own
