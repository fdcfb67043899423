"""Cuts an object that stands on the floor out of a scan, in three steps: ground plane detection, hole filling
and upright placement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.meshes import Mesh, extract_submesh, shells
from enliven.scanning.holes import close_holes, find_lowest_rims
from enliven.scanning.settings import CutOutSettings

_MAX_FLOOR_DISTANCE_M = 0.02
"""Maximum distance of a face from the floor plane, metres, at which the face belongs to the floor."""

_PLANE_HYPOTHESES = 100
"""Number of faces that are tried as floor hypotheses (RANSAC). This number is enough if one face in ten
belongs to the floor."""
_COMPARED_FACES = 6000
"""Number of random faces that each plane hypothesis is compared with. They give the area of the plane to
within a few percent."""
_MIN_UP_COSINE = 0.82
"""Minimum cosine (35 degrees) between up and the normal of a face that may be part of a floor."""
_MIN_FACE_COSINE = 0.97
"""Minimum cosine (14 degrees) between the normal of the floor and the normals of its faces. Noise tilts the
faces."""
_RIVAL_AREA_FRACTION = 0.5
"""If a lower plane has more than this fraction of the largest plane's area, the lower plane is the floor and
the largest plane is a table."""
_MIN_OBJECT_FRACTION = 0.05
"""Other objects are ignored if their surface area near the focus is less than this fraction of the chosen
object's."""
_REFITS = 3
"""Number of times that a plane is fitted to its inlier faces."""


@dataclass(frozen=True)
class GroundPlane:
    """The ground plane that objects stand on: normal . x = offset, world.

    Attributes:
        normal: (3,) unit, up.
        offset: metres.
        area: observed part of the plane, square metres.
    """

    normal: Float
    offset: float
    area: float

    def heights(self, points: Float) -> Float:
        """Returns (N,) heights in metres of (N, 3) points above the plane."""
        return np.asarray(points @ self.normal - self.offset)


def find_ground(mesh: Mesh, up: Float | None = None) -> GroundPlane:
    """Returns the lowest of the large level planes of a scan.

    Args:
        up: (3,) approximate up direction in the scan's world, at most 35 degrees off. None means +Y.

    Raises:
        InputError: if no level surface was scanned.
    """
    up = np.array([0.0, 1.0, 0.0]) if up is None else up
    vectors = mesh.face_vectors()
    areas = np.linalg.norm(vectors, axis=1) / 2
    normals = vectors / np.maximum(2 * areas, 1e-30)[:, None]
    middles = mesh.vertices[mesh.faces].mean(1) if len(mesh.faces) else np.zeros((0, 3))
    level = np.flatnonzero(normals @ up > _MIN_UP_COSINE)
    count = len(level)
    if not count:
        problem = "no floor and no table top was scanned"
        raise InputError(problem, where="scan", remedy="Scan a part of the floor around the object, too.")
    level = np.random.default_rng(0).permutation(level)[:_COMPARED_FACES]
    normals, middles, areas = normals[level], middles[level], areas[level] * count / len(level)
    planes = [
        _fit_plane(normals[k], float(normals[k] @ middles[k]), normals, middles, areas)
        for k in range(min(_PLANE_HYPOTHESES, len(level)))
    ]
    largest_area = max(plane.area for plane in planes)
    large = [plane for plane in planes if plane.area > _RIVAL_AREA_FRACTION * largest_area]
    centroid = np.average(middles, axis=0, weights=areas)
    return min(
        large, key=lambda plane: float(plane.offset - centroid @ plane.normal) / float(plane.normal @ up)
    )


def _fit_plane(normal: Float, offset: float, normals: Float, middles: Float, areas: Float) -> GroundPlane:
    """Returns the plane fitted to the inlier faces of an initial plane (``normal``, ``offset``)."""
    is_inlier = _faces_in_plane(normal, offset, normals, middles)
    for _ in range(_REFITS):
        weight = areas[is_inlier]
        if weight.sum() <= 0 or is_inlier.sum() < 3:
            break
        middle = np.average(middles[is_inlier], axis=0, weights=weight)
        spread = (middles[is_inlier] - middle) * np.sqrt(weight)[:, None]
        fitted = np.linalg.svd(spread.T @ spread)[0][:, 2]
        normal = fitted if fitted @ normal > 0 else -fitted
        offset = float(normal @ middle)
        is_inlier = _faces_in_plane(normal, offset, normals, middles)
    return GroundPlane(normal, offset, float(areas[is_inlier].sum()))


def _faces_in_plane(normal: Float, offset: float, normals: Float, middles: Float) -> Bool:
    """Returns (F,) True for each face that lies in the plane ``normal`` . x = ``offset``, within the
    tolerances of the floor."""
    near = np.abs(middles @ normal - offset) < _MAX_FLOOR_DISTANCE_M
    return np.asarray(near & (normals @ normal > _MIN_FACE_COSINE))


def find_focus(poses: list[Float]) -> Float:
    """Returns the (3,) point nearest to the optical axes of camera poses (4, 4): the point that the cameras
    look at.
    """
    matrix, right = 1e-6 * np.eye(3), np.zeros(3)
    for pose in poses:
        axis = pose[:3, 2]
        projection = np.eye(3) - np.outer(axis, axis)
        matrix += projection
        right += projection @ pose[:3, 3]
    # If all cameras look in the same direction, the point is undetermined. A weak prior then places the point
    # one metre in front of the cameras.
    prior_point = np.mean([pose[:3, 3] + pose[:3, 2] for pose in poses], axis=0)
    return np.asarray(np.linalg.solve(matrix, right + 1e-6 * prior_point), np.float64)


def cut_out(mesh: Mesh, ground: GroundPlane, focus: Float, settings: CutOutSettings | None = None) -> Mesh:
    """Cuts out the object that stands on the ground near ``focus`` (3,). The result is upright, on y = 0,
    with its bounding box centred on x and z.

    If there are several objects, the settings choose one. The contact area with the ground is closed. Holes
    with short rims are closed, and larger ones stay open.

    Raises:
        InputError: if there are fewer objects than ``number`` in the settings.
    """
    s = settings or CutOutSettings()
    parts = find_parts(mesh, ground, focus, s)
    if not parts:
        problem = "no object on the floor was scanned"
        raise InputError(
            problem, where="scan", remedy="Carry the camera around the object, and keep the object in view."
        )
    if s.number > len(parts):
        problem = f"object number {s.number} does not exist; the camera looked at {len(parts)} objects"
        raise InputError(
            problem,
            where="scan",
            remedy="Choose one of these objects, or point the camera at the object while you scan.",
        )
    chosen_part = parts[s.number - 1]
    vertices = level_mesh(chosen_part, ground).vertices
    # Extend the feet down again by the clearance that the cut has removed.
    feet = vertices[:, 1] < s.clearance + 1e-9
    vertices[feet, 1] = 0.0
    feet |= find_lowest_rims(replace(chosen_part, vertices=vertices), s.drawn)
    vertices[feet, 1] = 0.0
    return close_holes(replace(chosen_part, vertices=vertices), feet, s)


def cut_whole_part(mesh: Mesh, ground: GroundPlane, settings: CutOutSettings | None = None) -> Mesh:
    """Returns the largest connected part of an object that was scanned from all sides, also from below.

    The result is upright, on y = 0. Holes with short rims are closed.
    """
    object_mesh = level_mesh(find_largest_component(mesh), ground)
    object_mesh.vertices[:, 1] -= object_mesh.vertices[:, 1].min()
    return close_holes(object_mesh, np.zeros(len(object_mesh.vertices), bool), settings or CutOutSettings())


def find_parts(
    mesh: Mesh, ground: GroundPlane, focus: Float, settings: CutOutSettings | None = None
) -> list[Mesh]:
    """Returns the connected parts that stand on the ground about a point (3,), the most likely object first.

    The most likely object is the part with the most surface near the point. Small and distant parts are left
    out.
    """
    s = settings or CutOutSettings()
    above_ground = cut_above_plane(mesh, ground.normal, ground.offset + s.clearance)
    if not len(above_ground.faces):
        return []
    label = np.asarray(shells(above_ground.faces, len(above_ground.vertices)))[above_ground.faces[:, 0]]
    middles = above_ground.vertices[above_ground.faces].mean(1)
    focus_weights = np.exp(-np.square(middles - focus).sum(1) / s.about**2)
    areas = np.linalg.norm(above_ground.face_vectors(), axis=1) / 2
    total_areas, near_areas = np.bincount(label, areas), np.bincount(label, areas * focus_weights)
    large = (total_areas >= s.least_area) & (near_areas >= _MIN_OBJECT_FRACTION * near_areas.max())
    return [
        extract_submesh(above_ground, label == n) for n in np.argsort(-near_areas, kind="stable") if large[n]
    ]


def find_largest_component(mesh: Mesh) -> Mesh:
    """Returns the connected part of a mesh with the most surface."""
    if not len(mesh.faces):
        return mesh
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    return extract_submesh(
        mesh, label == np.bincount(label, np.linalg.norm(mesh.face_vectors(), axis=1)).argmax()
    )


def find_largest_part(mesh: Mesh) -> Mesh:
    """Returns the connected part with the most surface, standing on y = 0, with its bounding box centred on x
    and z.
    """
    part = find_largest_component(mesh)
    up = np.array([0.0, 1.0, 0.0])
    return level_mesh(part, GroundPlane(up, float(part.vertices[:, 1].min()), 0.0))


def level_mesh(mesh: Mesh, ground: GroundPlane) -> Mesh:
    """Rotates the mesh upright and moves it so that the ground is y = 0 and its bounding box is centred on x
    and z.
    """
    rotation_matrix = rotation.to_matrix(rotation.swing(ground.normal, np.array([0.0, 1.0, 0.0])))
    vertices = mesh.vertices @ rotation_matrix.T
    vertices[:, 1] -= ground.offset
    low, high = vertices.min(0), vertices.max(0)
    vertices[:, [0, 2]] -= ((low + high) / 2)[[0, 2]]
    return replace(mesh, vertices=vertices)


def cut_above_plane(mesh: Mesh, normal: Float, offset: float) -> Mesh:
    """Returns the part of a mesh above a plane (normal . x > offset, normal (3,)), cut along the plane."""
    heights = np.asarray(mesh.vertices @ normal - offset)
    is_above = heights[mesh.faces] > 0
    count = is_above.sum(1)
    # Rotate the corners of each face so that the single corner on one side of the plane comes first.
    lone_corner = np.where(count == 1, is_above.argmax(1), (~is_above).argmax(1))
    rotated_faces = np.take_along_axis(mesh.faces, (lone_corner[:, None] + np.arange(3)) % 3, 1).astype(
        np.int64
    )
    one_above, two_above = rotated_faces[count == 1], rotated_faces[count == 2]
    ends = np.sort(
        np.concatenate(
            [one_above[:, [0, 1]], one_above[:, [0, 2]], two_above[:, [0, 1]], two_above[:, [0, 2]]]
        ),
        1,
    )
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    cuts = np.split(
        number.reshape(-1) + len(mesh.vertices), np.cumsum([len(one_above), len(one_above), len(two_above)])
    )
    corner = [
        rotated_faces[count == 3],
        np.stack([one_above[:, 0], cuts[0], cuts[1]], 1),
        np.stack([two_above[:, 1], two_above[:, 2], cuts[2]], 1),
        np.stack([two_above[:, 2], cuts[3], cuts[2]], 1),
    ]
    fraction = heights[edges[:, :1]] / (heights[edges[:, :1]] - heights[edges[:, 1:]])

    def spread(values: Float) -> Float:
        return np.concatenate([values, values[edges[:, 0]] * (1 - fraction) + values[edges[:, 1]] * fraction])

    colours = None if mesh.colours is None else np.rint(spread(mesh.colours.astype(float))).astype(np.uint8)
    faces = np.concatenate(corner).astype(np.int32)
    clipped = Mesh(spread(mesh.vertices), faces, mesh.name, colours)
    return extract_submesh(clipped, np.ones(len(faces), bool))
