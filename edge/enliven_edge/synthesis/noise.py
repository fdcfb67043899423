"""The faults of a real depth camera, put on a perfect depth image.

In the order of the sensor's own working: edges appear displaced; the projector or second imager does not see
everything; a matching window loses or mixes what lies at an edge; slanted, dark and mirroring surfaces return
too little; depth scatters, neighbours alike; and it is reported in steps of disparity.

Everything random comes from the raw bits of PCG64, and the arithmetic is + - * / and square roots: the same
seed and frame number give the same image on every machine with IEEE doubles.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float, UInt8, UInt16
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
        self._window = max(1, round(n.correlation * scale))
        self._blob = max(2, round(3 * scale))
        self._lateral = n.lateral * scale
        self._reach = max(1, round(f.edge * scale)) if f.edge > 0 else 0
        self._parallax = intrinsics.fx * r.baseline
        self._disparity_unit = (
            profile.camera.fx * abs(r.baseline) / r.disparity_step if r.disparity_step > 0 else 0.0
        )
        self._limits = np.array([r.near, r.far, r.depth_step, self._disparity_unit])
        self._sigma = np.array([n.constant, n.linear, n.quadratic, n.start, n.slant])
        self._losses = np.array([f.edge_holes, f.flying, math.cos(math.radians(f.grazing)), f.dark, f.mirror])
        self._still = self._field(_FROZEN, 0, self._window)
        self._still_blobs = self._field(_FROZEN, 1, self._blob)

    def corrupt(self, depth: Float, material: UInt8, index: int) -> UInt16:
        """(H, W) uint16 millimetres, 0 where nothing is reported.

        Args:
            depth: (H, W) metres along the optical axis, inf where there is nothing.
            material: (H, W) 0 ordinary, 1 dark, 2 mirroring.
            index: the frame's number: with the seed it fixes everything random.
        """
        frozen = self._profile.noise.frozen
        axial = math.sqrt(frozen) * self._still + math.sqrt(1.0 - frozen) * self._field(index, 0, self._window)
        blobs = math.sqrt(frozen) * self._still_blobs + math.sqrt(1.0 - frozen) * self._field(index, 1, self._blob)
        moved, stuff = np.empty_like(depth), np.empty_like(material)
        _displace(
            depth, material, self._field(index, 2, self._blob), self._field(index, 3, self._blob),
            self._lateral, moved, stuff,
        )  # fmt: skip
        shadow = np.zeros(self._shape, np.bool_)
        if self._parallax != 0.0:
            _cast_shadow(moved, self._parallax, shadow)
        low, high = _extremes(moved, self._reach)
        out = np.zeros(self._shape, np.uint16)
        _report(
            moved, stuff, shadow, low, high, axial, blobs, self._bytes(index, 4, self._shape), self._ray,
            self._limits, self._sigma, self._losses, out,
        )  # fmt: skip
        return out

    def _bytes(self, index: int, stream: int, shape: tuple[int, int]) -> UInt8:
        """Random bytes of one frame and one purpose."""
        count = shape[0] * shape[1]
        bits = np.random.PCG64([self._seed, index + 1, stream]).random_raw(-(-count // 8))
        return bits.astype("<u8").view(np.uint8)[:count].reshape(shape)

    def _field(self, index: int, stream: int, window: int) -> Float:
        """(H, W) nearly Gaussian noise of unit variance, equal over ``window`` pixels (a box of bytes)."""
        pad = window if window > 1 else 2
        raw = self._bytes(index, stream, (self._shape[0] + pad, self._shape[1] + pad))
        box = window if window > 1 else 1
        if box == 1:
            four = raw[:-2, :-2].astype(np.int64) + raw[1:-1, 2:] + raw[2:, 1:-1] + raw[1:-1, :-2]
            return (four - 510.0) / (2.0 * _BYTE_DEVIATION)
        out = np.empty(self._shape)
        _box_sums(raw, box, out)
        return (out - 127.5 * box * box) / (box * _BYTE_DEVIATION)


@njit(cache=True, nogil=True)
def _box_sums(raw: UInt8, box: int, out: Float) -> None:
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
def _displace(
    depth: Float, material: UInt8, across: Float, down: Float, sigma: float, moved: Float, stuff: UInt8
) -> None:
    """Each pixel looks ``sigma`` pixels beside itself: edges fray, flat surfaces do not change."""
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            x = min(max(int(np.rint(u + sigma * across[v, u])), 0), width - 1)
            y = min(max(int(np.rint(v + sigma * down[v, u])), 0), height - 1)
            moved[v, u], stuff[v, u] = depth[y, x], material[y, x]


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
def _extremes(depth: Float, reach: int) -> tuple[Float, Float]:
    """(H, W) the least and the greatest depth within ``reach`` pixels (a square window, separably)."""
    height, width = depth.shape
    row_low, row_high = np.empty_like(depth), np.empty_like(depth)
    low, high = np.empty_like(depth), np.empty_like(depth)
    for v in range(height):
        for u in range(width):
            a, b = depth[v, u], depth[v, u]
            for w in range(max(u - reach, 0), min(u + reach + 1, width)):
                a, b = min(a, depth[v, w]), max(b, depth[v, w])
            row_low[v, u], row_high[v, u] = a, b
    for v in range(height):
        for u in range(width):
            a, b = row_low[v, u], row_high[v, u]
            for w in range(max(v - reach, 0), min(v + reach + 1, height)):
                a, b = min(a, row_low[w, u]), max(b, row_high[w, u])
            low[v, u], high[v, u] = a, b
    return low, high


@njit(cache=True, nogil=True)
def _report(
    depth: Float, stuff: UInt8, shadow: AnyArray, low: Float, high: Float, axial: Float, blobs: Float, dice: UInt8,
    ray: Float, limits: Float, sigma: Float, losses: Float, out: UInt16,
) -> None:  # fmt: skip
    """What the sensor says of every pixel."""
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            z = depth[v, u]
            if shadow[v, u] or not limits[0] <= z <= 2.0 * limits[1]:
                continue
            chance = dice[v, u] / 256.0
            if low[v, u] * (1.0 + _JUMP) < high[v, u] and _is_torn(depth, v, u):
                behind = high[v, u] - z < z - low[v, u]
                if _lost(losses[0] if behind else 0.12 * losses[0], blobs[v, u]):
                    continue
                if chance < losses[1]:
                    mix = chance / losses[1]
                    z = low[v, u] + mix * (min(high[v, u], limits[1]) - low[v, u])
            cosine = _cosine(depth, ray, v, u)
            if cosine < losses[2] * (1.0 + 0.5 * chance):
                continue
            if stuff[v, u] > 0 and _lost(losses[2 + stuff[v, u]], blobs[v, u]):
                continue
            out[v, u] = _measured(z, cosine, axial[v, u], limits, sigma)


@njit(cache=True, nogil=True)
def _is_torn(depth: Float, v: int, u: int) -> bool:
    return True


@njit(cache=True, nogil=True)
def _lost(part: float, blob: float) -> bool:
    """Whether a blob of unit variance lies below the quantile of ``part`` (logistic, to within 0.02)."""
    if part <= 0.0:
        return False
    # x -> 1 / 2 (1 + x / sqrt(1 + x^2 * 0.64 ... )) is replaced by its rational inverse: exact arithmetic.
    p = min(max(part, 1e-6), 1.0 - 1e-6)
    t = 2.0 * p - 1.0
    return blob < t / np.sqrt(1.0 - t * t) * 1.25 if part < 1.0 else True


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _slope(before: float, here: float, after: float) -> float:
    """The smaller in size of the differences to both neighbours."""
    a, b = here - before, after - here
    return a if abs(a) < abs(b) else b


@njit(cache=True, nogil=True)
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
