"""Compiled distances from points to tapered capsules: the inner loop of the fit and of the detection."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_NUMBER = 31
"""Bit mask of the lowest 5 bits of a cost. The kernel stores the capsule's index in them, so at most 32
capsules are possible.
"""
FAST = {"nsz", "arcp", "contract", "reassoc", "nnan", "ninf"}
"""LLVM's fast-math flags for kernels without infinite numbers. They allow sums in any order, so that the
compiler can vectorise loops."""


@njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")
def nearest_capsules(which, seen, affinity, ends, radii, side):
    """Finds the capsule with the nearest surface for each observed point, and writes its index into
    ``which``.

    The cost of a surface that faces away from the observed normal is up to twice ``side`` metres higher. So a
    point on the front of an arm is not explained by the chest behind it.

    Args:
        which: (M,) int32 output, the index of each point's capsule.
        seen: (6, M) float32 the points in metres, world frame, and their outward unit normals. One row per
            coordinate lets the compiler vectorise the loop.
        affinity: (C, M) float32 metres added to each capsule's cost for points that the network assigns to
            another body part; or (0, 0).
        ends, radii: (C, 2, 3) and (C, 2) metres, world frame; C is at most 32.
        side: float32 metres, half the additional cost of a surface that faces the opposite way.
    """
    which[:] = np.int32(0x7FFFFFFF)
    zero32, one32 = np.float32(0.0), np.float32(1.0)
    liked = len(affinity) > 0
    for c in range(len(ends)):
        sx, sy, sz = np.float32(ends[c, 0, 0]), np.float32(ends[c, 0, 1]), np.float32(ends[c, 0, 2])
        dx, dy, dz = (
            np.float32(ends[c, 1, 0]) - sx,
            np.float32(ends[c, 1, 1]) - sy,
            np.float32(ends[c, 1, 2]) - sz,
        )
        share = one32 / (dx * dx + dy * dy + dz * dz + np.float32(1e-12))
        start, growth = np.float32(radii[c, 0]), np.float32(radii[c, 1] - radii[c, 0])
        likes = affinity[c] if liked else seen[0]
        scale = one32 if liked else zero32
        for i in range(len(which)):
            px, py, pz = seen[0, i] - sx, seen[1, i] - sy, seen[2, i] - sz
            t = min(one32, max(zero32, (px * dx + py * dy + pz * dz) * share))
            px, py, pz = px - t * dx, py - t * dy, pz - t * dz
            length = np.sqrt(px * px + py * py + pz * pz) + np.float32(1e-9)
            facing = (px * seen[3, i] + py * seen[4, i] + pz * seen[5, i]) / length
            cost = abs(length - (start + t * growth)) + side * max(zero32, one32 - facing) + scale * likes[i]
            # Costs are not negative, so their bit patterns have the same order as the costs. The lowest bits
            # contain the capsule's index. So an integer minimum finds the nearest capsule without a branch.
            bits = (np.float32(cost).view(np.int32) & np.int32(~_NUMBER)) | np.int32(c)
            which[i] = min(which[i], bits)
    for i in range(len(which)):
        which[i] &= np.int32(_NUMBER)


@njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")
def misfits(points, ends, radii, far):
    """Returns (N,) misfits of N postures in metres.

    A misfit is the mean distance from each point to the nearest capsule, plus the mean distance from each
    capsule to the nearest point. Lower values are better.

    Args:
        points: (3, M) float32 metres.
        ends: (N, C, 2, 3) metres, the ends of the capsules of N postures.
        radii: (C, 2) metres, the same for all postures.
        far: upper limit in metres to which each point's distance is clipped.
    """
    out = np.empty(len(ends))
    zero32, one32 = np.float32(0.0), np.float32(1.0)
    nearest = np.empty(points.shape[1], np.float32)
    for k in range(len(ends)):
        nearest[:] = np.float32(far)
        total = 0.0
        for c in range(ends.shape[1]):
            sx, sy, sz = (
                np.float32(ends[k, c, 0, 0]),
                np.float32(ends[k, c, 0, 1]),
                np.float32(ends[k, c, 0, 2]),
            )
            dx, dy = np.float32(ends[k, c, 1, 0]) - sx, np.float32(ends[k, c, 1, 1]) - sy
            dz = np.float32(ends[k, c, 1, 2]) - sz
            share = one32 / (dx * dx + dy * dy + dz * dz + np.float32(1e-12))
            start, growth = np.float32(radii[c, 0]), np.float32(radii[c, 1] - radii[c, 0])
            closest = np.float32(1e6)
            for i in range(points.shape[1]):
                px, py, pz = points[0, i] - sx, points[1, i] - sy, points[2, i] - sz
                t = min(one32, max(zero32, (px * dx + py * dy + pz * dz) * share))
                px, py, pz = px - t * dx, py - t * dy, pz - t * dz
                distance = abs(np.sqrt(px * px + py * py + pz * pz) - (start + t * growth))
                nearest[i] = min(nearest[i], distance)
                closest = min(closest, distance)
            total += closest / ends.shape[1]
        out[k] = total + nearest.mean()
    return out


@njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")
def signed_distances(points, ends, radii):
    """Returns (M,) float32 signed distances in metres from (M, 3) float32 points to the nearest of the
    capsules.

    Points inside have negative distances.
    """
    zero32, one32 = np.float32(0.0), np.float32(1.0)
    coordinates, out = np.empty((3, len(points)), np.float32), np.full(len(points), np.float32(1e9))
    for i in range(len(points)):
        coordinates[0, i], coordinates[1, i], coordinates[2, i] = points[i, 0], points[i, 1], points[i, 2]
    for c in range(len(ends)):
        sx, sy, sz = np.float32(ends[c, 0, 0]), np.float32(ends[c, 0, 1]), np.float32(ends[c, 0, 2])
        dx, dy = np.float32(ends[c, 1, 0]) - sx, np.float32(ends[c, 1, 1]) - sy
        dz = np.float32(ends[c, 1, 2]) - sz
        share = one32 / (dx * dx + dy * dy + dz * dz + np.float32(1e-12))
        start, growth = np.float32(radii[c, 0]), np.float32(radii[c, 1] - radii[c, 0])
        for i in range(len(points)):
            px, py, pz = coordinates[0, i] - sx, coordinates[1, i] - sy, coordinates[2, i] - sz
            t = min(one32, max(zero32, (px * dx + py * dy + pz * dz) * share))
            px, py, pz = px - t * dx, py - t * dy, pz - t * dz
            out[i] = min(out[i], np.sqrt(px * px + py * py + pz * pz) - (start + t * growth))
    return out


@njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")
def ray_clearances(points, eye, near, far, ends, radii):
    """Returns (M,) float32 signed distances in metres between the capsules and a segment of each point's ray.

    The distance is the smallest one between the segment and a capsule's axis, minus the radius there. It is
    negative if the segment enters a capsule.

    Args:
        points: (M, 3) float32 metres.
        eye: (3,) origin of the rays.
        near, far: start and end of the segment in metres beyond the point; negative in front of it.
        ends, radii: (C, 2, 3) and (C, 2) metres, world frame.
    """
    zero32, one32, tiny = np.float32(0.0), np.float32(1.0), np.float32(1e-12)
    first, long = np.float32(near), np.float32(far - near)
    rays, out = np.empty((6, len(points)), np.float32), np.full(len(points), np.float32(1e9))
    for i in range(len(points)):
        x, y, z = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        scale = one32 / np.sqrt(x * x + y * y + z * z + tiny)
        x, y, z = x * scale, y * scale, z * scale
        rays[0, i], rays[1, i] = points[i, 0] + first * x, points[i, 1] + first * y
        rays[2, i], rays[3, i] = points[i, 2] + first * z, long * x
        rays[4, i], rays[5, i] = long * y, long * z
    # Find the closest points of two segments. Parameter s runs along the ray, and t along the axis.
    a, start, growth = long * long, radii[:, 0], radii[:, 1] - radii[:, 0]
    for c in range(len(ends)):
        sx, sy, sz = np.float32(ends[c, 0, 0]), np.float32(ends[c, 0, 1]), np.float32(ends[c, 0, 2])
        dx, dy = np.float32(ends[c, 1, 0]) - sx, np.float32(ends[c, 1, 1]) - sy
        dz = np.float32(ends[c, 1, 2]) - sz
        e = dx * dx + dy * dy + dz * dz + tiny
        thick, more = np.float32(start[c]), np.float32(growth[c])
        for i in range(len(points)):
            x, y, z = rays[0, i] - sx, rays[1, i] - sy, rays[2, i] - sz
            vx, vy, vz = rays[3, i], rays[4, i], rays[5, i]
            b, f = vx * dx + vy * dy + vz * dz, x * dx + y * dy + z * dz
            d = x * vx + y * vy + z * vz
            # If the two segments are parallel, all points on them are equally near. In that case take the
            # start of the segment.
            s = min(one32, max(zero32, (b * f - d * e) / (a * e - b * b + tiny)))
            t = min(one32, max(zero32, (b * s + f) / e))
            s = min(one32, max(zero32, (b * t - d) / a))
            t = min(one32, max(zero32, (b * s + f) / e))
            x, y, z = x + s * vx - t * dx, y + s * vy - t * dy, z + s * vz - t * dz
            out[i] = min(out[i], np.sqrt(x * x + y * y + z * z) - (thick + t * more))
    return out
