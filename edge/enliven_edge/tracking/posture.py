"""A posture of the model: where it is, how its frames turn, how long its bones are; forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from enliven.arrays import Float
from enliven_edge.tracking import model


@dataclass
class Posture:
    """The unknowns of the fit.

    Attributes:
        position: (3,) metres, world frame, of the hip centre.
        rotations: (13, 3, 3) parent_from_frame.
        lengths: (12,) metres, ordered by ``model.LENGTHS``.
    """

    position: Float
    rotations: Float
    lengths: Float

    def copy(self) -> Posture:
        return Posture(self.position.copy(), self.rotations.copy(), self.lengths.copy())

    def joints(self) -> Float:
        """(20, 3) joint positions, world frame, metres."""
        world, pivots, _ = forward(self.position, self.rotations, self.lengths)
        offsets = model.JOINT_OFFSETS @ self.lengths
        return pivots[model.JOINT_FRAMES] + np.einsum("jab,jb->ja", world[model.JOINT_FRAMES], offsets)

    def capsules(self) -> tuple[Float, Float]:
        """(C, 2, 3) capsule ends in the world frame and (C, 2) radii, metres."""
        world, pivots, _ = forward(self.position, self.rotations, self.lengths)
        frame = model.CAPSULES.frame
        local = model.CAPSULES.ends @ self.lengths
        ends = pivots[frame, None] + np.einsum("cab,ceb->cea", world[frame], local)
        return ends, model.CAPSULES.radii * self.lengths[model.GIRTH]


def forward(position: Float, rotations: Float, lengths: Float) -> tuple[Float, Float, Float]:
    """World rotations (13, 3, 3), pivots (13, 3), and the pivots' derivatives by the lengths (13, 3, 12)."""
    return _forward(position, rotations, lengths, model.FRAME_PARENTS, model.PIVOTS)


@njit(cache=True, nogil=True)
def _forward(position, rotations, lengths, parents, offsets):  # type: ignore[no-untyped-def]
    """Forward kinematics, parents first."""
    count, terms = len(parents), len(lengths)
    world = np.empty((count, 3, 3))
    pivots = np.empty((count, 3))
    by_length = np.zeros((count, 3, terms))
    world[0] = rotations[0]
    pivots[0] = position
    for f in range(1, count):
        p = parents[f]
        for a in range(3):
            pivots[f, a] = pivots[p, a]
            for term in range(terms):
                derivative = 0.0
                for b in range(3):
                    derivative += world[p, a, b] * offsets[f, b, term]
                by_length[f, a, term] = by_length[p, a, term] + derivative
                pivots[f, a] += derivative * lengths[term]
            for c in range(3):
                world[f, a, c] = (
                    world[p, a, 0] * rotations[f, 0, c]
                    + world[p, a, 1] * rotations[f, 1, c]
                    + world[p, a, 2] * rotations[f, 2, c]
                )
    return world, pivots, by_length


def rotation(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Float:
    """(3, 3) Rz(z) Ry(y) Rx(x): turns about the fixed x, then y, then z axis, radians."""
    cx, sx, cy, sy, cz, sz = np.cos(x), np.sin(x), np.cos(y), np.sin(y), np.cos(z), np.sin(z)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


@njit(cache=True, nogil=True)
def exponential(v):  # type: ignore[no-untyped-def]
    """(3, 3) the rotation by the rotation vector v (Rodrigues)."""
    angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    a = 1.0 - angle * angle / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    b = 0.5 - angle * angle / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / (angle * angle)
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = b * v[i] * v[j]
        out[i, i] += 1.0 - b * angle * angle
    out[0, 1] -= a * v[2]
    out[1, 0] += a * v[2]
    out[0, 2] += a * v[1]
    out[2, 0] -= a * v[1]
    out[1, 2] -= a * v[0]
    out[2, 1] += a * v[0]
    return out


@njit(cache=True, nogil=True)
def logarithm(r):  # type: ignore[no-untyped-def]
    """(3,) the rotation vector of a (3, 3) rotation, of length at most pi."""
    v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = 0.5 * np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > 1e-4:
        return v * (0.5 * angle / sine)
    if cosine > 0.0:
        return v * 0.5
    # Near a half turn the axis is the eigenvector of R + I with the largest diagonal.
    axis = 0
    for i in range(1, 3):
        if r[i, i] > r[axis, axis]:
            axis = i
    column = np.array([r[0, axis], r[1, axis], r[2, axis]])
    column[axis] += 1.0
    norm = np.sqrt(column[0] ** 2 + column[1] ** 2 + column[2] ** 2)
    return column * (angle / norm)


_CARRY_ON = 0.8
_FASTEST_STEP, _FASTEST_TURN = 0.1, 0.25


def continued(before: Posture, now: Posture) -> Posture:
    """The posture one frame later if it moves on as it did, a little slower, at a person's speed at most."""
    made = now.copy()
    step = _CARRY_ON * (now.position - before.position)
    made.position += step * min(1.0, _FASTEST_STEP / max(1e-9, float(np.linalg.norm(step))))
    for f in range(len(made.rotations)):
        turn = _CARRY_ON * logarithm(before.rotations[f].T @ now.rotations[f])
        turn *= min(1.0, _FASTEST_TURN / max(1e-9, float(np.linalg.norm(turn))))
        made.rotations[f] = now.rotations[f] @ exponential(turn)
    return made
