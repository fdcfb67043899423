"""Preview of a growing scan: the surface in cubic pieces, at a lower resolution than the final surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int, Int32, UInt8, UInt16
from enliven.kernels import njit
from enliven.scanning.blocks import SIDE, VOXELS
from enliven.scanning.cube_table import MOST_TRIANGLES, STARTS, triangle_table
from enliven.scanning.tsdf_volume import TsdfVolume

PIECE = 8
"""Number of blocks along a side of a piece. With 4 mm voxels, a piece is 26 cm wide."""
STEPS = 512
"""Quantization steps of vertex positions per voxel. The side of a piece, 64 voxels, has 32768 steps."""
PIECE_STEPS = PIECE * SIDE * STEPS
"""Number of quantization steps along the side of a piece."""
_VOXELS_PER_CELL = 2
"""Number of voxels along the side of a preview cell. With two voxels, a preview has a quarter of the
triangles, and legs of 2 cm are still connected."""
_CELLS_PER_BLOCK = SIDE // _VOXELS_PER_CELL
"""Number of preview cells along a side of a block."""
_MIN_VOXEL_WEIGHT = 0.05
"""Minimum sum of weights of a voxel that is shown. It is half of the minimum for the final surface."""
_WELL_OBSERVED_WEIGHT = 1.2
"""Sum of weights of a well-observed voxel: six observations from 1.5 m."""
_EDGE_STARTS = np.array(STARTS, np.int32)
"""(3, 4) for each axis, the corners at which the four edges along it begin."""


@dataclass(frozen=True)
class ScanPiece:
    """A piece of the surface.

    Attributes:
        place: (3,) position of the piece, in piece sides from the scan's origin.
        places: (V, 3) uint16 vertex positions, in units of ``step`` metres from the piece's corner.
        colours: (V, 3) uint8 sRGB, or None.
        seen: (V,) uint8 quality of the observation; 255 if the surface was observed well.
        faces: (F, 3) int32 vertex numbers.
        step: quantization step of ``places``, metres.
    """

    place: tuple[int, int, int]
    places: UInt16
    colours: UInt8 | None
    seen: UInt8
    faces: Int32
    step: float

    @property
    def vertices(self) -> Float:
        """(V, 3) vertex positions in the scan's world, metres."""
        return (self.places + np.array(self.place) * float(PIECE_STEPS)) * self.step


@dataclass(frozen=True)
class PieceSums:
    """Summary of a volume's contents per piece.

    Attributes:
        places: (P, 3) positions of the pieces.
        counts: (P,) number of blocks with a surface.
        weights: (P,) sums of the weights in these blocks.
        piece: (B,) the piece of each of these blocks.
        blocks: (B,) the block's number in the volume.
    """

    places: Int
    counts: Int
    weights: Float
    piece: Int
    blocks: Int


def sum_pieces(volume: TsdfVolume) -> PieceSums:
    """Returns a summary of each piece of a volume. A changed summary shows that the piece has changed."""
    count = volume.blocks.count
    neighbours, solid = volume.blocks.neighbour_blocks[:count], volume.solid[:count]
    # A cell begins in its own block, but its far corners may lie in neighbouring blocks.
    blocks = np.flatnonzero((solid[np.maximum(neighbours, 0)] & (neighbours >= 0)).any(1))
    weights = np.empty(len(blocks))
    _sum_weights(blocks, volume.weight, weights)
    block_pieces = volume.blocks.places[blocks].astype(np.int64) // PIECE
    piece_places, piece_numbers = np.unique(block_pieces, axis=0, return_inverse=True)
    piece_numbers = piece_numbers.reshape(-1).astype(np.int64)
    counts = np.bincount(piece_numbers, minlength=len(piece_places)).astype(np.int64)
    sums = np.asarray(np.bincount(piece_numbers, weights, len(piece_places)), np.float64)
    return PieceSums(piece_places, counts, sums, piece_numbers, blocks)


def extract_piece(volume: TsdfVolume, place: tuple[int, int, int], blocks: Int) -> ScanPiece:
    """Returns the surface in the given blocks (B,) of a piece."""
    max_corners = len(blocks) * _CELLS_PER_BLOCK**3 * MOST_TRIANGLES * 3
    places, certainties = np.empty((max_corners, 3), np.uint16), np.empty(max_corners, np.uint8)
    colours = np.zeros((max_corners if len(volume.hue) else 0, 3), np.uint8)
    corner = np.array(place, np.int64) * PIECE
    used = _write_corners(
        blocks, volume.blocks.neighbour_blocks, volume.blocks.places, corner, volume.distance, volume.weight,
        volume.hue, triangle_table(), places, colours, certainties,
    )  # fmt: skip
    coordinates = places[:used].astype(np.int64)
    keys = coordinates[:, 0] << 32 | coordinates[:, 1] << 16 | coordinates[:, 2]
    _, first_corners, corner_vertices = np.unique(keys, return_index=True, return_inverse=True)
    faces = corner_vertices.reshape(-1, 3).astype(np.int32)
    is_proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    tinted = colours[:used][first_corners] if len(volume.hue) else None
    step = volume.band.voxel / STEPS
    return ScanPiece(
        place, places[:used][first_corners], tinted, certainties[:used][first_corners], faces[is_proper], step
    )


@njit(cache=True, nogil=True)
def _sum_weights(blocks, weight, sums):
    """Writes the sum of the voxel weights of each of the ``blocks`` (B,) into ``sums`` (B,)."""
    for n in range(len(blocks)):
        total = 0.0
        for i in range(VOXELS):
            total += weight[blocks[n], i]
        sums[n] = total


@njit(cache=True, nogil=True)
def _block_and_voxel(b, x, y, z, neighbour_blocks):
    """Returns the block and the voxel number at the voxel position (x, y, z) relative to block ``b``. The
    position may be in the next block.
    """
    other = neighbour_blocks[b, (x >> 3) + 2 * (y >> 3) + 4 * (z >> 3)]
    return other, (x & 7) + SIDE * (y & 7) + SIDE * SIDE * (z & 7)


@njit(cache=True, nogil=True)
def _cell_case(b, x, y, z, neighbour_blocks, distance, weight):
    """Returns the case of a cell (its row in the triangle table), or 0 if a corner is unknown."""
    case = 0
    for k in range(8):
        at = (
            x + _VOXELS_PER_CELL * (k & 1),
            y + _VOXELS_PER_CELL * ((k >> 1) & 1),
            z + _VOXELS_PER_CELL * (k >> 2),
        )
        other, i = _block_and_voxel(b, at[0], at[1], at[2], neighbour_blocks)
        if other < 0 or weight[other, i] < _MIN_VOXEL_WEIGHT:
            return 0
        case |= (1 << k) if distance[other, i] < 0.0 else 0
    return case


@njit(cache=True, nogil=True)
def _write_corners(blocks, neighbour_blocks, at, corner, distance, weight, hue, table, places, colours, seen):
    """Writes the corners of the triangles in the given ``blocks``, three per triangle. Returns the number of
    corners."""
    used = 0
    place = np.empty(3, np.int64)
    for b in blocks:
        for cell in range(_CELLS_PER_BLOCK**3):
            x, y = (
                _VOXELS_PER_CELL * (cell % _CELLS_PER_BLOCK),
                _VOXELS_PER_CELL * (cell // _CELLS_PER_BLOCK % _CELLS_PER_BLOCK),
            )
            z = _VOXELS_PER_CELL * (cell // _CELLS_PER_BLOCK**2)
            case = _cell_case(b, x, y, z, neighbour_blocks, distance, weight)
            if case == 0 or case == 255:
                continue
            k = 0
            while table[case, k] >= 0:
                axis, start = table[case, k] // 4, _EDGE_STARTS[table[case, k] // 4, table[case, k] % 4]
                place[0], place[1] = (
                    x + _VOXELS_PER_CELL * (start & 1),
                    y + _VOXELS_PER_CELL * ((start >> 1) & 1),
                )
                place[2] = z + _VOXELS_PER_CELL * (start >> 2)
                first_block, i = _block_and_voxel(b, place[0], place[1], place[2], neighbour_blocks)
                place[axis] += _VOXELS_PER_CELL
                second_block, j = _block_and_voxel(b, place[0], place[1], place[2], neighbour_blocks)
                place[axis] -= _VOXELS_PER_CELL
                share = distance[first_block, i] / (distance[first_block, i] - distance[second_block, j])
                for c in range(3):
                    voxels = SIDE * (at[b, c] - corner[c]) + place[c] + _VOXELS_PER_CELL * share * (axis == c)
                    places[used, c] = np.uint16(voxels * STEPS + 0.5)
                for c in range(len(colours) and 3):
                    # If only one end of the edge has a colour, the vertex takes that colour. 0 means no
                    # colour.
                    first = hue[first_block, i, c] if hue[first_block, i, c] > 0 else hue[second_block, j, c]
                    second = hue[second_block, j, c] if hue[second_block, j, c] > 0 else first
                    colours[used, c] = np.uint8(min((first + share * (float(second) - first)) / 256.0, 255.0))
                certainty = min(weight[first_block, i], weight[second_block, j]) / _WELL_OBSERVED_WEIGHT
                seen[used] = np.uint8(min(255.0 * certainty, 255.0))
                used += 1
                k += 1
    return used
