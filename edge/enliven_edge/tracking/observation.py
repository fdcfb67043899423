"""What one depth frame shows at the working resolution: points, normals, the person's silhouette."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import ndimage

from enliven.arrays import Bool, Float, UInt16
from enliven.camera import Intrinsics, rays


class WorkingCamera:
    """The camera of the reduced image, with its rays; made once for a sensor.

    Attributes:
        stride: full-resolution pixels a working pixel.
        intrinsics: of the reduced image.
        ray: (h, w, 2) x/z and y/z of every working pixel.
    """

    def __init__(self, intrinsics: Intrinsics, width: int) -> None:
        self.full = intrinsics
        self.stride = max(1, round(intrinsics.width / width))
        h, w = intrinsics.height // self.stride, intrinsics.width // self.stride
        scaled = intrinsics.scaled(1.0 / self.stride)
        self.intrinsics = Intrinsics(w, h, scaled.fx, scaled.fy, scaled.cx, scaled.cy, scaled.distortion)
        self.ray = np.ascontiguousarray(rays(self.intrinsics))
        self.camera = np.array([scaled.fx, scaled.fy, scaled.cx, scaled.cy])

    def reduce(self, depth: UInt16) -> Float:
        """(h, w) metres along the optical axis; 0 where nothing is known."""
        h, w = self.intrinsics.height, self.intrinsics.width
        return reduce_depth(depth, self.stride, h, w)


@njit(cache=True, nogil=True)
def reduce_depth(depth, stride, height, width):  # type: ignore[no-untyped-def]
    """The lower median of up to nine known samples of every stride x stride block, in metres.

    A median keeps a depth edge an edge, where a mean would invent points between the two sides.
    """
    out = np.zeros((height, width))
    values = np.empty(9)
    step = max(1, stride // 3)
    for v in range(height):
        for u in range(width):
            count = 0
            for j in range(0, min(stride, 3 * step), step):
                for i in range(0, min(stride, 3 * step), step):
                    millimetres = depth[v * stride + j, u * stride + i]
                    if millimetres == 0 or millimetres == 65535:
                        continue
                    value = millimetres * 1e-3
                    k = count
                    while k > 0 and values[k - 1] > value:
                        values[k] = values[k - 1]
                        k -= 1
                    values[k] = value
                    count += 1
            if count > 0:
                out[v, u] = values[(count - 1) // 2]
    return out


@dataclass(frozen=True)
class Observation:
    """The person in one frame.

    Attributes:
        points: (M, 3) metres, world frame, on the person's surface.
        normals: (M, 3) outward unit normals of the points, world frame.
        view: (person_z, other_z, nearest, camera, world_from_camera) as ``terms.free_space`` takes it.
        cut: whether the person runs out of the image at its lower border.
    """

    points: Float
    normals: Float
    view: tuple[Float, Float, Float, Float, Float]
    cut: bool

    @property
    def crown(self) -> Float:
        """(3,) the top of the head, or of whatever is highest: the mean of the topmost points."""
        order = np.argsort(-self.points[:, 1])
        return np.asarray(self.points[order[: max(3, len(order) // 40)]].mean(0))


def world_points(z: Float, ray: Float, world_from_camera: Float) -> Float:
    """(h, w, 3) world-frame points of an image of (h, w) metres along the optical axis."""
    return np.asarray(_world_points(z, ray, np.ascontiguousarray(world_from_camera)))


@njit(cache=True, nogil=True)
def _world_points(z, ray, pose):  # type: ignore[no-untyped-def]
    """Every pixel's ray scaled by its depth and moved by the (4, 4) pose."""
    height, width = z.shape
    out = np.empty((height, width, 3))
    for v in range(height):
        for u in range(width):
            x, y, depth = ray[v, u, 0] * z[v, u], ray[v, u, 1] * z[v, u], z[v, u]
            for a in range(3):
                out[v, u, a] = pose[a, 0] * x + pose[a, 1] * y + pose[a, 2] * depth + pose[a, 3]
    return out


_AROUND = 24


def nearest_pixel(mask: Bool) -> Float:
    """(h, w, 2) row and column of the masked pixel nearest to every pixel.

    Exact within 24 pixels of the mask's box; farther out, that of the nearest pixel this close.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if len(rows) == 0:
        return np.full((*mask.shape, 2), -1.0)
    top, left = max(0, rows[0] - _AROUND), max(0, columns[0] - _AROUND)
    box = mask[top : rows[-1] + _AROUND + 1, left : columns[-1] + _AROUND + 1]
    found = ndimage.distance_transform_edt(~box, return_distances=False, return_indices=True)
    below, right = mask.shape[0] - top - box.shape[0], mask.shape[1] - left - box.shape[1]
    padding = ((0, 0), (top, below), (left, right))
    return np.stack(list(np.pad(found, padding, mode="edge")), -1) + np.array([top, left], float)


def observe(
    z: Float, surface: Float, mask: Bool, camera: WorkingCamera, world_from_camera: Float, points: int
) -> Observation:
    """The observation of the masked person.

    Args:
        z: (h, w) metres along the optical axis.
        surface: (h, w, 3) the same pixels in the world frame.
        mask: (h, w) the person's pixels.
        points: at most this many surface points are kept, evenly over the pixels.
    """
    v, u = np.nonzero(mask)
    keep = np.linspace(0, len(v) - 1, min(points, len(v))).astype(int)
    v, u = v[keep], u[keep]
    nearest = nearest_pixel(mask)
    view = (np.where(mask, z, 0.0), np.where(mask, 0.0, z), nearest, camera.camera, world_from_camera)
    cut = bool(mask[-2:].sum() > 0.05 * mask.shape[1])
    normals = surface_normals(surface, z, v, u, world_from_camera[:3, 3])
    return Observation(surface[v, u], normals, view, cut)


@njit(cache=True, nogil=True)
def surface_normals(points, z, rows, columns, eye):  # type: ignore[no-untyped-def]
    """(M, 3) unit normals at M pixels from differences across two pixels, facing the eye.

    Where a neighbour is unknown or across a depth edge, the direction to the eye stands in.
    """
    height, width = z.shape
    out = np.empty((len(rows), 3))
    for i in range(len(rows)):
        v, u = rows[i], columns[i]
        for a in range(3):
            out[i, a] = eye[a] - points[v, u, a]
        if 0 < v < height - 1 and 0 < u < width - 1:
            low = min(min(z[v, u + 1], z[v, u - 1]), min(z[v + 1, u], z[v - 1, u]))
            high = max(max(z[v, u + 1], z[v, u - 1]), max(z[v + 1, u], z[v - 1, u]))
            if low > 0.0 and high - low < 0.06 + 0.04 * low:
                _cross(out[i], points[v, u + 1], points[v, u - 1], points[v + 1, u], points[v - 1, u])
        length = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2) + 1e-12
        for a in range(3):
            out[i, a] /= length
    return out


@njit(cache=True, nogil=True)
def _cross(out, right, left, down, up):  # type: ignore[no-untyped-def]
    """(right - left) x (down - up), turned to the side that ``out`` points to, into ``out``."""
    ax, ay, az = right[0] - left[0], right[1] - left[1], right[2] - left[2]
    bx, by, bz = down[0] - up[0], down[1] - up[1], down[2] - up[2]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    side = 1.0 if x * out[0] + y * out[1] + z * out[2] >= 0.0 else -1.0
    out[0], out[1], out[2] = side * x, side * y, side * z
