"""Inflates a flat outline to a closed surface that is round across its axis and smooth everywhere.

The half height above the plane is z = rho sqrt(u). Here u solves the Poisson equation laplace(u) = -2 with u
= 0 on the outline. For a strip, sqrt(u) is a half circle. For an outline rounder than a strip, it would be
flatter than a circle. So the factor rho raises the surface to circles around the axis, as in RigMesh, and
varies smoothly elsewhere. The two halves meet at the outline. So the surface is closed and has the topology
of a sphere.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Int, Int32
from enliven.meshes import split_long_edges
from enliven.meshes.planar import refine_triangulation
from enliven.modeling.mesh.poisson_equation import SYMMETRIC_LU, solve_poisson
from enliven.modeling.mesh.remesh import flip_to_delaunay, smooth_taubin
from enliven.modeling.skinning.heat_diffusion import cotangent_laplacian

_MAX_EDGE_STEPS = 1.5
"""Maximum length of an edge in steps of the outline. Longer edges are split in half."""


def inflate_outline(
    outline: Float, triangles: Int, axis: Float, radii: Float, depth: float, smooth: int
) -> tuple[Float, Int32]:
    """Returns (V, 3) vertices and (F, 3) outward faces; x and y in the plane, z towards the viewer.

    Args:
        outline: (N, 2) metres, counter-clockwise, evenly spaced.
        triangles: (T, 3) its constrained Delaunay triangulation.
        axis: (A, 2) metres, points of the axis.
        radii: (A,) metres, radii of the circles there.
        depth: ratio of thickness to width: 1 for circles, less for a flatter shape.
        smooth: number of smoothing passes over the vertices (Taubin).
    """
    step = float(np.linalg.norm(np.roll(outline, -1, 0) - outline, axis=1).mean())
    flat, cells = refine_triangulation(outline, triangles, np.full(len(outline), step))
    squared = _compute_squared_heights(flat, cells, len(outline), axis, radii) * depth**2
    vertices, faces, squared = _make_both_halves(flat, cells, squared, len(outline), depth)
    while True:
        count = len(vertices)
        vertices, faces, parents, _ = split_long_edges(vertices, faces, _MAX_EDGE_STEPS * step)
        if len(parents) == 0 or count > 100_000:
            break
        # Interpolate the squared height, which keeps the midpoint of an edge on the circle.
        between = (squared[parents[:, 0]] + squared[parents[:, 1]]) / 2
        squared = np.concatenate([squared, between])
        side = np.sign(vertices[parents[:, 0], 2] + vertices[parents[:, 1], 2])
        vertices[count:, 2] = side * np.sqrt(between)
    for _ in range(2):
        faces = flip_to_delaunay(vertices, faces)
        vertices = smooth_taubin(vertices, faces, (smooth + 1) // 2)
    return vertices, flip_to_delaunay(vertices, faces)


def _compute_squared_heights(flat: Float, cells: Int, rim: int, axis: Float, radii: Float) -> Float:
    """Returns (V,) square metres: z squared at depth 1, zero on the first ``rim`` points, the outline."""
    points = np.concatenate([flat, np.zeros((len(flat), 1))], 1)
    inner = np.arange(rim, len(flat))
    if len(inner) == 0:
        return np.zeros(len(flat))
    out = solve_poisson(points, cells.astype(np.int32), np.arange(len(flat)) >= rim)
    laplacian, _ = cotangent_laplacian(points, cells.astype(np.int32))
    # Compute the factor rho. It makes the cross-sections round at the axis, and is as smooth as possible
    # elsewhere.
    distances = np.linalg.norm(flat[None, inner] - axis[:, None], axis=2)
    nearest = inner[np.argmin(distances, axis=1)]
    factors = radii**2 / np.maximum(out[nearest], 1e-12 * float(out.max()))
    pull = np.zeros(len(flat))
    np.add.at(pull, nearest, 0.3)
    right = np.zeros(len(flat))
    np.add.at(right, nearest, 0.3 * np.clip(factors, 0.7, 2.2))
    if not pull.any():
        return out
    lift = splu(csc_matrix(laplacian + diags(pull)), **SYMMETRIC_LU).solve(right)
    return np.asarray(out * np.clip(lift, 0.7, 2.2))


def _make_both_halves(
    flat: Float, cells: Int, squared: Float, rim: int, depth: float
) -> tuple[Float, Int32, Float]:
    """Returns vertices (V, 3), faces (F, 3) and squared heights (V,) of the upper and lower half, joined at
    the outline."""
    height = np.sqrt(np.maximum(squared, 0.0))
    upper = np.concatenate([flat, height[:, None]], 1)
    lower = np.concatenate([flat[rim:], -height[rim:, None]], 1)
    under = np.concatenate([np.arange(rim), len(flat) + np.arange(len(flat) - rim)])
    faces = np.concatenate([cells, under[cells][:, ::-1]])
    # A triangle with all corners on the outline would coincide in both halves. So each of its two copies gets
    # an inner point.
    vertices = np.concatenate([upper, lower])
    return _split_inner_edges(vertices, faces, np.concatenate([squared, squared[rim:]]), rim, depth)


def _split_inner_edges(
    vertices: Float, faces: Int, squared: Float, rim: int, depth: float
) -> tuple[Float, Int32, Float]:
    """Splits inner edges between two outline points, with separate midpoints in the two halves. Returns
    vertices (V, 3), faces (F, 3) and squared heights (V,)."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1), -1).reshape(-1, 2)
    step = ends[:, 1] - ends[:, 0]
    across = (ends[:, 1] < rim) & (step != 1) & (step != rim - 1)
    touched = across.reshape(-1, 3).any(1)
    upper = (np.arange(len(faces)) < len(faces) // 2)[touched]
    midpoints: list[Float] = []
    heights: list[float] = []
    out: list[list[int]] = []
    number: dict[tuple[int, int, bool], int] = {}
    for face, above in zip(faces[touched].tolist(), upper.tolist(), strict=True):
        corners: list[int] = []
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            corners.append(a)
            low, high = min(a, b), max(a, b)
            if high < rim and high - low not in (1, rim - 1):
                key = (low, high, above)
                if key not in number:
                    number[key] = len(vertices) + len(midpoints)
                    width = depth * float(np.linalg.norm(vertices[a] - vertices[b])) / 2
                    middle = (vertices[a] + vertices[b]) / 2
                    middle[2] = width if above else -width
                    midpoints.append(middle)
                    heights.append(width**2)
                corners.append(number[key])
        out += _triangulate_polygon(corners, len(vertices))
    all_vertices = np.concatenate([vertices, *([np.array(midpoints)] if midpoints else [])])
    parts = np.concatenate([faces[~touched], np.array(out, np.int64).reshape(-1, 3)])
    return all_vertices, parts.astype(np.int32), np.concatenate([squared, np.array(heights)])


def _triangulate_polygon(corners: list[int], first_made: int) -> list[list[int]]:
    """Returns the triangles of a polygon with three to six corners. Every new edge ends at a new point; new
    points have numbers from ``first_made`` on."""
    new_corners = [k for k, v in enumerate(corners) if v >= first_made]
    if not new_corners:
        return [corners]
    if len(new_corners) == 1:
        k = new_corners[0]
        turn = corners[k:] + corners[:k]
        return [[turn[0], turn[i], turn[i + 1]] for i in range(1, len(turn) - 1)]
    out: list[list[int]] = []
    rest = list(corners)
    while len(rest) > 3:
        # Cut off an old corner between two new corners. If there is none, split the remaining polygon as a
        # fan.
        size = len(rest)
        ear = next(
            (
                k
                for k in range(size)
                if rest[k] < first_made and rest[k - 1] >= first_made and rest[(k + 1) % size] >= first_made
            ),
            None,
        )
        if ear is None:
            k = next(k for k in range(size) if rest[k] >= first_made)
            turn = rest[k:] + rest[:k]
            return out + [[turn[0], turn[i], turn[i + 1]] for i in range(1, size - 1)]
        out.append([rest[ear - 1], rest[ear], rest[(ear + 1) % size]])
        rest.pop(ear)
    return [*out, rest]
