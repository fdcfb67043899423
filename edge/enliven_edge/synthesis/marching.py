"""Sphere tracing of the flesh, sixteen rays at a time (Hart 1996, "Sphere tracing").

The loops over lanes have no branches, so that the compiler turns them into vector instructions; their
arithmetic is + - * / and square roots in a fixed order, so that the result is the same on every machine with
IEEE doubles, however wide its vectors.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float, Int

SIDE = 4
LANES = SIDE * SIDE
"""Rays that go together: a tile of 4 x 4 pixels."""
_STEPS = 64
_CLOSE = 5e-4
"""Metres from the surface at which a ray has arrived."""
_WARINESS = 1.4
"""The ellipsoids' distances are of first order: one may shrink by this much faster than the ray goes."""
_FAR = 1e9


Lanes = tuple[Float, ...]
"""Rows of sixteen: rays x/z, y/z, their lengths per depth, depths (m) at which they end, depths (m) reached,
primitives met (-1: none); and scratch: union, union of the group, least distance, its primitive, distance."""


@njit(cache=True, nogil=True)
def empty_lanes() -> Lanes:
    """The rows that :func:`march` works on."""
    e = np.empty((11, LANES))
    return e[0], e[1], e[2], e[3], e[4], e[5], e[6], e[7], e[8], e[9], e[10]


@njit(cache=True, nogil=True, error_model="numpy")
def march(
    shape: Float, kind: Int, group: Int, near_by: Int, clear: Float, lanes: Lanes, near: float,
    blend: Float, between: float,
) -> None:  # fmt: skip
    """Carry sixteen rays to the body.

    Args:
        near_by: the primitives that they can meet, ordered by group.
        clear: (P,) scratch.
        lanes: rays, lengths and ends in; depths reached and primitives met out.
        near: depth (m) before which nothing is.
        blend, between: metres, widths of the smooth unions within each group and between groups.
    """
    _, _, length, end, depth, met, whole, _, _, nearest, _ = lanes
    clear[: len(near_by)] = 0.0
    depth[:], met[:] = near, -1.0
    longest = _greatest(length, 1.0)
    for _ in range(_STEPS):
        travelled = _WARINESS * (_greatest(depth, 1.0) - near) * longest
        _distances(shape, kind, group, near_by, clear, travelled, lanes, blend, between)
        active = 0
        for k in range(LANES):
            if met[k] < 0.0 and depth[k] < end[k]:
                depth[k] += whole[k] / length[k]
                if depth[k] < end[k]:
                    active += whole[k] >= _CLOSE
                    met[k] = nearest[k] if whole[k] < _CLOSE else -1.0
        if active == 0:
            return


@njit(cache=True, nogil=True, error_model="numpy")
def _distances(
    shape: Float, kind: Int, group: Int, near_by: Int, clear: Float, travelled: float, lanes: Lanes,
    blend: Float, between: float,
) -> None:  # fmt: skip
    """Signed distances (m) to the smooth union, and the nearest primitives, of all rays.

    The union is the polynomial one, min(a, b) - h^2 k / 4 with h = max(k - |a - b|, 0) / k: it acts only
    where two surfaces are nearer to each other than k, so leaving out far primitives changes nothing. One is
    left out while no ray has ``travelled`` beyond ``clear``, up to where all found it far.
    """
    rx, ry, _, _, depth, _, whole, part, least, nearest, apart = lanes
    for k in range(LANES):
        whole[k], part[k], least[k], nearest[k] = _FAR, _FAR, _FAR, -1.0
    current, bound = -1, _FAR
    for n in range(len(near_by)):
        i = near_by[n]
        if group[i] != current:
            _unite(whole, part, between)
            part[:] = _FAR
            current = group[i]
        if clear[n] - travelled > bound + blend[current] + between:
            continue
        if kind[i] == 0:
            _taper(shape, i, rx, ry, depth, apart)
        else:
            _ellipsoid(shape, i, rx, ry, depth, apart)
        clear[n] = travelled - _greatest(apart, -1.0)
        _add(part, apart, blend[current], least, nearest, float(i))
        bound = _greatest(least, 1.0)
    _unite(whole, part, between)


@njit(cache=True, nogil=True, error_model="numpy")
def _greatest(values: Float, sign: float) -> float:
    """The greatest of the values times ``sign``."""
    most = sign * values[0]
    for k in range(LANES):
        value = sign * values[k]
        most = value if value > most else most
    return most


@njit(cache=True, nogil=True, error_model="numpy")
def _unite(whole: Float, part: Float, width: float) -> None:
    """``whole`` becomes the smooth minimum of both over ``width`` metres."""
    inverse, quarter = 1.0 / width, 0.25 * width
    for k in range(LANES):
        a, b = whole[k], part[k]
        d = a - b
        h = 1.0 - abs(d) * inverse
        h = 0.0 if h < 0.0 else h
        whole[k] = (a if d < 0.0 else b) - h * h * quarter


@njit(cache=True, nogil=True, error_model="numpy")
def _add(part: Float, apart: Float, width: float, least: Float, nearest: Float, i: float) -> None:
    """:func:`_unite` the distances of primitive ``i`` into a group, and note where it is the nearest."""
    inverse, quarter = 1.0 / width, 0.25 * width
    for k in range(LANES):
        a, b, so_far = part[k], apart[k], least[k]
        d = a - b
        h = 1.0 - abs(d) * inverse
        h = 0.0 if h < 0.0 else h
        part[k] = (a if d < 0.0 else b) - h * h * quarter
        nearest[k] = i if b < so_far else nearest[k]
        least[k] = b if b < so_far else so_far


@njit(cache=True, nogil=True, error_model="numpy")
def _taper(s: Float, i: int, rx: Float, ry: Float, depth: Float, out: Float) -> None:
    """Distances to a capsule whose radius changes linearly, with a parabolic bulge half-way."""
    ax, ay, az, bx, by, bz = s[i, 0], s[i, 1], s[i, 2], s[i, 3], s[i, 4], s[i, 5]
    inverse, ra, grow, bulge = s[i, 6], s[i, 7], s[i, 8], 4.0 * s[i, 9]
    for k in range(LANES):
        z = depth[k]
        px, py, pz = rx[k] * z - ax, ry[k] * z - ay, z - az
        t = (px * bx + py * by + pz * bz) * inverse
        t = 0.0 if t < 0.0 else t
        t = 1.0 if t > 1.0 else t
        dx, dy, dz = px - t * bx, py - t * by, pz - t * bz
        out[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - (ra + t * grow + bulge * t * (1.0 - t))


@njit(cache=True, nogil=True, error_model="numpy")
def _ellipsoid(s: Float, i: int, rx: Float, ry: Float, depth: Float, out: Float) -> None:
    """First-order distances to an ellipsoid, |q| (|q| - 1) / |q'| with q and q' scaled by 1/r and 1/r^2."""
    ax, ay, az, u, v, w = s[i, 0], s[i, 1], s[i, 2], s[i, 12], s[i, 13], s[i, 14]
    a, b, c, d, e, f, g, h, j = s[i, 3], s[i, 4], s[i, 5], s[i, 6], s[i, 7], s[i, 8], s[i, 9], s[i, 10], s[i, 11]
    for k in range(LANES):
        z = depth[k]
        px, py, pz = rx[k] * z - ax, ry[k] * z - ay, z - az
        qx, qy, qz = px * a + py * b + pz * c, px * d + py * e + pz * f, px * g + py * h + pz * j
        k0 = np.sqrt(qx * qx + qy * qy + qz * qz)
        wx, wy, wz = qx * u, qy * v, qz * w
        k1 = np.sqrt(wx * wx + wy * wy + wz * wz) + 1e-12
        out[k] = k0 * (k0 - 1.0) / k1
