"""Compiled loops of frame-to-model tracking: distances of a depth image's points from the surface in a
TSDF volume.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.scanning.blocks import SIDE, find, key_of

MOMENT_COUNT = 32
"""Index of the first sum that is used to estimate the noise of the slopes."""
BIN_COUNT = 16
"""Number of histogram bins for the angle between the image's normal and the surface's normal. Bin edges grow
quadratically."""
SQUARE_COUNT = MOMENT_COUNT + 9 + BIN_COUNT
"""Index of the sum of squared weights. The 21 sums after it are the upper half of the products of the
surface's slopes and the image's normals, row by row. They are computed only on request."""
SUM_COUNT = SQUARE_COUNT + 22
"""Length of a row of sums. Elements 0 to 20 are the upper half of the normal matrix, row by row, and 21 to 26
the gradient. Then follow the weighted squared distances (27), the weights (28), and three weighted counts:
points on the surface (29), all valid points (30), and points in observed space (31). From MOMENTS on follow
the weighted positions relative to the camera (3), and their products (6, the upper half, row by row). After
these comes a histogram of the weights by the angle between the two normals (BINS)."""
_MIN_NORMAL_COSINE = 0.5
"""Minimum cosine between the normals of a point and of the surface if both belong to the same side of an
object."""
MAX_CHORD = 1.0
"""Upper edge of the last bin of angles: the chord (twice the sine of half the angle) of the largest allowed
angle (``_MIN_NORMAL_COSINE``)."""


@njit(cache=True, nogil=True, error_model="numpy")
def interpolate_field(field, x, y, z, found, last):
    """Interpolates the signed distance and its gradient at a point of the world, trilinearly between voxels.

    Args:
        field: the signed distances of the volume, as :class:`FieldArrays`.
        found: (4,) the signed distance (m) and its gradient; written.
        last: (4,) int64 cache of the last block: its number and its position (3); read and written.

    Returns:
        True if all eight voxels around the point were observed.
    """
    voxel, beside = field.band.voxel, field.neighbour_blocks
    gx, gy, gz = x / voxel, y / voxel, z / voxel
    cx, cy, cz = int(np.floor(gx)), int(np.floor(gy)), int(np.floor(gz))
    bx, by, bz = cx >> 3, cy >> 3, cz >> 3
    if last[1] != bx or last[2] != by or last[3] != bz:
        last[0], last[1], last[2], last[3] = find(field.keys, field.slots, key_of(bx, by, bz)), bx, by, bz
    block = last[0]
    if block < 0:
        return False
    ix, iy, iz = cx & 7, cy & 7, cz & 7
    fx, fy, fz = gx - cx, gy - cy, gz - cz
    value, sx, sy, sz = 0.0, 0.0, 0.0, 0.0
    for k in range(8):
        dx, dy, dz = k & 1, (k >> 1) & 1, k >> 2
        jx, jy, jz = ix + dx, iy + dy, iz + dz
        over = (jx >> 3) + 2 * (jy >> 3) + 4 * (jz >> 3)
        b = block
        if over != 0:
            b = beside[block, over]
            if b < 0:
                return False
        i = (jx & 7) + SIDE * (jy & 7) + SIDE * SIDE * (jz & 7)
        if field.weight[b, i] <= 0.0:
            return False
        d = field.distance[b, i]
        ax = fx if dx == 1 else 1.0 - fx
        ay = fy if dy == 1 else 1.0 - fy
        az = fz if dz == 1 else 1.0 - fz
        value += d * ax * ay * az
        sx += d * ay * az * (2 * dx - 1)
        sy += d * ax * az * (2 * dy - 1)
        sz += d * ax * ay * (2 * dz - 1)
    found[0], found[1], found[2], found[3] = value, sx / voxel, sy / voxel, sz / voxel
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def accumulate_normal_equations(points, stride, span, pose, soft, field, closely, sums, first, last):  # noqa: PLR0915, a kernel
    """Accumulates the normal equations of the points in some rows of a half-size image.

    The residual of a point is the volume's signed distance at the point. The derivative for a motion of the
    camera follows from the gradient.

    Args:
        points: the points of the half-size image, as :class:`PointArrays`.
        stride: step in pixels between the points that are used, in each direction.
        span: (2,) minimum and maximum depth of the points that are used, metres.
        pose: (4, 4) world_from_camera.
        field: the signed distances of the volume, as :class:`FieldArrays`.
        closely: True to accumulate the products of slopes and normals as well.
        soft: metres at which a residual has a quarter of its weight (Geman-McClure).
        sums: (R, SUMS) one row for each row of points, written. The six unknowns are a translation (m) and a
            rotation (rad) about the camera's position, world frame.
    """
    sample, cache, j, m = np.empty(4), np.empty(4, np.int64), np.empty(6), np.empty(6)
    cache[0], cache[1] = -1, np.int64(1) << 40
    for r in range(first, last):
        sums[r, :] = 0.0
        v = r * stride
        for u in range((r % 2) * (stride // 2), points.places.shape[1], stride):
            z = points.places[v, u, 2]
            if points.worth[v, u] == 0.0 or z < span[0] or z >= span[1]:
                continue
            sums[r, 30] += points.worth[v, u]
            # Transform the point into the world, and look up its signed distance.
            px, py = points.places[v, u, 0], points.places[v, u, 1]
            qx = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * z
            qy = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * z
            qz = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * z
            if not interpolate_field(field, qx + pose[0, 3], qy + pose[1, 3], qz + pose[2, 3], sample, cache):
                continue
            sums[r, 31] += points.worth[v, u]
            d, gx, gy, gz = sample[0], sample[1], sample[2], sample[3]
            if d >= 0.98 * field.band.front or d <= -0.98 * field.band.behind:
                continue
            # Reject the point if its normal and the gradient of the surface point to opposite sides.
            nx, ny, nz = points.normals[v, u, 0], points.normals[v, u, 1], points.normals[v, u, 2]
            mx = pose[0, 0] * nx + pose[0, 1] * ny + pose[0, 2] * nz
            my = pose[1, 0] * nx + pose[1, 1] * ny + pose[1, 2] * nz
            mz = pose[2, 0] * nx + pose[2, 1] * ny + pose[2, 2] * nz
            along, slope = mx * gx + my * gy + mz * gz, np.sqrt(gx * gx + gy * gy + gz * gz)
            if along < _MIN_NORMAL_COSINE * slope:
                continue
            # Compute the robust weight (Geman-McClure).
            robust = soft * soft / (soft * soft + d * d)
            w = points.worth[v, u] * robust * robust
            j[0], j[1], j[2] = gx, gy, gz
            j[3], j[4], j[5] = qy * gz - qz * gy, qz * gx - qx * gz, qx * gy - qy * gx
            # Add to the upper half of the normal matrix J^T W J, and to the gradient J^T W d.
            at = 0
            for a in range(6):
                wj = w * j[a]
                for b in range(a, 6):
                    sums[r, at] += wj * j[b]
                    at += 1
                sums[r, 21 + a] += wj * d
            # Add to the sums for error, agreement and overlap, and to the moments of the positions for the
            # noise estimate.
            sums[r, 27] += w * d * d
            sums[r, 28] += w
            sums[r, 29] += points.worth[v, u] * robust
            sums[r, MOMENT_COUNT] += w * qx
            sums[r, MOMENT_COUNT + 1] += w * qy
            sums[r, MOMENT_COUNT + 2] += w * qz
            sums[r, MOMENT_COUNT + 3] += w * qx * qx
            sums[r, MOMENT_COUNT + 4] += w * qx * qy
            sums[r, MOMENT_COUNT + 5] += w * qx * qz
            sums[r, MOMENT_COUNT + 6] += w * qy * qy
            sums[r, MOMENT_COUNT + 7] += w * qy * qz
            sums[r, MOMENT_COUNT + 8] += w * qz * qz
            # Add to the histogram of the angle between the normal of the image and the gradient of the
            # surface.
            chord = np.sqrt(2.0 - 2.0 * min(along / max(slope, 1e-12), 1.0)) / MAX_CHORD
            sums[r, MOMENT_COUNT + 9 + min(int(BIN_COUNT * np.sqrt(chord)), BIN_COUNT - 1)] += w
            # Add the symmetrised products of surface gradients and image normals. The noise of the two is
            # independent, so it averages out in these products.
            if closely:
                m[0], m[1], m[2] = slope * mx, slope * my, slope * mz
                m[3], m[4], m[5] = qy * m[2] - qz * m[1], qz * m[0] - qx * m[2], qx * m[1] - qy * m[0]
                sums[r, SQUARE_COUNT] += w * w
                at = SQUARE_COUNT + 1
                for a in range(6):
                    for b in range(a, 6):
                        sums[r, at] += 0.5 * w * (j[a] * m[b] + m[a] * j[b])
                        at += 1
