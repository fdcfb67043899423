"""Extracts the surface of a sparse TSDF volume as a triangle mesh, by marching cubes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit
from enliven.meshes import Mesh
from enliven.scanning.blocks import SIDE, VOXELS
from enliven.scanning.cube_table import STARTS, triangle_table
from enliven.scanning.tsdf_volume import TsdfVolume

_EDGE_STARTS = np.array(STARTS, np.int32)
"""(3, 4) for each axis, the corners at which the four edges along it begin."""
_MIN_VOXEL_WEIGHT = 0.1
"""Minimum sum of weights of a voxel that counts as observed: one observation from nearby, or two from two
metres away."""


def extract_surface(volume: TsdfVolume, support: float = _MIN_VOXEL_WEIGHT) -> Mesh:
    """Returns the surface as a mesh (metres, world). The mesh is open at unobserved voxels, and has colours
    if the volume has colours.

    Args:
        support: minimum sum of weights of a voxel.
    """
    count = volume.blocks.count
    neighbours, solid = volume.blocks.neighbour_blocks[:count], volume.solid[:count]
    is_active = solid | (solid[np.maximum(neighbours, 0)] & (neighbours >= 0)).any(1)
    rows = np.full(count, -1, np.int64)
    # The edges of a cell begin in its own block or in a neighbouring block.
    neighbour_blocks = neighbours[is_active]
    owners = np.unique(neighbour_blocks[neighbour_blocks >= 0])
    rows[owners] = np.arange(len(owners))
    numbers = np.full((len(owners), VOXELS, 3), -1, np.int32)
    table, blocks = triangle_table(), np.flatnonzero(is_active)
    arguments = (blocks, neighbours, volume.distance, volume.weight, np.float32(support), table)
    faces_count, vertices_count = _number_vertices(*arguments, rows, numbers)
    vertices, faces = np.empty((vertices_count, 3)), np.empty((faces_count, 3), np.int32)
    colours = np.zeros((vertices_count if len(volume.hue) else 0, 3), np.uint8)
    has_colour = np.zeros(len(colours), np.bool_)
    _place_vertices(
        owners, numbers, neighbours, volume.blocks.places, volume.distance, volume.hue, volume.band.voxel,
        vertices, colours, has_colour,
    )  # fmt: skip
    _write_faces(*arguments, rows, numbers, faces)
    return Mesh(
        vertices, faces, "scan", _fill_colours(vertices, colours, has_colour) if len(volume.hue) else None
    )


def _fill_colours(vertices: Float, colours: UInt8, has_colour: Bool) -> UInt8:
    """Returns the colours (V, 3). A vertex without a colour gets the colour of the nearest vertex that has
    one."""
    if has_colour.any() and not has_colour.all():
        colours[~has_colour] = colours[has_colour][
            cKDTree(vertices[has_colour]).query(vertices[~has_colour])[1]
        ]
    return colours


@njit(cache=True, nogil=True)
def _gather_distances(b, neighbour_blocks, distance, weight, support, cells):
    """Gathers (9, 9, 9) signed distances into ``cells``: those of block ``b``, and of the adjacent layer of
    its neighbours. Voxels with a weight below ``support`` get NaN.
    """
    for z in range(SIDE + 1):
        for y in range(SIDE + 1):
            for x in range(SIDE + 1):
                other = neighbour_blocks[b, (x >> 3) + 2 * (y >> 3) + 4 * (z >> 3)]
                i = (x & 7) + SIDE * (y & 7) + SIDE * SIDE * (z & 7)
                is_known = other >= 0 and weight[other, i] >= support
                cells[z, y, x] = distance[other, i] if is_known else np.float32(np.nan)


@njit(cache=True, nogil=True)
def _cell_case(cells, x, y, z):
    """Returns the case of a cell (its row in the triangle table), or 0 if a corner is unknown."""
    case = 0
    for k in range(8):
        d = cells[z + (k >> 2), y + ((k >> 1) & 1), x + (k & 1)]
        if np.isnan(d):
            return 0
        case |= (1 << k) if d < 0.0 else 0
    return case


@njit(cache=True, nogil=True)
def _locate_edge(b, neighbour_blocks, x, y, z, edge):
    """Returns where edge ``edge`` of the cell (x, y, z) of block ``b`` begins, as block and voxel number, and
    its axis."""
    axis, corner = edge // 4, _EDGE_STARTS[edge // 4, edge % 4]
    x, y, z = x + (corner & 1), y + ((corner >> 1) & 1), z + (corner >> 2)
    owner = neighbour_blocks[b, (x >> 3) + 2 * (y >> 3) + 4 * (z >> 3)]
    return owner, (x & 7) + SIDE * (y & 7) + SIDE * SIDE * (z & 7), axis


@njit(cache=True, nogil=True)
def _number_vertices(blocks, neighbour_blocks, distance, weight, support, table, rows, numbers):
    """Numbers the voxel edges that the surface crosses, and writes the vertex numbers into ``numbers``.
    Returns the numbers of faces and vertices."""
    cells = np.empty((SIDE + 1, SIDE + 1, SIDE + 1), np.float32)
    faces, vertices = 0, 0
    for b in blocks:
        _gather_distances(b, neighbour_blocks, distance, weight, support, cells)
        for z in range(SIDE):
            for y in range(SIDE):
                for x in range(SIDE):
                    case = _cell_case(cells, x, y, z)
                    if case == 0 or case == 255:
                        continue
                    k = 0
                    while table[case, k] >= 0:
                        owner, i, axis = _locate_edge(b, neighbour_blocks, x, y, z, table[case, k])
                        if numbers[rows[owner], i, axis] < 0:
                            numbers[rows[owner], i, axis] = vertices
                            vertices += 1
                        k += 1
                    faces += k // 3
    return faces, vertices


@njit(cache=True, nogil=True)
def _place_vertices(
    owners, numbers, neighbour_blocks, places, distance, hue, voxel, vertices, colours, has_colour
):
    """Computes the vertex positions on the numbered edges, their colours, and ``has_colour``: True for each
    vertex with a colour.
    """
    for row in range(len(owners)):
        b = owners[row]
        for i in range(VOXELS):
            for axis in range(3):
                number = numbers[row, i, axis]
                if number < 0:
                    continue
                x, y, z = i & 7, (i >> 3) & 7, i >> 6
                ex, ey, ez = x + (axis == 0), y + (axis == 1), z + (axis == 2)
                other = neighbour_blocks[b, (ex >> 3) + 2 * (ey >> 3) + 4 * (ez >> 3)]
                first = distance[b, i]
                beyond = (ex & 7) + SIDE * (ey & 7) + SIDE * SIDE * (ez & 7)
                second = distance[other, beyond]
                share = first / (first - second)
                vertices[number, 0] = voxel * (SIDE * places[b, 0] + x + share * (axis == 0))
                vertices[number, 1] = voxel * (SIDE * places[b, 1] + y + share * (axis == 1))
                vertices[number, 2] = voxel * (SIDE * places[b, 2] + z + share * (axis == 2))
                for c in range(len(colours) and 3):
                    # If only one end of the edge has a colour, the vertex takes that colour. 0 means no
                    # colour.
                    near_colour = hue[b, i, c] if hue[b, i, c] > 0 else hue[other, beyond, c]
                    far_colour = hue[other, beyond, c] if hue[other, beyond, c] > 0 else near_colour
                    mixed = near_colour + share * (float(far_colour) - near_colour)
                    colours[number, c] = np.uint8(min(mixed / 256.0 + 0.5, 255.0))
                    has_colour[number] = near_colour > 0


@njit(cache=True, nogil=True)
def _write_faces(blocks, neighbour_blocks, distance, weight, support, table, rows, numbers, faces):
    """Writes the faces of all cells into ``faces`` (F, 3)."""
    cells = np.empty((SIDE + 1, SIDE + 1, SIDE + 1), np.float32)
    face = 0
    for b in blocks:
        _gather_distances(b, neighbour_blocks, distance, weight, support, cells)
        for z in range(SIDE):
            for y in range(SIDE):
                for x in range(SIDE):
                    case = _cell_case(cells, x, y, z)
                    if case == 0 or case == 255:
                        continue
                    k = 0
                    while table[case, k] >= 0:
                        owner, i, axis = _locate_edge(b, neighbour_blocks, x, y, z, table[case, k])
                        faces[face + k // 3, k % 3] = numbers[rows[owner], i, axis]
                        k += 1
                    face += k // 3
