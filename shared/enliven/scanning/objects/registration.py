"""Global registration of an object that was picked up and put down. Starts from evenly spread rotations, and
verifies the results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.kernels import njit, run_in_pieces
from enliven.scanning.objects.free_space import SeenDepth, seen_through
from enliven.scanning.objects.surface_points import NearestGrid, SurfacePoints, make_nearest_grid
from enliven.scanning.rigid import invert_pose, pose_difference

_GRID_CELL_M = 0.015
"""Cell size of the grid for finding nearest surface points."""
_GRID_MARGIN_M = 0.3
"""Margin of the grid around the object's surface."""
_COARSE_POINTS = 300
"""Number of surface points that are aligned from each starting rotation."""
START_ROTATIONS = 900
"""Number of starting rotations to try; 900 are about 20 degrees apart. Lower it to save time."""
_MAX_SURFACE_DISTANCE_M = 0.01
"""Maximum distance of a point that counts as on the surface."""
REFINED_CANDIDATES = 24
"""Number of the best candidate poses that are refined."""
_FINE_POINTS = 2000
"""Number of surface points for the refinement."""
_SEEN_THROUGH_PENALTY = 2.0
"""Penalty in the score for a point that the camera saw through, relative to the reward for a point on the
surface."""
MIN_AGREEING_FRACTION = 0.5
"""Minimum fraction of points on the surface for an accepted pose."""
MAX_SEEN_THROUGH_FRACTION = 0.04
"""Maximum fraction of points in space that the camera saw through, for an accepted pose."""
_MIN_SCORE_LEAD = 0.2
"""Minimum difference between the best and the second-best score for an accepted pose."""
_MIN_FREE_SPACE_M = 0.04
"""Minimum distance in front of the observed depth at which space counts as free."""

_SPIRAL_NUMBER = 1.533751168755204288118041
"""Real root of x^4 = x + 4. It is the second constant of super-Fibonacci spirals; the first is the square
root of 2."""
_ROTATIONS_PER_PIECE = 8
"""Number of rotations that a thread processes at a time."""
_ICP_STEPS = 12
"""Number of ICP steps from each rotation. Most alignments have converged after eight."""
_FINE_STEPS = 20
"""Number of ICP steps for the candidates that are refined."""
_RESIDUAL_WIDTHS_M = 0.15, 0.01
"""Residuals (metres) that get a quarter of the full weight: in the first ICP step, and in the last. The width
shrinks, so that parts that do not overlap lose influence."""
_DAMPING_PER_WEIGHT = 1e-4
"""Damping of the normal matrix, relative to the total weight of the points. It keeps the pose unchanged along
directions that the points do not constrain."""
_MAX_DUPLICATE_DIFFERENCE = 0.05, 0.25
"""Maximum difference of two results that count as the same, in metres and radians."""
_MIN_NORMAL_COSINE = 0.5
"""Minimum cosine (60 degrees) between the normals of two matching points. Below it, they belong to different
sides."""


@dataclass(frozen=True)
class Registration:
    """The pose of a part relative to a model.

    Attributes:
        model_from_part: (4, 4) the rigid transform from the part to the model.
        agreeing: fraction of the part's points that lie on the model's surface.
        through: fraction of a surface's points that the images of the other surface saw through. It is the
            larger value of the two surfaces.
        margin: the score of this pose minus the score of the best other pose.
    """

    model_from_part: Float
    agreeing: float
    through: float
    margin: float


@dataclass(frozen=True)
class ScannedSurface:
    """A surface, and the images that saw it with its surroundings. Both are in the same frame."""

    surface: SurfacePoints
    views: Sequence[SeenDepth]


def spread_rotations(count: int) -> Float:
    """Returns (count, 3, 3) evenly spread rotations: super-Fibonacci spirals (Alexa, CVPR 2022)."""
    s = np.arange(count) + 0.5
    inner, outer = np.sqrt(s / count), np.sqrt(1.0 - s / count)
    inner_angle, outer_angle = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / _SPIRAL_NUMBER
    spiral = np.stack(
        [
            inner * np.sin(inner_angle),
            inner * np.cos(inner_angle),
            outer * np.sin(outer_angle),
            outer * np.cos(outer_angle),
        ],
        -1,
    )
    return np.asarray(rotation.to_matrix(spiral))


def register_part(model: ScannedSurface, part: ScannedSurface) -> Registration | None:
    """Returns the pose of a part relative to the earlier scan of the object, or None if it is not certain.

    From each of many rotations, the part is aligned with the model by robust ICP (iterative closest points),
    in which non-overlapping parts lose influence. The results are then verified: the images of one surface
    must not see through the other surface.

    Args:
        model: the earlier scan.
        part: the current scan, in any pose.
    """
    grid = make_nearest_grid(model.surface, _GRID_CELL_M, _GRID_MARGIN_M)
    coarse_points = part.surface.take_first(_COARSE_POINTS)
    starts = _start_poses(model.surface, coarse_points, START_ROTATIONS)
    poses, scores = align_from_starts(grid, coarse_points, starts, _ICP_STEPS, _MAX_SURFACE_DISTANCE_M)
    best = _find_distinct_poses(poses, scores, REFINED_CANDIDATES)
    refinement_points = part.surface.take_first(_FINE_POINTS)
    poses, agreeing = align_from_starts(
        grid, refinement_points, poses[best], _FINE_STEPS, _MAX_SURFACE_DISTANCE_M
    )
    distinct = _find_distinct_poses(poses, agreeing, REFINED_CANDIDATES)
    poses, agreeing = poses[distinct], agreeing[distinct]
    seen_through_fractions = np.array([_compute_seen_through_fraction(model, part, pose) for pose in poses])
    scores = agreeing - _SEEN_THROUGH_PENALTY * seen_through_fractions
    order = np.argsort(-scores)
    best_index = order[0]
    margin = float(scores[best_index] - scores[order[1]]) if len(order) > 1 else 1.0
    registration = Registration(
        poses[best_index], float(agreeing[best_index]), float(seen_through_fractions[best_index]), margin
    )
    return (
        registration
        if registration.agreeing >= MIN_AGREEING_FRACTION
        and registration.through <= MAX_SEEN_THROUGH_FRACTION
        and margin >= _MIN_SCORE_LEAD
        else None
    )


def _compute_seen_through_fraction(model: ScannedSurface, part: ScannedSurface, pose: Float) -> float:
    """Returns the fraction of a surface's points that the images of the other surface saw through, as the
    larger value of the two surfaces.
    """
    moved_part = part.surface.take_first(_FINE_POINTS).transform(pose)
    part_share = seen_through(moved_part.points, model.views, _MIN_FREE_SPACE_M).mean()
    back = invert_pose(pose)
    moved_model = model.surface.take_first(_FINE_POINTS).transform(back)
    return float(max(part_share, seen_through(moved_model.points, part.views, _MIN_FREE_SPACE_M).mean()))


def _start_poses(model: SurfacePoints, part: SurfacePoints, count: int) -> Float:
    """Returns (count, 4, 4) poses, one for each rotation. All of them align the centre of the part with the
    centre of the model.
    """
    starts = np.tile(np.eye(4), (count, 1, 1))
    starts[:, :3, :3] = spread_rotations(count)
    middles = [(points.max(0) + points.min(0)) / 2 for points in (model.points, part.points)]
    starts[:, :3, 3] = middles[0] - starts[:, :3, :3] @ middles[1]
    return starts


def align_from_starts(
    grid: NearestGrid,
    part: SurfacePoints,
    starts: Float,
    steps: int,
    near: float,
    widths: tuple[float, float] = _RESIDUAL_WIDTHS_M,
) -> tuple[Float, Float]:
    """Aligns a part with a surface by ICP from K initial poses. Returns (K, 4, 4) poses, and (K,) fractions
    of the part's points on the surface.

    Args:
        starts: (K, 4, 4) initial poses.
        near: maximum distance, metres, of a point that counts as on the surface.
        widths: residuals (metres) that get a quarter of the full weight, in the first step and in the last.
    """
    poses, fractions = starts.copy(), np.zeros(len(starts))
    softs = np.geomspace(*widths, steps)
    run_in_pieces(
        _align_poses,
        len(poses),
        _ROTATIONS_PER_PIECE,
        *grid,
        part.points,
        part.normals,
        softs,
        near,
        poses,
        fractions,
    )
    return poses, fractions


def _find_distinct_poses(poses: Float, scores: Float, max_count: int) -> list[int]:
    """Returns the indices of the best poses without duplicates, best first."""
    chosen: list[int] = []
    for n in np.argsort(-scores, kind="stable"):
        differences = (pose_difference(poses[n], poses[k]) for k in chosen)
        if not any(
            distance < _MAX_DUPLICATE_DIFFERENCE[0] and angle < _MAX_DUPLICATE_DIFFERENCE[1]
            for distance, angle in differences
        ):
            chosen.append(int(n))
            if len(chosen) == max_count:
                break
    return chosen


@njit(cache=True, nogil=True, error_model="numpy")
def _align_poses(
    origin, cell, nearest, points, normals, part, facing, widths, near, poses, shares, first, last
):
    """Aligns a part by point-to-plane ICP with Geman-McClure weights, from each of the poses ``first`` to
    ``last``."""
    matrix, right, j = np.empty((6, 6)), np.empty(6), np.empty(6)
    for k in range(first, last):
        pose = poses[k]
        for step in range(len(widths) + 1):
            soft, agreeing, weight = widths[min(step, len(widths) - 1)], 0, 0.0
            matrix[:], right[:] = 0.0, 0.0
            for n in range(len(part)):
                # Transform the point, and find the nearest surface point in the grid.
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
                # Reject the pair if the two normals point to different sides.
                x, y, z = facing[n, 0], facing[n, 1], facing[n, 2]
                cosine = (
                    nx * (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z)
                    + ny * (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z)
                    + nz * (pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z)
                )
                if cosine < _MIN_NORMAL_COSINE:
                    continue
                # Compute the point-to-plane residual, and count the points on the surface.
                dx, dy, dz = qx - points[at, 0], qy - points[at, 1], qz - points[at, 2]
                away = nx * dx + ny * dy + nz * dz
                distance = dx * dx + dy * dy + dz * dz
                if distance < 4.0 * cell * cell and abs(away) < near:
                    agreeing += 1
                # Compute the robust weight (Geman-McClure), and add to the normal equations.
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
            # Stop here in the last pass, which only counts the points on the surface.
            if step == len(widths) or weight == 0.0:
                break
            for a in range(6):
                matrix[a, a] += _DAMPING_PER_WEIGHT * weight + 1e-12
            _move_pose(pose, np.linalg.solve(matrix, right))


@njit(cache=True, nogil=True, error_model="numpy")
def _move_pose(pose, step):
    """Moves a pose (4, 4) in place and rotates it about its own position (Rodrigues); ``step`` is (6,),
    world axes.
    """
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
