"""A TSDF volume (truncated signed distances) in sparse blocks: fuses depth images into a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int, UInt8, UInt16
from enliven.scanning.blocks import VOXELS, BlockTable, grow_array, link
from enliven.scanning.depth_view import DepthView
from enliven.scanning.integration import FREE, NEAR, allocate, classify, integrate
from enliven.scanning.kernel_arguments import (
    CameraArrays,
    DistanceBand,
    FieldArrays,
    ImageArrays,
    VoxelArrays,
)
from enliven.scanning.settings import VolumeSettings
from enliven.scanning.threads import run_in_pieces

_BLOCKS_PER_PIECE = 64
"""Blocks that a thread processes at a time: 0.1 ms."""
_PIXEL_STRIDE = 2
"""Distance, in half-size pixels, between the pixels that may allocate new blocks. The offset changes with
each image."""


@dataclass(frozen=True)
class FusionResult:
    """The effect of an image on a volume: the number of changed and of new blocks, and True if there was
    enough memory.
    """

    changed: int
    new: int
    room: bool


class TsdfVolume:
    """A TSDF volume: averages of truncated signed distances, metres, positive in front of the surface.

    A voxel's distance is that to the plane of the pixel that shows it (Bylow et al., RSS 2013), weighted by
    the reliability of the pixel's depth. No weight depends on earlier images, so the order of images does not
    matter.

    Args:
        voxel: metres, side of a voxel.
        settings: the truncation distances about a surface, in voxels, the camera's noise, and the memory
            limit.
        reach: metres; surfaces farther from the camera get no blocks.
    """

    def __init__(
        self, settings: VolumeSettings, voxel: float | None = None, reach: float | None = None
    ) -> None:
        size = voxel or settings.voxel
        self.band = DistanceBand(size, settings.truncation * size, settings.behind * size)
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
        """Memory of the voxels and of their table."""
        arrays = (
            self.distance,
            self.weight,
            self.hue,
            self.blocks.places,
            self.blocks.beside,
            self.blocks.keys,
        )
        return sum(array.nbytes for array in arrays) * 1e-6

    def integrate(self, view: DepthView, world_from_camera: Float) -> FusionResult:
        """Averages a depth image into the volume.

        Args:
            world_from_camera: (4, 4) pose of the camera.
        """
        before, room = self.blocks.count, self.allocate(view, world_from_camera)
        count = self.blocks.count
        camera = self._camera_arrays(view, world_from_camera)
        state: UInt8 = np.empty(count, np.uint8)
        blocks = self.blocks
        run_in_pieces(
            classify, count, 1024, blocks.places, self.band, camera, view.tiles, view.weights.shape, state
        )
        jobs: Int = np.flatnonzero((state == NEAR) | ((state == FREE) & self.solid[:count]))
        image = ImageArrays(
            view.planes.reshape(-1), view.weights.reshape(-1), self._image_arrays(view), view.weights.shape
        )
        voxels = VoxelArrays(self.distance, self.weight, self.solid, self.hue)
        run_in_pieces(
            integrate,
            len(jobs),
            _BLOCKS_PER_PIECE,
            jobs,
            state,
            blocks.places,
            self.band,
            camera,
            image,
            voxels,
        )
        self._images += 1
        return FusionResult(len(jobs), count - before, room)

    def allocate(self, view: DepthView, world_from_camera: Float) -> bool:
        """Adds the blocks that an image needs, as :meth:`integrate` does. Returns True if there was enough
        memory.
        """
        before, blocks = self.blocks.count, self.blocks
        points = view.point_arrays
        turn = np.ascontiguousarray(world_from_camera[:3, :3], np.float32)
        place = world_from_camera[:3, 3].astype(np.float32)
        phase, room = self._images * 3 % _PIXEL_STRIDE**2, True
        while True:
            blocks.count = allocate(
                points, _PIXEL_STRIDE, phase, self.reach, turn, place, self.band, blocks.keys, blocks.slots,
                blocks.places, blocks.count,
            )  # fmt: skip
            if blocks.count < blocks.capacity:
                break
            if not self._make_room():
                room = False
                break
        link(blocks.keys, blocks.slots, blocks.places, blocks.beside, before, blocks.count)
        return room

    def _image_arrays(self, view: DepthView) -> UInt8:
        """Returns the image's colours in the form that a kernel takes, empty if colours are off."""
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
        """The signed distances in the form that kernels take."""
        b = self.blocks
        return FieldArrays(b.keys, b.slots, b.beside, self.distance, self.weight, self.band)

    def _camera_arrays(self, view: DepthView, world_from_camera: Float) -> CameraArrays:
        """Returns the camera in the form that kernels take."""
        turn = np.ascontiguousarray(world_from_camera[:3, :3].T)
        i = view.intrinsics
        return CameraArrays(
            turn.astype(np.float32),
            (-turn @ world_from_camera[:3, 3]).astype(np.float32),
            np.array([i.fx, i.fy, i.cx, i.cy], np.float32),
            self._limits,
        )

    def clear(self) -> None:
        """Discards all images but keeps the allocated memory for the next ones."""
        for array in (self.distance, self.weight, self.solid, self.hue):
            array[: self.blocks.count] = 0
        self.blocks.keep(np.empty(0, np.int64))
        self._images = 0

    def clean(self) -> int:
        """Removes the blocks that contain no surface. Returns the number of removed blocks."""
        count = self.blocks.count
        near = self.solid[:count].copy()
        # Include the neighbours of each block, because a surface crosses from one block into the next.
        for k in range(1, 8):
            other = self.blocks.beside[:count, k]
            exists = other >= 0
            near[:count][exists] |= self.solid[other[exists]]
            near[other[exists]] |= self.solid[:count][exists]
        kept_blocks = np.flatnonzero(near)
        for array in (self.distance, self.weight, self.solid, *([self.hue] if len(self.hue) else [])):
            array[: len(kept_blocks)] = array[kept_blocks]
            array[len(kept_blocks) : count] = 0
        self.blocks.keep(kept_blocks)
        return count - len(kept_blocks)
