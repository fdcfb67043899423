"""Computes clips and bone rotations from joint positions, with the least twist.

    clip_of_bodies(bodies, seconds, id, *, rest=0, step=1/30, names=None) -> Clip  # enliven.person.body.Body
    rotations_from_positions(skeleton, positions (F, N, 3), known=None) -> (F, N, 4)
    rest_from_positions(parents, at_rest, positions) -> (N, 3)    # the rest pose with median bone lengths
    fill_unseen(parents, positions, seen) -> (F, N, 3)            # unseen joints, interpolated in time

Every bone points from its parent joint to its joint. Its twist relative to the parent bone is minimal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from enliven.arrays import AnyArray, Bool, Float
from enliven.document import Clip, Skeleton
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import load, mul, store, turn
from enliven.motion.kinematics.vectors import cross, dot, length, rotation_about, row, subtract, swing_to
from enliven.motion_clips.clip_sampling import evenly_sampled_clip
from enliven.person import BODY_NAMES, PARENTS, Body
from enliven.rotation import conjugate, multiply, nearest_quaternion

_MIN_DIRECTION_LENGTH_M = 1e-6
"""Minimum length, metres, of a bone with a defined direction."""


def clip_of_bodies(
    bodies: Sequence[Body],
    seconds: AnyArray,
    id: str,
    *,
    rest: int | Body = 0,
    step: float = 1.0 / 30.0,
    names: Sequence[str] | None = None,
) -> Clip:
    """Converts a tracked person's motion to a clip of 20 joints.

    If a body has measured orientations, they define the rotations of the bones since rest. Otherwise, the
    rotation of a bone is the swing with the least twist relative to the parent bone. In both cases, every
    bone points from its parent joint to its joint. A joint of confidence 0 is interpolated from the frames
    before and after.

    Args:
        bodies: (F,) the tracked bodies of the person over time.
        seconds: (F,) times of the bodies, ascending. Intervals may be irregular.
        rest: index of the rest pose among the bodies, or a body in the rest pose.
        step: seconds between the frames of the clip.
        names: (20,) names of the joints. None means :data:`BODY_NAMES`.

    Raises:
        InputError: if the list of bodies is empty, or the times do not match or do not ascend.
    """
    times: Float = np.asarray(seconds, np.float64)
    where = f"clip {id!r}"
    if not bodies or times.shape != (len(bodies),) or (np.diff(times) <= 0).any():
        advice = "Pass one time for each body, in ascending order."
        raise InputError(
            f"{len(bodies)} bodies do not match times of the shape {times.shape}", where=where, remedy=advice
        )
    joints = np.stack([body.joints for body in bodies])
    is_seen = np.stack([body.confidence > 0 for body in bodies])
    joints = fill_unseen(np.array(PARENTS), joints, is_seen)
    rest_body = bodies[rest] if isinstance(rest, int) else rest
    rest_joints = joints[rest] if isinstance(rest, int) else rest.joints
    positions = rest_from_positions(np.array(PARENTS), rest_joints, joints)
    skeleton = Skeleton(tuple(names or BODY_NAMES), np.array(PARENTS, np.int32), positions)
    turns = rotations_from_positions(skeleton, joints, _measured_rotations(bodies, rest_body))
    return evenly_sampled_clip(id, skeleton, times - times[0], turns, joints[:, 0], step)


def rotations_from_positions(skeleton: Skeleton, positions: Float, known: Float | None = None) -> Float:
    """Computes world rotations since rest (F, N, 4) that point every bone from its parent joint to its joint.

    A bone first rotates with its parent, then swings by the shortest arc. The root, and bones with several
    child bones, also twist so that the child bones fit best. So the positions of the hips determine the
    rotation of the pelvis, and those of the shoulders the rotation of the chest.

    Args:
        positions: (F, N, 3) metres.
        known: (F, N, 4) measured rotations since rest. The result is these rotations, corrected by the
            shortest swing that points each bone at its joint.
    """
    turns = np.empty((len(positions), len(skeleton), 4))
    known_turns = (
        np.empty((0, len(skeleton), 4)) if known is None else np.ascontiguousarray(known, np.float64)
    )
    places = np.ascontiguousarray(positions, np.float64)
    point_bones(skeleton.parents, skeleton.vectors, places, known_turns, turns)
    return turns


def rest_from_positions(parents: AnyArray, at_rest: Float, positions: Float) -> Float:
    """Returns the joint positions (N, 3) at rest, with each bone's median length over the frames
    ``positions`` (F, N, 3)."""
    joints = np.array(at_rest, np.float64)
    for j, parent in enumerate(parents):
        if parent < 0:
            continue
        length = float(np.median(np.linalg.norm(positions[:, j] - positions[:, parent], axis=1)))
        joints[j] = joints[parent] + _unit_direction(at_rest[j] - at_rest[parent]) * length
    return joints


def fill_unseen(parents: AnyArray, positions: Float, seen: Bool) -> Float:
    """Returns the positions (F, N, 3) with interpolated positions of unseen joints.

    The offset of an unseen joint from its parent is interpolated in time. A joint that was never seen stays
    unchanged.
    """
    completed = np.array(positions, np.float64)
    frames = np.arange(len(positions))
    for j, parent in enumerate(parents):
        is_seen = seen[:, j] if parent < 0 else seen[:, j] & seen[:, parent]
        base = np.zeros_like(completed[:, j]) if parent < 0 else completed[:, parent]
        raw = positions[:, j] if parent < 0 else positions[:, j] - positions[:, parent]
        link = raw.copy()
        if is_seen.any() and not is_seen.all():
            for axis in range(3):
                link[~is_seen, axis] = np.interp(frames[~is_seen], frames[is_seen], raw[is_seen, axis])
        completed[:, j] = base + link
    return completed


def _measured_rotations(bodies: Sequence[Body], still: Body) -> Float | None:
    """Computes rotations since rest (F, 20, 4) from the bodies' measured orientations. Returns None if a body
    has none.
    """
    if still.orientations is None or any(body.orientations is None for body in bodies):
        return None
    world = np.stack([np.asarray(body.orientations) for body in bodies])
    return multiply(world, conjugate(still.orientations))


def _unit_direction(v: Float) -> Float:
    """Normalises vectors. A vector of zero length becomes +Y."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(
        np.where(
            length > _MIN_DIRECTION_LENGTH_M,
            v / np.where(length > _MIN_DIRECTION_LENGTH_M, length, 1.0),
            [0.0, 1.0, 0.0],
        )
    )


@njit(cache=True, nogil=True)
def point_bones(parents, vectors, positions, known, turns):
    """Computes the world rotations ``turns`` (F, N, 4) that point bones along ``positions``
    (F, N, 3).

    ``known`` is (F, N, 4), or (0, N, 4) if nothing is known.
    """
    has_known = len(known) > 0
    for f in range(len(positions)):
        for j in range(len(parents)):
            if has_known:
                q = load(known[f], j)
            elif parents[j] < 0:
                q = fit_root_rotation(parents, vectors, positions[f])
            else:
                q = load(turns[f], parents[j])
            if parents[j] >= 0:
                q = swing_to_direction(
                    q, row(vectors, j), subtract(row(positions[f], j), row(positions[f], parents[j]))
                )
                if not has_known:
                    q = add_twist(parents, vectors, positions[f], j, q)
            store(turns[f], j, q)


@njit(cache=True, nogil=True)
def fit_root_rotation(parents, vectors, positions):
    """Returns the rotation that best fits the bones that begin at the root (Kabsch algorithm). If there is a
    single bone, returns its shortest swing.
    """
    moment = np.zeros((3, 3))
    count, only = 0, 0
    for j in range(1, len(parents)):
        if parents[j] == 0 and length(row(vectors, j)) > _MIN_DIRECTION_LENGTH_M:
            count, only = count + 1, j
            for a in range(3):
                for b in range(3):
                    moment[a, b] += (positions[j, a] - positions[0, a]) * vectors[j, b]
    if count > 1:
        return nearest_quaternion(moment)
    identity = (1.0, 0.0, 0.0, 0.0)
    if count == 0:
        return identity
    return swing_to_direction(identity, row(vectors, only), subtract(row(positions, only), row(positions, 0)))


@njit(cache=True, nogil=True)
def swing_to_direction(q, rest, now):
    """Returns ``q`` followed by the shortest rotation that points ``rest`` along ``now``.

    If a joint coincides with its parent, the direction is undefined, and the bone keeps ``q``.
    """
    if length(rest) < _MIN_DIRECTION_LENGTH_M or length(now) < _MIN_DIRECTION_LENGTH_M:
        return q
    return mul(swing_to(turn(q, rest[0], rest[1], rest[2]), now), q)


@njit(cache=True, nogil=True)
def add_twist(parents, vectors, positions, joint, q):
    """Returns ``q`` with an additional twist about its bone, so that the child bones fit best. There is no
    twist unless there are several child bones.

    For each child bone, let a and b be its components perpendicular to the bone, as predicted by ``q`` and as
    measured. With n along the bone, the twist angle is atan2(sum (a x b).n, sum a.b), the least squares fit
    of a single angle.
    """
    bone = row(vectors, joint)
    size = length(bone)
    if size < _MIN_DIRECTION_LENGTH_M:
        bone, size = (0.0, 1.0, 0.0), 1.0
    n = turn(q, bone[0] / size, bone[1] / size, bone[2] / size)
    sine, cosine, count = 0.0, 0.0, 0
    for child in range(joint + 1, len(parents)):
        if parents[child] == joint:
            count += 1
            a = turn(q, vectors[child, 0], vectors[child, 1], vectors[child, 2])
            b = subtract(row(positions, child), row(positions, joint))
            sine += dot(cross(a, b), n)
            cosine += dot(a, b) - dot(a, n) * dot(b, n)
    if count < 2 or (sine == 0.0 and cosine == 0.0):
        return q
    return mul(rotation_about(n, math.atan2(sine, cosine)), q)
