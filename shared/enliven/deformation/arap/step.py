"""Small kernels of a frame of the ARAP solver: they correct positions, and write them to the output."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def apply_correction(frames, z, shift, eliminated):
    """Adds to the positions in ``frames`` (16 V,) the correction ``z`` (4 V,), in elimination order, and the
    translation ``shift``.
    """
    for i in range(len(frames) // 16):
        at = 4 * eliminated[i]
        for c in range(3):
            frames[16 * i + 12 + c] += z[at + c] + shift[c]


@njit(cache=True, nogil=True)
def set_zero(z):
    """Sets the correction z (4 V,) to zero."""
    for i in range(len(z)):
        z[i] = 0.0


@njit(cache=True, nogil=True)
def write_pose(frames, z, shift, eliminated, place_of, centre, out):
    """Writes the corrected positions into ``out`` (V, 3) metres, in the mesh's order."""
    for v in range(len(place_of)):
        i = place_of[v]
        at = 4 * eliminated[i]
        for c in range(3):
            out[v, c] = frames[16 * i + 12 + c] + z[at + c] + shift[c] + centre[c]


@njit(cache=True, nogil=True)
def move_positions(frames, shown, place_of, centre, before, after, turn):
    """Moves the positions in ``frames`` and ``shown`` (P, 3) with a proxy: after + turn (position - before)
    for each vertex.

    Args:
        before, after: (V, 3) metres, the mesh as moved by the proxy in the last frame, and in this frame.
        turn: (3, 3) the rotation of the offset from the proxy.
    """
    done = np.zeros(len(shown), np.bool_)
    for v in range(len(place_of)):
        i = place_of[v]
        if done[i]:
            continue
        done[i] = True
        at = 16 * i + 12
        bx, by, bz = before[v, 0] - centre[0], before[v, 1] - centre[1], before[v, 2] - centre[2]
        x, y, z = frames[at] - bx, frames[at + 1] - by, frames[at + 2] - bz
        u, k, w = shown[i, 0] - bx, shown[i, 1] - by, shown[i, 2] - bz
        for r in range(3):
            to = after[v, r] - centre[r]
            frames[at + r] = to + turn[r, 0] * x + turn[r, 1] * y + turn[r, 2] * z
            shown[i, r] = to + turn[r, 0] * u + turn[r, 1] * k + turn[r, 2] * w
