"""A software rasterizer: draws triangles into a depth image, with the face and the barycentric coordinates
per pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int32
from enliven.camera import Intrinsics
from enliven.kernels import njit
from enliven.meshes import Mesh

_NEAR_CLIP_M = 0.05
"""Near clipping distance, metres. A face nearer to the camera is not drawn, because its projection would
overflow."""


class RenderedMesh(NamedTuple):
    """A rendered view of a mesh: depth, face and barycentric coordinates per pixel.

    Attributes:
        depth: (H, W) metres along the optical axis, inf if the pixel shows no face.
        face: (H, W) int32 index of the face, -1 if there is none.
        barycentric: (H, W, 3) barycentric coordinates at the pixel's centre.
    """

    depth: Float
    face: Int32
    barycentric: Float


def draw_mesh(mesh: Mesh, intrinsics: Intrinsics, world_from_camera: Float) -> RenderedMesh:
    """Renders the view of a mesh from a pinhole camera. Lens distortion is ignored.

    Faces are visible from both sides. A face that comes nearer to the camera than 5 cm is left out.

    Args:
        world_from_camera: (4, 4) pose of the camera, in the frame of the mesh's vertices.
    """
    rotation, origin = world_from_camera[:3, :3], world_from_camera[:3, 3]
    local = (mesh.vertices - origin) @ rotation
    size = (intrinsics.height, intrinsics.width)
    drawing = RenderedMesh(np.full(size, np.inf), np.full(size, -1, np.int32), np.zeros((*size, 3)))
    lens = np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])
    _draw_faces(local, mesh.faces, lens, drawing.depth, drawing.face, drawing.barycentric)
    return drawing


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_faces(points, faces, lens, depth, face, shares):
    """Draws the ``faces`` (F, 3) of ``points`` in the camera frame. At each pixel, the nearest face is
    kept."""
    height, width = depth.shape
    u, v, inverse = np.empty(3), np.empty(3), np.empty(3)
    for f in range(len(faces)):
        nearest = min(points[faces[f, 0], 2], points[faces[f, 1], 2], points[faces[f, 2], 2])
        if nearest < _NEAR_CLIP_M:
            continue
        for k in range(3):
            p = faces[f, k]
            inverse[k] = 1.0 / points[p, 2]
            u[k] = lens[0] * points[p, 0] * inverse[k] + lens[2]
            v[k] = lens[1] * points[p, 1] * inverse[k] + lens[3]
        area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
        if area == 0.0:
            continue
        left, right = max(int(np.ceil(u.min())), 0), min(int(np.floor(u.max())), width - 1)
        top, bottom = max(int(np.ceil(v.min())), 0), min(int(np.floor(v.max())), height - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                a = ((u[1] - column) * (v[2] - row) - (u[2] - column) * (v[1] - row)) / area
                b = ((u[2] - column) * (v[0] - row) - (u[0] - column) * (v[2] - row)) / area
                c = 1.0 - a - b
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                # Interpolate the inverse of the depth, which is linear in the image.
                z = 1.0 / (a * inverse[0] + b * inverse[1] + c * inverse[2])
                if z < depth[row, column]:
                    depth[row, column], face[row, column] = z, f
                    shares[row, column, 0] = a * inverse[0] * z
                    shares[row, column, 1] = b * inverse[1] * z
                    shares[row, column, 2] = c * inverse[2] * z
