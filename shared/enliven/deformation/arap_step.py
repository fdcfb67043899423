"""Small kernels of a frame: corrections onto positions, positions out."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def moved(frames, z, shift, eliminated):  # type: ignore[no-untyped-def]
    """Positions in ``frames`` (16 V,) += the correction ``z`` (4 V,), in elimination order, + ``shift``."""
    for i in range(len(frames) // 16):
        at = 4 * eliminated[i]
        for c in range(3):
            frames[16 * i + 12 + c] += z[at + c] + shift[c]


@njit(cache=True, nogil=True)
def plain(z):  # type: ignore[no-untyped-def]
    """No correction."""
    for i in range(len(z)):
        z[i] = 0.0


@njit(cache=True, nogil=True)
def give(frames, z, shift, eliminated, place_of, centre, out):  # type: ignore[no-untyped-def]
    """``out`` (V, 3) <- the corrected positions, in the mesh's order."""
    for v in range(len(place_of)):
        i = place_of[v]
        at = 4 * eliminated[i]
        for c in range(3):
            out[v, c] = frames[16 * i + 12 + c] + z[at + c] + shift[c] + centre[c]
