"""Depth differences (Shotton et al. 2011, equation 1) and the walk down a tree, compiled.

A feature is two offsets (a, b) in metres on the plane of a pixel at depth z; its response is

    f = d(x + a f/z) - d(x + b f/z),    d(q) = clip(depth(q) - z, +-0.7), and 1 off the person.

Nothing but the person's own pixels counts: neither the room nor somebody beside them changes a response.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float32, UInt16

_ABREAST = 8
"""Pixels that walk down a tree side by side: each step waits for memory, and the others go on meanwhile."""
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
def find_leaves(pixels, height, width, rows, columns, across, down, turn, roots, nodes, out):  # type: ignore[no-untyped-def]
    """The leaf that every pixel reaches in every tree.

    Args:
        turn: (cosine, sine) float32 by which the features are turned, see :meth:`PartForest.leaves`.
        roots: (T,) the first node of every tree.
        nodes: (n, 8) float32, see :func:`packed_nodes`.
        out: (M, T) int32 receives the leaves, -1 where a pixel is off the person.
    """
    children = nodes.view(np.int32)
    cosine, sine = turn
    at, span = np.empty(_ABREAST, np.int64), np.empty((_ABREAST, 3), np.float32)
    for first in range(0, len(rows), _ABREAST):
        many = min(_ABREAST, len(rows) - first)
        for j in range(many):
            pixel = pixels[rows[first + j] * width + columns[first + j]]
            span[j, 2] = np.float32(max(pixel, 1)) * np.float32(1e-3)
            span[j, 0], span[j, 1] = np.float32(across) / span[j, 2], np.float32(down) / span[j, 2]
        for t in range(len(roots)):
            at[:] = roots[t]
            walking = True
            while walking:
                walking = False
                for j in range(many):
                    node = at[j]
                    row, column = rows[first + j], columns[first + j]
                    x, y, z = span[j, 0], span[j, 1], span[j, 2]
                    a, b, c, d = nodes[node, 0], nodes[node, 1], nodes[node, 2], nodes[node, 3]
                    right, low = (
                        _moved(column, a * cosine - b * sine, x),
                        _moved(row, a * sine + b * cosine, y),
                    )
                    response = _probe(pixels, 0, height, width, low, right, z)
                    right, low = (
                        _moved(column, c * cosine - d * sine, x),
                        _moved(row, c * sine + d * cosine, y),
                    )
                    response -= _probe(pixels, 0, height, width, low, right, z)
                    child = children[node, 5]
                    at[j] = child + (response >= nodes[node, 4]) if child >= 0 else node
                    walking = walking or child >= 0
            for j in range(many):
                here = pixels[rows[first + j] * width + columns[first + j]]
                out[first + j, t] = -1 - children[at[j], 5] if here > 0 else -1


def packed_nodes(features: Float32, feature: UInt16, threshold: Float32, child: AnyArray) -> Float32:
    """(n, 8) float32 all that a walk asks of a node in one place, so that a step reads memory once.

    The four numbers of the feature, the threshold, and the bits of ``child``: the node where the response is
    below the threshold, the next node is the other; or -1 - leaf.
    """
    out = np.zeros((len(child), 8), np.float32)
    out[:, :4], out[:, 4] = features[feature], threshold
    out.view(np.int32)[:, 5] = child
    return out


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
