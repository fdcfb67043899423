"""A depth frame in world coordinates, and one person's points, normals and silhouette in it.

Both are at working resolution, the reduced resolution of the tracker.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int, UInt16
from enliven.camera import Intrinsics, pixel_rays
from enliven.kernels import HeldArguments, hold, njit
from enliven.masks import pixels_of
from enliven_edge.tracking.frame.reduction import reduce_depth


class WorkingCamera:
    """The camera of the reduced image, with the ray of each pixel. Created once per sensor.

    Attributes:
        stride: full-resolution pixels per working pixel along each axis.
        intrinsics: the intrinsics of the reduced image.
        ray: (h, w, 2) x/z and y/z of every working pixel.
    """

    def __init__(self, intrinsics: Intrinsics, width: int) -> None:
        self.full = intrinsics
        self.stride = max(1, round(intrinsics.width / width))
        h, w = intrinsics.height // self.stride, intrinsics.width // self.stride
        scaled = intrinsics.scale(1.0 / self.stride)
        self.intrinsics = Intrinsics(w, h, scaled.fx, scaled.fy, scaled.cx, scaled.cy, scaled.distortion)
        self.ray = np.ascontiguousarray(pixel_rays(self.intrinsics))
        self.camera = np.array([scaled.fx, scaled.fy, scaled.cx, scaled.cy])

    def reduce(self, depth: UInt16) -> Float:
        """Returns the depth (h, w) in metres along the optical axis, with 0 for unknown depth."""
        h, w = self.intrinsics.height, self.intrinsics.width
        return reduce_depth(depth, self.stride, h, w)


class ImageView(NamedTuple):
    """The depth image of one person.

    Attributes:
        depth: (h, w) metres, 0 where unknown.
        mask: (h, w) the person's pixels.
        nearest: (h, w) the result of :func:`nearest_columns`.
        camera: (4,) fx, fy, cx, cy.
        world_from_camera: (4, 4) the camera's pose.
    """

    depth: Float
    mask: Bool
    nearest: Int
    camera: Float
    world_from_camera: Float


class ObservationArrays(NamedTuple):
    """The arrays of an :class:`Observation`, for compiled kernels. ``points`` (6, M) include the normals."""

    points: Float32
    affinity: Float32
    image: ImageView
    landmarks: Float


@dataclass(frozen=True)
class Observation:
    """The observation of a person in one frame.

    Attributes:
        points: (M, 3) float32 metres, world frame, on the person's surface.
        surface: (6, M) the points and their outward unit normals, from :func:`stack_rows`.
        pixels: (M, 2) row and column of the points in the working image.
        view: the depth image of the person.
        cut: whether the person extends beyond the lower border of the image.
        affinity: (C, M) float32 metres added to a point's distance from a capsule if the network assigns the
            point to another body part; (0, 0) without an estimate.
        landmarks: (20, 5) in the form that ``terms.near_landmarks`` takes; (0, 5) without landmarks.
    """

    points: Float32
    surface: Float32
    pixels: Int
    view: ImageView
    cut: bool
    affinity: Float32 = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    landmarks: Float = field(default_factory=lambda: np.zeros((0, 5)))

    @property
    def arrays(self) -> ObservationArrays:
        """Returns the arrays of the observation, for compiled kernels."""
        return ObservationArrays(self.surface, self.affinity, self.view, self.landmarks)

    @cached_property
    def held(self) -> HeldArguments:
        """Returns the arrays as reusable kernel arguments. They are unpacked only once for all fits."""
        return hold(self.arrays)

    def with_guides(self, affinity: Float32, landmarks: Float | None = None) -> Observation:
        """Returns a copy with new affinities, and with new landmarks unless they are None."""
        new_landmarks = self.landmarks if landmarks is None else landmarks
        return Observation(
            self.points, self.surface, self.pixels, self.view, self.cut, affinity, new_landmarks
        )

    def thin(self, step: int) -> Observation:
        """Returns a copy with every ``step``-th point."""
        points, pixels = np.ascontiguousarray(self.points[::step]), np.ascontiguousarray(self.pixels[::step])
        surface, affinity = (
            np.ascontiguousarray(array[:, ::step]) for array in (self.surface, self.affinity)
        )
        return Observation(points, surface, pixels, self.view, self.cut, affinity, self.landmarks)

    @property
    def crown(self) -> Float:
        """Returns the mean (3,) of the highest points in metres, world frame: on the head or a raised
        hand.
        """
        order = np.argsort(-self.points[:, 1])
        return np.asarray(self.points[order[: max(3, len(order) // 40)]].mean(0))


@njit(cache=True, nogil=True)
def stack_rows(points, normals):
    """Returns (6, M) float32 from (M, 3) points and (M, 3) normals: one row per coordinate.

    This layout lets the compiler vectorise loops over the points.
    """
    out = np.empty((6, len(points)), np.float32)
    for i in range(len(points)):
        for a in range(3):
            out[a, i], out[3 + a, i] = points[i, a], normals[i, a]
    return out


def world_points(z: Float, ray: Float, world_from_camera: Float) -> Float:
    """Returns (h, w, 3) world-frame points of an image of (h, w) metres along the optical axis."""
    return np.asarray(_world_points(z, ray, np.ascontiguousarray(world_from_camera)))


@njit(cache=True, nogil=True)
def _world_points(z, ray, pose):
    """Scales every pixel's ray by its depth and transforms it by the (4, 4) pose."""
    height, width = z.shape
    out = np.empty((height, width, 3))
    for v in range(height):
        for u in range(width):
            x, y, depth = ray[v, u, 0] * z[v, u], ray[v, u, 1] * z[v, u], z[v, u]
            for a in range(3):
                out[v, u, a] = pose[a, 0] * x + pose[a, 1] * y + pose[a, 2] * depth + pose[a, 3]
    return out


@njit(cache=True, nogil=True)
def nearest_columns(mask):
    """Returns (h, w) int16: for every pixel, the nearest masked column in its row, or -1 if the row has none.

    If two columns are equally near, the left one is returned.
    """
    height, width = mask.shape
    out = np.empty((height, width), np.int16)
    for v in range(height):
        row, shown, masked = out[v], mask[v], np.int32(0)
        for u in range(width):
            masked += np.int32(shown[u])
        if masked == 0:
            row[:] = -1
            continue
        first = 0
        while not shown[first]:
            first += 1
        row[:first], last = first, first
        # Process columns up to the last masked pixel. All pixels to its right get its column after the loop.
        for u in range(first, width):
            if not shown[u]:
                continue
            row[u] = u
            if u > last + 1:
                middle = (last + u) // 2 + 1
                row[last + 1 : middle], row[middle:u] = last, u
            last = u
            masked -= 1
            if masked == 0:
                break
        row[last + 1 :] = last
    return out


@njit(cache=True, nogil=True)
def nearest_pixel(v, u, nearest):
    """Returns (row, column) of the masked pixel nearest to row ``v`` and column ``u``.

    Both are -1 if there is none. ``nearest`` is the result of :func:`nearest_columns`.
    """
    height = nearest.shape[0]
    best, row, column = 1 << 60, -1, -1
    for step in range(height):
        if step * step >= best:
            break
        for side in range(2):
            r = v + step if side == 0 else v - step
            if r < 0 or r >= height or nearest[r, u] < 0:
                continue
            square = step * step + (nearest[r, u] - u) ** 2
            if square < best:
                best, row, column = square, r, nearest[r, u]
    return row, column


def observe_person(
    z: Float, surface: Float, mask: Bool, camera: WorkingCamera, world_from_camera: Float, points: int
) -> Observation:
    """Returns the observation of the masked person.

    Args:
        z: (h, w) metres along the optical axis.
        surface: (h, w, 3) the same pixels in the world frame.
        mask: (h, w) the person's pixels.
        camera: the working camera.
        world_from_camera: (4, 4) the camera's pose.
        points: maximum number of surface points, spread evenly over the pixels.
    """
    samples, stacked, pixels, nearest = _observed(surface, z, mask, world_from_camera[:3, 3].copy(), points)
    view = ImageView(z, mask, nearest, camera.camera, world_from_camera)
    cut = bool(np.count_nonzero(mask[-2:]) > 0.05 * mask.shape[1])
    return Observation(samples, stacked, pixels, view, cut)


@njit(cache=True, nogil=True)
def _observed(surface, z, mask, eye, points):
    """Computes :func:`observe_person`: returns points, surface, pixels and nearest columns, as in
    :class:`Observation`.
    """
    pixels = sample_pixels(mask, points)
    samples, normals = surface_samples(surface, z, pixels, eye)
    return samples, stack_rows(samples, normals), pixels, nearest_columns(mask)


@njit(cache=True, nogil=True)
def sample_pixels(mask, points):
    """Returns (M, 2) rows and columns of at most ``points`` masked pixels, evenly spread in reading order."""
    pixels, width = pixels_of(mask), mask.shape[1]
    total = len(pixels)
    kept = min(points, total)
    out = np.empty((kept, 2), np.int64)
    for n in range(kept):
        # The index floor((n + 1/2) total / kept) spreads the samples evenly and selects no pixel twice.
        pixel = pixels[((2 * n + 1) * total) // (2 * kept)]
        out[n, 0], out[n, 1] = pixel // width, pixel % width
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def surface_samples(points, z, pixels, eye):
    """Returns (M, 3) float32 points at M pixels, and their unit normals from central differences.

    Normals point towards the sensor. If a neighbour is unknown or beyond a depth edge, the normal is the
    direction to the sensor.
    """
    height, width = z.shape
    samples, out = np.empty((len(pixels), 3), np.float32), np.empty((len(pixels), 3), np.float32)
    for i in range(len(pixels)):
        v, u = pixels[i, 0], pixels[i, 1]
        point = points[v, u]
        x, y, depth = eye[0] - point[0], eye[1] - point[1], eye[2] - point[2]
        if 0 < v < height - 1 and 0 < u < width - 1:
            right, left, down, up = z[v, u + 1], z[v, u - 1], z[v + 1, u], z[v - 1, u]
            low, high = min(min(right, left), min(down, up)), max(max(right, left), max(down, up))
            if low > 0.0 and high - low < 0.06 + 0.04 * low:
                across = _difference(points[v, u - 1], points[v, u + 1])
                along = _difference(points[v - 1, u], points[v + 1, u])
                x, y, depth = _negated_towards((x, y, depth), _cross(across, along))
        length = np.sqrt(x**2 + y**2 + depth**2) + 1e-12
        samples[i, 0], samples[i, 1], samples[i, 2] = point[0], point[1], point[2]
        out[i, 0], out[i, 1], out[i, 2] = x / length, y / length, depth / length
    return samples, out


@njit(cache=True, nogil=True)
def _difference(a, b):
    """Returns the vector b - a."""
    return b[0] - a[0], b[1] - a[1], b[2] - a[2]


@njit(cache=True, nogil=True)
def _cross(a, b):
    """Returns the cross product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def _negated_towards(a, b):
    """Returns the vector b, negated if its dot product with a is negative."""
    side = 1.0 if b[0] * a[0] + b[1] * a[1] + b[2] * a[2] >= 0.0 else -1.0
    return side * b[0], side * b[1], side * b[2]


@dataclass(frozen=True)
class FrameView:
    """One reduced depth frame in world coordinates.

    Attributes:
        time_ns: the time by the sensor's clock.
        z: (h, w) depth in metres along the optical axis; 0 where unknown.
        points: (h, w, 3) world positions of the pixels, metres.
        camera: the working camera.
        world_from_camera: (4, 4) the pose of the sensor.
        has_floor: whether the height above the floor is known. If not, it is guessed from the people.
    """

    time_ns: int
    z: Float
    points: Float
    camera: WorkingCamera
    world_from_camera: Float
    has_floor: bool = True

    def raise_by(self, metres: float) -> FrameView:
        """Returns the frame with sensor and points raised by ``metres``, because the floor is lower than
        assumed."""
        pose = self.world_from_camera.copy()
        pose[1, 3] += metres
        return replace(self, points=self.points + np.array([0.0, metres, 0.0]), world_from_camera=pose)

    @property
    def eye(self) -> Float:
        """Returns the sensor's position (3,), world frame."""
        return self.world_from_camera[:3, 3].copy()
