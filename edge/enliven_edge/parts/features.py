"""Depth differences (Shotton et al. 2011, equation 1) and the walk down a tree, compiled.

A feature is two offsets (a, b) in metres on the plane of a pixel at depth z; its response is

    f = d(x + a f/z) - d(x + b f/z),    d(q) = clip(depth(q) - z, +-0.7), and 1 off the person.

Nothing but the person's own pixels counts: neither the room nor somebody beside them changes a response.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float32, UInt16

CLIP, OFF = 0.7, 1.0
"""Metres: differences are clipped to this, and what is off the person counts as that much farther."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _probe(pixels, start, height, width, row, column, z):  # type: ignore[no-untyped-def]
    """Clipped metres behind ``z`` of the pixel at (row, column); :data:`OFF` off the person.

    The picture's border is 0, so that a pixel outside is as good as one on the border: no branch to guess.
    """
    row, column = min(max(row, 0), height - 1), min(max(column, 0), width - 1)
    millimetres = pixels[start + row * width + column]
    behind = np.float32(millimetres) * np.float32(1e-3) - z
    behind = min(np.float32(0.7), max(np.float32(-0.7), behind))
    return behind if millimetres > 0 else np.float32(1.0)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _moved(pixel, offset, scale):  # type: ignore[no-untyped-def]
    """The row or column ``offset`` metres from a pixel, rounded (an int of a sum above zero is a floor)."""
    return pixel + int(offset * scale + np.float32(4096.5)) - 4096


@njit(cache=True, nogil=True, error_model="numpy")
def response(pixels, start, height, width, row, column, z, x, y, feature):  # type: ignore[no-untyped-def]
    """The response of one (4,) feature at one pixel, float32.

    Args:
        pixels: (N,) uint16 millimetres of pictures one after another, 0 off the person and on the border.
        start: where this picture begins.
        z: metres, the depth at the pixel.
        x, y: pixels that a metre at that depth spans, across and down.
        feature: (4,) metres right and down of the first and of the second offset.
    """
    first = _probe(pixels, start, height, width, _moved(row, feature[1], y), _moved(column, feature[0], x), z)
    second = _probe(
        pixels, start, height, width, _moved(row, feature[3], y), _moved(column, feature[2], x), z
    )
    return first - second


@njit(cache=True, nogil=True, error_model="numpy")
def find_leaves(  # type: ignore[no-untyped-def]
    pixels, height, width, rows, columns, across, down, features, roots, feature, threshold, child, out
):
    """The leaf that every pixel reaches in every tree.

    Args:
        roots: (T,) the first node of every tree; feature, threshold, child: (n,) of all nodes. ``child`` is
            the node where f < threshold, the next node is the other; or -1 - leaf.
        out: (M, T) int32 receives the leaves, -1 where a pixel is off the person.
    """
    for i in range(len(rows)):
        row, column = rows[i], columns[i]
        if pixels[row * width + column] == 0:
            out[i] = -1
            continue
        z = np.float32(pixels[row * width + column]) * np.float32(1e-3)
        x, y = np.float32(across) / z, np.float32(down) / z
        for t in range(len(roots)):
            node = roots[t]
            while child[node] >= 0:
                value = response(pixels, 0, height, width, row, column, z, x, y, features[feature[node]])
                node = child[node] + (value >= threshold[node])
            out[i, t] = -1 - child[node]


@njit(cache=True, nogil=True, error_model="numpy")
def mean_shares(shares, leaves, out):  # type: ignore[no-untyped-def]
    """(M, K) the mean, over trees, of the (leaves, K) uint8 shares, to a sum of one; 0 off the person."""
    for i in range(len(leaves)):
        out[i] = 0.0
        if leaves[i, 0] < 0:
            continue
        total = np.float32(0.0)
        for t in range(leaves.shape[1]):
            for k in range(shares.shape[1]):
                out[i, k] += shares[leaves[i, t], k]
                total += np.float32(shares[leaves[i, t], k])
        for k in range(shares.shape[1]):
            out[i, k] /= total


def random_features(count: int, dice: np.random.Generator) -> Float32:
    """(count, 4) offsets in metres: near ones as often as far ones; the second is none in four of ten."""
    radius = 0.02 * (45.0 ** dice.random((count, 2)))
    angle = dice.uniform(0.0, 2.0 * np.pi, (count, 2))
    radius[dice.random(count) < 0.4, 1] = 0.0
    offsets = np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)
    return offsets.reshape(count, 4).astype(np.float32)


def millimetres(z: AnyArray) -> UInt16:
    """(h + 2, w + 2) uint16 millimetres of an image of (h, w) metres, with a border of 0."""
    out = np.zeros((z.shape[0] + 2, z.shape[1] + 2), np.uint16)
    out[1:-1, 1:-1] = np.minimum(np.rint(z * 1e3), 65535.0)
    return out
