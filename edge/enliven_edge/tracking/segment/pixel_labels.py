"""Compiled kernels that label each pixel with a person if it lies on the person's predicted body."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit
from enliven_edge.tracking.body_model.capsules import FAST
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.scene.background_kernels import BACKGROUND, UNLIKELY


def image_boxes(view: FrameView, ends: Float, radii: Float, reach: float) -> Int:
    """Returns (K, 4) image boxes of each person's capsules in pixels: top, left, bottom and right.

    The capsules are widened by ``reach`` metres.

    ``ends`` (K, C, 2, 3) and ``radii`` (K, C, 2) are in metres.
    """
    return np.asarray(_boxes(ends, radii, reach, view.camera.camera, view.world_from_camera, view.z.shape))


@njit(cache=True, nogil=True)
def _boxes(ends, radii, reach, camera, pose, shape):
    """Computes :func:`image_boxes`.

    A capsule next to the sensor extends the box to the image border on that side.
    """
    out = np.empty((len(ends), 4), np.int64)
    for k in range(len(ends)):
        top, left, bottom, right = np.inf, np.inf, -np.inf, -np.inf
        for c in range(ends.shape[1]):
            for e in range(2):
                # Transform this end of the capsule into the camera's frame.
                x, y, z = 0.0, 0.0, 0.0
                for b in range(3):
                    offset = ends[k, c, e, b] - pose[b, 3]
                    x += pose[b, 0] * offset
                    y += pose[b, 1] * offset
                    z += pose[b, 2] * offset
                # Find the tangents to the ball around this end, vertically and horizontally.
                around = radii[k, c, e] + reach
                first, last = project_ball_extent(y, z, around)
                top, bottom = (
                    min(top, camera[1] * first + camera[3]),
                    max(bottom, camera[1] * last + camera[3]),
                )
                first, last = project_ball_extent(x, z, around)
                left, right = (
                    min(left, camera[0] * first + camera[2]),
                    max(right, camera[0] * last + camera[2]),
                )
        if not (bottom > top and right > left):
            # The box is empty or NaN, because a capsule has an infinite or missing coordinate.
            out[k] = 0
            continue
        out[k, 0] = int(min(max(np.floor(top), 0.0), shape[0]))
        out[k, 1] = int(min(max(np.floor(left), 0.0), shape[1]))
        out[k, 2] = int(min(max(np.ceil(bottom) + 1.0, 0.0), shape[0]))
        out[k, 3] = int(min(max(np.ceil(right) + 1.0, 0.0), shape[1]))
    return out


@njit(cache=True, nogil=True)
def project_ball_extent(x, z, radius):
    """Returns the minimum and maximum x / z of a ball at (x, z), from its tangents through the sensor.

    A ball is wider in the image than its radius divided by its distance.
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


@njit(cache=True, nogil=True)
def label_pixels(points, kind, boxes, ends, radii, handicap, reach, reach_unlikely, owner, distance):
    """Labels each candidate pixel within reach with the person of the nearest capsule, and writes it into
    ``owner``.

    The bounding boxes of the person in the image and in the world exclude most pixels. A vectorised loop
    compares the remaining pixels with one capsule after the other.
    """
    largest = 0
    for k in range(len(boxes)):
        largest = max(largest, (boxes[k, 2] - boxes[k, 0]) * (boxes[k, 3] - boxes[k, 1]))
    chosen, place, away = (
        np.empty(largest, np.int64),
        np.empty((3, largest), np.float32),
        np.empty(largest, np.float32),
    )
    kinds, owners, distances = kind.ravel(), owner.ravel(), distance.ravel()
    for k in range(len(boxes)):
        low, high = _corners(ends[k], radii[k], reach)
        count = _candidates_within(chosen, place, points, kind, boxes[k], low, high)
        _distances(away, place, count, ends[k], radii[k])
        for n in range(count):
            i = chosen[n]
            best = max(away[n], 0.0) + handicap[k]
            limit = reach_unlikely if kinds[i] == UNLIKELY else reach
            if best < limit and best < distances[i]:
                owners[i], distances[i] = k, best


@njit(cache=True, nogil=True)
def _candidates_within(chosen, place, points, kind, box, low, high):
    """Finds the non-background pixels of an image box that are inside a box in the world. Returns their
    number.

    Their flat indices go into ``chosen``, and their (3, N) float32 metres into ``place``.
    """
    count, width = 0, kind.shape[1]
    top, left, bottom, right = box
    for v in range(top, bottom):
        for u in range(left, right):
            if kind[v, u] == BACKGROUND:
                continue
            x, y, z = points[v, u, 0], points[v, u, 1], points[v, u, 2]
            chosen[count] = v * width + u
            place[0, count], place[1, count], place[2, count] = x, y, z
            count += _is_in_box(x, y, z, low, high)
    return count


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _distances(away, place, count, ends, radii):
    """Writes the distances of (3, N) places to the nearest capsule's surface, in metres, into ``away``.

    It uses only the first ``count`` places.
    """
    away[:count] = np.float32(np.inf)
    zero32, one32 = np.float32(0.0), np.float32(1.0)
    for c in range(len(ends)):
        sx, sy, sz = np.float32(ends[c, 0, 0]), np.float32(ends[c, 0, 1]), np.float32(ends[c, 0, 2])
        dx, dy = np.float32(ends[c, 1, 0]) - sx, np.float32(ends[c, 1, 1]) - sy
        dz = np.float32(ends[c, 1, 2]) - sz
        share = one32 / (dx * dx + dy * dy + dz * dz + np.float32(1e-12))
        start, growth = np.float32(radii[c, 0]), np.float32(radii[c, 1] - radii[c, 0])
        for i in range(count):
            x, y, z = place[0, i] - sx, place[1, i] - sy, place[2, i] - sz
            t = min(one32, max(zero32, (x * dx + y * dy + z * dz) * share))
            x, y, z = x - t * dx, y - t * dy, z - t * dz
            away[i] = min(away[i], np.sqrt(x * x + y * y + z * z) - (start + t * growth))


@njit(cache=True, nogil=True)
def _is_in_box(x, y, z, low, high):
    """Returns True if a point is inside a box."""
    return low[0] < x < high[0] and low[1] < y < high[1] and low[2] < z < high[2]


@njit(cache=True, nogil=True)
def _corners(ends, radii, reach):
    """Returns the minimum and maximum corner of the box that contains all points within any capsule's
    reach.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for c in range(len(ends)):
        for e in range(2):
            around = radii[c, e] + reach
            for a in range(3):
                low[a], high[a] = min(low[a], ends[c, e, a] - around), max(high[a], ends[c, e, a] + around)
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
