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

from enliven.arrays import AnyArray, Float, Int, UInt8, UInt16
from enliven.camera import Intrinsics, rays
from enliven_edge.sensors.profile import SensorProfile

_BYTE_DEVIATION = math.sqrt((256.0**2 - 1.0) / 12.0)
_JUMP = 0.035
"""Part of the distance (and metres at 1 m) beyond which two neighbours are different surfaces."""
_FROZEN = -1


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
        self._disparity_unit = (
            profile.camera.fx * abs(r.baseline) / r.disparity_step if r.disparity_step > 0 else 0.0
        )
        self._limits = np.array([r.near, r.far, r.depth_step, self._disparity_unit])
        self._sigma = np.array([n.constant, n.linear, n.quadratic, n.start, n.slant])
        self._losses = np.array([_quantile(p) for p in (f.edge_holes, 0.12 * f.edge_holes, f.dark, f.mirror)])
        self._tears = np.array([f.flying, math.cos(math.radians(f.grazing))])
        self._still = [self._field(_FROZEN, stream, self._windows[stream]) for stream in range(3)]

    def corrupt(self, depth: Float, material: UInt8, index: int) -> UInt16:
        """(H, W) uint16 millimetres, 0 where nothing is reported.

        Args:
            depth: (H, W) metres along the optical axis, inf where there is nothing.
            material: (H, W) 0 ordinary, 1 dark, 2 mirroring.
            index: the frame's number: with the seed it fixes everything random.
        """
        frozen = self._profile.noise.frozen
        axial, blobs = self._aged(index, 0, frozen), self._aged(index, 1, frozen)
        patches = self._aged(index, 2, 0.9)
        across, down = self._field(index, 3, self._blob), self._field(index, 4, self._blob)
        shadow, zone = np.zeros(self._shape, np.bool_), np.zeros(self._shape, np.bool_)
        if self._parallax != 0.0:
            _cast_shadow(depth, self._parallax, shadow)
        if self._reach > 0:
            _mark_edges(depth, self._reach, zone)
        out = np.zeros(self._shape, np.uint16)
        _report(
            depth, material, shadow, zone, across, down, self._lateral, self._reach, axial, blobs, patches,
            self._bytes(index, 5, self._shape), self._ray, self._limits, self._sigma, self._losses, self._tears, out,
        )  # fmt: skip
        return out

    def _aged(self, index: int, stream: int, frozen: float) -> Float:
        """(H, W) unit noise of which the part ``frozen`` of the variance never changes."""
        fresh = self._field(index, stream, self._windows[stream])
        return math.sqrt(frozen) * self._still[stream] + math.sqrt(1.0 - frozen) * fresh

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
        raw = self._bytes(index, stream, (height + 2 * box - 2, width + 2 * box - 2)).astype(np.int64)
        once = np.empty((height + box - 1, width + box - 1), np.int64)
        twice = np.empty((height, width), np.int64)
        _box_sums(raw, box, once)
        _box_sums(once, box, twice)
        # The sum of the squared weights of two boxes in a row, per axis: b (2 b^2 + 1) / 3.
        squares = box * (2 * box * box + 1) // 3
        return (twice - 127.5 * box**4) / (squares * _BYTE_DEVIATION)


def _quantile(part: float) -> float:
    """The value below which ``part`` of a unit Gaussian lies."""
    if part <= 0.0 or part >= 1.0:
        return -math.inf if part <= 0.0 else math.inf
    return NormalDist().inv_cdf(part)


@njit(cache=True, nogil=True)
def _box_sums(raw: Int, box: int, out: Int) -> None:
    """Sums of ``raw`` over box x box windows, in integers."""
    height, width = out.shape
    columns = np.zeros(raw.shape[1], np.int64)
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
                    max(v - reach + 1 - right, 0) : v + reach + below, max(u - reach + 1 - below, 0) : u + reach + right
                ] = True


@njit(cache=True, nogil=True, forceinline=True)
def _is_tear(before: float, here: float, there: float, beyond: float) -> bool:
    """Whether the depth jumps between ``here`` and ``there``, more than the surfaces' own slopes explain."""
    jump = abs(there - here)
    if jump < _JUMP * min(here, there):
        return False
    return jump > 3.0 * min(abs(here - before), abs(beyond - there))


@njit(cache=True, nogil=True)
def _report(
    depth: Float, stuff: UInt8, shadow: AnyArray, zone: AnyArray, across: Float, down: Float, lateral: float,
    reach: int, axial: Float, blobs: Float, patches: Float, dice: UInt8, ray: Float, limits: Float, sigma: Float,
    losses: Float, tears: Float, out: UInt16,
) -> None:  # fmt: skip
    """What the sensor says of every pixel; an edge's pixels look beside themselves, so that it frays."""
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            x, y = u, v
            if zone[v, u]:
                x = min(max(int(np.rint(u + lateral * across[v, u])), 0), width - 1)
                y = min(max(int(np.rint(v + lateral * down[v, u])), 0), height - 1)
            z, material = depth[y, x], stuff[y, x]
            if shadow[y, x] or not limits[0] * 0.5 <= z <= limits[1] * 2.0:
                continue
            chance = dice[v, u] / 256.0
            if zone[v, u]:
                low, high = _extremes(depth, v, u, reach)
                behind = high - z < z - low
                if blobs[v, u] < losses[0 if behind else 1]:
                    continue
                if chance < tears[0]:
                    z = low + chance / tears[0] * (min(high, limits[1]) - low)
            cosine = _cosine(depth, ray, y, x)
            if cosine < tears[1]:
                continue
            if material > 0 and patches[v, u] < losses[1 + material]:
                continue
            out[v, u] = _measured(z, cosine, axial[v, u], limits, sigma)


@njit(cache=True, nogil=True, forceinline=True)
def _extremes(depth: Float, v: int, u: int, reach: int) -> tuple[float, float]:
    """The least and the greatest depth within ``reach`` pixels."""
    window = depth[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1]
    return window.min(), window.max()


@njit(cache=True, nogil=True, forceinline=True)
def _cosine(depth: Float, ray: Float, v: int, u: int) -> float:
    """Cosine between the surface's normal and the ray, from the flatter neighbour on either axis."""
    height, width = depth.shape
    z = depth[v, u]
    across = _slope(depth[v, max(u - 1, 0)], z, depth[v, min(u + 1, width - 1)])
    down = _slope(depth[max(v - 1, 0), u], z, depth[min(v + 1, height - 1), u])
    pitch_x = abs(ray[v, min(u + 1, width - 1), 0] - ray[v, max(u - 1, 0), 0]) * 0.5
    pitch_y = abs(ray[min(v + 1, height - 1), u, 1] - ray[max(v - 1, 0), u, 1]) * 0.5
    x, y = ray[v, u, 0], ray[v, u, 1]
    # Tangents d/du (x z, y z, z) and d/dv; their cross product is the normal.
    ax, ay, az = pitch_x * z + x * across, y * across, across
    bx, by, bz = x * down, pitch_y * z + y * down, down
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.sqrt((nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0))
    return abs(nx * x + ny * y + nz) / length if length > 0.0 else 0.0


@njit(cache=True, nogil=True, forceinline=True)
def _slope(before: float, here: float, after: float) -> float:
    """The smaller in size of the differences to both neighbours."""
    a, b = here - before, after - here
    return a if abs(a) < abs(b) else b


@njit(cache=True, nogil=True, forceinline=True)
def _measured(z: float, cosine: float, noise: float, limits: Float, sigma: Float) -> int:
    """Depth z with noise, in the sensor's steps, as whole millimetres (0: out of range).

    The published deviations include the steps; a uniform step q contributes q^2 / 12 of the variance, so the
    scatter before it is the rest.
    """
    out_of = z - sigma[3]
    tangent2 = 1.0 / (cosine * cosine) - 1.0
    deviation = sigma[0] + sigma[1] * max(out_of, 0.0) + sigma[2] * out_of * out_of + sigma[4] * tangent2 / np.sqrt(z)
    step = z * z / limits[3] if limits[3] > 0.0 else limits[2]
    rest = deviation * deviation - step * step / 12.0
    z += noise * np.sqrt(rest) if rest > 0.0 else 0.0
    if z <= 0.0:
        return 0
    if limits[3] > 0.0:
        z = limits[3] / np.rint(limits[3] / z)
    z = np.rint(z / limits[2]) * limits[2]
    return int(np.rint(z * 1000.0)) if limits[0] <= z <= limits[1] else 0
