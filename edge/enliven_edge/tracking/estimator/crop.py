"""The network's input: an upright crop around a person, with cells of a known size in metres.

The crop has four channels: the person, the depth, the height above the floor, and unknown pixels. Pixels are
unknown if a nearer object hides the person, if nothing was measured, or outside the image. The crop is
upright and in metres. So people look the same at any distance, with any lens, and with a sensor that hangs
upside down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32
from enliven.kernels import njit
from enliven.masks import pixels_of

ROWS = 80
"""Rows of a crop, fixed by the network. A person with raised arms fits into them."""
COLUMNS = 64
"""Columns of a crop, fixed by the network. Outstretched arms fit into them."""
MIN_CELL_M = 0.02
"""Minimum size of a cell in metres at the person's depth. A finer crop would exceed the sensor's
resolution.
"""
MAX_CELL_M = 0.036
"""Maximum size of a cell in metres at the person's depth. 80 cells then cover a tall person with raised
arms."""
CROP_MARGIN = 1.2
"""Size of a crop relative to the visible part of the person. The margin includes limbs that the first
segmentation missed.
"""
CHANNELS = 4
"""Channels of a crop: the person, the depth, the height above the floor, and the unknown fraction."""
_CROP_SAMPLES = 500
"""Approximate number of pixels for measuring a person's position and size. It is enough for percentiles, and
sorting is fast."""
_OUTLIER_FRACTION = 0.01
"""Fraction of the lowest and of the highest samples that is ignored, because depth at edges may be wrong."""
_MIN_UP_LENGTH = 0.2
"""Minimum length of the world's up vector projected into the image. With a shorter one the view is from
above, and no image direction is upright."""
_OCCLUDER_DISTANCE_M = 0.1
"""Minimum distance in metres in front of the person's middle for an object to hide the person. Objects at a
similar depth are next to the person.
"""
_MIN_DEPTH_M = 0.1
"""Minimum depth of a joint in metres. A lower value would put the joint next to the sensor or behind it."""
_FLOOR_BAND_M = 0.08
"""Points below this height in metres do not hide a person, because they belong to the floor in front of the
feet.
"""


@dataclass(frozen=True)
class Crop:
    """A person's crop, and the transform from its coordinates to the camera's frame.

    Crop coordinates are in metres. The first two point right and down from the crop's middle, in the plane at
    ``depth``. The third is the distance behind that plane.

    Attributes:
        image: (4, 80, 64) float32. Channel 0 is the fraction of each cell that shows the person. Channels 1
            and 2 are the depth behind ``depth`` and the height above the floor, both in metres times that
            fraction. Channel 3 is the unknown fraction.
        depth: depth of the person's middle along the optical axis in metres.
        cell: size of a cell in metres, in the plane at ``depth``.
        axes: (2, 2) the crop's right and down in the image.
        centre: (2,) the crop's middle along them, at unit depth.
    """

    image: Float32
    depth: float
    cell: float
    axes: Float
    centre: Float

    @property
    def place(self) -> tuple[Float, Float, float]:
        """Returns the arguments of :func:`cells_at`: axes, centre, and cells per unit at unit depth."""
        return self.axes, self.centre, self.depth / self.cell

    def cells(self, rays: Float) -> Float:
        """Returns (N, 2) cells right and down from the crop's middle for (N, 2) rays, x/z and y/z."""
        return np.asarray(cells_at(rays, *self.place))

    def to_camera(self, points: Float) -> Float:
        """Returns (N, 3) points in the camera's frame from (N, 3) crop coordinates."""
        return np.asarray(_to_camera(points, self.depth, self.centre, self.axes))


@njit(cache=True, nogil=True)
def _to_camera(points, depth, centre, axes):
    """Computes :meth:`Crop.to_camera`. The depth is at least ``_MIN_DEPTH_M``."""
    out = np.empty((len(points), 3))
    for i in range(len(points)):
        right, down = points[i, 0] / depth + centre[0], points[i, 1] / depth + centre[1]
        z = max(points[i, 2] + depth, _MIN_DEPTH_M)
        out[i, 0] = (right * axes[0, 0] + down * axes[1, 0]) * z
        out[i, 1] = (right * axes[0, 1] + down * axes[1, 1]) * z
        out[i, 2] = z
    return out


@njit(cache=True, nogil=True)
def cells_at(rays, axes, centre, scale):
    """Computes :meth:`Crop.cells`."""
    out = np.empty((len(rays), 2))
    for i in range(len(rays)):
        for a in range(2):
            out[i, a] = (rays[i, 0] * axes[a, 0] + rays[i, 1] * axes[a, 1] - centre[a]) * scale
    return out


def crop_person(
    z: Float,
    mask: Bool,
    camera: Float,
    world_from_camera: Float,
    shift: Float | None = None,
    raised: float = 0.0,
) -> Crop:
    """Returns the crop around the masked person.

    Args:
        z: (h, w) metres along the optical axis; 0 where unknown.
        mask: (h, w) the person's pixels, at least one.
        camera: (4,) fx, fy, cx, cy.
        world_from_camera: (4, 4), the floor at y = 0.
        shift: (4,) for training: displacement of the crop in metres (3), and the logarithm of its additional
            scale.
        raised: for training: metres added to the height above the floor.
    """
    axes = _upright_axes(world_from_camera)
    low, high, depth = _person_extent(z, mask, camera, axes)
    displacement = np.zeros(4) if shift is None else shift
    depth = max(0.2, depth + float(displacement[2]))
    centre = 0.5 * (low + high) + displacement[:2] / depth
    needed_cell = max(float(high[0] - low[0]) / COLUMNS, float(high[1] - low[1]) / ROWS) * depth
    cell = min(max(CROP_MARGIN * needed_cell * math.exp(displacement[3]), MIN_CELL_M), MAX_CELL_M)
    image = np.zeros((CHANNELS, ROWS, COLUMNS), np.float32)
    _fill(image, z, mask, camera, np.ascontiguousarray(world_from_camera), axes, centre, depth, cell, raised)
    return Crop(image, depth, cell, axes, centre)


def _upright_axes(world_from_camera: Float) -> Float:
    """Returns the (2, 2) image directions that are right and down for an upright person."""
    x, y = float(world_from_camera[1, 0]), float(world_from_camera[1, 1])
    length = math.hypot(x, y)
    if length < _MIN_UP_LENGTH:
        return np.eye(2)
    x, y = x / length, y / length
    return np.array([[-y, x], [-x, -y]])


def _person_extent(z: Float, mask: Bool, camera: Float, axes: Float) -> tuple[Float, Float, float]:
    """Returns the person's (2,) minimum and maximum along the axes at unit depth, and its median depth."""
    ordered = np.sort(_samples(z, mask, camera, axes), axis=1)
    count = ordered.shape[1]
    first = int(_OUTLIER_FRACTION * count)
    return ordered[:2, first], ordered[:2, count - 1 - first], float(ordered[2, count // 2])


@njit(cache=True, nogil=True, error_model="numpy")
def _samples(z, mask, camera, axes):
    """Returns (3, N) coordinates of some masked pixels: right and down along the axes at unit depth, and
    depth.
    """
    pixels, width = pixels_of(mask), mask.shape[1]
    some = pixels[:: max(1, len(pixels) // _CROP_SAMPLES)]
    out = np.empty((3, len(some)))
    for n in range(len(some)):
        v, u = some[n] // width, some[n] % width
        x, y = (u - camera[2]) / camera[0], (v - camera[3]) / camera[1]
        out[0, n] = axes[0, 0] * x + axes[0, 1] * y
        out[1, n] = axes[1, 0] * x + axes[1, 1] * y
        out[2, n] = z[v, u]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(image, z, mask, camera, pose, axes, centre, depth, cell, raised):
    """Fills the four channels. The value of a cell is the mean of four pixels, the nearest to the centres of
    its quarters.
    """
    rows, columns = image.shape[1:]
    size, rise = cell / depth, pose[1]
    z, mask, shape = z.ravel(), mask.ravel(), z.shape
    rays, pixels = np.empty((2, 2 * columns)), np.empty(2 * columns, np.int32)
    for i in range(2 * rows):
        down = (0.5 * i + 0.25 - 0.5 * rows) * size + centre[1]
        _cast_rays(rays, pixels, down, size, camera, axes, centre, shape)
        row = i // 2
        for j in range(2 * columns):
            column, pixel = j // 2, np.uintp(pixels[j])
            if pixels[j] < 0 or z[pixel] == 0.0:
                image[3, row, column] += 0.25
                continue
            away = z[pixel]
            if not mask[pixel] and away >= depth - _OCCLUDER_DISTANCE_M:
                continue
            level = (rise[0] * rays[0, j] + rise[1] * rays[1, j] + rise[2]) * away + rise[3]
            if mask[pixel]:
                image[0, row, column] += 0.25
                image[1, row, column] += 0.25 * (away - depth)
                image[2, row, column] += 0.25 * (level + raised)
            elif level > _FLOOR_BAND_M:
                image[3, row, column] += 0.25


@njit(cache=True, nogil=True, error_model="numpy")
def _cast_rays(rays, pixels, down, size, camera, axes, centre, shape):
    """Computes the rays and pixels of a row of quarter cells ``down`` from the crop's middle, at unit depth.
    It writes the rays, x/z and y/z, into (2, J) ``rays``, and the flat pixel indices into (J,) ``pixels``; -1
    outside the image. The loop does not depend on the image's contents, so that the compiler can vectorise
    it.
    """
    height, width = shape
    fx, fy, cx, cy = camera
    for j in range(len(pixels)):
        right = (0.5 * j + 0.25 - 0.25 * len(pixels)) * size + centre[0]
        x = axes[0, 0] * right + axes[1, 0] * down
        y = axes[0, 1] * right + axes[1, 1] * down
        u, v = np.floor(fx * x + cx + 0.5), np.floor(fy * y + cy + 0.5)
        inside = (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height)
        pixels[j] = np.int32(v * width + u) if inside else np.int32(-1)
        rays[0, j], rays[1, j] = x, y
