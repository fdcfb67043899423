"""Adds the faults of a real depth camera to a perfect depth image.

The faults are applied in the order in which they arise in a sensor. Edges appear displaced. Parts of the
scene are occluded from the projector or the second imager. A matching window loses or mixes depths at an
edge. Slanted, dark and mirroring surfaces return too little light. Depth has noise that is correlated between
neighbours. Finally, depth is quantised in steps of disparity.

All random numbers come from the raw bits of PCG64, and the arithmetic is + - * / and square roots. The same
seed and frame number therefore give the same image on every machine with IEEE doubles.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from enliven.arrays import Float, Int32, UInt8, UInt16
from enliven.camera import Intrinsics, pixel_rays
from enliven.kernels import njit
from enliven_synthesis.body.rotations import round_to_grid
from enliven_synthesis.sensor.faults import (
    cast_shadow,
    compute_slants,
    mark_edges,
    quantise_depth,
    sample_surfaces,
)
from enliven_synthesis.sensor.profile import SensorProfile

_BYTE_DEVIATION = math.sqrt((256.0**2 - 1.0) / 12.0)
"""Standard deviation of a uniformly distributed byte."""
_FROZEN_FRAME = -1
"""Frame number for the noise that is constant over time. It is lower than the number of any frame."""
_FROZEN_PATCHES = 0.9
"""Fraction of the variance of the lost patches on dark and mirroring surfaces that is constant over time.

It is close to 1, because such patches hardly change."""
_NO_HIT_DEPTH_M = 1e3
"""Depth in metres of a ray that hits nothing. It is beyond the range of any sensor."""


class DepthNoise:
    """Converts perfect depth into the depth that a sensor with the given profile reports.

    Args:
        intrinsics: intrinsics of the images. Fault sizes in pixels are scaled from the profile's width.
        seed: random seed. Another seed simulates another sensor of the same model.
    """

    def __init__(self, profile: SensorProfile, intrinsics: Intrinsics, seed: int = 0) -> None:
        self._profile, self._seed = profile, seed
        self._shape = (intrinsics.height, intrinsics.width)
        self._ray = pixel_rays(intrinsics)
        scale = intrinsics.width / profile.camera.width
        n, f, r = profile.noise, profile.faults, profile.range
        self._blob = max(2, round(3 * scale))
        self._windows = (max(1, round(n.correlation * scale)), self._blob, max(3, round(14 * scale)))
        self._lateral = n.lateral * scale
        self._reach = max(1, round(f.edge * scale)) if f.edge > 0 else 0
        self._parallax = intrinsics.fx * r.baseline
        unit = profile.camera.fx * abs(r.baseline) / r.disparity_step if r.disparity_step > 0 else 0.0
        steepest = float(round_to_grid(np.array(math.tan(math.radians(f.grazing)) ** 2)))
        self._limits = np.array([r.near, r.far, r.depth_step, unit, steepest])
        self._sigma = np.array([n.constant, n.linear, n.quadratic, n.start, n.slant])
        self._losses = np.array([_quantile(p) for p in (f.edge_holes, 0.12 * f.edge_holes, f.dark, f.mirror)])
        self._flying = f.flying
        self._pitch = np.array([1.0 / intrinsics.fx, 1.0 / intrinsics.fy])
        self._frozen = (n.frozen, n.frozen, _FROZEN_PATCHES)
        self._still = [
            math.sqrt(self._frozen[stream]) * self.noise_field(_FROZEN_FRAME, stream, self._windows[stream])
            for stream in range(3)
        ]

    def add_noise(self, depth: Float, material: UInt8, index: int) -> UInt16:
        """Returns (H, W) uint16 millimetres, with 0 for pixels without a measurement.

        Args:
            depth: (H, W) metres along the optical axis, inf for rays without a surface.
            material: (H, W) 0 for ordinary, 1 for dark, 2 for mirroring surfaces.
            index: the frame's number. Together with the seed it determines all random numbers.
        """
        axial, blobs, patches = (
            self._make_partly_frozen_noise(index, 0),
            self._make_partly_frozen_noise(index, 1),
            self._make_partly_frozen_noise(index, 2),
        )
        across, down = (
            self.noise_field(index, 3, self._blob),
            self.noise_field(index, 4, self._blob),
        )
        shadow, zone = np.zeros(self._shape, np.bool_), np.zeros(self._shape, np.bool_)
        depth = np.minimum(depth, _NO_HIT_DEPTH_M)
        slant = np.empty(self._shape)
        compute_slants(depth, self._ray, self._pitch, slant)
        if self._parallax != 0.0:
            cast_shadow(depth, self._parallax, shadow)
        if self._reach > 0:
            mark_edges(depth, self._reach, zone)
        sampled_depth = np.empty(self._shape)
        sample_surfaces(
            depth, material, shadow, zone, across, down, self._lateral, self._reach, blobs, patches,
            self.random_bytes(index, 5, self._shape), self._losses, self._flying, self._limits[1],
            sampled_depth, slant,
        )  # fmt: skip
        out = np.empty(self._shape, np.uint16)
        quantise_depth(sampled_depth, slant, axial, self._limits, self._sigma, out)
        return out

    def _make_partly_frozen_noise(self, index: int, stream: int) -> Float:
        """Returns (H, W) noise of unit variance. A fixed fraction of the variance is constant over all
        frames.
        """
        frozen = self._frozen[stream]
        return self._still[stream] + math.sqrt(1.0 - frozen) * self.noise_field(
            index, stream, self._windows[stream]
        )

    def random_bytes(self, index: int, stream: int, shape: tuple[int, int]) -> UInt8:
        """Returns random bytes of one frame. ``stream`` identifies their purpose."""
        count = shape[0] * shape[1]
        bits = np.random.PCG64([self._seed, index + 1, stream]).random_raw(-(-count // 8))
        return bits.astype("<u8").view(np.uint8)[:count].reshape(shape)

    def noise_field(self, index: int, stream: int, window: int) -> Float:
        """Returns (H, W) nearly Gaussian noise of unit variance, correlated over about ``window`` pixels.

        Random bytes pass two integer box filters. For a window of one pixel, four bytes are summed instead.
        """
        height, width = self._shape
        box = max(1, round(0.7 * window))
        if box == 1:
            raw = self.random_bytes(index, stream, (4 * height, width)).astype(np.int64)
            summed = raw[0::4] + raw[1::4] + raw[2::4] + raw[3::4]
            return np.asarray((summed - 510.0) / (2.0 * _BYTE_DEVIATION), np.float64)
        raw = self.random_bytes(index, stream, (height + 2 * box - 2, width + 2 * box - 2)).astype(np.int32)
        once = np.empty((height + box - 1, width + box - 1), np.int32)
        twice = np.empty((height, width), np.int32)
        _box_sums(raw, box, once)
        _box_sums(once, box, twice)
        # Compute the sum of the squared weights of two successive box filters. Per axis it is b (2 b^2 + 1) /
        # 3.
        squares = box * (2 * box * box + 1) // 3
        return np.asarray((twice - 127.5 * box**4) * (1.0 / (squares * _BYTE_DEVIATION)), np.float64)


def _quantile(part: float) -> float:
    """Returns the ``part`` quantile of the standard normal distribution."""
    if part <= 0.0 or part >= 1.0:
        return -math.inf if part <= 0.0 else math.inf
    return float(round_to_grid(np.array(NormalDist().inv_cdf(part))))


@njit(cache=True, nogil=True)
def _box_sums(raw: Int32, box: int, out: Int32) -> None:
    """Fills ``out`` with integer sums of ``raw`` over box x box windows."""
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
