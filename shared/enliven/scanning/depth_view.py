"""A depth image prepared for fusion and tracking: a plane through each pixel, and its weight."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Bool, Float32, Int, UInt8, UInt16
from enliven.camera import Intrinsics, pixel_rays, project
from enliven.kernels import njit, run_in_pieces
from enliven.scanning.kernel_arguments import PointArrays
from enliven.scanning.settings import DepthNoiseModel

TILE = 8
"""Number of pixels along a tile's side. The minimum and maximum depth are stored for each tile. A voxel block
covers a few tiles in the image."""
_SAMPLE_SPACING_PX = 2
"""Spacing, in half-size pixels, of the nine samples of a plane fit. They span 17 mm at 1 m. Closer samples
would not help: in most cameras, adjacent pixels share their noise."""
_MAX_DEPTH_JUMP = 0.04
"""Maximum relative difference in depth between a pixel and a neighbour on the same surface."""
_MIN_PLANE_SAMPLES = 4
"""Minimum number of valid samples (of nine) for a plane fit. Points with fewer samples are isolated points
that float at edges."""
_MIN_FACING_COSINE = 0.12
"""Minimum cosine (83 degrees) between ray and normal at which depth is trusted."""
_NO_SURFACE_OFFSET = np.float32(1e9)
"""Plane offset of a pixel without depth. All voxels lie far behind such a plane, so that nothing is fused."""
_ROWS_PER_PIECE = 24
"""Rows of half-size pixels that a thread processes at a time."""


@dataclass(frozen=True)
class DepthView:
    """A depth image prepared for fusion and tracking.

    Attributes:
        intrinsics: camera intrinsics of the full image.
        planes: (H, W, 4) float32 unit normal towards the camera, camera frame, and offset. The distance of a
            point in front of the surface is normal . point - offset.
        weights: (H, W) float32 weight of the pixel's plane, at most 1; 0 if the pixel has no plane.
        points: (h, w, 3) float32 points of the half-size image, metres, camera frame; 0 for none.
        normals: (h, w, 3) float32 normals of the points; 0 if a pixel has no point.
        worth: (h, w) float32 weights of the points, like ``weights``.
        tiles: (R, C, 3) float32 minimum and maximum depth of each 8 x 8 tile, metres, and the fraction of its
            pixels without depth. A tile without depth has inf and 0.
        colour: (H, W, 3) uint8 sRGB, or None.
    """

    intrinsics: Intrinsics
    planes: Float32
    weights: Float32
    points: Float32
    normals: Float32
    worth: Float32
    tiles: Float32
    colour: UInt8 | None = None

    @property
    def point_arrays(self) -> PointArrays:
        """The points as arguments of the compiled kernels."""
        return PointArrays(self.points, self.normals, self.worth)

    @property
    def known(self) -> float:
        """Fraction of the half-size pixels that show a surface."""
        return float(np.count_nonzero(self.worth)) / self.worth.size


def restrict_view(view: DepthView, keep: Bool) -> DepthView:
    """Returns a view restricted to some half-size pixels (h, w).

    The other pixels only show that the space in front of them is free. When fused, they add free space and no
    surface.
    """
    height, width = view.weights.shape
    full_mask = keep.repeat(2, 0).repeat(2, 1)[:height, :width]
    return replace(
        view,
        weights=view.weights * full_mask,
        points=view.points * keep[..., None],
        normals=view.normals * keep[..., None],
        worth=view.worth * keep,
    )


class DepthPreparation:
    """Preparation of one camera's depth images, with cached values that depend only on the camera.

    Args:
        near: metres; nearer depth is discarded.
        far: metres; farther depth is discarded.
    """

    def __init__(self, intrinsics: Intrinsics, noise: DepthNoiseModel, near: float, far: float) -> None:
        # Remove the lens distortion here, because the remaining code assumes a pinhole camera.
        self._straight = _undistort_pixels(intrinsics) if any(intrinsics.distortion) else None
        self.intrinsics = replace(intrinsics, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))
        ray = pixel_rays(self.intrinsics).astype(np.float32)
        # Without distortion, all rays of a column share the same x, and all rays of a row share the same y.
        self._across, self._down = np.ascontiguousarray(ray[0, :, 0]), np.ascontiguousarray(ray[:, 0, 1])
        self._half = np.pad(_pair_means(self._across), _SAMPLE_SPACING_PX), _pair_means(self._down)
        self._limits = np.array([near, far, noise.constant, noise.quadratic, noise.start], np.float32)

    def prepare(self, depth: UInt16 | Float32, colour: UInt8 | None = None) -> DepthView:
        """Returns the view of a depth image (H, W) in millimetres, with 0 and 65535 for unknown depth.

        Args:
            colour: (h, w, 3) sRGB, registered to the depth image, or None.
        """
        height, width = depth.shape
        if colour is not None and colour.shape[:2] != depth.shape:
            rows = np.arange(height) * colour.shape[0] // height
            colour = colour[rows[:, None], np.arange(width) * colour.shape[1] // width]
        if self._straight is not None:
            depth = depth[self._straight]
            colour = None if colour is None else colour[self._straight]
        half_shape = ((height + 1) // 2, (width + 1) // 2)
        # Add empty columns on both sides, so that the neighbours of a pixel need no bounds check.
        inverse = np.zeros((half_shape[0], half_shape[1] + 2 * _SAMPLE_SPACING_PX), np.float32)
        planes, weights = np.empty((height, width, 4), np.float32), np.empty((height, width), np.float32)
        points, normals = np.zeros((*half_shape, 3), np.float32), np.zeros((*half_shape, 3), np.float32)
        worth = np.zeros(half_shape, np.float32)
        run_in_pieces(_halve_resolution, half_shape[0], _ROWS_PER_PIECE, depth, self._limits, inverse)
        run_in_pieces(
            _fit_planes,
            half_shape[0],
            _ROWS_PER_PIECE,
            inverse,
            *self._half,
            self._limits,
            points,
            normals,
            worth,
        )
        run_in_pieces(
            _assign_pixel_planes,
            half_shape[0],
            _ROWS_PER_PIECE,
            depth,
            self._across,
            self._down,
            points,
            normals,
            worth,
            planes,
            weights,
        )
        tiles = np.empty((-(-height // TILE), -(-width // TILE), 3), np.float32)
        run_in_pieces(_bound_tiles, len(tiles), _ROWS_PER_PIECE, depth, self._limits, tiles)
        return DepthView(self.intrinsics, planes, weights, points, normals, worth, tiles, colour)


def _undistort_pixels(intrinsics: Intrinsics) -> tuple[Int, Int]:
    """Returns (H, W) rows and columns of the source pixel for each pixel of an undistorted (pinhole)
    image.
    """
    rows, columns = np.mgrid[0 : intrinsics.height, 0 : intrinsics.width].astype(float)
    x, y = (columns - intrinsics.cx) / intrinsics.fx, (rows - intrinsics.cy) / intrinsics.fy
    source_pixels = np.rint(project(np.stack([x, y, np.ones_like(x)], -1), intrinsics)).astype(int)
    return source_pixels[..., 1].clip(0, intrinsics.height - 1), source_pixels[..., 0].clip(
        0, intrinsics.width - 1
    )


def _pair_means(values: Float32) -> Float32:
    """Returns the means of (N,) values in pairs; the last value is its own mean if N is odd."""
    next_index = np.minimum(np.arange(1, len(values) + 1, 2), len(values) - 1)
    return (0.5 * (values[::2] + values[next_index])).astype(np.float32)


@njit(cache=True, nogil=True, error_model="numpy")
def _halve_resolution(depth, limits, inverse, first, last):
    """Halves the resolution of some rows. Writes the mean inverse depth (1/m) of each 2 x 2 pixels over the
    nearest surface into ``inverse`` (h, w + 2 _SAMPLE_SPACING_PX).
    """
    height, width = depth.shape
    for v in range(first, last):
        upper, lower = depth[2 * v], depth[min(2 * v + 1, height - 1)]
        for u in range(width // 2):
            inverse[v, u + _SAMPLE_SPACING_PX] = _mean_inverse(
                upper[2 * u], upper[2 * u + 1], lower[2 * u], lower[2 * u + 1], limits
            )
        if width % 2:
            a, b = upper[width - 1], lower[width - 1]
            inverse[v, width // 2 + _SAMPLE_SPACING_PX] = _mean_inverse(a, a, b, b, limits)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _mean_inverse(a, b, c, d, limits):
    """Averages the inverse depth (1/m) of the pixels on the nearest surface, out of four depths (mm). Returns
    0 if all four are unknown.
    """
    za, zb, zc, zd = (
        _depth_in_metres(a, limits),
        _depth_in_metres(b, limits),
        _depth_in_metres(c, limits),
        _depth_in_metres(d, limits),
    )
    ab, cd = (za if za < zb else zb), (zc if zc < zd else zd)
    last = (ab if ab < cd else cd) * np.float32(1.0 / (1.0 - _MAX_DEPTH_JUMP))
    zero, unity = np.float32(0.0), np.float32(1.0)
    # Unknown depth is stored as infinity. The comparison of infinity with itself is False, so unknown depth
    # counts as 0.
    ia, ib = (unity if za < last else zero), (unity if zb < last else zero)
    ic, id_ = (unity if zc < last else zero), (unity if zd < last else zero)
    count = ia + ib + ic + id_
    return (ia / za + ib / zb + ic / zc + id_ / zd) / (count if count > unity else unity)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _depth_in_metres(depth, limits):
    """Returns a depth (mm) in metres; infinity if it is unknown or outside of the depth limits."""
    z = np.float32(depth) * np.float32(1e-3)
    return z if (z > np.float32(0.0)) & (z >= limits[0]) & (z <= limits[1]) else np.float32(np.inf)


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_planes(inverse, across, down, limits, points, normals, worth, first, last):
    """Fits a plane around each half-size pixel of the rows ``first`` to ``last``.

    The inverse depth of a plane is linear in the ray: 1/z = a x + b y + c, and (a, b, c) points along the
    normal. The noise of a structured-light camera is uniform in inverse depth, so least squares in inverse
    depth is appropriate.

    Args:
        inverse: (h, w + 2 _SAMPLE_SPACING_PX), across: (w + 2 _SAMPLE_SPACING_PX,) 1/m and x of the
            rays, with empty columns on either side.
        down: (h,) y of the rays.
    """
    width = inverse.shape[1] - 2 * _SAMPLE_SPACING_PX
    sums = np.empty((9, width), np.float32)
    unity, least = np.float32(1.0), np.float32(1e-4)
    for v in range(first, last):
        _add_neighbours(inverse, v, across, down, sums)
        for u in range(width):
            n = sums[0, u]
            if n < _MIN_PLANE_SAMPLES:
                continue
            centre, x0, y0, part = (
                inverse[v, u + _SAMPLE_SPACING_PX],
                across[u + _SAMPLE_SPACING_PX],
                down[v],
                unity / n,
            )
            sx, sy, sz = sums[1, u], sums[2, u], sums[3, u]
            xx, xy, yy = sums[4, u] - sx * sx * part, sums[5, u] - sx * sy * part, sums[6, u] - sy * sy * part
            xz, yz = sums[7, u] - sx * sz * part, sums[8, u] - sy * sz * part
            det = xx * yy - xy * xy
            if det <= least * xx * yy:
                continue
            a, b = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
            smooth = centre + (sz - a * sx - b * sy) * part
            c = smooth - a * x0 - b * y0
            # Use the depth of the pixel itself. On curved surfaces the fitted depth is too deep, and the
            # camera would drift.
            z, length = unity / centre, np.sqrt(a * a + b * b + c * c)
            facing = smooth / (length * np.sqrt(x0 * x0 + y0 * y0 + unity))
            if not facing > _MIN_FACING_COSINE:
                continue
            points[v, u, 0], points[v, u, 1], points[v, u, 2] = x0 * z, y0 * z, z
            normals[v, u, 0], normals[v, u, 1], normals[v, u, 2] = -a / length, -b / length, -c / length
            share = n / np.float32(9.0)
            worth[v, u] = facing * share * share * compute_relative_certainty(limits, z)


@njit(cache=True, nogil=True, error_model="numpy")
def _add_neighbours(inverse, v, across, down, sums):
    """Computes sums over the nine samples around each pixel of a row. Samples on another surface are
    excluded. The loop has no branch, so the compiler vectorizes it.

    Args:
        sums: (9, w) of 1, x, y, z, xx, xy, yy, xz and yz, written. x, y (rays) and z (1/m) are relative to
            the pixel.
    """
    unity, zero, wide = np.float32(1.0), np.float32(0.0), 2 * _SAMPLE_SPACING_PX
    middle = inverse[v]
    sums[:, :] = zero
    for j in range(
        max(v - _SAMPLE_SPACING_PX, v % _SAMPLE_SPACING_PX),
        min(v + _SAMPLE_SPACING_PX + 1, len(inverse)),
        _SAMPLE_SPACING_PX,
    ):
        row, y = inverse[j], down[j] - down[v]
        for u in range(sums.shape[1]):
            centre = middle[u + _SAMPLE_SPACING_PX]
            gate = np.float32(_MAX_DEPTH_JUMP) * centre
            left, right = (
                across[u] - across[u + _SAMPLE_SPACING_PX],
                across[u + wide] - across[u + _SAMPLE_SPACING_PX],
            )
            za, zb, zc = row[u] - centre, row[u + _SAMPLE_SPACING_PX] - centre, row[u + wide] - centre
            a = unity if abs(za) < gate else zero
            b = unity if abs(zb) < gate else zero
            c = unity if abs(zc) < gate else zero
            n, x, z = a + b + c, a * left + c * right, a * za + b * zb + c * zc
            sums[0, u] += n
            sums[1, u] += x
            sums[2, u] += n * y
            sums[3, u] += z
            sums[4, u] += a * left * left + c * right * right
            sums[5, u] += x * y
            sums[6, u] += n * y * y
            sums[7, u] += a * left * za + c * right * zc
            sums[8, u] += z * y


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def compute_relative_certainty(limits, z):
    """Returns the weight of a depth z (m), at most 1: the depth variance at the best depth divided by the
    variance at z."""
    beyond = z - limits[4]
    share = limits[2] / (limits[2] + limits[3] * beyond * beyond)
    return share * share


@njit(cache=True, nogil=True, error_model="numpy")
def _assign_pixel_planes(depth, across, down, points, normals, worth, planes, weights, first, last):
    """Writes the plane and weight of each pixel in the rows ``first`` to ``last``. A pixel gets the plane of
    its half-size pixel, shifted to pass through the pixel's own depth point.
    """
    height, width = depth.shape
    for v in range(2 * first, min(2 * last, height)):
        for u in range(width):
            z = np.float32(depth[v, u]) * np.float32(1e-3)
            j, i = v // 2, u // 2
            plane_depth = points[j, i, 2]
            if worth[j, i] == 0.0 or abs(z - plane_depth) > np.float32(_MAX_DEPTH_JUMP) * plane_depth:
                planes[v, u, 0], planes[v, u, 1], planes[v, u, 2] = 0.0, 0.0, 0.0
                planes[v, u, 3], weights[v, u] = _NO_SURFACE_OFFSET, 0.0
                continue
            nx, ny, nz = normals[j, i, 0], normals[j, i, 1], normals[j, i, 2]
            planes[v, u, 0], planes[v, u, 1], planes[v, u, 2] = nx, ny, nz
            planes[v, u, 3] = (nx * across[u] + ny * down[v] + nz) * z
            weights[v, u] = worth[j, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _bound_tiles(depth, limits, tiles, first, last):
    """Computes the minimum and maximum depth (m) and the fraction of unknown pixels, for the rows ``first``
    to ``last`` of tiles."""
    height, width = depth.shape
    zero, unity = np.float32(0.0), np.float32(1.0)
    near, far, known_counts = (
        np.empty(width, np.float32),
        np.empty(width, np.float32),
        np.empty(width, np.float32),
    )
    for r in range(first, last):
        near[:], far[:], known_counts[:] = np.float32(np.inf), zero, zero
        low, high = r * TILE, min(r * TILE + TILE, height)
        for v in range(low, high):
            for u in range(width):
                z = _depth_in_metres(depth[v, u], limits)
                is_known = z < np.float32(np.inf)
                near[u] = z if z < near[u] else near[u]
                far[u] = z if is_known & (z > far[u]) else far[u]
                known_counts[u] += unity if is_known else zero
        for c in range(tiles.shape[1]):
            nearest, farthest, count = np.float32(np.inf), zero, zero
            right = min(c * TILE + TILE, width)
            for u in range(c * TILE, right):
                nearest, farthest = min(nearest, near[u]), max(farthest, far[u])
                count += known_counts[u]
            tiles[r, c, 0], tiles[r, c, 1] = nearest, farthest
            # Do not count pixels beyond the edge of the image as holes.
            holes = np.float32((high - low) * (right - c * TILE)) - count
            tiles[r, c, 2] = holes / np.float32(TILE * TILE)
