"""Kernels of live outputs. They convert transforms to positions and quaternions, and to Unity's axes.

A *row* contains seven numbers: a position in metres and a unit quaternion (w, x, y, z), in enliven's world
frame. One call converts a whole character in about 2 us, without holding Python's global lock.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.person.unity_axes import GIMBAL_COSINE
from enliven.rotation import nearest_quaternion

_MAX_ROTATION_ERROR = 2e-6
"""Maximum absolute entry of RᵀR - 1 if a matrix counts as a rotation. Rigs in float32 have errors of about
5e-7."""
_DEGREES = 180.0 / np.pi
"""Degrees of one radian."""
_MIN_TRACE = 0.1
"""Minimum trace at which w is computed first. Below it, computing x, y or z first is more exact."""


@njit(cache=True, nogil=True)
def _quaternion(m):
    """Returns the quaternion (w, x, y, z), w >= 0, of the rotation nearest to a matrix (3, 3).

    The search for the nearest rotation takes 1 us. It is skipped for matrices that are rotations, such as the
    transforms of a rig: their quaternion is computed from the entries (S. W. Shepperd, "Quaternion from
    rotation matrix", 1978).
    """
    a, b, c = float(m[0, 0]), float(m[0, 1]), float(m[0, 2])
    d, e, f = float(m[1, 0]), float(m[1, 1]), float(m[1, 2])
    g, h, i = float(m[2, 0]), float(m[2, 1]), float(m[2, 2])
    error = max(
        max(abs(a * a + d * d + g * g - 1.0), abs(b * b + e * e + h * h - 1.0)),
        max(abs(c * c + f * f + i * i - 1.0), abs(a * b + d * e + g * h)),
    )
    error = max(error, max(abs(a * c + d * f + g * i), abs(b * c + e * f + h * i)))
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if not (error < _MAX_ROTATION_ERROR and determinant > 0.0):
        w, x, y, z = nearest_quaternion(m)
        return (-w, -x, -y, -z) if w < 0.0 else (w, x, y, z)
    # Each line contains the products of one component with all four components. The line of the largest
    # component is the most exact.
    if a + e + i > _MIN_TRACE:
        w, x, y, z = 1.0 + a + e + i, h - f, c - g, d - b
    elif a >= e and a >= i:
        w, x, y, z = h - f, 1.0 + a - e - i, b + d, c + g
    elif e >= i:
        w, x, y, z = c - g, b + d, 1.0 - a + e - i, f + h
    else:
        w, x, y, z = d - b, c + g, f + h, 1.0 - a - e + i
    scale = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        scale = -scale
    return w * scale, x * scale, y * scale, z * scale


@njit(cache=True, nogil=True)
def write_bone_rows(linear, positions, out):
    """Writes transforms with linear parts ``linear`` (J, 3, 3) and ``positions`` (J, 3) as rows to
    ``out`` (J, 7)."""
    for j in range(len(out)):
        for k in range(3):
            out[j, k] = positions[j, k]
        out[j, 3], out[j, 4], out[j, 5], out[j, 6] = _quaternion(linear[j])


@njit(cache=True, nogil=True)
def write_placement(linear, positions, pivots, middle, out):
    """Writes a character as one rigid object to a row. The character's transform 0 moves it as a
    whole.

    Args:
        linear: (J, 3, 3) linear parts of the transforms. positions: (J, 3) metres. pivots: (J, 3) metres, the
            positions at rest.
        middle: (3,) metres, a point of the rest shape. Its transformed position is written.
        out: (7,) receives the row.
    """
    w, x, y, z = _quaternion(linear[0])
    a, b, c = middle[0] - pivots[0, 0], middle[1] - pivots[0, 1], middle[2] - pivots[0, 2]
    # v + 2 w (u x v) + 2 u x (u x v)
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    out[0] = positions[0, 0] + a + w * tx + y * tz - z * ty
    out[1] = positions[0, 1] + b + w * ty + z * tx - x * tz
    out[2] = positions[0, 2] + c + w * tz + x * ty - y * tx
    out[3], out[4], out[5], out[6] = w, x, y, z


@njit(cache=True, nogil=True)
def write_humanoid(linear, positions, transforms, offsets, rest, out_positions, out_turns):
    """Writes the humanoid bones of a rigged character.

    Args:
        linear: (J, 3, 3) linear parts of the character's transforms, and ``positions``: (J, 3) metres.
        transforms: (B,) number of the transform that moves each bone.
        offsets: (B, 3) metres from the transform's pivot to the start of the bone, at rest.
        rest: (B, 4) rotation from the T-pose to the rest pose.
        out_positions: (B, 3) metres, the start of each bone.
        out_turns: (B, 4) rotations since the T-pose.
    """
    for b in range(len(transforms)):
        j = transforms[b]
        m = linear[j]
        for k in range(3):
            out_positions[b, k] = positions[j, k] + (
                m[k, 0] * offsets[b, 0] + m[k, 1] * offsets[b, 1] + m[k, 2] * offsets[b, 2]
            )
        w, x, y, z = _quaternion(m)
        rw, rx, ry, rz = rest[b, 0], rest[b, 1], rest[b, 2], rest[b, 3]
        out_turns[b, 0] = w * rw - x * rx - y * ry - z * rz
        out_turns[b, 1] = w * rx + x * rw + y * rz - z * ry
        out_turns[b, 2] = w * ry - x * rz + y * rw + z * rx
        out_turns[b, 3] = w * rz + x * ry - y * rx + z * rw


@njit(cache=True, nogil=True)
def write_unity_rows(rows, chosen, out):
    """Converts chosen rows to Unity's axes, and writes position (x, y, z) and quaternion (x, y, z, w)
    to ``out`` (N, 7).

    Args:
        rows: (R, 7).
        chosen: (N,) numbers of rows.
    """
    for n in range(len(chosen)):
        row = rows[chosen[n]]
        out[n, 0], out[n, 1], out[n, 2] = -row[0], row[1], row[2]
        out[n, 3], out[n, 4], out[n, 5], out[n, 6] = row[4], -row[5], -row[6], row[3]


@njit(cache=True, nogil=True)
def write_unity_angles(turns, chosen, out):
    """Writes the Euler angles of chosen rotations, in degrees, to ``out[:, 1]``. ``out`` has the
    shape (N, 2, 3).

    :func:`enliven.person.unity_euler` defines the angles.

    Args:
        turns: (R, 4).
        chosen: (N,) numbers of rotations.
    """
    for n in range(len(chosen)):
        turn = turns[chosen[n]]
        w, x, y, z = turn[0], turn[1], -turn[2], -turn[3]
        sine = min(max(2.0 * (w * x - y * z), -1.0), 1.0)
        yaw = np.arctan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
        roll = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z))
        if np.sqrt(1.0 - sine * sine) < GIMBAL_COSINE:
            yaw, roll = np.arctan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z)), 0.0
        out[n, 1, 0], out[n, 1, 1], out[n, 1, 2] = np.arcsin(sine) * _DEGREES, yaw * _DEGREES, roll * _DEGREES


@njit(cache=True, nogil=True)
def write_local_rows(parents, positions, turns, out):
    """Converts the bones of a human to Unity's axes, relative to their parents, and writes them to
    ``out`` (B, 7).

    Args:
        parents: (B,) number of each bone's parent, -1 for the hips.
        positions: (B, 3) metres, world. turns: (B, 4) rotations since the T-pose, world.
    """
    for b in range(len(parents)):
        p = parents[b]
        x, y, z = positions[b, 0], positions[b, 1], positions[b, 2]
        w, i, j, k = turns[b, 0], turns[b, 1], turns[b, 2], turns[b, 3]
        if p >= 0:
            x, y, z = x - positions[p, 0], y - positions[p, 1], z - positions[p, 2]
            # Apply the conjugate (s, u) of the parent's rotation: v + 2 s (u x v) + 2 u x (u x v).
            s, ux, uy, uz = turns[p, 0], -turns[p, 1], -turns[p, 2], -turns[p, 3]
            tx, ty, tz = 2.0 * (uy * z - uz * y), 2.0 * (uz * x - ux * z), 2.0 * (ux * y - uy * x)
            x, y, z = (
                x + s * tx + uy * tz - uz * ty,
                y + s * ty + uz * tx - ux * tz,
                z + s * tz + ux * ty - uy * tx,
            )
            w, i, j, k = (
                s * w - ux * i - uy * j - uz * k,
                s * i + ux * w + uy * k - uz * j,
                s * j - ux * k + uy * w + uz * i,
                s * k + ux * j - uy * i + uz * w,
            )
        out[b, 0], out[b, 1], out[b, 2] = -x, y, z
        out[b, 3], out[b, 4], out[b, 5], out[b, 6] = i, -j, -k, w


@njit(cache=True, nogil=True)
def write_multiplied_rows(positions, turns, chosen, right, out):
    """Multiplies the rotations of chosen rows by other rest rotations, converts the rows to Unity's
    axes, and writes them to ``out`` (N, 7).

    Args:
        positions: (R, 3) metres. turns: (R, 4).
        chosen: (N,) numbers of rows.
        right: (M, 4) rotations that are multiplied from the right. Row n uses rotation n modulo M.
    """
    for n in range(len(chosen)):
        r, q = chosen[n], right[n % len(right)]
        w, x, y, z = turns[r, 0], turns[r, 1], turns[r, 2], turns[r, 3]
        out[n, 0], out[n, 1], out[n, 2] = -positions[r, 0], positions[r, 1], positions[r, 2]
        out[n, 3] = w * q[1] + x * q[0] + y * q[3] - z * q[2]
        out[n, 4] = -(w * q[2] - x * q[3] + y * q[0] + z * q[1])
        out[n, 5] = -(w * q[3] + x * q[2] - y * q[1] + z * q[0])
        out[n, 6] = w * q[0] - x * q[1] - y * q[2] - z * q[3]
