"""Builds a surface through the points of a scan from a single position. Parts that the sensor did not see
stay open.

Visible points are connected by a Delaunay triangulation of their directions from the sensor. Triangles that
span a gap, or a depth step between an object and its background, are left out.
"""

from __future__ import annotations

import re

import numpy as np
import scipy
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from enliven.arrays import Bool, Float, Int
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh, extract_submesh

_MAX_EDGE_IN_SPACINGS = 4.0
"""Maximum edge length, as a multiple of the point spacing."""
_MIN_FACING_COSINE = 0.13
"""Minimum cosine between a triangle's normal and the ray to the sensor. Triangles with a smaller cosine are
depth steps, not surfaces."""
_OCCLUSION_SPACINGS = 4.0
"""Minimum depth difference between an occluded point and the point in front of it, as a multiple of the point
spacing."""
_MIN_PART_FRACTION = 0.01
"""Minimum fraction of all triangles in a connected piece. Smaller pieces are removed as specks."""
_MAX_COLUMNS = 1024
"""Maximum number of values per point in a file."""
_MAX_PIXELS = 1 << 24
"""Maximum number of pixels of the occlusion image: 4096 x 4096. At one pixel per 1 cm of spacing, the image
is 40 m wide."""
_MAX_DISTANCE_M = 1e6
"""Maximum distance of a valid point from the sensor, in metres."""


def surface_through_points(
    points: Float, viewpoint: Float, spacing: float = 0.010, name: str = "scan"
) -> Mesh:
    """Returns the surface through the points that are visible from ``viewpoint``. Its triangles face the
    sensor.

    Args:
        points: (P, 3) metres, not finite for missing measurements.
        viewpoint: (3,) metres, position of the sensor.
        spacing: minimum distance between vertices, metres. Denser points are averaged.

    Raises:
        InputError: if there are too few points for a surface.
    """
    points = points - viewpoint
    points = points[(np.abs(points) < _MAX_DISTANCE_M).all(1)]
    centroid = points.mean(0) if len(points) else np.zeros(3)
    depth = float(np.linalg.norm(centroid))
    if len(points) < 3 or depth < 1e-6:
        raise _make_too_few_points_error(len(points), name)
    forward = centroid / depth
    right = np.cross(forward, [0.0, 1.0, 0.0] if abs(forward[1]) < 0.9 else [1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    sensor_points = points @ axes.T
    sensor_points = _thin_out_points(
        _find_unoccluded_points(sensor_points[sensor_points[:, 2] > 0.05 * depth], spacing), spacing
    )
    if len(sensor_points) < 3:
        raise _make_too_few_points_error(len(sensor_points), name)
    faces = np.asarray(
        scipy.spatial.Delaunay(sensor_points[:, :2] / sensor_points[:, 2:]).simplices, np.int64
    )
    faces = faces[_is_surface(sensor_points, faces, spacing)]
    if len(faces) == 0:
        raise _make_too_few_points_error(0, name)
    mesh = Mesh(
        sensor_points @ axes + viewpoint, _find_facing_triangles(sensor_points, faces).astype(np.int32), name
    )
    return _remove_specks(mesh)


def parse_pcd(data: bytes, where: str) -> tuple[Float, Float]:
    """Parses a PCD file, ASCII or binary. Returns (P, 3) its points, and (3,) its viewpoint.

    Raises:
        InputError: if the data is not a PCD file, is compressed, or lacks x, y, z of 4 or 8 bytes. The error
            names ``where``.
    """
    head = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", data[:4096], re.MULTILINE)
    if head is None:
        raise InputError("the file has no DATA line, so it is not a PCD file", where=where)
    lines = [line.split() for line in data[: head.start()].decode("ascii", "replace").splitlines()]
    header = {line[0]: line[1:] for line in lines if len(line) > 1 and line[0].isupper()}
    kind, body = head[1].decode(), data[head.end() :]
    try:
        names, sizes = header["FIELDS"], [int(s) for s in header["SIZE"]]
        counts = [int(c) for c in header.get("COUNT", ["1"] * len(names))]
        count, columns = int(header["POINTS"][0]), [names.index(axis) for axis in "xyz"]
        if count < 0 or min(sizes + counts, default=0) < 0 or sum(counts) > _MAX_COLUMNS:
            raise ValueError("a negative or a huge count")
        viewpoint = np.array(header.get("VIEWPOINT", ["0"] * 3)[:3], np.float64)
        if kind == "ascii":
            starts = np.cumsum([0, *counts])
            rows = np.array(body.split(), np.float64).reshape(-1, sum(counts))
            return rows[:count, starts[columns]], viewpoint
        if kind != "binary" or any(sizes[a] not in (4, 8) or header["TYPE"][a] != "F" for a in columns):
            raise InputError(f"points of the type {kind} {header['TYPE']} are not supported", where=where)
        kinds = [f"V{size * repeats}" for size, repeats in zip(sizes, counts, strict=True)]
        for a in columns:
            kinds[a] = f"<f{sizes[a]}"
        table = np.frombuffer(body, np.dtype([(f"{k}", kind) for k, kind in enumerate(kinds)]), count)
    except (KeyError, ValueError, IndexError, TypeError, OverflowError):
        raise InputError(
            "the points of the file do not match its header",
            where=where,
            remedy="Copy or export the file again.",
        ) from None
    return np.stack([table[f"{a}"] for a in columns], -1).astype(np.float64), viewpoint


def _make_too_few_points_error(count: int, name: str) -> InputError:
    return InputError(f"{count} points are too few for a surface", where=name, remedy="Record a denser scan.")


def _find_unoccluded_points(seen: Float, spacing: float) -> Float:
    """Returns the points (N, 3) of ``seen`` that no nearer point occludes. Occlusion is tested in an image
    with one pixel per ``spacing`` metres."""
    if len(seen) == 0:
        return seen
    pixel = spacing / float(np.median(seen[:, 2]))
    pixels = np.floor(seen[:, :2] / seen[:, 2:] / pixel).astype(np.int64)
    pixels -= pixels.min(0) - 1
    if np.prod(pixels.max(0) + 2.0) > _MAX_PIXELS:
        problem = (
            f"the scanned points cover too large an area: {pixels.max(0)[0]} x {pixels.max(0)[1]} "
            f"times the point spacing of {spacing:g} m"
        )
        raise InputError(
            problem, where="scan", remedy="Remove the points that are far from the scanned object."
        )
    nearest = np.full(pixels.max(0) + 2, np.inf)
    np.minimum.at(nearest, (pixels[:, 0], pixels[:, 1]), seen[:, 2])
    nearest = scipy.ndimage.minimum_filter(nearest, 3)
    return np.asarray(seen[seen[:, 2] < nearest[pixels[:, 0], pixels[:, 1]] + _OCCLUSION_SPACINGS * spacing])


def _thin_out_points(seen: Float, spacing: float) -> Float:
    """Returns one point (N, 3) for each occupied cube with sides of ``spacing`` metres: the mean of the
    points in the cube."""
    cells = np.floor(seen / spacing).astype(np.int64)
    _, of, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(of.reshape(-1), seen[:, a]) for a in range(3)], -1)
    return np.asarray(sums / counts[:, None])


def _is_surface(seen: Float, faces: Int, spacing: float) -> Bool:
    """Returns (F,) True for triangles that span neither a gap nor a depth step."""
    typical_spacing = float(np.median(scipy.spatial.cKDTree(seen).query(seen, k=2)[0][:, 1]))
    corners = seen[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ray = corners.mean(1)
    product = np.linalg.norm(normal, axis=1) * np.linalg.norm(ray, axis=1)
    facing = np.abs((normal * ray).sum(1)) / np.maximum(product, 1e-30)
    return np.asarray(
        (edges < _MAX_EDGE_IN_SPACINGS * max(typical_spacing, spacing)) & (facing > _MIN_FACING_COSINE)
    )


def _find_facing_triangles(seen: Float, faces: Int) -> Int:
    """Returns the triangles (F, 3), oriented counter-clockwise as seen from the sensor."""
    a, b, c = (seen[faces[:, k]] for k in range(3))
    faces_away = np.einsum("fi,fi->f", np.cross(b - a, c - a), a) > 0
    return np.where(faces_away[:, None], faces[:, [0, 2, 1]], faces)


def _remove_specks(mesh: Mesh) -> Mesh:
    """Returns the mesh without very small pieces."""
    count, faces = len(mesh.vertices), mesh.faces
    links = (np.ones(2 * len(faces)), (faces[:, [0, 1]].reshape(-1), faces[:, [1, 2]].reshape(-1)))
    _, part = connected_components(coo_matrix(links, (count, count)), directed=False)
    sizes = np.bincount(part[faces[:, 0]])
    return extract_submesh(mesh, sizes[part[faces[:, 0]]] >= _MIN_PART_FRACTION * len(faces))
