"""Labels each pixel with the person that it lies on, by the predicted bodies, compiled."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.scene import ROOM, UNLIKELY

_ON_SURFACE = 0.025
"""Metres from a predicted surface within which a pixel lies on it and the search ends: depth's noise."""


def image_boxes(view: FrameView, ends: Float, radii: Float, reach: float) -> Int:
    """(K, 4) pixels: top, left, bottom, right of each person's (C, 2, 3) capsules, widened by the reach."""
    return np.asarray(_boxes(ends, radii, reach, view.camera.camera, view.world_from_camera, view.z.shape))


@njit(cache=True, nogil=True)
def _boxes(ends, radii, reach, camera, pose, shape):  # type: ignore[no-untyped-def]
    """See :func:`image_boxes`; a capsule beside the sensor covers the whole image on that side."""
    out = np.empty((len(ends), 4), np.int64)
    for k in range(len(ends)):
        top, left, bottom, right = np.inf, np.inf, -np.inf, -np.inf
        for c in range(ends.shape[1]):
            for e in range(2):
                x, y, z = 0.0, 0.0, 0.0
                for b in range(3):
                    offset = ends[k, c, e, b] - pose[b, 3]
                    x += pose[b, 0] * offset
                    y += pose[b, 1] * offset
                    z += pose[b, 2] * offset
                around = radii[k, c, e] + reach
                first, last = _span(y, z, around)
                top, bottom = (
                    min(top, camera[1] * first + camera[3]),
                    max(bottom, camera[1] * last + camera[3]),
                )
                first, last = _span(x, z, around)
                left, right = (
                    min(left, camera[0] * first + camera[2]),
                    max(right, camera[0] * last + camera[2]),
                )
        if not (bottom > top and right > left):  # a capsule has an infinite or missing coordinate
            out[k] = 0
            continue
        out[k, 0] = int(min(max(np.floor(top), 0.0), shape[0]))
        out[k, 1] = int(min(max(np.floor(left), 0.0), shape[1]))
        out[k, 2] = int(min(max(np.ceil(bottom) + 1.0, 0.0), shape[0]))
        out[k, 3] = int(min(max(np.ceil(right) + 1.0, 0.0), shape[1]))
    return out


@njit(cache=True, nogil=True)
def _span(x, z, radius):  # type: ignore[no-untyped-def]
    """The least and the greatest x / z of a ball about (x, z): the slopes of its tangents through the sensor.

    A ball is wider in the image than its radius over its distance.
    """
    square = x * x + z * z
    if not np.isfinite(square + radius):
        return np.nan, np.nan
    if square <= radius * radius:
        return -np.inf, np.inf
    sine = radius / np.sqrt(square)
    cosine = np.sqrt(1.0 - sine * sine)
    ahead, back = z * cosine + x * sine, z * cosine - x * sine
    least = (x * cosine - z * sine) / ahead if ahead > 0.0 else -np.inf
    most = (x * cosine + z * sine) / back if back > 0.0 else np.inf
    return least, most


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def label_pixels(points, kind, boxes, ends, radii, handicap, reach, reach_unlikely, owner, distance):  # type: ignore[no-untyped-def]
    """Labels each candidate pixel within reach with the person of the nearest capsule, into ``owner``.

    The search ends at a capsule that the pixel lies on; the last pixel's capsule is tried first. A box around
    the person and a ball around each capsule rule out pixels that are out of reach.
    """
    for k in range(len(boxes)):
        top, left, bottom, right = boxes[k]
        shafts, balls = _shafts(ends[k], radii[k]), _balls(ends[k], radii[k], reach)
        low, high = _corners(ends[k], radii[k], reach)
        last = 0
        for v in range(top, bottom):
            for u in range(left, right):
                x, y, z = points[v, u, 0], points[v, u, 1], points[v, u, 2]
                if kind[v, u] == ROOM or not _within(x, y, z, low, high):
                    continue
                best = _nearer(x, y, z, shafts[last], np.inf)
                if best > _ON_SURFACE:
                    for c in range(len(shafts)):
                        if _beyond(x, y, z, balls[c]):
                            continue
                        away = _nearer(x, y, z, shafts[c], best)
                        if away < best:
                            best, last = away, c
                            if away < _ON_SURFACE:
                                break
                best = max(best, 0.0) + handicap[k]
                limit = reach_unlikely if kind[v, u] == UNLIKELY else reach
                if best < limit and best < distance[v, u]:
                    owner[v, u], distance[v, u] = k, best


@njit(cache=True, nogil=True)
def _within(x, y, z, low, high):  # type: ignore[no-untyped-def]
    """Whether a point lies in a box."""
    return low[0] < x < high[0] and low[1] < y < high[1] and low[2] < z < high[2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _beyond(x, y, z, ball):  # type: ignore[no-untyped-def]
    """Whether a point lies out of a ball."""
    return (x - ball[0]) ** 2 + (y - ball[1]) ** 2 + (z - ball[2]) ** 2 > ball[3]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _nearer(x, y, z, shaft, best):  # type: ignore[no-untyped-def]
    """Metres from a point to a capsule's surface, or ``best`` where it is not less, found without a root."""
    ax, ay, az = x - shaft[0], y - shaft[1], z - shaft[2]
    t = min(1.0, max(0.0, (ax * shaft[3] + ay * shaft[4] + az * shaft[5]) * shaft[6]))
    ax, ay, az = ax - t * shaft[3], ay - t * shaft[4], az - t * shaft[5]
    radius = shaft[7] + t * shaft[8]
    square = ax * ax + ay * ay + az * az
    return np.sqrt(square) - radius if square < (best + radius) ** 2 else best


@njit(cache=True, nogil=True)
def _shafts(ends, radii):  # type: ignore[no-untyped-def]
    """(C, 9) each capsule's start, axis, one over the axis squared, first radius and growth of the radius."""
    out = np.empty((len(ends), 9))
    for c in range(len(ends)):
        square = 1e-12
        for a in range(3):
            out[c, a], out[c, 3 + a] = ends[c, 0, a], ends[c, 1, a] - ends[c, 0, a]
            square += out[c, 3 + a] ** 2
        out[c, 6], out[c, 7], out[c, 8] = 1.0 / square, radii[c, 0], radii[c, 1] - radii[c, 0]
    return out


@njit(cache=True, nogil=True)
def _balls(ends, radii, reach):  # type: ignore[no-untyped-def]
    """(C, 4) centre and squared radius of the ball that holds all points within a capsule's reach."""
    out = np.empty((len(ends), 4))
    for c in range(len(ends)):
        square = 0.0
        for a in range(3):
            out[c, a] = 0.5 * (ends[c, 0, a] + ends[c, 1, a])
            square += (0.5 * (ends[c, 1, a] - ends[c, 0, a])) ** 2
        out[c, 3] = (np.sqrt(square) + max(radii[c, 0], radii[c, 1]) + reach) ** 2
    return out


@njit(cache=True, nogil=True)
def _corners(ends, radii, reach):  # type: ignore[no-untyped-def]
    """The low and high corner of the box that holds all points within any capsule's reach."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for c in range(len(ends)):
        for e in range(2):
            around = radii[c, e] + reach
            for a in range(3):
                low[a], high[a] = min(low[a], ends[c, e, a] - around), max(high[a], ends[c, e, a] + around)
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
