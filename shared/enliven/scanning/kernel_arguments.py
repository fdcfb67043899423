"""Named tuples of arrays: the arguments of the compiled loops of fusion and tracking."""

from __future__ import annotations

from typing import NamedTuple

from enliven.arrays import Bool, Float32, Int, Int32, UInt8, UInt16


class DistanceBand(NamedTuple):
    """The voxel size of a volume and its truncation distances, metres."""

    voxel: float
    front: float
    behind: float


class ImageArrays(NamedTuple):
    """A depth view as an argument of the fusion kernels.

    Attributes:
        planes: (4 H W,), weights: (H W,) float32 as in a :class:`DepthView`.
        colours: (3 H W,) uint8 sRGB, empty if there are none.
        shape: (H, W) of the image, in pixels.
    """

    planes: Float32
    weights: Float32
    colours: UInt8
    shape: tuple[int, ...]


class VoxelArrays(NamedTuple):
    """The contents of the voxels of C blocks.

    Attributes:
        distance: (C, 512) float32 average signed distance from the surface, metres, positive in front of it.
        weight: (C, 512) float32 sum of weights; 0 for unobserved voxels.
        solid: (C,) True if the block has voxels behind the surface.
        hue: (C, 512, 3) uint16 average sRGB colour in 256ths, 0 for a voxel without colour; (0, 512, 3) if
            the volume stores no colours.
    """

    distance: Float32
    weight: Float32
    solid: Bool
    hue: UInt16


class CameraArrays(NamedTuple):
    """A camera and its pose as an argument of the kernels.

    Attributes:
        turn: (3, 3) float32 rotation of camera_from_world.
        place: (3,) float32 translation of camera_from_world.
        lens: (4,) float32 fx, fy, cx, cy.
        limits: (5,) float32 minimum and maximum depth (m), and the three parameters of the noise model.
    """

    turn: Float32
    place: Float32
    lens: Float32
    limits: Float32


class PointArrays(NamedTuple):
    """The points of a half-size image, camera frame.

    Attributes:
        places: (h, w, 3) float32 metres, the positions.
        normals: (h, w, 3) float32 towards the camera.
        worth: (h, w) float32 weights, 0 for a pixel without a point.
    """

    places: Float32
    normals: Float32
    worth: Float32


class FieldArrays(NamedTuple):
    """The signed distances of a volume and the hash table to find them.

    Attributes:
        keys: (S,), slots: (S,) of the hash table of blocks.
        neighbour_blocks: (C, 8) neighbours of each block, as in a :class:`BlockTable`.
        distance: (C, 512), weight: (C, 512) of its voxels.
        band: the voxel size and truncation distances.
    """

    keys: Int
    slots: Int32
    neighbour_blocks: Int32
    distance: Float32
    weight: Float32
    band: DistanceBand
