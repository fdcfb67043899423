"""Volume preservation of a closed surface by a pressure, which acts on the stretched cells in the pose state.

V_i of eq. 12 preserves the volume of a cell, but the cells of a surface have no volume. If a ball is
stretched between two hands, its curved surface straightens. This deforms no cell, but the volume grows. So
the pose state has a pressure p: eq. 13 with the additional term - 4 p Vol(x'). The gradient of Vol at a
vertex is a third of its faces' area vectors. The pressure acts only on stretched cells, so that squashing the
head does not inflate the tail. A single global volume constraint would inflate it (J. Huang et al., "Subspace
gradient domain mesh deformation", 2006). Over the frames, p approaches the value that restores the volume at
rest. It only changes the right-hand side of the pose's solve, so no additional solve is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.arap.cells import Cells
from enliven.deformation.arap.factor import Factor
from enliven.deformation.arap.solves import solve_backward, solve_forward
from enliven.kernels import njit

_MAX_OPEN_EDGE_FRACTION = 0.02
"""Maximum fraction of open edges for a surface to count as closed."""
_MIN_BALL_VOLUME_FRACTION = 1e-3
"""Minimum volume of a closed surface, as a fraction of the volume of a ball with the same area."""
_CORRECTION_PER_FRAME = 0.7
"""Fraction of the missing volume that is corrected per frame."""
_HALF_PRESSURE_STRETCH_SQUARED = 0.05**2
"""Squared stretch (s - 1)^2 at which a cell gets half of the pressure."""
_MAX_MOVED_VOLUME_FRACTION = 0.35
"""Maximum change of the volume by the pressure, as a fraction of the volume."""


class Volume(NamedTuple):
    """The volume that a closed surface encloses.

    Attributes:
        faces: (F, 3) the corners of the faces, as indices in the solver's order.
        border: (B,) indices of the positions at open edges, empty for a closed surface. The volume is
            computed about their centre.
        rest: volume at rest in cubic metres, above 0.
        ease: growth of the volume under a pressure of 1 on the whole surface, at rest.
    """

    faces: Int32
    border: Int
    rest: float
    ease: float


def compute_enclosed_volume(rest: Float, faces: Int, cells: Cells, factor: Factor) -> Volume | None:
    """Returns the volume of a surface with the positions ``rest`` (P, 3) in metres, or None if it encloses no
    volume."""
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    keys, uses = np.unique(sides[:, 0] * len(rest) + sides[:, 1], return_counts=True)
    is_open = keys[uses == 1]
    if len(is_open) > _MAX_OPEN_EDGE_FRACTION * len(keys):
        return None
    border = np.unique(np.concatenate([is_open // len(rest), is_open % len(rest)]))
    triangles = np.ascontiguousarray(faces, np.int32)
    forces = np.zeros((len(rest), 3))
    enclosed = compute_volume_gradient(rest, triangles, border, forces)
    a, b, c = (rest[faces[:, k]] for k in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    if not enclosed > _MIN_BALL_VOLUME_FRACTION * area**1.5 / (6 * np.sqrt(np.pi)):
        return None
    forces -= forces.mean(0)
    z = np.zeros(4 * (len(rest) + 4), np.float32)
    z[: 4 * len(rest)].reshape(-1, 4)[cells.eliminated, :3] = forces
    room = np.zeros(4 * (factor.tallest + 4), np.float32)
    solve_forward(factor, z, room)
    solve_backward(factor, z, room)
    answer = z[: 4 * len(rest)].reshape(-1, 4)[cells.eliminated, :3]
    ease = float((answer * forces).sum())
    return Volume(triangles, border, enclosed, ease) if ease > 0 else None


@njit(cache=True, nogil=True)
def compute_volume_gradient(x, faces, border, out):
    """Returns the volume for the positions x (P, 3) in metres, and computes its gradient into ``out`` (P,
    3)."""
    ox = oy = oz = 0.0
    for k in border:
        ox, oy, oz = ox + x[k, 0] / len(border), oy + x[k, 1] / len(border), oz + x[k, 2] / len(border)
    if len(border) == 0:
        ox, oy, oz = x[0, 0], x[0, 1], x[0, 2]
    out[:] = 0.0
    total = 0.0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        vx, vy, vz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        nx, ny, nz = (uy * vz - uz * vy) / 6.0, (uz * vx - ux * vz) / 6.0, (ux * vy - uy * vx) / 6.0
        total += nx * (x[i, 0] - ox) + ny * (x[i, 1] - oy) + nz * (x[i, 2] - oz)
        for p in (i, j, k):
            out[p, 0] += nx
            out[p, 1] += ny
            out[p, 2] += nz
    return total


@njit(cache=True, nogil=True)
def add_pressure(volume, frames, eliminated, pose, forces, pressure, kept, z):
    """Adds the pressure on the stretched cells to z (4 V,), and returns the pressure.

    Args:
        frames: (16 V,) the solver's state. The fourth number of a cell is its stretch minus 1.
        pose: (V, 3) metres, the positions shown last, in the solver's order.
        forces: (V, 3) scratch space.
        pressure: the pressure of the last frame.
        kept: the fraction of the change of volume that the pressure corrects, from 0 to 1.
    """
    missing = volume.rest - compute_volume_gradient(pose, volume.faces, volume.border, forces)
    whole = pressed = 0.0
    for i in range(len(forces)):
        size = forces[i, 0] ** 2 + forces[i, 1] ** 2 + forces[i, 2] ** 2
        d = frames[16 * i + 3] ** 2
        share = d / (d + _HALF_PRESSURE_STRETCH_SQUARED)
        whole, pressed = whole + size, pressed + share * size
    if pressed < 1e-3 * whole:
        return 0.0
    most = _MAX_MOVED_VOLUME_FRACTION * volume.rest / volume.ease
    # Estimate the volume without pressure: the present volume minus the effect of the pressure.
    ease = volume.ease * pressed / whole
    pressure += _CORRECTION_PER_FRAME * (kept * missing - (1.0 - kept) * pressure * ease) / ease
    pressure = min(max(pressure, -most), most)
    for i in range(len(forces)):
        d, at = frames[16 * i + 3] ** 2, 4 * eliminated[i]
        push = pressure * d / (d + _HALF_PRESSURE_STRETCH_SQUARED)
        for c in range(3):
            z[at + c] += push * forces[i, c]
    return pressure
