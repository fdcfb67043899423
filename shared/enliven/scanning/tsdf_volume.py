"""A TSDF volume (truncated signed distances) in sparse blocks: fuses depth images into a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int, UInt8, UInt16
from enliven.kernels import run_in_pieces
from enliven.scanning.blocks import VOXELS, BlockTable, grow_array, link_neighbours
from enliven.scanning.depth_view import DepthView
from enliven.scanning.integration import FREE, NEAR, allocate_blocks, classify_blocks, integrate_image
from enliven.scanning.kernel_arguments import (
    CameraArrays,
    DistanceBand,
    FieldArrays,
    ImageArrays,
    VoxelArrays,
)
from enliven.scanning.settings import VolumeSettings

TRUNCATION_VOXELS = 4.0
"""Truncation distance of the TSDF in front of a surface. Noisy depth needs a larger distance."""
TRUNCATION_BEHIND_VOXELS = 3.0
"""Truncation distance of the TSDF behind a surface. It should be smaller than the thickness of thin parts."""

_BLOCKS_PER_PIECE = 64
"""Number of blocks that a thread processes at a time, which takes 0.1 ms."""
_PIXEL_STRIDE = 2
"""Distance, in half-size pixels, between the pixels that may allocate new blocks. The offset changes with
each image."""


@dataclass(frozen=True)
class FusionResult:
    """The effect of an image on a volume: the numbers of changed and new blocks, and True if the memory was
    sufficient.
    """

    changed: int
    new: int
    has_memory: bool


class TsdfVolume:
    """A TSDF volume: averages of truncated signed distances, metres, positive in front of the surface.

    A voxel's distance is measured to the plane of the pixel onto which the voxel projects (Bylow et al., RSS
    2013), and weighted by the reliability of the pixel's depth. No weight depends on earlier images, so the
    order of images does not matter.

    Args:
        voxel: side of a voxel, metres.
        settings: the truncation distances about a surface, in voxels, the camera's noise, and the memory
            limit.
        reach: maximum distance from the camera, metres, at which a surface gets blocks.
    """

    def __init__(
        self, settings: VolumeSettings, voxel: float | None = None, reach: float | None = None
    ) -> None:
        size = voxel or settings.voxel
        self.band = DistanceBand(size, TRUNCATION_VOXELS * size, TRUNCATION_BEHIND_VOXELS * size)
        self.settings, self.reach = settings, reach or settings.reach
        noise = settings.noise
        self._limits = np.array(
            [settings.near, settings.far, noise.constant, noise.quadratic, noise.start], np.float32
        )
        self.blocks = BlockTable()
        self.distance: Float32 = np.zeros((self.blocks.capacity, VOXELS), np.float32)
        self.weight: Float32 = np.zeros((self.blocks.capacity, VOXELS), np.float32)
        self.solid: Bool = np.zeros(self.blocks.capacity, np.bool_)
        self.hue: UInt16 = np.zeros((0, VOXELS, 3), np.uint16)
        self._images = 0

    @property
    def megabytes(self) -> float:
        """Memory of the voxels and of their table, in megabytes."""
        arrays = (
            self.distance,
            self.weight,
            self.hue,
            self.blocks.places,
            self.blocks.neighbour_blocks,
            self.blocks.keys,
        )
        return sum(array.nbytes for array in arrays) * 1e-6

    def integrate(self, view: DepthView, world_from_camera: Float) -> FusionResult:
        """Fuses a depth image into the volume, as a running average of distances.

        Args:
            world_from_camera: (4, 4) pose of the camera.
        """
        old_count, had_memory = self.blocks.count, self.allocate(view, world_from_camera)
        count = self.blocks.count
        camera = self._camera_arrays(view, world_from_camera)
        state: UInt8 = np.empty(count, np.uint8)
        blocks = self.blocks
        run_in_pieces(
            classify_blocks,
            count,
            1024,
            blocks.places,
            self.band,
            camera,
            view.tiles,
            view.weights.shape,
            state,
        )
        block_numbers: Int = np.flatnonzero((state == NEAR) | ((state == FREE) & self.solid[:count]))
        image = ImageArrays(
            view.planes.reshape(-1), view.weights.reshape(-1), self._image_arrays(view), view.weights.shape
        )
        voxels = VoxelArrays(self.distance, self.weight, self.solid, self.hue)
        run_in_pieces(
            integrate_image,
            len(block_numbers),
            _BLOCKS_PER_PIECE,
            block_numbers,
            state,
            blocks.places,
            self.band,
            camera,
            image,
            voxels,
        )
        self._images += 1
        return FusionResult(len(block_numbers), count - old_count, had_memory)

    def allocate(self, view: DepthView, world_from_camera: Float) -> bool:
        """Adds the blocks that an image needs, as :meth:`integrate` does. Returns True if there was enough
        memory.
        """
        old_count, blocks = self.blocks.count, self.blocks
        points = view.point_arrays
        rotation_matrix = np.ascontiguousarray(world_from_camera[:3, :3], np.float32)
        translation = world_from_camera[:3, 3].astype(np.float32)
        phase, had_memory = self._images * 3 % _PIXEL_STRIDE**2, True
        while True:
            blocks.count = allocate_blocks(
                points, _PIXEL_STRIDE, phase, self.reach, rotation_matrix, translation, self.band,
                blocks.keys, blocks.slots, blocks.places, blocks.count,
            )  # fmt: skip
            if blocks.count < blocks.capacity:
                break
            if not self._make_room():
                had_memory = False
                break
        link_neighbours(
            blocks.keys, blocks.slots, blocks.places, blocks.neighbour_blocks, old_count, blocks.count
        )
        return had_memory

    def _image_arrays(self, view: DepthView) -> UInt8:
        """Returns the image's colours (3 H W,) as a kernel argument. The array is empty if colours are
        off."""
        if view.colour is None or not self.settings.colour:
            return np.empty(0, np.uint8)
        if len(self.hue) < len(self.distance):
            self.hue = grow_array(self.hue, len(self.distance), 0)
        return np.ascontiguousarray(view.colour).reshape(-1)

    def _make_room(self) -> bool:
        """Enlarges the capacity for more blocks. Returns True if the memory limit allows it."""
        if self.megabytes * 1.5 > self.settings.memory:
            return False
        self.blocks.grow()
        capacity = self.blocks.capacity
        self.distance, self.weight = (
            grow_array(self.distance, capacity, 0),
            grow_array(self.weight, capacity, 0),
        )
        self.solid = grow_array(self.solid, capacity, 0)
        self.hue = grow_array(self.hue, capacity, 0) if len(self.hue) else self.hue
        return True

    @property
    def field(self) -> FieldArrays:
        """The signed distances as an argument of kernels."""
        b = self.blocks
        return FieldArrays(b.keys, b.slots, b.neighbour_blocks, self.distance, self.weight, self.band)

    def _camera_arrays(self, view: DepthView, world_from_camera: Float) -> CameraArrays:
        """Returns the camera as an argument of kernels."""
        rotation_matrix = np.ascontiguousarray(world_from_camera[:3, :3].T)
        i = view.intrinsics
        return CameraArrays(
            rotation_matrix.astype(np.float32),
            (-rotation_matrix @ world_from_camera[:3, 3]).astype(np.float32),
            np.array([i.fx, i.fy, i.cx, i.cy], np.float32),
            self._limits,
        )

    def clear(self) -> None:
        """Empties the volume, but keeps the allocated memory for reuse."""
        for array in (self.distance, self.weight, self.solid, self.hue):
            array[: self.blocks.count] = 0
        self.blocks.keep_blocks(np.empty(0, np.int64))
        self._images = 0

    def clean(self) -> int:
        """Removes the blocks that contain no surface. Returns the number of removed blocks."""
        count = self.blocks.count
        is_kept = self.solid[:count].copy()
        # Also keep the neighbours of each block, because a surface continues from one block into the next.
        for k in range(1, 8):
            neighbours = self.blocks.neighbour_blocks[:count, k]
            exists = neighbours >= 0
            is_kept[:count][exists] |= self.solid[neighbours[exists]]
            is_kept[neighbours[exists]] |= self.solid[:count][exists]
        kept_blocks = np.flatnonzero(is_kept)
        for array in (self.distance, self.weight, self.solid, *([self.hue] if len(self.hue) else [])):
            array[: len(kept_blocks)] = array[kept_blocks]
            array[len(kept_blocks) : count] = 0
        self.blocks.keep_blocks(kept_blocks)
        return count - len(kept_blocks)
