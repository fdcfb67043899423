"""Adds the faults of a real depth camera to a perfect depth image.

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

from enliven.arrays import Float, Int32, UInt8, UInt16
from enliven.camera import Intrinsics, rays
from enliven.kernels import njit
from enliven_synthesis.body import on_grid
from enliven_synthesis.sensor.faults import cast_shadow, look, mark_edges, measure, slants
from enliven_synthesis.sensor.profile import SensorProfile

_BYTE_DEVIATION = math.sqrt((256.0**2 - 1.0) / 12.0)
"""Standard deviation of a uniform byte."""
_FROZEN = -1
"""Frame number of the noise that never changes: before that of any frame."""
_FROZEN_PATCHES = 0.9
"""Share of the variance that never changes in the loss of dark and mirroring surfaces: nearly all."""
_NOWHERE = 1e3
"""Metres: the depth where a ray meets nothing, beyond the range of any sensor."""


class DepthNoise:
    """Turns perfect depth into the report of a sensor with a profile.

    Args:
        intrinsics: those of the images; fault sizes in pixels are scaled from the profile's width.
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
        steepest = float(on_grid(np.array(math.tan(math.radians(f.grazing)) ** 2)))
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
        """Returns (H, W) uint16 millimetres, 0 where nothing is reported.

        Args:
            depth: (H, W) metres along the optical axis, inf where there is nothing.
            material: (H, W) 0 ordinary, 1 dark, 2 mirroring.
            index: the frame's number; it and the seed fix everything random.
        """
        axial, blobs, patches = self._aged(index, 0), self._aged(index, 1), self._aged(index, 2)
        across, down = self._field(index, 3, self._blob), self._field(index, 4, self._blob)
        shadow, zone = np.zeros(self._shape, np.bool_), np.zeros(self._shape, np.bool_)
        depth = np.minimum(depth, _NOWHERE)
        slant = np.empty(self._shape)
        slants(depth, self._ray, self._pitch, slant)
        if self._parallax != 0.0:
            cast_shadow(depth, self._parallax, shadow)
        if self._reach > 0:
            mark_edges(depth, self._reach, zone)
        seen = np.empty(self._shape)
        look(
            depth, material, shadow, zone, across, down, self._lateral, self._reach, blobs, patches,
            self._bytes(index, 5, self._shape), self._losses, self._flying, self._limits[1], seen, slant,
        )  # fmt: skip
        out = np.empty(self._shape, np.uint16)
        measure(seen, slant, axial, self._limits, self._sigma, out)
        return out

    def _aged(self, index: int, stream: int) -> Float:
        """Returns (H, W) unit noise with a share of the variance that never changes."""
        frozen = self._frozen[stream]
        return self._still[stream] + math.sqrt(1.0 - frozen) * self._field(
            index, stream, self._windows[stream]
        )

    def _bytes(self, index: int, stream: int, shape: tuple[int, int]) -> UInt8:
        """Returns the random bytes of one frame for one purpose, ``stream``."""
        count = shape[0] * shape[1]
        bits = np.random.PCG64([self._seed, index + 1, stream]).random_raw(-(-count // 8))
        return bits.astype("<u8").view(np.uint8)[:count].reshape(shape)

    def _field(self, index: int, stream: int, window: int) -> Float:
        """Returns (H, W) nearly Gaussian noise of unit variance, correlated over about ``window`` pixels.

        Bytes pass two box filters, in integers; for a window of one pixel four bytes are summed.
        """
        height, width = self._shape
        box = max(1, round(0.7 * window))
        if box == 1:
            raw = self._bytes(index, stream, (4 * height, width)).astype(np.int64)
            summed = raw[0::4] + raw[1::4] + raw[2::4] + raw[3::4]
            return np.asarray((summed - 510.0) / (2.0 * _BYTE_DEVIATION), np.float64)
        raw = self._bytes(index, stream, (height + 2 * box - 2, width + 2 * box - 2)).astype(np.int32)
        once = np.empty((height + box - 1, width + box - 1), np.int32)
        twice = np.empty((height, width), np.int32)
        _box_sums(raw, box, once)
        _box_sums(once, box, twice)
        # The sum of the squared weights of two boxes in a row, per axis: b (2 b^2 + 1) / 3.
        squares = box * (2 * box * box + 1) // 3
        return np.asarray((twice - 127.5 * box**4) * (1.0 / (squares * _BYTE_DEVIATION)), np.float64)


def _quantile(part: float) -> float:
    """Returns the value below which the share ``part`` of a unit Gaussian lies."""
    if part <= 0.0 or part >= 1.0:
        return -math.inf if part <= 0.0 else math.inf
    return float(on_grid(np.array(NormalDist().inv_cdf(part))))


@njit(cache=True, nogil=True)
def _box_sums(raw: Int32, box: int, out: Int32) -> None:
    """Fills ``out`` with sums of ``raw`` over box x box windows, in integers."""
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
