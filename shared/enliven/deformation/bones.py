"""How the bones of a tracked body turn, from joint positions alone, and cylinders of samples around them."""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Bool, Float
from enliven.body import BONES, PARENTS, J, Joint

_PARENT = np.array(PARENTS)
_HIP, _CHEST = int(Joint.HIP_CENTER), int(Joint.SHOULDER_CENTER)
_HIPS = (int(Joint.HIP_LEFT), int(Joint.HIP_RIGHT))
_SHOULDERS = (int(Joint.SHOULDER_LEFT), int(Joint.SHOULDER_RIGHT))
_UPPER_ARMS = (int(Joint.ELBOW_LEFT), int(Joint.ELBOW_RIGHT))
_ON_CHEST = np.array([j in (_CHEST, Joint.HEAD, *_SHOULDERS, *_UPPER_ARMS) for j in range(J)])
_ON_TORSO = _ON_CHEST | np.isin(_PARENT, (_HIP, *_HIPS)) | (np.arange(J) == _HIP)
"""Bones that turn with the hips or the shoulders; the others turn with the bone before them."""


def bone_samples(joints: Float, radius: float = 0.04, along: int = 4, around: int = 4) -> tuple[Float, Float]:
    """Points on a cylinder about each of the 19 bones, and their outward normals (KinÊtre, "Constraints").

    Args:
        joints: (20, 3) metres; the samples of a bone with a joint that is not finite are NaN.
        radius: metres.
        along: samples along each bone, in the middles of as many equal pieces.
        around: samples around each bone, every second ring turned by half a step.

    Returns:
        (19, along * around, 3) metres and (19, along * around, 3) unit vectors.
    """
    rotations = bone_rotations(joints, joints)[1]
    points = np.empty((len(BONES), along * around, 3))
    normals = np.empty_like(points)
    _sample_cylinders(np.ascontiguousarray(joints, np.float64), rotations, radius, along, around, points, normals)
    return points, normals


def bone_rotations(rest: Float, joints: Float) -> tuple[Float, Float]:
    """(19, 3, 3) how each bone has turned since ``rest``, and (19, 3, 3) its torso's axes now.

    The hips and the shoulders each give a frame. A bone turns with its girdle, or with the bone before it,
    and then swings by the shortest arc to where it points now: so limbs twist with the body, and never spin
    of themselves. Only an upper arm can come to point against its direction at rest, where the shortest arc
    is undefined (arms hanging at rest, then raised). It swings by way of a direction ahead and outward of
    the one at rest, which moves that gap behind the body, where no arm reaches.

    Args:
        rest: (20, 3) metres, the joints when the body took hold.
        joints: (20, 3) metres, now. A joint that is not finite moves with its parent.
    """
    turns = np.empty((len(BONES), 3, 3))
    axes = np.empty((len(BONES), 3, 3))
    filled_rest = filled(rest, rest)
    _rotations(filled_rest, filled(joints, filled_rest), turns, axes)
    return turns, axes


def known_bones(joints: Float) -> Bool:
    """(19,) whether both joints of each bone are finite."""
    finite = np.isfinite(joints).all(1)
    return np.asarray(finite[1:] & finite[_PARENT[1:]])


def filled(joints: Float, rest: Float) -> Float:
    """(20, 3) the joints, each that is not finite placed as far from its parent as in ``rest``."""
    out = np.array(joints, np.float64)
    _fill(out, np.ascontiguousarray(rest, np.float64))
    return out


@njit(cache=True, nogil=True)
def _fill(joints, rest):  # type: ignore[no-untyped-def]
    for j in range(joints.shape[0]):
        if np.isfinite(joints[j, 0] + joints[j, 1] + joints[j, 2]):
            continue
        p = _PARENT[j]
        if p < 0:
            _fill_root(joints, rest)
            continue
        offset = rest[j] - rest[p]
        joints[j] = joints[p]
        if np.isfinite(offset[0] + offset[1] + offset[2]):
            joints[j] += offset


@njit(cache=True, nogil=True)
def _fill_root(joints, rest):  # type: ignore[no-untyped-def]
    """The root moves as the first known joint has moved."""
    joints[0] = 0.0
    for j in range(1, joints.shape[0]):
        moved = joints[j] - rest[j] + rest[0]
        if np.isfinite(moved[0] + moved[1] + moved[2]):
            joints[0] = moved
            return
        if np.isfinite(joints[j, 0] + joints[j, 1] + joints[j, 2]):
            joints[0] = joints[j]
            return


@njit(cache=True, nogil=True)
def _unit(v, fallback):  # type: ignore[no-untyped-def]
    length = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v / length if length > 1e-6 else fallback.copy()


@njit(cache=True, nogil=True)
def _girdle(joints, left, right):  # type: ignore[no-untyped-def]
    """(3, 3) columns: to the left, up along the spine, ahead."""
    up = _unit(joints[_CHEST] - joints[_HIP], np.array([0.0, 1.0, 0.0]))
    across = joints[left] - joints[right]
    across = across - up * (across @ up)
    other = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    side = _unit(across, _unit(other - up * up[0 if abs(up[0]) < 0.9 else 2], other))
    ahead = np.cross(side, up)
    frame = np.empty((3, 3))
    frame[:, 0], frame[:, 1], frame[:, 2] = side, up, ahead
    return frame


@njit(cache=True, nogil=True)
def _swing(a, b):  # type: ignore[no-untyped-def]
    """(3, 3) the rotation by the shortest arc from the unit vector ``a`` to ``b``."""
    cosine = a @ b
    v = np.cross(a, b)
    if cosine < -1 + 1e-9:
        axis = np.cross(a, np.array([1.0, 0.0, 0.0]) if abs(a[0]) < 0.7 else np.array([0.0, 1.0, 0.0]))
        axis = axis / np.sqrt(axis @ axis)
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + cosine)


@njit(cache=True, nogil=True)
def _rotations(rest, joints, turns, axes):  # type: ignore[no-untyped-def]
    """Kernel of :func:`bone_rotations`; both bodies complete."""
    hips_rest, hips = _girdle(rest, _HIPS[0], _HIPS[1]), _girdle(joints, _HIPS[0], _HIPS[1])
    chest_rest = _girdle(rest, _SHOULDERS[0], _SHOULDERS[1])
    chest = _girdle(joints, _SHOULDERS[0], _SHOULDERS[1])
    hips_turn = np.ascontiguousarray(hips @ hips_rest.T)
    chest_turn = np.ascontiguousarray(chest @ chest_rest.T)
    for child in range(1, joints.shape[0]):
        parent = _PARENT[child]
        start, frame = (chest_turn, chest) if _ON_CHEST[child] else (hips_turn, hips)
        if not _ON_TORSO[child]:
            start, frame = turns[parent - 1].copy(), axes[parent - 1].copy()
        before = _unit(rest[child] - rest[parent], np.zeros(3))
        after = _unit(joints[child] - joints[parent], np.zeros(3))
        axes[child - 1] = frame
        turns[child - 1] = start
        if before @ before == 0.0 or after @ after == 0.0:
            continue
        turned = start @ before
        if child in _UPPER_ARMS:
            outward = 1.0 if child == _UPPER_ARMS[0] else -1.0
            by = _unit(turned + 0.6 * frame[:, 2] + 0.3 * outward * frame[:, 0], turned)
            turns[child - 1] = _swing(by, after) @ _swing(turned, by) @ start
        else:
            turns[child - 1] = _swing(turned, after) @ start


@njit(cache=True, nogil=True)
def _sample_cylinders(joints, axes, radius, along, around, points, normals):  # type: ignore[no-untyped-def]
    """Kernel of :func:`bone_samples`."""
    for child in range(1, joints.shape[0]):
        b, start = child - 1, joints[_PARENT[child]]
        way = joints[child] - start
        axis = _unit(way, axes[b][:, 1].copy())
        ahead = axes[b][:, 2] - axis * (axes[b][:, 2].copy() @ axis)
        if ahead @ ahead < 0.01:
            ahead = axes[b][:, 1] - axis * (axes[b][:, 1].copy() @ axis)
        ahead = _unit(ahead, ahead)
        side = np.cross(axis, ahead)
        for i in range(along):
            for k in range(around):
                angle = 2 * np.pi * (k + 0.5 * (i % 2)) / around
                n = np.cos(angle) * ahead + np.sin(angle) * side
                normals[b, i * around + k] = n
                points[b, i * around + k] = start + way * ((i + 0.5) / along) + radius * n
