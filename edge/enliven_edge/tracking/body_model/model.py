"""The articulated body model that is fitted to depth: 13 frames, 27 angles, 12 lengths, 20 capsules.

Every rigid frame rotates about a pivot in its parent's frame. At zero rotation the person stands upright
facing +Z with the arms hanging, so each limb lies along -Y of its frame. All offsets are linear in the vector
of lengths, and left and right share their lengths. This makes the derivatives by the lengths constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven.person import Joint

PELVIS, CHEST, HEAD, *_LIMBS = range(13)
"""The indices of the trunk's frames. Parents come first."""
UPPER_ARM_L, FOREARM_L, UPPER_ARM_R, FOREARM_R, *_LEGS = _LIMBS
"""The indices of the arms' frames. Left is the person's left."""
THIGH_L, SHIN_L, FOOT_L, THIGH_R, SHIN_R, FOOT_R = _LEGS
"""The indices of the legs' frames."""
FRAME_PARENTS = np.array([-1, 0, 1, 1, 3, 1, 5, 0, 7, 8, 0, 10, 11])
"""(13,) the parent of each frame. Parents come first."""
HINGES = frozenset({FOREARM_L, FOREARM_R, SHIN_L, FOOT_L, SHIN_R, FOOT_R})
"""Frames that rotate about their own x axis only."""
MIRROR = np.array([0, 1, 2, 5, 6, 3, 4, 10, 11, 12, 7, 8, 9])
"""(13,) the index of the mirrored frame on the other side of the body."""
LENGTHS = (
    "lower spine",
    "upper spine",
    "neck",
    "half shoulders",
    "upper arm",
    "forearm",
    "hand",
    "half hips",
    "thigh",
    "shin",
    "foot",
    "girth",
)
"""(12,) the names of the lengths."""
SPINE_LOW, SPINE_UP, NECK, SHOULDER, ARM, FORE, HAND, HIP, THIGH, SHIN, FOOT, GIRTH = range(12)
"""The indices of the lengths. The girth comes last."""
REFERENCE_HEIGHT = 1.75
"""Metres from sole to crown of an adult with the reference lengths."""
REFERENCE_LENGTHS = np.array([0.12, 0.31, 0.18, 0.185, 0.285, 0.25, 0.085, 0.085, 0.43, 0.41, 0.14, 1.0])
"""(12,) reference lengths in metres, of an adult of the reference height. The girth is a factor on every
radius.
"""


def frame_weights(usual: float, others: dict[int, float]) -> Float:
    """Returns (13,) a weight for each frame: ``usual``, except for the frames in ``others``."""
    weights = np.full(len(FRAME_PARENTS), usual)
    for frame, weight in others.items():
        weights[frame] = weight
    return weights


def lengths_for_height(height: float) -> Float:
    """Returns the average proportions (12,) of a person of ``height`` metres."""
    return REFERENCE_LENGTHS * (height / REFERENCE_HEIGHT)


def body_height_from_lengths(lengths: Float) -> float:
    """Returns the height in metres, from sole to crown, of a person with these lengths (12,) that stands
    straight.
    """
    metres: list[float] = lengths.tolist()
    crown, sole = 1.25 * metres[NECK] + 0.095 * metres[GIRTH], 0.35 * metres[FOOT] + 0.03 * metres[GIRTH]
    return (
        0.9 * metres[HIP] + metres[THIGH] + metres[SHIN] + sole + metres[SPINE_LOW] + metres[SPINE_UP] + crown
    )


def _offset_from_lengths(
    x: dict[int, float] | None = None, y: dict[int, float] | None = None, z: dict[int, float] | None = None
) -> Float:
    """Returns (3, 12) an offset in a frame, each coordinate a linear combination of the lengths."""
    offset = np.zeros((3, len(LENGTHS)))
    for row, terms in enumerate((x, y, z)):
        for length, factor in (terms or {}).items():
            offset[row, length] = factor
    return offset


def _frame_pivots() -> Float:
    """Returns the pivot (13, 3, 12) of each frame in its parent's frame."""
    down_arm, down_thigh, down_shin = (
        _offset_from_lengths(y={ARM: -1}),
        _offset_from_lengths(y={THIGH: -1}),
        _offset_from_lengths(y={SHIN: -1}),
    )
    shoulder = {
        side: _offset_from_lengths(x={SHOULDER: side}, y={SPINE_UP: 1, SHOULDER: -0.25}) for side in (1, -1)
    }
    hip = {side: _offset_from_lengths(x={HIP: side}, y={HIP: -0.9}) for side in (1, -1)}
    return np.stack(
        [
            _offset_from_lengths(),
            _offset_from_lengths(y={SPINE_LOW: 1}),
            _offset_from_lengths(y={SPINE_UP: 1}),
            shoulder[1],
            down_arm,
            shoulder[-1],
            down_arm,
            hip[1],
            down_thigh,
            down_shin,
            hip[-1],
            down_thigh,
            down_shin,
        ]
    )


@dataclass(frozen=True)
class Capsules:
    """Tapered capsules, each fixed to one frame.

    Attributes:
        frame: (C,) the frame to which each capsule is fixed.
        ends: (C, 2, 3, 12) both ends in that frame, linear in the lengths.
        radii: (C, 2) metres at girth 1.
        joint: (C,) the joint that the capsule's observed points support. They raise its confidence.
    """

    frame: Int
    ends: Float
    radii: Float
    joint: Int


def _capsules() -> Capsules:
    """Returns the capsules of the body's surface."""
    rows: list[tuple[int, Float, Float, float, float, int]] = []
    for side in (1, -1):
        x = {HIP: 0.95 * side}
        rows.append(
            (
                PELVIS,
                _offset_from_lengths(x, {HIP: -0.7}),
                _offset_from_lengths(x, {SPINE_LOW: 1.0}),
                0.115,
                0.105,
                Joint.HIP_CENTER,
            )
        )
        low, high = (
            _offset_from_lengths({SHOULDER: 0.42 * side}, {SPINE_UP: 0.08}),
            _offset_from_lengths({SHOULDER: 0.5 * side}, {SPINE_UP: 0.74}),
        )
        rows.append((CHEST, low, high, 0.10, 0.10, Joint.SPINE))
        inner, outer = (
            _offset_from_lengths({SHOULDER: 0.15 * side}, {SPINE_UP: 0.93}),
            _offset_from_lengths({SHOULDER: 0.85 * side}, {SPINE_UP: 0.82}),
        )
        rows.append((CHEST, inner, outer, 0.065, 0.06, Joint.SHOULDER_CENTER))
    rows.append(
        (
            HEAD,
            _offset_from_lengths(y={NECK: 0.05}),
            _offset_from_lengths(y={NECK: 0.6}),
            0.058,
            0.055,
            Joint.SHOULDER_CENTER,
        )
    )
    rows.append(
        (
            HEAD,
            _offset_from_lengths(y={NECK: 0.85}),
            _offset_from_lengths(y={NECK: 1.25}),
            0.085,
            0.095,
            Joint.HEAD,
        )
    )
    arms = ((UPPER_ARM_L, FOREARM_L, Joint.ELBOW_LEFT), (UPPER_ARM_R, FOREARM_R, Joint.ELBOW_RIGHT))
    for upper, fore, elbow in arms:
        wrist, tip = _offset_from_lengths(y={FORE: -1}), _offset_from_lengths(y={FORE: -1, HAND: -1.3})
        rows.append((upper, _offset_from_lengths(), _offset_from_lengths(y={ARM: -1}), 0.055, 0.045, elbow))
        rows.append((fore, _offset_from_lengths(), wrist, 0.045, 0.033, elbow + 1))
        rows.append((fore, wrist, tip, 0.037, 0.03, elbow + 2))
    legs = ((THIGH_L, Joint.KNEE_LEFT), (THIGH_R, Joint.KNEE_RIGHT))
    for thigh, knee in legs:
        rows.append((thigh, _offset_from_lengths(), _offset_from_lengths(y={THIGH: -1}), 0.085, 0.058, knee))
        rows.append(
            (thigh + 1, _offset_from_lengths(), _offset_from_lengths(y={SHIN: -1}), 0.055, 0.042, knee + 1)
        )
        heel, toe = (
            _offset_from_lengths(y={FOOT: -0.28}, z={FOOT: -0.25}),
            _offset_from_lengths(y={FOOT: -0.35}, z={FOOT: 1.0}),
        )
        rows.append((thigh + 2, heel, toe, 0.04, 0.03, knee + 2))
    frame, a, b, ra, rb, joint = zip(*rows, strict=True)
    return Capsules(
        np.array(frame),
        np.stack([np.stack(a), np.stack(b)], 1),
        np.stack([ra, rb], 1).astype(float),
        np.array([int(j) for j in joint]),
    )


def _joint_offsets() -> tuple[Int, Float]:
    """Returns the (20,) frames and (20, 3, 12) offsets of the tracked joints.

    A tracked joint is some centimetres away from the model's pivot. The back bends below the spine joint, and
    the middle of the head lies in front of the neck's end.
    """
    zero, wrist, hand = (
        _offset_from_lengths(),
        _offset_from_lengths(y={FORE: -1}),
        _offset_from_lengths(y={FORE: -1, HAND: -1}),
    )
    ankle, toe = _offset_from_lengths(y={SHIN: -1.05}), _offset_from_lengths(y={FOOT: -0.4}, z={FOOT: 0.88})
    spine, head = (
        _offset_from_lengths(y={SPINE_UP: 0.12}),
        _offset_from_lengths(y={NECK: 1.1}, z={NECK: 0.07}),
    )
    rows = [(PELVIS, zero), (CHEST, spine), (HEAD, zero), (HEAD, head)]
    for upper, fore in ((UPPER_ARM_L, FOREARM_L), (UPPER_ARM_R, FOREARM_R)):
        rows += [(upper, zero), (fore, zero), (fore, wrist), (fore, hand)]
    for thigh in (THIGH_L, THIGH_R):
        rows += [(thigh, zero), (thigh + 1, zero), (thigh + 1, ankle), (thigh + 2, toe)]
    return np.array([f for f, _ in rows]), np.stack([o for _, o in rows])


PIVOTS = _frame_pivots()
"""(13, 3, 12) the pivot of each frame in its parent's frame, linear in the lengths."""
CAPSULES = _capsules()
"""The 20 capsules of the body's surface."""
JOINT_FRAMES, JOINT_OFFSETS = _joint_offsets()
"""(20,) the frame of each tracked joint, and (20, 3, 12) its position in that frame, linear in the
lengths."""


def _degrees_of_freedom() -> tuple[Int, Int]:
    """Returns the (27,) frames and (27,) local axes of the rotational degrees of freedom, frame by frame."""
    rows = [(f, a) for f in range(13) for a in ((0,) if f in HINGES else (0, 1, 2))]
    return np.array([f for f, _ in rows]), np.array([a for _, a in rows])


DOF_FRAME, DOF_AXIS = _degrees_of_freedom()
"""(27,) the frame and (27,) the local axis of each rotational degree of freedom."""
DOFS = 3 + len(DOF_FRAME)
"""The number of degrees of freedom of a posture: translation first, then rotations."""


def _ancestry() -> Int:
    """Returns a (13, 27) matrix: 1 if a rotational degree of freedom (row) moves a coordinate frame (column),
    else 0.
    """
    moves = np.zeros((13, len(DOF_FRAME)), np.int64)
    for frame in range(13):
        ancestor = frame
        while ancestor >= 0:
            moves[frame, ancestor == DOF_FRAME] = 1
            ancestor = int(FRAME_PARENTS[ancestor])
    return moves


MOVES = _ancestry()
"""(13, 27) matrix: 1 if a rotational degree of freedom (row) moves a coordinate frame (column), else 0.
"""


def _bone_frames() -> Int:
    """Returns the frame (20,) of the bone that ends at each joint."""
    trunk = [PELVIS, PELVIS, CHEST, HEAD]
    arms = [CHEST, UPPER_ARM_L, FOREARM_L, FOREARM_L, CHEST, UPPER_ARM_R, FOREARM_R, FOREARM_R]
    legs = [PELVIS, THIGH_L, SHIN_L, FOOT_L, PELVIS, THIGH_R, SHIN_R, FOOT_R]
    return np.array(trunk + arms + legs)


BONE_FRAMES = _bone_frames()
"""(20,) the frame of the bone that ends at each joint."""


def _frame_lengths() -> Int:
    """Returns (13, 1 + 12) for each frame: the number of lengths that move its points, then their indices.

    The girth is the last one.
    """
    table = np.zeros((13, 1 + len(LENGTHS)), np.int64)
    of_pivot = np.zeros((13, len(LENGTHS)), bool)
    for frame in range(13):
        if frame > 0:
            of_pivot[frame] = of_pivot[FRAME_PARENTS[frame]] | PIVOTS[frame].any(0)
        moved = of_pivot[frame] | CAPSULES.ends[CAPSULES.frame == frame].any((0, 1, 2))
        moved |= JOINT_OFFSETS[frame == JOINT_FRAMES].any((0, 1))
        moved[GIRTH] = True
        indices = np.flatnonzero(moved)
        table[frame, 0], table[frame, 1 : 1 + len(indices)] = len(indices), indices
    return table


FRAME_LENGTHS = _frame_lengths()
"""(13, 1 + 12) for each frame: the number of lengths that move its points, then their indices."""
