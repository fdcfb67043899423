"""Converts positions and rotations to and from Unity's axes, which VMC, VRChat and Rokoko use: left-handed,
+Y up, metres.

enliven's world is right-handed. Both have +Y up, and a person who faces the viewer faces +Z in both. So the
X axis must be mirrored: the person's left is +X in enliven and -X in Unity.

Let M = diag(-1, 1, 1). A position p becomes M p. A rotation R becomes M R M. A rotation by an angle about the
axis n becomes the rotation by the opposite angle about M n, because a mirror reverses the sense of rotation.
So the quaternion (w, x, y, z) becomes (w, x, -y, -z). This law holds for every q and v, and a test checks
it::

    unity_position(rotate(q, v)) == unity_rotation(q) applied to unity_position(v)

A VRM 1 file stores models that face +Z, and UniVRM mirrors X when it loads one. A VRM 0 file stores models
that face -Z, and UniVRM mirrors Z instead. After loading, both models face Unity's +Z. So receivers need the
same numbers for both versions.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float

_MIRROR_X = np.array([-1.0, 1.0, 1.0])
_XYZW = [1, 2, 3, 0]
"""Indices of x, y, z, w in a quaternion (w, x, y, z)."""
_WXYZ = [3, 0, 1, 2]
"""Indices of w, x, y, z in a quaternion (x, y, z, w)."""
_TO_UNITY = np.array([1.0, -1.0, -1.0, 1.0])
"""Factors on (x, y, z, w) that mirror a rotation."""
GIMBAL_COSINE = 1e-6
"""Minimum cosine of the pitch. Below it, yaw and roll rotate about the same axis (gimbal lock), so roll is
set to 0."""


def unity_position(positions: AnyArray) -> Float:
    """Converts positions or directions (..., 3) to Unity's axes."""
    return np.asarray(np.asarray(positions, np.float64) * _MIRROR_X)


def unity_rotation(turns: AnyArray) -> Float:
    """Converts quaternions (..., 4) in the order (w, x, y, z) to Unity's axes and order (x, y, z, w)."""
    return np.asarray(np.asarray(turns, np.float64)[..., _XYZW] * _TO_UNITY)


def from_unity_position(positions: AnyArray) -> Float:
    """Converts positions or directions (..., 3) from Unity's axes to enliven's axes."""
    return unity_position(positions)


def from_unity_rotation(turns: AnyArray) -> Float:
    """Converts quaternions (..., 4) from Unity's axes and order (x, y, z, w) to enliven's axes and order (w,
    x, y, z)."""
    return np.asarray((np.asarray(turns, np.float64) * _TO_UNITY)[..., _WXYZ])


def unity_euler(turns: AnyArray) -> Float:
    """Converts quaternions (w, x, y, z) to Unity's Euler angles (..., 3) in degrees about X, Y and Z.

    Unity rotates about Z first, then X, then Y: R = Ry Rx Rz. The formulas between quaternions, matrices and
    angles are the same in left-handed axes.
    """
    x, y, z, w = np.moveaxis(unity_rotation(turns), -1, 0)
    sine = np.clip(2.0 * (w * x - y * z), -1.0, 1.0)
    pitch = np.arcsin(sine)
    yaw = np.arctan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
    roll = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z))
    locked = np.sqrt(1.0 - sine * sine) < GIMBAL_COSINE
    locked_yaw = np.arctan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z))
    yaw, roll = np.where(locked, locked_yaw, yaw), np.where(locked, 0.0, roll)
    return np.degrees(np.stack([pitch, yaw, roll], -1))
