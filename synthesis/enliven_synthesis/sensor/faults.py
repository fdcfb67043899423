"""Compiled loops for the faults of a depth image: shadows, edges, slanted surfaces, depth steps and noise."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float, UInt8, UInt16
from enliven.kernels import njit

_MIN_DEPTH_STEP = 0.035
"""Minimum depth difference between neighbouring pixels on different surfaces, as a fraction of the depth."""
_RANGE_MARGIN = 1.25
"""Surfaces beyond this multiple of the sensor's range are not measured. Otherwise noise might move them into
the range."""


@njit(cache=True, nogil=True)
def cast_shadow(depth: Float, parallax: float, shadow: AnyArray) -> None:
    """Marks in ``shadow`` the pixels with a surface occluded from the second imager or the projector.

    The second imager sees the surface at pixel u at its column u - parallax / z. The loop visits the pixels
    in the direction in which these columns increase. If the column of a pixel is not larger than all previous
    ones, a nearer surface occludes the pixel.
    """
    height, width = depth.shape
    for v in range(height):
        passed = np.inf
        for n in range(width):
            u = width - 1 - n if parallax > 0 else n
            column = u - parallax / depth[v, u]
            ahead = column if parallax > 0 else -column
            if ahead > passed:
                shadow[v, u] = True
            else:
                passed = ahead


@njit(cache=True, nogil=True)
def mark_edges(depth: Float, reach: int, zone: AnyArray) -> None:
    """Marks in ``zone`` the pixels near an edge between two surfaces.

    Near means within a square of ``reach`` pixels to each side.
    """
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            right = u + 1 < width and _is_edge(
                depth[v, max(u - 1, 0)], depth[v, u], depth[v, u + 1], depth[v, min(u + 2, width - 1)]
            )
            below = v + 1 < height and _is_edge(
                depth[max(v - 1, 0), u], depth[v, u], depth[v + 1, u], depth[min(v + 2, height - 1), u]
            )
            if right or below:
                top, left = max(v - reach + 1, 0), max(u - reach + 1, 0)
                zone[top : v + reach + below, left : u + reach + right] = True


@njit(cache=True, nogil=True, forceinline=True)
def _is_edge(before: float, here: float, there: float, beyond: float) -> bool:
    """Returns True if the depth jumps from ``here`` to ``there`` by more than the slopes of the surfaces
    explain.
    """
    jump = abs(there - here)
    if jump < _MIN_DEPTH_STEP * min(here, there):
        return False
    return jump > 3.0 * min(abs(here - before), abs(beyond - there))


@njit(cache=True, nogil=True, error_model="numpy")
def sample_surfaces(
    depth: Float, stuff: UInt8, shadow: AnyArray, zone: AnyArray, across: Float, down: Float, lateral: float,
    reach: int, blobs: Float, patches: Float, random_bytes: UInt8, losses: Float, flying: float, far: float,
    seen: Float, slant: Float,
) -> None:  # fmt: skip
    """Fills ``seen`` with the (H, W) depth in metres of the surface that each pixel measures; 0 if no light
    returns.

    Pixels near an edge measure the depth at a displaced position. If this position is in another pixel,
    ``slant`` is set to 0.
    """
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            if zone[v, u]:
                _sample_edge_pixel(
                    depth, shadow, across, down, lateral, reach, blobs, random_bytes, losses, flying, far,
                    seen, slant, v, u,
                )  # fmt: skip
            else:
                seen[v, u] = 0.0 if shadow[v, u] else depth[v, u]
            if stuff[v, u] > 0 and patches[v, u] < losses[1 + stuff[v, u]]:
                seen[v, u] = 0.0


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _sample_edge_pixel(
    depth: Float, shadow: AnyArray, across: Float, down: Float, lateral: float, reach: int, blobs: Float,
    random_bytes: UInt8, losses: Float, flying: float, far: float, seen: Float, slant: Float, v: int, u: int,
) -> None:  # fmt: skip
    """Fills one pixel near an edge.

    The pixel may sample the other side of the edge, measure nothing, or mix the depths of both sides (flying
    pixel).
    """
    height, width = depth.shape
    x = min(max(int(np.rint(u + lateral * across[v, u])), 0), width - 1)
    y = min(max(int(np.rint(v + lateral * down[v, u])), 0), height - 1)
    z = depth[y, x]
    low, high = z, z
    for q in range(max(v - reach, 0), min(v + reach + 1, height)):
        for p in range(max(u - reach, 0), min(u + reach + 1, width)):
            other = depth[q, p]
            low = other if other < low else low
            high = other if other > high else high
    behind = high - z < z - low
    if shadow[y, x] or blobs[v, u] < losses[0 if behind else 1]:
        seen[v, u] = 0.0
        return
    chance = random_bytes[v, u] / 256.0
    seen[v, u] = low + chance / flying * (min(high, far) - low) if chance < flying else z
    slant[v, u] = 0.0 if (y, x) != (v, u) else slant[v, u]


@njit(cache=True, nogil=True, error_model="numpy")
def compute_slants(depth: Float, ray: Float, pitch: Float, out: Float) -> None:
    """Fills ``out`` with (H, W) tan^2 of the angle between each pixel's ray and its surface's normal.

    The horizontal and vertical slopes are one-sided differences to the neighbour that is closer in depth. So
    edges have no effect.
    """
    height, width = depth.shape
    for v in range(height):
        above, here, below = depth[max(v - 1, 0)], depth[v], depth[min(v + 1, height - 1)]
        for u in range(1, width - 1):
            z, x, y = here[u], ray[v, u, 0], ray[v, u, 1]
            left, right, up, down = z - here[u - 1], here[u + 1] - z, z - above[u], below[u] - z
            across = left if abs(left) < abs(right) else right
            along = up if abs(up) < abs(down) else down
            # Compute the tangents d/du and d/dv of (x z, y z, z). Their cross product is the normal.
            ax, ay, az = pitch[0] * z + x * across, y * across, across
            bx, by, bz = x * along, pitch[1] * z + y * along, along
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            facing = nx * x + ny * y + nz
            out[v, u] = (nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0) / (facing * facing) - 1.0
        out[v, 0], out[v, width - 1] = out[v, 1], out[v, width - 2]


@njit(cache=True, nogil=True, error_model="numpy")
def quantise_depth(seen: Float, slant: Float, noise: Float, limits: Float, sigma: Float, out: UInt16) -> None:
    """Fills ``out`` with (H, W) noisy depth in whole millimetres, quantised to the sensor's steps.

    Depth out of range becomes 0.

    The published standard deviations include quantisation. Quantisation with the step q contributes q^2 / 12
    to the variance. The noise that is added before quantisation has the remaining variance.
    """
    near, far, step, unit, steepest = limits[0], limits[1], limits[2], limits[3], limits[4]
    by_disparity = unit > 0.0
    per_unit = 1.0 / unit if by_disparity else 0.0
    height, width = out.shape
    for v in range(height):
        for u in range(width):
            z, tangent2 = max(seen[v, u], 1e-3), slant[v, u]
            beyond = z - sigma[3]
            deviation = sigma[0] + sigma[1] * max(beyond, 0.0) + sigma[2] * beyond * beyond
            deviation += sigma[4] * tangent2 / np.sqrt(z)
            jump = z * z * per_unit if by_disparity else step
            rest = max(deviation * deviation - jump * jump / 12.0, 0.0)
            measured = max(z + noise[v, u] * np.sqrt(rest), 1e-3)
            measured = unit / np.rint(unit / measured) if by_disparity else measured
            measured = np.rint(measured / step) * step
            good = near <= measured <= far and seen[v, u] <= _RANGE_MARGIN * far and tangent2 <= steepest
            out[v, u] = np.uint16(np.rint(measured * 1000.0)) if good else np.uint16(0)
