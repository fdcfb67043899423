"""Where a surface lies that was picked up and put down: all turns are tried, and what is found is doubted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.kernels import njit
from enliven.scanning.objects.free_space import SeenDepth, seen_through
from enliven.scanning.objects.surface_points import NearestGrid, SurfacePoints, nearest_grid
from enliven.scanning.rigid import apart, inverse
from enliven.scanning.settings import RegistrationSettings
from enliven.scanning.threads import in_pieces

_GOLDEN = 1.533751168755204288118041
"""Real root of x^4 = x + 4, the second number of super-Fibonacci spirals."""
_PIECE = 8
"""Turns that a thread takes at a time."""
_STEPS = 12
"""Steps from each turn: most are where they will be after eight."""
_FINE_STEPS = 20
"""Steps of those that are looked at closely."""
_WIDTHS = 0.15, 0.01
"""Metres at which a residual counts a quarter, first and last: what does not overlap lets go."""
_DAMPING = 1e-4
"""Of the normal matrix, per weight of the points: what slides freely stays where it is."""
_SAME = 0.05, 0.25
"""Metres and radians within which two answers are one."""
_FACING = 0.5
"""Cosine, 60 degrees, between two normals below which points are of two different sides."""


@dataclass(frozen=True)
class Registration:
    """How a part lies on a model.

    Attributes:
        model_from_part: (4, 4).
        agreeing: share of the part's points that lie on the model's surface.
        through: share of points, the larger of both ways, that lie in space that was seen empty.
        margin: by how much its score is better than that of the best other answer.
    """

    model_from_part: Float
    agreeing: float
    through: float
    margin: float


@dataclass(frozen=True)
class Scanned:
    """A surface, and images that saw it with what is round it, in one frame."""

    surface: SurfacePoints
    views: Sequence[SeenDepth]


def turns(count: int) -> Float:
    """Returns (count, 3, 3) rotations spread evenly: super-Fibonacci spirals (Alexa, CVPR 2022)."""
    s = np.arange(count) + 0.5
    inner, outer = np.sqrt(s / count), np.sqrt(1.0 - s / count)
    one, two = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / _GOLDEN
    spiral = np.stack(
        [inner * np.sin(one), inner * np.cos(one), outer * np.sin(two), outer * np.cos(two)], -1
    )
    return np.asarray(rotation.to_matrix(spiral))


def registered(
    model: Scanned, part: Scanned, settings: RegistrationSettings | None = None
) -> Registration | None:
    """Returns how a part of an object lies on what was scanned of it before, or None where that is not sure.

    From each of many turns the part is laid onto the model by iterated closest points, which let go of what
    does not overlap. The answers are then doubted: no surface may lie where the other's images saw through.

    Args:
        model: what was scanned before.
        part: what is seen now, anywhere.
    """
    s = settings or RegistrationSettings()
    grid = nearest_grid(model.surface, s.cell, s.margin)
    some = part.surface.some(s.points)
    starts = _starts(model.surface, some, s.turns)
    poses, scores = laid(grid, some, starts, _STEPS, s.near)
    best = _distinct(poses, scores, s.looked_at)
    more = part.surface.some(s.fine_points)
    poses, agreeing = laid(grid, more, poses[best], _FINE_STEPS, s.near)
    kept = _distinct(poses, agreeing, s.looked_at)
    poses, agreeing = poses[kept], agreeing[kept]
    through = np.array([_through(model, part, pose, s) for pose in poses])
    scores = agreeing - s.doubt * through
    order = np.argsort(-scores)
    first = order[0]
    margin = float(scores[first] - scores[order[1]]) if len(order) > 1 else 1.0
    found = Registration(poses[first], float(agreeing[first]), float(through[first]), margin)
    return (
        found if found.agreeing >= s.agreeing and found.through <= s.through and margin >= s.clear else None
    )


def _through(model: Scanned, part: Scanned, pose: Float, s: RegistrationSettings) -> float:
    """Returns the share of points that lie where the other's images saw through, the larger of both ways."""
    there = part.surface.some(s.fine_points).moved(pose)
    one = seen_through(there.points, model.views, s.clearance).mean()
    back = inverse(pose)
    here = model.surface.some(s.fine_points).moved(back)
    return float(max(one, seen_through(here.points, part.views, s.clearance).mean()))


def _starts(model: SurfacePoints, part: SurfacePoints, count: int) -> Float:
    """Returns (count, 4, 4) poses, one for each turn, that lay the middle of a part onto the model's."""
    starts = np.tile(np.eye(4), (count, 1, 1))
    starts[:, :3, :3] = turns(count)
    middles = [(points.max(0) + points.min(0)) / 2 for points in (model.points, part.points)]
    starts[:, :3, 3] = middles[0] - starts[:, :3, :3] @ middles[1]
    return starts


def laid(
    grid: NearestGrid,
    part: SurfacePoints,
    starts: Float,
    steps: int,
    near: float,
    widths: tuple[float, float] = _WIDTHS,
) -> tuple[Float, Float]:
    """Returns (K, 4, 4) poses of a part laid onto a surface, and (K,) shares of its points that lie on it.

    Args:
        starts: (K, 4, 4) where each begins.
        near: metres from the surface within which a point lies on it.
        widths: metres at which a residual counts a quarter, in the first step and in the last.
    """
    poses, shares = starts.copy(), np.zeros(len(starts))
    softs = np.geomspace(*widths, steps)
    in_pieces(_lay, len(poses), _PIECE, *grid, part.points, part.normals, softs, near, poses, shares)
    return poses, shares


def _distinct(poses: Float, scores: Float, most: int) -> list[int]:
    """Returns the numbers of the best poses of which no two are the same, the best first."""
    kept: list[int] = []
    for n in np.argsort(-scores, kind="stable"):
        near = (apart(poses[n], poses[k]) for k in kept)
        if not any(move < _SAME[0] and turn < _SAME[1] for move, turn in near):
            kept.append(int(n))
            if len(kept) == most:
                break
    return kept


@njit(cache=True, nogil=True, error_model="numpy")
def _lay(origin, cell, nearest, points, normals, part, facing, widths, near, poses, shares, first, last):
    """Lays a part from each of some poses; point to plane, robust after Geman and McClure."""
    matrix, right, j = np.empty((6, 6)), np.empty(6), np.empty(6)
    for k in range(first, last):
        pose = poses[k]
        for step in range(len(widths) + 1):
            soft, agreeing, weight = widths[min(step, len(widths) - 1)], 0, 0.0
            matrix[:], right[:] = 0.0, 0.0
            for n in range(len(part)):
                x, y, z = part[n, 0], part[n, 1], part[n, 2]
                rx = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z
                ry = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z
                rz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z
                qx, qy, qz = rx + pose[0, 3], ry + pose[1, 3], rz + pose[2, 3]
                cx = int(np.floor((qx - origin[0]) / cell))
                cy = int(np.floor((qy - origin[1]) / cell))
                cz = int(np.floor((qz - origin[2]) / cell))
                if cx < 0 or cy < 0 or cz < 0:
                    continue
                if cx >= nearest.shape[0] or cy >= nearest.shape[1] or cz >= nearest.shape[2]:
                    continue
                at = nearest[cx, cy, cz]
                nx, ny, nz = normals[at, 0], normals[at, 1], normals[at, 2]
                x, y, z = facing[n, 0], facing[n, 1], facing[n, 2]
                alike = (
                    nx * (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z)
                    + ny * (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z)
                    + nz * (pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z)
                )
                if alike < _FACING:
                    continue
                dx, dy, dz = qx - points[at, 0], qy - points[at, 1], qz - points[at, 2]
                away = nx * dx + ny * dy + nz * dz
                distance = dx * dx + dy * dy + dz * dz
                if distance < 4.0 * cell * cell and abs(away) < near:
                    agreeing += 1
                robust = soft * soft / (soft * soft + distance)
                w = robust * robust
                j[0], j[1], j[2] = nx, ny, nz
                j[3], j[4], j[5] = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
                for a in range(6):
                    for b in range(6):
                        matrix[a, b] += w * j[a] * j[b]
                    right[a] -= w * j[a] * away
                weight += w
            shares[k] = agreeing / len(part)
            if step == len(widths) or weight == 0.0:
                break
            for a in range(6):
                matrix[a, a] += _DAMPING * weight + 1e-12
            _apply(pose, np.linalg.solve(matrix, right))


@njit(cache=True, nogil=True, error_model="numpy")
def _apply(pose, step):
    """Moves a pose (4, 4) in place and turns it about its own place (Rodrigues), (6,), world axes."""
    angle = np.sqrt(step[3] * step[3] + step[4] * step[4] + step[5] * step[5])
    if angle > 1e-12:
        x, y, z = step[3] / angle, step[4] / angle, step[5] / angle
        c, s = np.cos(angle), np.sin(angle)
        for k in range(3):
            a, b, d = pose[0, k], pose[1, k], pose[2, k]
            along = (x * a + y * b + z * d) * (1.0 - c)
            pose[0, k] = a * c + (y * d - z * b) * s + x * along
            pose[1, k] = b * c + (z * a - x * d) * s + y * along
            pose[2, k] = d * c + (x * b - y * a) * s + z * along
    for k in range(3):
        pose[k, 3] += step[k]
