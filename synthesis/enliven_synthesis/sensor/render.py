"""Renders the depth of a performer's body over the depth of an empty room.

Each 4 x 4 tile of the image has a list of the few primitives that can be visible in it. Its rays are tested
only against these.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, UInt8
from enliven.camera import Intrinsics, pixel_rays
from enliven.kernels import njit
from enliven_synthesis.body.body_sdf import BLEND_BETWEEN_GROUPS_M, GROUP_BLEND_WIDTHS_M, PIECES, BodySdf
from enliven_synthesis.body.sphere_tracing import (
    DEPTH,
    END,
    LANES,
    LANES_SIZE,
    LENGTH,
    MET,
    SIDE,
    X,
    Y,
    sphere_trace,
)

_BLEND = np.array(GROUP_BLEND_WIDTHS_M)
"""(6,) widths in metres of the smooth unions within the groups, in the form that compiled kernels accept."""
_REACH = np.array([GROUP_BLEND_WIDTHS_M[piece.group] + 0.5 * BLEND_BETWEEN_GROUPS_M for piece in PIECES])
"""(P,) maximum distance in metres at which each primitive still influences the smooth union."""
_MIN_DISTANCE_M = 0.15
"""Minimum distance in metres from the camera at which bodies are drawn. Sensors do not measure nearer
surfaces."""


class DepthRenderer:
    """Renders bodies into the depth image of one camera. Caches arrays that depend only on the camera."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = intrinsics
        self.ray = pixel_rays(intrinsics)
        self._tiles = self._tile_bounds()
        edges = self._tiles[:, :, 2].max(1)
        self._bands = np.stack([self._tiles[:, :, 1].min(1) - edges, self._tiles[:, :, 1].max(1) + edges], 1)
        rows, columns = self._tiles.shape[:2]
        self._lists = np.zeros((rows, columns, len(PIECES)), np.int64)
        self._spans = np.zeros((rows, columns, 2))
        self._counts = np.zeros((rows, columns), np.int64)

    def _tile_bounds(self) -> Float:
        """Returns (R, C, 3): centre (x/z, y/z) and radius of every tile in the plane at depth 1."""
        height, width = self.ray.shape[:2]
        # A tile that crosses the image border repeats the last pixels. This does not change the box or the
        # radius of the tile.
        whole = np.pad(self.ray, ((0, -height % SIDE), (0, -width % SIDE), (0, 0)), mode="edge")
        blocks = whole.reshape(len(whole) // SIDE, SIDE, -1, SIDE, 2)
        centre = (blocks.min((1, 3), keepdims=True) + blocks.max((1, 3), keepdims=True)) / 2
        squared_offsets = np.square(blocks - centre)
        radius = np.sqrt((squared_offsets[..., 0] + squared_offsets[..., 1]).max((1, 3)))
        return np.concatenate([centre[:, 0, :, 0], radius[..., None]], -1)

    def draw(self, sdf: BodySdf, depth: Float, material: UInt8) -> None:
        """Draws a body in place over ``depth`` (H, W) in metres and ``material`` (H, W).

        Depth is infinite without a surface.
        """
        _sort_into_tiles(sdf.hull, _REACH, self._tiles, self._bands, self._lists, self._spans, self._counts)
        _trace_tiles(
            sdf.shape, sdf.kind, sdf.group, sdf.material, self._lists, self._spans, self._counts,
            self.ray, _BLEND, BLEND_BETWEEN_GROUPS_M, depth, material,
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _sort_into_tiles(
    hull: Float, reach: Float, tiles: Float, bands: Float, lists: Int, spans: Float, counts: Int
) -> None:
    """Writes the primitives that may be visible in each tile, and the depth range in metres of all of
    them.
    """
    counts[:] = 0
    spans[:, :, 0], spans[:, :, 1] = np.inf, 0.0
    for i in range(len(hull)):
        radius = hull[i, 6] + reach[i]
        last = max(hull[i, 2], hull[i, 5]) + radius
        first = max(min(hull[i, 2], hull[i, 5]) - radius, _MIN_DISTANCE_M)
        if last <= first:
            continue
        low = min(hull[i, 1], hull[i, 4]) - radius
        high = max(hull[i, 1], hull[i, 4]) + radius
        for r in range(tiles.shape[0]):
            if low > max(bands[r, 1] * first, bands[r, 1] * last) or high < min(
                bands[r, 0] * first, bands[r, 0] * last
            ):
                continue
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
    """Returns the distance in the plane at depth 1 from (x, y) to the projected axis of a hull.

    It is 0 if the hull reaches behind the camera, and inf if it is clearly more than ``enough``.
    """
    if hull[i, 2] < _MIN_DISTANCE_M or hull[i, 5] < _MIN_DISTANCE_M:
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
def _trace_tiles(
    shape: Float, kind: Int, group: Int, stuff: Int, lists: Int, spans: Float, counts: Int, ray: Float,
    blend: Float, between: float, depth: Float, material: UInt8,
) -> None:  # fmt: skip
    """Traces the rays of every tile that has primitives.

    Writes hits that are nearer than the current depth.
    """
    clear, lanes = np.empty(len(shape)), np.empty(LANES_SIZE)
    for r in range(lists.shape[0]):
        for c in range(lists.shape[1]):
            if counts[r, c] == 0:
                continue
            near_by = lists[r, c, : counts[r, c]]
            _set_tile_rays(lanes, ray, depth, r * SIDE, c * SIDE, spans[r, c, 1])
            sphere_trace(shape, kind, group, near_by, clear, lanes, spans[r, c, 0], blend, between)
            for k in range(LANES):
                if lanes[MET + k] >= 0.0:
                    v, u = r * SIDE + k // SIDE, c * SIDE + k % SIDE
                    depth[v, u] = lanes[DEPTH + k]
                    material[v, u] = stuff[int(lanes[MET + k])]


@njit(cache=True, nogil=True)
def _set_tile_rays(lanes: Float, ray: Float, depth: Float, top: int, left: int, far: float) -> None:
    """Sets the rays of a tile, their lengths and their end depths. Rays outside the image end immediately."""
    height, width = depth.shape
    for k in range(LANES):
        v, u = top + k // SIDE, left + k % SIDE
        inside = v < height and u < width
        v, u = min(v, height - 1), min(u, width - 1)
        x, y = ray[v, u, 0], ray[v, u, 1]
        lanes[X + k], lanes[Y + k], lanes[LENGTH + k] = x, y, np.sqrt(x * x + y * y + 1.0)
        lanes[END + k] = min(far, depth[v, u]) if inside else 0.0
