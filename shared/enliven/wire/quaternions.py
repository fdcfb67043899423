"""Encodes unit quaternions in four bytes: the three smallest components with ten bits each ("smallest
three").

The largest component is omitted, since the other components and the unit length determine it. It is made
positive by negating the quaternion if necessary, which does not change the rotation. The 32 bits are
little-endian. Bits 30-31 are the index of the omitted component (0 is w). The other components follow in
order in bits 20-29, 10-19 and 0-9, each as 511 + value / :data:`COMPONENT_STEP`. The error of a rotation is
at most :data:`MAX_ROTATION_ERROR` radians. Any 32 bits decode to a rotation.
"""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.rotation import canonical, normalized

COMPONENT_STEP = math.sqrt(0.5) / 511
"""Quantization step of a component. All components except the largest are within +-sqrt(1/2)."""
MAX_ROTATION_ERROR = 2 * math.sqrt(3.0) * COMPONENT_STEP
"""Maximum error of a rotation, in radians (0.27 degrees). The error of three components is at most half a
step, and that of the fourth at most sqrt(3) times as large."""

_OTHER_COMPONENTS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_COMPONENT_SHIFTS = np.array([20, 10, 0])


def pack_quaternions(quaternions: AnyArray) -> bytes:
    """Encodes unit quaternions (N, 4) as 4 N bytes. A quaternion that is not finite is encoded as the
    identity.
    """
    q = normalized(quaternions)
    missing = np.abs(q).argmax(1)
    rows = np.arange(len(q))
    q = np.where(q[rows, missing, None] < 0, -q, q)
    steps = (
        np.rint(q[rows[:, None], _OTHER_COMPONENTS[missing]] / COMPONENT_STEP)
        .astype(np.int64)
        .clip(-511, 511)
        + 511
    )
    bits = (missing << 30) | (steps << _COMPONENT_SHIFTS).sum(1)
    return bytes(bits.astype("<u4").tobytes())


def unpack_quaternions(data: bytes) -> Float:
    """Decodes 4 N bytes to unit quaternions (N, 4) with w >= 0."""
    bits = np.frombuffer(data, "<u4").astype(np.int64)
    missing = bits >> 30
    others = ((((bits[:, None] >> _COMPONENT_SHIFTS) & 1023) - 511) * COMPONENT_STEP).astype(np.float64)
    quaternions = np.empty((len(bits), 4))
    rows = np.arange(len(bits))
    quaternions[rows[:, None], _OTHER_COMPONENTS[missing]] = others
    quaternions[rows, missing] = np.sqrt(np.maximum(0.0, 1.0 - (others * others).sum(1)))
    return canonical(normalized(quaternions))
