"""Sphere tracing of the body surface, sixteen rays at a time (Hart 1996, "Sphere tracing").

Each ray is a lane of the vector instructions. The loops over lanes have no branches, so that the compiler can
vectorise them. Their arithmetic is + - * / and square roots in a fixed order. The result is therefore the
same on every machine with IEEE doubles, whatever its vector width.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit

SIDE = 4
"""Side of a tile in pixels. The rays of a tile are traced together. Their number is a multiple of all vector
widths."""
LANES = SIDE * SIDE
"""Number of rays in a tile."""
_MAX_STEPS = 64
"""Maximum number of steps of a ray. Grazing rays need the most."""
_HIT_DISTANCE_M = 5e-4
"""Distance in metres from the surface at which a ray hits it. It is less than a sensor's depth step."""
_STEP_SAFETY = 1.4
"""Safety factor for skipping primitives.

A distance may shrink faster than the ray advances by this factor, because distances of ellipsoids are
first-order approximations."""
_FAR = 1e9
"""Initial distance in metres, before a primitive is evaluated. It is larger than any room."""

X, Y, LENGTH, END, DEPTH, MET, _WHOLE, _PART, _LEAST, _NEAREST_HIT, _APART = range(0, 11 * LANES, LANES)
"""Offsets of the rows in the array of lanes. The first rows are the input: the rays' x/z and y/z, their
lengths per unit of depth, and the depths in metres at which they end. The next rows are the output: the
depths in metres that were reached, and the primitives that were hit, or -1. The other rows are scratch."""
LANES_SIZE = 11 * LANES
"""Number of entries of the array of lanes: eleven rows of lanes."""


@njit(cache=True, nogil=True, error_model="numpy")
def sphere_trace(
    shape: Float, kind: Int, group: Int, near_by: Int, clear: Float, lanes: Float, near: float,
    blend: Float, between: float,
) -> None:  # fmt: skip
    """Traces sixteen rays to the body surface.

    Args:
        near_by: indices of the primitives that the rays can hit, ordered by group.
        clear: (P,) scratch memory.
        lanes: (LANES_SIZE,) input: rays, lengths and ends; output: depths reached and primitives hit.
        near: depth in metres at which the rays start.
        blend, between: widths in metres of the smooth unions within each group and between groups.
    """
    clear[: len(near_by)] = 0.0
    for k in range(LANES):
        lanes[DEPTH + k], lanes[MET + k] = near, -1.0
    longest = _greatest(lanes, LENGTH, 1.0)
    for _ in range(_MAX_STEPS):
        travelled = _STEP_SAFETY * (_greatest(lanes, DEPTH, 1.0) - near) * longest
        _distances(shape, kind, group, near_by, clear, travelled, lanes, blend, between)
        if _advance_rays(lanes) == 0:
            return


@njit(cache=True, nogil=True, error_model="numpy")
def _advance_rays(lanes: Float) -> int:
    """Advances each active ray by its distance to the body. Returns the number of rays that are still
    active."""
    active = 0
    for k in range(LANES):
        if lanes[MET + k] >= 0.0 or lanes[DEPTH + k] >= lanes[END + k]:
            continue
        lanes[DEPTH + k] += lanes[_WHOLE + k] / lanes[LENGTH + k]
        if lanes[DEPTH + k] >= lanes[END + k]:
            continue
        if lanes[_WHOLE + k] < _HIT_DISTANCE_M:
            lanes[MET + k] = lanes[_NEAREST_HIT + k]
        else:
            active += 1
    return active


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _distances(
    shape: Float, kind: Int, group: Int, near_by: Int, clear: Float, travelled: float, lanes: Float,
    blend: Float, between: float,
) -> None:  # fmt: skip
    """Computes the signed distances in metres of all rays to the smooth union, and the nearest primitives.

    The union is the polynomial one, min(a, b) - h^2 k / 4 with h = max(k - |a - b|, 0) / k. It has an effect
    only if two surfaces are closer than k, so distant primitives can be skipped. ``clear`` contains, for each
    primitive, a depth up to which it is far from all rays. A primitive is skipped until a ray has
    ``travelled`` past this depth.
    """
    for k in range(LANES):
        lanes[_WHOLE + k], lanes[_PART + k], lanes[_LEAST + k], lanes[_NEAREST_HIT + k] = (
            _FAR,
            _FAR,
            _FAR,
            -1.0,
        )
    current, bound = -1, _FAR
    for n in range(len(near_by)):
        i = near_by[n]
        if group[i] != current:
            _close_group(lanes, between)
            current = group[i]
        if clear[n] - travelled > bound + blend[current] + between:
            continue
        if kind[i] == 0:
            _taper_distances(shape, i, lanes)
        else:
            _ellipsoid_distances(shape, i, lanes)
        clear[n] = travelled - _greatest(lanes, _APART, -1.0)
        _merge_primitive(lanes, blend[current], float(i))
        bound = _greatest(lanes, _LEAST, 1.0)
    _close_group(lanes, between)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _greatest(lanes: Float, row: int, sign: float) -> float:
    """Returns the largest value of a row of lanes, after multiplying the row by ``sign``."""
    most = sign * lanes[row]
    for k in range(LANES):
        value = sign * lanes[row + k]
        most = value if value > most else most
    return most


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _close_group(lanes: Float, width: float) -> None:
    """Merges a complete group with the groups before it, by a smooth union of ``width`` metres."""
    inverse, quarter = 1.0 / width, 0.25 * width
    for k in range(LANES):
        a, b = lanes[_WHOLE + k], lanes[_PART + k]
        d = a - b
        h = 1.0 - abs(d) * inverse
        h = 0.0 if h < 0.0 else h
        lanes[_WHOLE + k] = (a if d < 0.0 else b) - h * h * quarter
        lanes[_PART + k] = _FAR


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _merge_primitive(lanes: Float, width: float, i: float) -> None:
    """Merges the distances of primitive ``i`` into its group.

    Records the rays to which it is the nearest primitive.
    """
    inverse, quarter = 1.0 / width, 0.25 * width
    for k in range(LANES):
        a, b, so_far = lanes[_PART + k], lanes[_APART + k], lanes[_LEAST + k]
        d = a - b
        h = 1.0 - abs(d) * inverse
        h = 0.0 if h < 0.0 else h
        lanes[_PART + k] = (a if d < 0.0 else b) - h * h * quarter
        lanes[_NEAREST_HIT + k] = i if b < so_far else lanes[_NEAREST_HIT + k]
        lanes[_LEAST + k] = b if b < so_far else so_far


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _taper_distances(s: Float, i: int, lanes: Float) -> None:
    """Computes distances to a tapered capsule with a parabolic bulge half-way."""
    ax, ay, az, bx, by, bz = s[i, 0], s[i, 1], s[i, 2], s[i, 3], s[i, 4], s[i, 5]
    inverse, ra, grow, bulge = s[i, 6], s[i, 7], s[i, 8], 4.0 * s[i, 9]
    for k in range(LANES):
        z = lanes[DEPTH + k]
        px, py, pz = lanes[X + k] * z - ax, lanes[Y + k] * z - ay, z - az
        t = (px * bx + py * by + pz * bz) * inverse
        t = 0.0 if t < 0.0 else t
        t = 1.0 if t > 1.0 else t
        dx, dy, dz = px - t * bx, py - t * by, pz - t * bz
        lanes[_APART + k] = np.sqrt(dx * dx + dy * dy + dz * dz) - (ra + t * grow + bulge * t * (1.0 - t))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _ellipsoid_distances(s: Float, i: int, lanes: Float) -> None:
    """Computes first-order distances to an ellipsoid, |q| (|q| - 1) / |q'|.

    q and q' are the vectors from the centre, scaled by 1/r and 1/r^2 with the half lengths r.
    """
    ax, ay, az, u, v, w = s[i, 0], s[i, 1], s[i, 2], s[i, 12], s[i, 13], s[i, 14]
    a, b, c, d, e, f, g, h, j = (
        s[i, 3],
        s[i, 4],
        s[i, 5],
        s[i, 6],
        s[i, 7],
        s[i, 8],
        s[i, 9],
        s[i, 10],
        s[i, 11],
    )
    for k in range(LANES):
        z = lanes[DEPTH + k]
        px, py, pz = lanes[X + k] * z - ax, lanes[Y + k] * z - ay, z - az
        qx, qy, qz = px * a + py * b + pz * c, px * d + py * e + pz * f, px * g + py * h + pz * j
        k0 = np.sqrt(qx * qx + qy * qy + qz * qz)
        wx, wy, wz = qx * u, qy * v, qz * w
        k1 = np.sqrt(wx * wx + wy * wy + wz * wz) + 1e-12
        lanes[_APART + k] = k0 * (k0 - 1.0) / k1
