"""Depth of the performer's flesh by sphere tracing, over the depth of an empty room.

Each 4 x 4 tile of the image keeps the few primitives that can touch it; a pixel marches only through those
(Hart 1996, "Sphere tracing"). The arithmetic is + - * / and square roots in a fixed order, so that the
picture is the same on every machine with IEEE doubles.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float, Int, UInt8
from enliven.camera import Intrinsics, rays
from enliven_edge.synthesis.flesh import BETWEEN, BLEND, PIECES, Flesh

TILE = 4
"""Pixels of a tile's side."""
_BLEND = np.array(BLEND)
_REACH = np.array([BLEND[piece.group] + 0.5 * BETWEEN for piece in PIECES])
"""Metres around each primitive in which it can still pull the surface."""
_NEAR = 0.15
"""Metres: nothing nearer to the camera is drawn."""
_STEPS = 64
_WARINESS = 1.4
"""The ellipsoids' distances are of first order: one may shrink by this much faster than the ray goes."""
_CLOSE = 2e-4
"""Metres from the surface at which a ray has arrived."""


class Renderer:
    """Draws figures into the depth image of one camera; keeps what depends on the camera only."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = intrinsics
        self.ray = rays(intrinsics)
        self._tiles = self._tile_bounds()
        rows, columns = self._tiles.shape[:2]
        self._lists = np.zeros((rows, columns, len(PIECES)), np.int64)
        self._spans = np.zeros((rows, columns, 2))
        self._counts = np.zeros((rows, columns), np.int64)

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
        _sort_into_tiles(flesh.hull, _REACH, self._tiles, self._lists, self._spans, self._counts)
        _draw(
            flesh.shape, flesh.kind, flesh.group, flesh.material, self._lists, self._spans, self._counts,
            self._tiles, self.ray, _BLEND, BETWEEN, depth, material,
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _sort_into_tiles(hull: Float, reach: Float, tiles: Float, lists: Int, spans: Float, counts: Int) -> None:
    """The primitives that may show in each tile, and the depths (m) between which they all lie."""
    counts[:] = 0
    spans[:, :, 0], spans[:, :, 1] = np.inf, 0.0
    for i in range(len(hull)):
        radius = hull[i, 6] + reach[i]
        last = max(hull[i, 2], hull[i, 5]) + radius
        first = max(min(hull[i, 2], hull[i, 5]) - radius, _NEAR)
        if last <= first:
            continue
        for r in range(tiles.shape[0]):
            for c in range(tiles.shape[1]):
                span = radius / first + tiles[r, c, 2] * 1.0001
                if _hull_distance(hull, i, tiles[r, c, 0], tiles[r, c, 1], span) > span:
                    continue
                lists[r, c, counts[r, c]] = i
                counts[r, c] += 1
                spans[r, c, 0] = min(spans[r, c, 0], first)
                spans[r, c, 1] = max(spans[r, c, 1], last)


@njit(cache=True, nogil=True, forceinline=True)
def _hull_distance(hull: Float, i: int, x: float, y: float, enough: float) -> float:
    """Distance in the plane at depth 1 from (x, y) to the projected core of a hull.

    0 where the hull reaches behind the camera; inf where it is plainly more than ``enough``.
    """
    if hull[i, 2] < _NEAR or hull[i, 5] < _NEAR:
        return 0.0
    ax, ay = hull[i, 0] / hull[i, 2], hull[i, 1] / hull[i, 2]
    bx, by = hull[i, 3] / hull[i, 5] - ax, hull[i, 4] / hull[i, 5] - ay
    px, py = x - ax, y - ay
    if min(px, px - bx) > enough or max(px, px - bx) < -enough or abs(py - 0.5 * by) > enough + 0.5 * abs(by):
        return np.inf
    length2 = bx * bx + by * by
    t = 0.0
    if length2 > 0.0:
        t = min(max((px * bx + py * by) / length2, 0.0), 1.0)
    dx, dy = px - t * bx, py - t * by
    return np.sqrt(dx * dx + dy * dy)


@njit(cache=True, nogil=True)
def _draw(
    shape: Float, kind: Int, group: Int, stuff: Int, lists: Int, spans: Float, counts: Int, tiles: Float,
    ray: Float, blend: Float, between: float, depth: Float, material: UInt8,
) -> None:  # fmt: skip
    """Every tile that has primitives: march its cone, then its pixels from where the cone came near."""
    height, width = depth.shape
    clear = np.empty(len(shape))
    for r in range(lists.shape[0]):
        for c in range(lists.shape[1]):
            if counts[r, c] == 0:
                continue
            near_by = lists[r, c, : counts[r, c]]
            far = spans[r, c, 1]
            x, y, radius = tiles[r, c]
            near, _ = _march(
                shape, kind, group, near_by, clear, x, y, radius, spans[r, c, 0], far, blend, between
            )
            if near >= far:
                continue
            for v in range(r * TILE, min((r + 1) * TILE, height)):
                for u in range(c * TILE, min((c + 1) * TILE, width)):
                    x, y, end = ray[v, u, 0], ray[v, u, 1], min(far, depth[v, u])
                    z, nearest = _march(
                        shape, kind, group, near_by, clear, x, y, 0.0, near, end, blend, between
                    )
                    if nearest >= 0:
                        depth[v, u] = z
                        material[v, u] = stuff[nearest]


@njit(cache=True, nogil=True, forceinline=True)
def _march(
    shape: Float, kind: Int, group: Int, near_by: Int, clear: Float, rx: float, ry: float, radius: float,
    near: float, far: float, blend: Float, between: float,
) -> tuple[float, int]:  # fmt: skip
    """Depth (m) at which the ray (rx, ry, 1) meets the body before ``far``, and what it met (-1: nothing).

    With a ``radius`` (m at depth 1) it is a cone, which has met the body where that is as near as the cone is
    wide and a half: no ray within the cone has met anything by then.
    """
    length = np.sqrt(rx * rx + ry * ry + 1.0)
    clear[: len(near_by)] = 0.0
    z = near
    for _ in range(_STEPS):
        travelled = _WARINESS * (z - near) * length
        distance, nearest = _field(
            shape, kind, group, near_by, clear, travelled, rx * z, ry * z, z, blend, between
        )
        if distance < _CLOSE + 1.5 * radius * z:
            return z, nearest
        z += (distance - radius * z) / (length + radius)
        if z >= far:
            return z, -1
    return z, -1


@njit(cache=True, nogil=True, forceinline=True)
def _field(
    shape: Float, kind: Int, group: Int, near_by: Int, clear: Float, travelled: float,
    x: float, y: float, z: float, blend: Float, between: float,
) -> tuple[float, int]:  # fmt: skip
    """Signed distance (m) to the smooth union of some primitives, and the nearest of them.

    The union is the polynomial one, min(a, b) - h^2 k / 4 with h = max(k - |a - b|, 0) / k: it acts only
    where two surfaces are nearer to each other than k, so leaving out far primitives changes nothing. One is
    left out while the ray has not ``travelled`` beyond ``clear``, up to where it was found to be far.
    """
    whole, part, smallest, nearest, current = 1e9, 1e9, 1e9, -1, -1
    for n in range(len(near_by)):
        i = near_by[n]
        if group[i] != current:
            whole = _united(whole, part, between)
            part, current = 1e9, group[i]
        if clear[n] - travelled > smallest + blend[current] + between:
            continue
        d = _taper(shape, i, x, y, z) if kind[i] == 0 else _ellipsoid(shape, i, x, y, z)
        clear[n] = travelled + d
        if d < smallest:
            smallest, nearest = d, i
        part = _united(part, d, blend[current])
    return _united(whole, part, between), nearest


@njit(cache=True, nogil=True, forceinline=True)
def _united(a: float, b: float, k: float) -> float:
    """The smooth minimum of two distances over the width k."""
    apart = a - b if a > b else b - a
    least = b if a > b else a
    if apart >= k:
        return least
    h = (k - apart) / k
    return least - h * h * k * 0.25


@njit(cache=True, nogil=True, forceinline=True)
def _taper(s: Float, i: int, x: float, y: float, z: float) -> float:
    """Distance to a capsule whose radius changes linearly, with a parabolic bulge half-way."""
    px, py, pz = x - s[i, 0], y - s[i, 1], z - s[i, 2]
    t = (px * s[i, 3] + py * s[i, 4] + pz * s[i, 5]) * s[i, 6]
    t = 0.0 if t < 0.0 else 1.0 if t > 1.0 else t
    dx, dy, dz = px - t * s[i, 3], py - t * s[i, 4], pz - t * s[i, 5]
    return np.sqrt(dx * dx + dy * dy + dz * dz) - (s[i, 7] + t * s[i, 8] + 4.0 * t * (1.0 - t) * s[i, 9])


@njit(cache=True, nogil=True, forceinline=True)
def _ellipsoid(s: Float, i: int, x: float, y: float, z: float) -> float:
    """First-order distance to an ellipsoid, |q| (|q| - 1) / |q'| with q and q' scaled by 1/r and 1/r^2."""
    px, py, pz = x - s[i, 0], y - s[i, 1], z - s[i, 2]
    qx = px * s[i, 3] + py * s[i, 4] + pz * s[i, 5]
    qy = px * s[i, 6] + py * s[i, 7] + pz * s[i, 8]
    qz = px * s[i, 9] + py * s[i, 10] + pz * s[i, 11]
    k0 = np.sqrt(qx * qx + qy * qy + qz * qz)
    wx, wy, wz = qx * s[i, 12], qy * s[i, 13], qz * s[i, 14]
    k1 = np.sqrt(wx * wx + wy * wy + wz * wz)
    if k1 < 1e-9:
        return -1.0 / max(s[i, 12], s[i, 13], s[i, 14])
    return k0 * (k0 - 1.0) / k1
