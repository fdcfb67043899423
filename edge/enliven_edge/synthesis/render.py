"""Depth of the performer's flesh by sphere tracing, over the depth of an empty room.

Each 8 x 8 tile of the image keeps the few primitives that can touch it; a pixel marches only through those
(Hart 1996, "Sphere tracing"). The arithmetic is + - * / and square roots in a fixed order, so that the
picture is the same on every machine with IEEE doubles.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float, Int, UInt8
from enliven.camera import Intrinsics, rays
from enliven_edge.synthesis.flesh import BETWEEN, BLEND, Flesh

TILE = 8
"""Pixels of a tile's side."""
_BLEND = np.array(BLEND)
_MARGIN = max(*BLEND, BETWEEN)
_NEAR = 0.15
"""Metres: nothing nearer to the camera is drawn."""
_STEPS = 64
_CLOSE = 2e-4
"""Metres from the surface at which a ray has arrived."""


class Renderer:
    """Draws figures into the depth image of one camera; keeps what depends on the camera only."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = intrinsics
        self.ray = rays(intrinsics)
        self._tiles = self._tile_bounds()

    def _tile_bounds(self) -> Float:
        """(R, C, 3) centre (x/z, y/z) and radius of every tile, in the plane at depth 1."""
        height, width = self.intrinsics.height, self.intrinsics.width
        rows, columns = -(-height // TILE), -(-width // TILE)
        bounds = np.zeros((rows, columns, 3))
        for r in range(rows):
            for c in range(columns):
                block = self.ray[r * TILE : (r + 1) * TILE, c * TILE : (c + 1) * TILE].reshape(-1, 2)
                centre = (block.min(0) + block.max(0)) / 2
                apart = block - centre
                bounds[r, c] = *centre, np.sqrt((apart[:, 0] ** 2 + apart[:, 1] ** 2).max())
        return bounds

    def draw(self, flesh: Flesh, depth: Float, material: UInt8) -> None:
        """Draw over ``depth`` (H, W) float64 metres (inf: nothing there) and ``material`` (H, W), in place."""
        _draw(
            flesh.shape, flesh.kind, flesh.group, flesh.material, flesh.hull,
            self._tiles, self.ray, _BLEND, BETWEEN, _MARGIN, depth, material,
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _draw(
    shape: Float, kind: Int, group: Int, stuff: Int, hull: Float, tiles: Float, ray: Float,
    blend: Float, between: float, margin: float, depth: Float, material: UInt8,
) -> None:  # fmt: skip
    """Every tile: collect its primitives, then march its pixels."""
    height, width = depth.shape
    near_by = np.empty(len(shape), np.int64)
    for r in range(tiles.shape[0]):
        for c in range(tiles.shape[1]):
            count, near, far = _collect(hull, tiles[r, c], margin, near_by)
            if count == 0:
                continue
            for v in range(r * TILE, min((r + 1) * TILE, height)):
                for u in range(c * TILE, min((c + 1) * TILE, width)):
                    end = min(far, depth[v, u])
                    z, nearest = _march(
                        shape, kind, group, near_by, count, ray[v, u, 0], ray[v, u, 1], near, end, blend, between
                    )
                    if nearest >= 0:
                        depth[v, u] = z
                        material[v, u] = stuff[nearest]


@njit(cache=True, nogil=True)
def _collect(hull: Float, tile: Float, margin: float, near_by: Int) -> tuple[int, float, float]:
    """The primitives whose hull may show in a tile, and the depths (m) between which they all lie."""
    count, near, far = 0, np.inf, 0.0
    for i in range(len(hull)):
        radius = hull[i, 6] + margin
        first = min(hull[i, 2], hull[i, 5]) - radius
        if first < _NEAR:
            first = _NEAR
        last = max(hull[i, 2], hull[i, 5]) + radius
        if last <= first:
            continue
        if _hull_distance(hull[i], tile[0], tile[1]) > radius / first + tile[2] * 1.0001:
            continue
        near_by[count] = i
        count += 1
        near, far = min(near, first), max(far, last)
    return count, near, far


@njit(cache=True, nogil=True)
def _hull_distance(hull: Float, x: float, y: float) -> float:
    """Distance in the plane at depth 1 from (x, y) to the projected core of a hull; 0 if behind the camera."""
    if hull[2] < _NEAR or hull[5] < _NEAR:
        return 0.0
    ax, ay = hull[0] / hull[2], hull[1] / hull[2]
    bx, by = hull[3] / hull[5] - ax, hull[4] / hull[5] - ay
    px, py = x - ax, y - ay
    length2 = bx * bx + by * by
    t = 0.0
    if length2 > 0.0:
        t = min(max((px * bx + py * by) / length2, 0.0), 1.0)
    dx, dy = px - t * bx, py - t * by
    return np.sqrt(dx * dx + dy * dy)


@njit(cache=True, nogil=True)
def _march(
    shape: Float, kind: Int, group: Int, near_by: Int, count: int, rx: float, ry: float,
    near: float, far: float, blend: Float, between: float,
) -> tuple[float, int]:  # fmt: skip
    """Depth (m) at which the ray (rx, ry, 1) meets the body before ``far``, and what it met (-1: nothing)."""
    per_depth = 1.0 / np.sqrt(rx * rx + ry * ry + 1.0)
    z = near
    for _ in range(_STEPS):
        distance, nearest = _field(shape, kind, group, near_by, count, rx * z, ry * z, z, blend, between)
        if distance < _CLOSE:
            return z, nearest
        z += distance * per_depth
        if z >= far:
            return z, -1
    return z, -1


@njit(cache=True, nogil=True)
def _field(
    shape: Float, kind: Int, group: Int, near_by: Int, count: int, x: float, y: float, z: float,
    blend: Float, between: float,
) -> tuple[float, int]:  # fmt: skip
    """Signed distance (m) to the smooth union of some primitives, and the nearest of them.

    The union is the polynomial one, min(a, b) - h^2 k / 4 with h = max(k - |a - b|, 0) / k: it acts only
    where two surfaces are nearer to each other than k, so leaving out far primitives changes nothing.
    """
    whole, part, smallest, nearest, current = 1e9, 1e9, 1e9, -1, -1
    for n in range(count):
        i = near_by[n]
        if group[i] != current:
            whole = _united(whole, part, between)
            part, current = 1e9, group[i]
        d = _taper(shape[i], x, y, z) if kind[i] == 0 else _ellipsoid(shape[i], x, y, z)
        if d < smallest:
            smallest, nearest = d, i
        part = _united(part, d, blend[current])
    return _united(whole, part, between), nearest


@njit(cache=True, nogil=True)
def _united(a: float, b: float, k: float) -> float:
    """The smooth minimum of two distances over the width k."""
    apart = a - b if a > b else b - a
    least = b if a > b else a
    if apart >= k:
        return least
    h = (k - apart) / k
    return least - h * h * k * 0.25


@njit(cache=True, nogil=True)
def _taper(s: Float, x: float, y: float, z: float) -> float:
    """Distance to a capsule whose radius changes linearly, with a parabolic bulge half-way."""
    px, py, pz = x - s[0], y - s[1], z - s[2]
    t = (px * s[3] + py * s[4] + pz * s[5]) * s[6]
    t = 0.0 if t < 0.0 else 1.0 if t > 1.0 else t
    dx, dy, dz = px - t * s[3], py - t * s[4], pz - t * s[5]
    return np.sqrt(dx * dx + dy * dy + dz * dz) - (s[7] + t * s[8] + 4.0 * t * (1.0 - t) * s[9])


@njit(cache=True, nogil=True)
def _ellipsoid(s: Float, x: float, y: float, z: float) -> float:
    """First-order distance to an ellipsoid, |p| (|p| - 1) / |p'| with p and p' scaled by r and r^2."""
    px, py, pz = x - s[0], y - s[1], z - s[2]
    qx = (px * s[3] + py * s[4] + pz * s[5]) / s[12]
    qy = (px * s[6] + py * s[7] + pz * s[8]) / s[13]
    qz = (px * s[9] + py * s[10] + pz * s[11]) / s[14]
    k0 = np.sqrt(qx * qx + qy * qy + qz * qz)
    wx, wy, wz = qx / s[12], qy / s[13], qz / s[14]
    k1 = np.sqrt(wx * wx + wy * wy + wz * wz)
    if k1 < 1e-9:
        return -min(s[12], s[13], s[14])
    return k0 * (k0 - 1.0) / k1
