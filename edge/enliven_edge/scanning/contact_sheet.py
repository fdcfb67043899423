"""A contact sheet of six views of a mesh, to judge the quality of a scan at a glance."""

from __future__ import annotations

import math

import numpy as np

from enliven import rotation
from enliven.arrays import Float, UInt8
from enliven.camera import Intrinsics
from enliven.meshes import Mesh
from enliven.scanning import draw_mesh

_SIDE_PX = 360
"""Width and height of each view in pixels."""
_FOCAL_RATIO = 1.6
"""Focal length as a multiple of the image width. The field of view is 35 degrees, with little perspective
distortion."""
_AZIMUTHS = (0.5, 2.1, 3.7, 5.3)
"""Azimuth angles of the views about +Y, in radians."""
_ELEVATIONS = (0.35, 0.35, 0.35, 0.35, 1.3, -0.5)
"""Elevation angles above the horizon in radians: four views from the sides, one from above and one from
below."""
_BACK_FACE_COLOUR = np.array([110, 40, 40])
"""sRGB of back faces. They are visible only if the mesh is open."""
_MESH_COLOUR = np.array([205, 205, 200])
"""sRGB of a mesh without colours."""
_BACKGROUND_COLOUR = np.array([28, 30, 34])
"""sRGB of the background."""
_AMBIENT = 0.45
"""Fraction of the light that is ambient."""


def draw_contact_sheet(mesh: Mesh) -> UInt8:
    """Returns (2 S, 3 S, 3) sRGB: six views of a mesh, each S = 360 pixels wide."""
    angles = (*_AZIMUTHS, _AZIMUTHS[0], _AZIMUTHS[0])
    views = [_draw_view(mesh, angle, up) for angle, up in zip(angles, _ELEVATIONS, strict=True)]
    return np.concatenate([np.concatenate(views[:3], 1), np.concatenate(views[3:], 1)], 0)


def _draw_view(mesh: Mesh, angle: float, up: float) -> UInt8:
    """Returns one view (S, S, 3) from ``angle`` radians about +Y and ``up`` radians above the horizon."""
    low, high = mesh.bounds
    radius = float(np.linalg.norm(high - low)) / 2 or 1.0
    distance = np.array([math.cos(up) * math.sin(angle), math.sin(up), math.cos(up) * math.cos(angle)])
    pose = _camera_pose((low + high) / 2 + distance * radius * 2.05 * _FOCAL_RATIO, -distance)
    camera = Intrinsics(
        _SIDE_PX,
        _SIDE_PX,
        _FOCAL_RATIO * _SIDE_PX,
        _FOCAL_RATIO * _SIDE_PX,
        (_SIDE_PX - 1) / 2,
        (_SIDE_PX - 1) / 2,
    )
    drawn_mesh = draw_mesh(mesh, camera, pose)
    is_covered = drawn_mesh.face >= 0
    face_indices = drawn_mesh.face[is_covered]
    light = -(
        mesh.face_normals()[face_indices] @ rotation.unit(-distance + 0.3 * pose[:3, 0] + 0.4 * pose[:3, 1])
    )
    colour = np.broadcast_to(_MESH_COLOUR.astype(float), (len(face_indices), 3))
    if mesh.colours is not None:
        colour = (mesh.colours[mesh.faces[face_indices]] * drawn_mesh.barycentric[is_covered][..., None]).sum(
            1
        )
    front = (mesh.face_normals()[face_indices] @ distance > 0)[:, None]
    shade = (_AMBIENT + (1 - _AMBIENT) * np.clip(light, 0, 1))[:, None]
    picture = np.broadcast_to(_BACKGROUND_COLOUR, (_SIDE_PX, _SIDE_PX, 3)).astype(np.uint8)
    picture[is_covered] = np.where(front, colour * shade, _BACK_FACE_COLOUR).astype(np.uint8)
    return picture


def _camera_pose(eye: Float, ahead: Float) -> Float:
    """Returns the (4, 4) pose of an upright camera."""
    right = rotation.unit(np.cross(ahead, [0.0, 1.0, 0.0]))
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(ahead, right), ahead, eye
    return pose
