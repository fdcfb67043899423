"""Change detection: compares two scans of a place, and selects the new surface in formerly free space."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Bool, Float, Float32, Int32
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.meshes import Mesh, extract_submesh, shells
from enliven.scanning.cutting.box import upright_frame
from enliven.scanning.cutting.parts import CutOut, place_on_floor
from enliven.scanning.ground_plane import GroundPlane, cut_above_plane, find_ground
from enliven.scanning.rigid import invert_pose
from enliven.scanning.settings import CutOutSettings, DepthNoiseModel

_MIN_IMAGES = 2
"""Minimum number of images that must have seen through a point, because a single image may have a wrong pixel
there."""
_MIN_SEEN_THROUGH_FRACTION = 0.7
"""Minimum fraction of the images of a point that must have seen through it. Near an edge, only some of the
images do."""
_SURFACE_DEVIATIONS = 3.0
"""Maximum distance of a point from the observed surface at which the point lies on it, in standard deviations
of the depth."""
_POSE_TOLERANCE_M = 0.012
"""Additional tolerance, metres, for the camera pose error between the two scans."""
_FOOT_RADIUS_M = 0.05
"""Radius around the new surface, metres, within which surface near the floor belongs to the object. This
close to the floor, the comparison cannot separate the object from the floor."""
_UNSEEN_RADIUS_M = 0.2
"""Radius around the new surface, metres, within which surface in formerly unobserved space (for example above
the view) belongs to the object."""
_MAX_PATCH_M = 0.4
"""Maximum size, metres, of a patch outside these radii that is still added to the object. A larger patch may
be another object."""
_SUPPORT_HEIGHT_RANGE_M = 0.1
"""Height range around the lowest new point, metres, in which the supporting plane is searched."""
_SUPPORT_MARGIN_M = 0.15
"""Horizontal margin around the new surface, metres, in which the supporting plane is searched."""
_VOTING_ROUNDS = 2
"""Number of rounds of majority voting among neighbouring vertices. It prevents holes due to noise."""


@dataclass(frozen=True)
class KnownImage:
    """A depth image of the place before the object was added.

    Attributes:
        depth: (H, W) millimetres, 0 if unknown.
        intrinsics: intrinsics of the camera.
        world_from_camera: (4, 4) pose of the camera in the world of the scan that the image is compared with.
    """

    depth: Float32
    intrinsics: Intrinsics
    world_from_camera: Float


def compare_with_images(
    points: Float, images: Iterable[KnownImage], noise: DepthNoiseModel | None = None
) -> Int32:
    """Returns the earlier state (N,) at points (N, 3) in the world: 1 for free space, -1 for a surface, 0 if
    unknown.
    """
    observed, seen_through = np.zeros(len(points), np.int32), np.zeros(len(points), np.int32)
    model = noise or DepthNoiseModel()
    limits = np.array(
        [
            _POSE_TOLERANCE_M,
            _SURFACE_DEVIATIONS * model.constant,
            _SURFACE_DEVIATIONS * model.quadratic,
            model.start,
        ]
    )
    points = np.ascontiguousarray(points, np.float64)
    for image in images:
        lens = image.intrinsics
        camera = np.array([lens.fx, lens.fy, lens.cx, lens.cy])
        metres = np.asarray(image.depth, np.float32) * np.float32(1e-3)
        _count_seen_through(
            points, invert_pose(image.world_from_camera), camera, metres, limits, observed, seen_through
        )
    air = seen_through >= _MIN_SEEN_THROUGH_FRACTION * observed
    return np.where(air, seen_through >= _MIN_IMAGES, -1).astype(np.int32)


@njit(cache=True, nogil=True)
def _count_seen_through(points, pose, camera, depth, limits, seen, through):
    """Counts for each point the images that observed it, and the images that saw through it to a surface
    behind it.

    Args:
        pose: (4, 4) camera_from_world.
        camera: (4,) fx, fy, cx, cy; limits: (4,) pose tolerance (m), and the three parameters of the depth
            noise model.
        seen, through: (N,) counts; written.
    """
    height, width = depth.shape
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        deep = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
        if deep < 0.05:
            continue
        u = camera[0] * (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]) / deep + camera[2]
        v = camera[1] * (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]) / deep + camera[3]
        column, row = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
        if column < 0 or row < 0 or column >= width or row >= height or depth[row, column] <= 0.0:
            continue
        surface_depth = depth[row, column]
        near = limits[0] + limits[1] + limits[2] * (surface_depth - limits[3]) ** 2
        if deep > surface_depth + near:
            continue
        seen[n] += 1
        through[n] += deep < surface_depth - near


def cut_new_object(
    mesh: Mesh,
    images: Sequence[KnownImage],
    ground: GroundPlane | None = None,
    settings: CutOutSettings | None = None,
    noise: DepthNoiseModel | None = None,
) -> CutOut:
    """Cuts out the object that occupies formerly free space, and places it on y = 0 (KinEtre, 2012).

    Args:
        mesh: the scan of the place with the object, in the world of the scan.
        images: depth images of the place without the object.
        ground: the floor; None if no floor was found.

    Raises:
        InputError: if nothing is new.
    """
    s = settings or CutOutSettings()
    is_new = _smooth_states(mesh.faces, compare_with_images(mesh.vertices, images, noise)) > 0
    new_faces = np.asarray(is_new[mesh.faces].all(1))
    new_part = extract_submesh(mesh, new_faces)
    if not new_faces.any() or new_part.area < s.least_area:
        problem = "no new object was found"
        advice = (
            "Scan the same place twice, the second time with the object, and scan the object from all sides."
        )
        raise InputError(problem, where="scan", remedy=advice)
    new_object = _remove_specks(new_part, s)
    support = _support_plane(mesh, new_faces, new_object, ground)
    above_support = cut_above_plane(mesh, support.normal, support.offset + s.clearance)
    earlier = _smooth_states(above_support.faces, compare_with_images(above_support.vertices, images, noise))
    distance_to_object, _ = cKDTree(new_object.vertices).query(
        above_support.vertices, distance_upper_bound=_UNSEEN_RADIUS_M
    )
    # The comparison cannot separate the object from its support if the two are very close. There, all surface
    # above the support and next to the object counts as object.
    is_near_support = (support.heights(above_support.vertices) < _FOOT_RADIUS_M) & (
        distance_to_object < _FOOT_RADIUS_M
    )
    is_kept = (earlier >= 0) & np.isfinite(distance_to_object) | is_near_support
    kept_faces = np.asarray(is_kept[above_support.faces].any(1))
    cut = extract_submesh(
        above_support, kept_faces | _find_small_patches(above_support, ~kept_faces, earlier >= 0)
    )
    return place_on_floor(cut, upright_frame(support, np.zeros(3)), s.clearance, s)


def _find_small_patches(mesh: Mesh, excluded: Bool, free: Bool) -> Bool:
    """Returns (F,) a mask of the excluded faces in patches that are too small to be another object.

    Args:
        excluded: (F,) the faces that were excluded.
        free: (V,) True for vertices at which no surface was observed before.
    """
    faces = mesh.faces[excluded]
    label = np.asarray(shells(faces, len(mesh.vertices)))
    low, high = np.full((label.max() + 1, 3), np.inf), np.full((label.max() + 1, 3), -np.inf)
    np.minimum.at(low, label[faces.ravel()], mesh.vertices[faces.ravel()])
    np.maximum.at(high, label[faces.ravel()], mesh.vertices[faces.ravel()])
    is_small = np.asarray(((high - low) < _MAX_PATCH_M).all(1), np.bool_)
    is_small[label[faces[~free[faces].all(1)].ravel()]] = False
    is_island = np.zeros(len(mesh.faces), np.bool_)
    is_island[excluded] = is_small[label[faces[:, 0]]]
    return is_island


def _remove_specks(mesh: Mesh, s: CutOutSettings) -> Mesh:
    """Removes parts with less than half the area of the smallest possible object."""
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    areas = np.bincount(label, np.linalg.norm(mesh.face_vectors(), axis=1)) / 2
    large = areas >= min(s.least_area / 2, areas.max())
    return extract_submesh(mesh, large[label])


def _smooth_states(faces: Int32, states: Int32) -> Int32:
    """Returns the earlier states (V,) of the vertices (1 free, -1 surface, 0 unknown) after majority voting
    among neighbours."""
    for _ in range(_VOTING_ROUNDS):
        votes, of_face = np.zeros(len(states)), states[faces].sum(1)
        for corner in range(3):
            votes += np.bincount(faces[:, corner], of_face, len(states))
        states = np.sign(votes).astype(np.int32)
    return states


def _support_plane(mesh: Mesh, new_faces: Bool, new_object: Mesh, ground: GroundPlane | None) -> GroundPlane:
    """Returns the plane that an object stands on: the table top below it, or else the floor."""
    up = np.array([0.0, 1.0, 0.0]) if ground is None else ground.normal
    frame = upright_frame(GroundPlane(up, 0.0, 0.0), np.zeros(3))[:3, :3]
    face_centres, object_vertices = mesh.vertices[mesh.faces].mean(1) @ frame.T, new_object.vertices @ frame.T
    low, high = (
        object_vertices.min(0) - [_SUPPORT_MARGIN_M, _SUPPORT_HEIGHT_RANGE_M, _SUPPORT_MARGIN_M],
        object_vertices.max(0) + _SUPPORT_MARGIN_M,
    )
    high[1] = object_vertices[:, 1].min() + _SUPPORT_HEIGHT_RANGE_M
    is_nearby = ~new_faces & (face_centres > low).all(1) & (face_centres < high).all(1)
    try:
        plane = find_ground(extract_submesh(mesh, is_nearby), up) if is_nearby.any() else None
    except InputError:
        plane = None
    if plane is not None:
        return plane
    return ground or GroundPlane(up, float((new_object.vertices @ up).min()), 0.0)
