"""The faults of a real depth camera, put on a perfect depth image.

In the order of the sensor's own working: edges appear displaced; the projector or second imager does not see
everything; a matching window loses or mixes what lies at an edge; slanted, dark and mirroring surfaces return
too little; depth scatters, neighbours alike; and it is reported in steps of disparity.

Everything random comes from the raw bits of PCG64, and the arithmetic is + - * / and square roots: the same
seed and frame number give the same image on every machine with IEEE doubles.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float, Int32, UInt8, UInt16
from enliven.camera import Intrinsics, rays
from enliven_edge.sensors.profile import SensorProfile

_BYTE_DEVIATION = math.sqrt((256.0**2 - 1.0) / 12.0)
_JUMP = 0.035
"""Part of the distance (and metres at 1 m) beyond which two neighbours are different surfaces."""
_BEYOND = 1.25
"""Times the range: no scatter brings a surface into view that is farther than this."""
_FROZEN = -1
_FROZEN_PATCHES = 0.9
"""Part of the variance that never changes of where dark and mirroring surfaces are lost."""
_NOWHERE = 1e3
"""Metres: the depth of what a ray never meets."""


class DepthNoise:
    """Turns perfect depth into what a sensor of a profile would report.

    Args:
        intrinsics: of the images; where they are smaller than the profile's, pixel sizes shrink alike.
        seed: another seed, another sensor of the same make.
    """

    def __init__(self, profile: SensorProfile, intrinsics: Intrinsics, seed: int = 0) -> None:
        self._profile, self._seed = profile, seed
        self._shape = (intrinsics.height, intrinsics.width)
        self._ray = rays(intrinsics)
        scale = intrinsics.width / profile.camera.width
        n, f, r = profile.noise, profile.faults, profile.range
        self._blob = max(2, round(3 * scale))
        self._windows = (max(1, round(n.correlation * scale)), self._blob, max(3, round(14 * scale)))
        self._lateral = n.lateral * scale
        self._reach = max(1, round(f.edge * scale)) if f.edge > 0 else 0
        self._parallax = intrinsics.fx * r.baseline
        unit = profile.camera.fx * abs(r.baseline) / r.disparity_step if r.disparity_step > 0 else 0.0
        steepest = math.tan(math.radians(f.grazing)) ** 2
        self._limits = np.array([r.near, r.far, r.depth_step, unit, steepest])
        self._sigma = np.array([n.constant, n.linear, n.quadratic, n.start, n.slant])
        self._losses = np.array([_quantile(p) for p in (f.edge_holes, 0.12 * f.edge_holes, f.dark, f.mirror)])
        self._flying = f.flying
        self._pitch = np.array([1.0 / intrinsics.fx, 1.0 / intrinsics.fy])
        self._frozen = (n.frozen, n.frozen, _FROZEN_PATCHES)
        self._still = [
            math.sqrt(self._frozen[stream]) * self._field(_FROZEN, stream, self._windows[stream])
            for stream in range(3)
        ]

    def corrupt(self, depth: Float, material: UInt8, index: int) -> UInt16:
        """(H, W) uint16 millimetres, 0 where nothing is reported.

        Args:
            depth: (H, W) metres along the optical axis, inf where there is nothing.
            material: (H, W) 0 ordinary, 1 dark, 2 mirroring.
            index: the frame's number: with the seed it fixes everything random.
        """
        axial, blobs, patches = self._aged(index, 0), self._aged(index, 1), self._aged(index, 2)
        across, down = self._field(index, 3, self._blob), self._field(index, 4, self._blob)
        shadow, zone = np.zeros(self._shape, np.bool_), np.zeros(self._shape, np.bool_)
        depth = np.minimum(depth, _NOWHERE)
        slant = np.empty(self._shape)
        _slants(depth, self._ray, self._pitch, slant)
        if self._parallax != 0.0:
            _cast_shadow(depth, self._parallax, shadow)
        if self._reach > 0:
            _mark_edges(depth, self._reach, zone)
        seen = np.empty(self._shape)
        _look(
            depth, material, shadow, zone, across, down, self._lateral, self._reach, blobs, patches,
            self._bytes(index, 5, self._shape), self._losses, self._flying, self._limits[1], seen, slant,
        )  # fmt: skip
        out = np.empty(self._shape, np.uint16)
        _measure(seen, slant, axial, self._limits, self._sigma, out)
        return out

    def _aged(self, index: int, stream: int) -> Float:
        """(H, W) unit noise of which a part of the variance never changes."""
        frozen = self._frozen[stream]
        return self._still[stream] + math.sqrt(1.0 - frozen) * self._field(
            index, stream, self._windows[stream]
        )

    def _bytes(self, index: int, stream: int, shape: tuple[int, int]) -> UInt8:
        """Random bytes of one frame and one purpose."""
        count = shape[0] * shape[1]
        bits = np.random.PCG64([self._seed, index + 1, stream]).random_raw(-(-count // 8))
        return bits.astype("<u8").view(np.uint8)[:count].reshape(shape)

    def _field(self, index: int, stream: int, window: int) -> Float:
        """(H, W) nearly Gaussian noise of unit variance, alike over about ``window`` pixels.

        Bytes through two box filters, in integers; where the window is one pixel, sums of four bytes.
        """
        height, width = self._shape
        box = max(1, round(0.7 * window))
        if box == 1:
            raw = self._bytes(index, stream, (4 * height, width)).astype(np.int64)
            summed = raw[0::4] + raw[1::4] + raw[2::4] + raw[3::4]
            return (summed - 510.0) / (2.0 * _BYTE_DEVIATION)
        raw = self._bytes(index, stream, (height + 2 * box - 2, width + 2 * box - 2)).astype(np.int32)
        once = np.empty((height + box - 1, width + box - 1), np.int32)
        twice = np.empty((height, width), np.int32)
        _box_sums(raw, box, once)
        _box_sums(once, box, twice)
        # The sum of the squared weights of two boxes in a row, per axis: b (2 b^2 + 1) / 3.
        squares = box * (2 * box * box + 1) // 3
        return (twice - 127.5 * box**4) * (1.0 / (squares * _BYTE_DEVIATION))


def _quantile(part: float) -> float:
    """The value below which ``part`` of a unit Gaussian lies."""
    if part <= 0.0 or part >= 1.0:
        return -math.inf if part <= 0.0 else math.inf
    return NormalDist().inv_cdf(part)


@njit(cache=True, nogil=True)
def _box_sums(raw: Int32, box: int, out: Int32) -> None:
    """Sums of ``raw`` over box x box windows, in integers."""
    height, width = out.shape
    columns = np.zeros(raw.shape[1], np.int32)
    for v in range(box - 1):
        for u in range(raw.shape[1]):
            columns[u] += raw[v, u]
    for v in range(height):
        for u in range(raw.shape[1]):
            columns[u] += raw[v + box - 1, u]
        total = 0
        for u in range(box - 1):
            total += columns[u]
        for u in range(width):
            total += columns[u + box - 1]
            out[v, u] = total
            total -= columns[u]
        for u in range(raw.shape[1]):
            columns[u] -= raw[v, u]


@njit(cache=True, nogil=True)
def _cast_shadow(depth: Float, parallax: float, shadow: AnyArray) -> None:
    """Where the second eye at ``parallax`` / focal length does not see the surface.

    Its column for pixel u is u - parallax / z. Walking away from that eye, columns must go on in the same
    direction; one that has been passed already is hidden behind something nearer.
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
def _mark_edges(depth: Float, reach: int, zone: AnyArray) -> None:
    """The pixels within ``reach`` (a square) of a place where one surface ends in front of another."""
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            right = u + 1 < width and _is_tear(
                depth[v, max(u - 1, 0)], depth[v, u], depth[v, u + 1], depth[v, min(u + 2, width - 1)]
            )
            below = v + 1 < height and _is_tear(
                depth[max(v - 1, 0), u], depth[v, u], depth[v + 1, u], depth[min(v + 2, height - 1), u]
            )
            if right or below:
                zone[
                    max(v - reach + 1 - right, 0) : v + reach + below,
                    max(u - reach + 1 - below, 0) : u + reach + right,
                ] = True


@njit(cache=True, nogil=True, forceinline=True)
def _is_tear(before: float, here: float, there: float, beyond: float) -> bool:
    """Whether the depth jumps between ``here`` and ``there``, more than the surfaces' own slopes explain."""
    jump = abs(there - here)
    if jump < _JUMP * min(here, there):
        return False
    return jump > 3.0 * min(abs(here - before), abs(beyond - there))


@njit(cache=True, nogil=True, error_model="numpy")
def _look(
    depth: Float, stuff: UInt8, shadow: AnyArray, zone: AnyArray, across: Float, down: Float, lateral: float,
    reach: int, blobs: Float, patches: Float, dice: UInt8, losses: Float, flying: float, far: float,
    seen: Float, slant: Float,
) -> None:  # fmt: skip
    """What each pixel looks at: (H, W) metres, 0 where nothing answers; an edge's pixels look beside themselves.

    ``slant`` follows to where a pixel looks.
    """
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            if zone[v, u]:
                _look_at_edge(
                    depth,
                    shadow,
                    across,
                    down,
                    lateral,
                    reach,
                    blobs,
                    dice,
                    losses,
                    flying,
                    far,
                    seen,
                    slant,
                    v,
                    u,
                )
            else:
                seen[v, u] = 0.0 if shadow[v, u] else depth[v, u]
            if stuff[v, u] > 0 and patches[v, u] < losses[1 + stuff[v, u]]:
                seen[v, u] = 0.0


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _look_at_edge(
    depth: Float, shadow: AnyArray, across: Float, down: Float, lateral: float, reach: int, blobs: Float,
    dice: UInt8, losses: Float, flying: float, far: float, seen: Float, slant: Float, v: int, u: int,
) -> None:  # fmt: skip
    """One pixel near an edge: it may look across the edge, see nothing, or mix both sides."""
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
    chance = dice[v, u] / 256.0
    seen[v, u] = low + chance / flying * (min(high, far) - low) if chance < flying else z
    slant[v, u] = 0.0 if (y, x) != (v, u) else slant[v, u]


@njit(cache=True, nogil=True, error_model="numpy")
def _slants(depth: Float, ray: Float, pitch: Float, out: Float) -> None:
    """(H, W) tan^2 of the angle between each pixel's ray and its surface's normal.

    The slope across and down is that to the nearer of both neighbours, so that edges do not count.
    """
    height, width = depth.shape
    for v in range(height):
        above, here, below = depth[max(v - 1, 0)], depth[v], depth[min(v + 1, height - 1)]
        for u in range(1, width - 1):
            z, x, y = here[u], ray[v, u, 0], ray[v, u, 1]
            left, right, up, down = z - here[u - 1], here[u + 1] - z, z - above[u], below[u] - z
            across = left if abs(left) < abs(right) else right
            along = up if abs(up) < abs(down) else down
            # Tangents d/du and d/dv of (x z, y z, z); their cross product is the normal.
            ax, ay, az = pitch[0] * z + x * across, y * across, across
            bx, by, bz = x * along, pitch[1] * z + y * along, along
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            facing = nx * x + ny * y + nz
            out[v, u] = (nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0) / (facing * facing) - 1.0
        out[v, 0], out[v, width - 1] = out[v, 1], out[v, width - 2]


@njit(cache=True, nogil=True, error_model="numpy")
def _measure(seen: Float, slant: Float, noise: Float, limits: Float, sigma: Float, out: UInt16) -> None:
    """Depths with their scatter, in the sensor's steps, as whole millimetres; 0 out of range.

    The published deviations include the steps; a uniform step q contributes q^2 / 12 of the variance, so the
    scatter before it is the rest.
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
            found = max(z + noise[v, u] * np.sqrt(rest), 1e-3)
            found = unit / np.rint(unit / found) if by_disparity else found
            found = np.rint(found / step) * step
            good = near <= found <= far and seen[v, u] <= _BEYOND * far and tangent2 <= steepest
            out[v, u] = np.uint16(np.rint(found * 1000.0)) if good else np.uint16(0)
