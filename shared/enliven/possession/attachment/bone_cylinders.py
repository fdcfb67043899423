"""Computes the rotations of a tracked body's bones from joint positions, and sample points on cylinders
around the bones.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit
from enliven.person import BONES, PARENTS, J, Joint

_PARENT_JOINTS = np.array(PARENTS)
_HIP_JOINT = int(Joint.HIP_CENTER)
_CHEST_JOINT = int(Joint.SHOULDER_CENTER)
# Use arrays, because Numba compiles a kernel again for each distinct tuple type.
_HIP_JOINTS = np.array([Joint.HIP_LEFT, Joint.HIP_RIGHT])
_SHOULDER_JOINTS = np.array([Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT])
_UPPER_ARMS = (int(Joint.ELBOW_LEFT), int(Joint.ELBOW_RIGHT))
_X, _Y, _Z = np.eye(3)
_CHEST_BONES = np.array([j in (_CHEST_JOINT, Joint.HEAD, *_SHOULDER_JOINTS, *_UPPER_ARMS) for j in range(J)])
_TORSO_BONES = (
    _CHEST_BONES | np.isin(_PARENT_JOINTS, (_HIP_JOINT, *_HIP_JOINTS)) | (np.arange(J) == _HIP_JOINT)
)
"""Bones that rotate with the hips or the shoulders. Every other bone rotates with its parent bone."""


def bone_samples(joints: Float, radius: float = 0.04, along: int = 4, around: int = 4) -> tuple[Float, Float]:
    """Returns points on a cylinder about each of the 19 bones, and their outward normals (KinÊtre,
    "Constraints").

    Args:
        joints: (20, 3) metres. If a joint is not finite, the samples of its bones are NaN.
        radius: metres.
        along: number of sample rings along each bone. The rings are in the middle of ``along`` equal
            sections.
        around: number of samples per ring. Every second ring is rotated by half a step.

    Returns:
        (19, along * around, 3) positions, metres, and (19, along * around, 3) unit normals.
    """
    rotations = bone_rotations(joints, joints)[1]
    points = np.empty((len(BONES), along * around, 3))
    normals = np.empty_like(points)
    joints = np.ascontiguousarray(joints, np.float64)
    _sample_cylinders(joints, rotations, radius, along, around, points, normals)
    points[~find_known_bones(joints)] = np.nan
    return points, normals


def bone_rotations(rest: Float, joints: Float) -> tuple[Float, Float]:
    """Returns the rotation (19, 3, 3) of each bone since ``rest``, and the current axes (19, 3, 3) of its
    part of the torso (hips or shoulders).

    The hips and the shoulders each define a frame (a girdle). A bone first rotates with its girdle or its
    parent bone, then swings by the shortest arc to its current direction. So limbs twist with the body and
    never spin independently. The shortest arc is undefined for opposite directions. Only an upper arm can
    point opposite to its rest direction (hanging at rest, then raised). So an upper arm swings in two steps,
    via a direction that is farther forward and outward than its rest direction. Then the undefined direction
    is behind the body, where arms cannot reach.

    Args:
        rest: (20, 3) metres, the joints when the body attached.
        joints: (20, 3) current joints, metres. A joint that is not finite moves with its parent.
    """
    turns = np.empty((len(BONES), 3, 3))
    axes = np.empty((len(BONES), 3, 3))
    filled_rest = fill_joints(rest, rest)
    _write_rotations(filled_rest, fill_joints(joints, filled_rest), turns, axes)
    return turns, axes


def find_known_bones(joints: Float) -> Bool:
    """Returns a mask (19,) that is True for the bones with two finite joints."""
    finite = np.asarray(np.isfinite(joints).all(1))
    return np.asarray(finite[1:] & finite[_PARENT_JOINTS[1:]])


def fill_joints(joints: Float, rest: Float) -> Float:
    """Replaces joints that are not finite by the parent's position plus the offset from the parent in
    ``rest``. Returns joints (20, 3), metres.
    """
    filled = np.array(joints, np.float64)
    is_known = np.asarray(np.isfinite(filled).all(1))
    if is_known.all():
        return filled
    offsets = np.nan_to_num(rest - rest[_PARENT_JOINTS], nan=0.0, posinf=0.0, neginf=0.0)
    if not is_known[0]:
        # The root is unknown, so move it by the displacement of the first known joint.
        displacements = (filled - rest + rest[0])[is_known]
        displacements = displacements[np.isfinite(displacements).all(1)]
        filled[0] = (
            displacements[0] if len(displacements) else (filled[is_known][0] if is_known.any() else 0.0)
        )
    for j in np.flatnonzero(~is_known):
        if j > 0:
            filled[j] = filled[PARENTS[j]] + offsets[j]
    return filled


@njit(cache=True, nogil=True)
def _unit_into(x, y, z, fallback, out):
    """Writes the direction of (x, y, z) into ``out`` (3,), or ``fallback`` (3,) if its length is zero."""
    length = np.sqrt(x * x + y * y + z * z)
    if length > 1e-6:
        out[0], out[1], out[2] = x / length, y / length, z / length
        return True
    for a in range(3):
        out[a] = fallback[a]
    return False


@njit(cache=True, nogil=True)
def _cross_into(u, v, out):
    out[0] = u[1] * v[2] - u[2] * v[1]
    out[1] = u[2] * v[0] - u[0] * v[2]
    out[2] = u[0] * v[1] - u[1] * v[0]


@njit(cache=True, nogil=True)
def _product_into(m, n, out):
    """Writes the matrix product M N of (3, 3) matrices into ``out``, which must not be M or N itself."""
    for r in range(3):
        for c in range(3):
            out[r, c] = m[r, 0] * n[0, c] + m[r, 1] * n[1, c] + m[r, 2] * n[2, c]


@njit(cache=True, nogil=True)
def _write_girdle_axes(joints, left, right, frame):
    """Writes the axes of a girdle into the rows of ``frame`` (3, 3): left, up along the spine, forward."""
    side, up, ahead = frame[0], frame[1], frame[2]
    spine = joints[_CHEST_JOINT] - joints[_HIP_JOINT]
    _unit_into(spine[0], spine[1], spine[2], _Y, up)
    across = joints[left] - joints[right]
    lean = across[0] * up[0] + across[1] * up[1] + across[2] * up[2]
    x, y, z = across[0] - lean * up[0], across[1] - lean * up[1], across[2] - lean * up[2]
    if not _unit_into(x, y, z, _X, side):
        # The girdle has no width, so use an arbitrary horizontal direction perpendicular to the spine.
        _cross_into(up, _Z if abs(up[2]) < 0.9 else _Y, side)
        _unit_into(side[0], side[1], side[2], _X, side)
    _cross_into(side, up, ahead)


@njit(cache=True, nogil=True)
def _swing_into(a, b, out):
    """Writes the rotation by the shortest arc from unit vector ``a`` to ``b`` into ``out`` (3, 3)."""
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    axis = np.empty(3)
    if cosine < -1 + 1e-9:
        _cross_into(a, _X if abs(a[0]) < 0.7 else _Y, axis)
        _unit_into(axis[0], axis[1], axis[2], _X, axis)
        for r in range(3):
            for c in range(3):
                out[r, c] = 2.0 * axis[r] * axis[c] - (1.0 if r == c else 0.0)
        return
    _cross_into(a, b, axis)
    scale = 1.0 / (1.0 + cosine)
    for r in range(3):
        for c in range(3):
            out[r, c] = scale * axis[r] * axis[c] + (cosine if r == c else 0.0)
    out[0, 1] -= axis[2]
    out[1, 0] += axis[2]
    out[0, 2] += axis[1]
    out[2, 0] -= axis[1]
    out[1, 2] -= axis[0]
    out[2, 1] += axis[0]


@njit(cache=True, nogil=True)
def _girdle_turn(rest, joints, pair, turn, frame):
    """Writes the rotation of a girdle since rest into ``turn`` (3, 3), and its current axes into the rows of
    ``frame``.
    """
    before = np.empty((3, 3))
    _write_girdle_axes(rest, pair[0], pair[1], before)
    _write_girdle_axes(joints, pair[0], pair[1], frame)
    _product_into(frame.T, before, turn)


@njit(cache=True, nogil=True)
def _write_rotations(rest, joints, turns, axes):
    """Writes the results of :func:`bone_rotations`. All joints of both bodies must be finite."""
    girdle_turn, girdle = np.empty((2, 3, 3)), np.empty((2, 3, 3))
    _girdle_turn(rest, joints, _HIP_JOINTS, girdle_turn[0], girdle[0])
    _girdle_turn(rest, joints, _SHOULDER_JOINTS, girdle_turn[1], girdle[1])
    before, after, turned, by = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    swing, start = np.empty((3, 3)), np.empty((3, 3))
    for child in range(1, joints.shape[0]):
        # Start with the rotation of the girdle, or of the parent bone.
        parent, b, g = _PARENT_JOINTS[child], child - 1, 1 if _CHEST_BONES[child] else 0
        for r in range(3):
            for c in range(3):
                # The rows of a girdle frame are its axes. The returned matrices contain the axes as columns.
                axes[b, r, c] = girdle[g, c, r] if _TORSO_BONES[child] else axes[parent - 1, r, c]
                start[r, c] = girdle_turn[g, r, c] if _TORSO_BONES[child] else turns[parent - 1, r, c]
                turns[b, r, c] = start[r, c]
        v, w = rest[child] - rest[parent], joints[child] - joints[parent]
        if not (_unit_into(v[0], v[1], v[2], _Y, before) and _unit_into(w[0], w[1], w[2], _Y, after)):
            continue
        for r in range(3):
            turned[r] = start[r, 0] * before[0] + start[r, 1] * before[1] + start[r, 2] * before[2]
        # Swing an upper arm in two steps. The first step leads to a direction farther forward and outward.
        # A swing is undefined for the direction opposite to its start. This moves that direction behind
        # the body, where arms do not point.
        if child in _UPPER_ARMS:
            outward = 0.3 if child == _UPPER_ARMS[0] else -0.3
            for r in range(3):
                by[r] = turned[r] + 0.6 * girdle[1, 2, r] + outward * girdle[1, 0, r]
            _unit_into(by[0], by[1], by[2], turned, by)
            _swing_into(turned, by, swing)
            _product_into(swing, start, turns[b])
            for r in range(3):
                turned[r] = by[r]
                for c in range(3):
                    start[r, c] = turns[b, r, c]
        _swing_into(turned, after, swing)
        _product_into(swing, start, turns[b])


@njit(cache=True, nogil=True)
def _sample_cylinders(joints, axes, radius, along, around, points, normals):
    """Writes ``points`` and ``normals`` (kernel of :func:`bone_samples`)."""
    axis, ahead, side = np.empty(3), np.empty(3), np.empty(3)
    for child in range(1, joints.shape[0]):
        b, start = child - 1, joints[_PARENT_JOINTS[child]]
        way = joints[child] - start
        _unit_into(way[0], way[1], way[2], axes[b, :, 1], axis)
        # Measure angles from the forward axis of the torso. If the bone itself points forward, measure them
        # from the spine.
        for column in (2, 1):
            lean = axis[0] * axes[b, 0, column] + axis[1] * axes[b, 1, column] + axis[2] * axes[b, 2, column]
            if abs(lean) < 0.99:
                break
        for a in range(3):
            ahead[a] = axes[b, a, column] - lean * axis[a]
        _unit_into(ahead[0], ahead[1], ahead[2], _X, ahead)
        _cross_into(axis, ahead, side)
        for i in range(along):
            for k in range(around):
                angle = 2 * np.pi * (k + 0.5 * (i % 2)) / around
                for a in range(3):
                    n = np.cos(angle) * ahead[a] + np.sin(angle) * side[a]
                    normals[b, i * around + k, a] = n
                    points[b, i * around + k, a] = start[a] + way[a] * ((i + 0.5) / along) + radius * n
