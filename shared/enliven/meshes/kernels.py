"""Compiled loops over a mesh's arrays: welding by position, normals, connected components (shells), splitting
of long edges.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import Float, Int32
from enliven.kernels import copy_row, copy_rows, njit
from enliven.union_find import join, root_of


@njit(cache=True, nogil=True)
def face_vectors(vertices, faces):
    """Returns (F, 3) the cross product of two edges of each face. It points along the face normal, and its
    length is twice the area.
    """
    out = np.empty((faces.shape[0], 3))
    for f in range(faces.shape[0]):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        out[f, 0], out[f, 1], out[f, 2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return out


@njit(cache=True, nogil=True)
def face_areas(vertices, faces):
    """Returns (F,) twice the area of each face."""
    out = np.empty(faces.shape[0])
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        ux, uy, uz = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
        vx, vy, vz = vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        out[f] = np.sqrt(nx * nx + ny * ny + nz * nz)
    return out


@njit(cache=True, nogil=True)
def normals_of(vertices, faces, wanted):
    """Computes the normals of a few vertices of a large mesh.

    Args:
        wanted: (W,) the numbers of the vertices, ascending.

    Returns:
        (W, 3) area-weighted unit normals (zero without any face area), and (W,) the smallest cosine between
        each normal and the unit normals of its faces, at most 1.
    """
    # Number the selected vertices by their row in the result. All other vertices get -1.
    number = np.full(vertices.shape[0], -1, np.int32)
    for w in range(wanted.shape[0]):
        number[wanted[w]] = w
    normals, sharpest = np.zeros((wanted.shape[0], 3)), np.ones(wanted.shape[0])
    touching = np.empty((6 * wanted.shape[0] + 64, 4))
    of = np.empty(touching.shape[0], np.int32)
    count = 0
    # Add up the area vectors of the faces around the selected vertices. Store the unit normal of each face
    # for each of its corners.
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        if number[i] < 0 and number[j] < 0 and number[k] < 0:
            continue
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        ux, uy, uz = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
        vx, vy, vz = vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        if count + 3 > of.shape[0]:
            touching, of = _double_capacity(touching, of)
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        per = 1.0 / length if length > 0 else 1.0
        for c in range(3):
            w = number[faces[f, c]]
            if w < 0:
                continue
            normals[w, 0] += nx
            normals[w, 1] += ny
            normals[w, 2] += nz
            touching[count, 0], touching[count, 1], touching[count, 2] = nx * per, ny * per, nz * per
            of[count] = w
            count += 1
    for w in range(wanted.shape[0]):
        length = np.sqrt(normals[w, 0] ** 2 + normals[w, 1] ** 2 + normals[w, 2] ** 2)
        if length > 0:
            for a in range(3):
                normals[w, a] /= length
    # Compare the vertex normals with the stored face normals.
    for t in range(count):
        w = of[t]
        cosine = (
            normals[w, 0] * touching[t, 0] + normals[w, 1] * touching[t, 1] + normals[w, 2] * touching[t, 2]
        )
        sharpest[w] = min(sharpest[w], cosine)
    return normals, sharpest


@njit(cache=True, nogil=True)
def _double_capacity(rows, of):
    """Returns copies of the arrays ``rows`` and ``of`` with doubled capacity."""
    more, longer = np.empty((2 * rows.shape[0], rows.shape[1])), np.empty(2 * of.shape[0], of.dtype)
    copy_rows(more[: rows.shape[0]], rows)
    copy_row(longer[: of.shape[0]], of)
    return more, longer


@njit(cache=True, nogil=True)
def corner_sums(faces, vectors, count):
    """Returns (count, 3) the sum of ``vectors`` (F, 3) over the ``faces`` (F, 3) around each vertex."""
    out = np.zeros((count, 3))
    for f in range(faces.shape[0]):
        for c in range(3):
            v = faces[f, c]
            for a in range(3):
                out[v, a] += vectors[f, a]
    return out


@njit(cache=True, nogil=True)
def _mix_bits(bits):
    """Mixes 64 bits (hash finaliser): every input bit affects every output bit."""
    bits ^= bits >> np.uint64(33)
    bits *= np.uint64(0xFF51AFD7ED558CCD)
    bits ^= bits >> np.uint64(33)
    bits *= np.uint64(0xC4CEB9FE1A85EC53)
    bits ^= bits >> np.uint64(33)
    return bits


def space_curve(points: Float) -> Any:
    """Returns the indices (N,) that sort points (N, 3) along a Z-order curve, so that neighbouring points are
    near in memory.
    """
    if not len(points):
        return np.zeros(0, np.int64)
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    code = ((points - points.min(0)) * (1023.999 / size)).astype(np.int64)
    # Insert two zero bits after each of the ten bits (Morton code).
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        code = (code | code << shift) & mask
    return np.argsort(code @ np.array([1, 2, 4]), kind="stable")


def first_of_position(vertices: Float) -> Any:
    """Returns (V,) int64: for each vertex the first vertex at exactly its position (-0.0 must be 0.0)."""
    return _first_equal(np.ascontiguousarray(vertices).view(np.uint64))


@njit(cache=True, nogil=True)
def _first_equal(rows):
    """Returns (V,) the first equal row for each row of ``rows`` (V, 3) uint64, by an open-addressing hash
    table."""
    count = rows.shape[0]
    size = 16
    while size < 2 * count:
        size *= 2
    mask = np.uint64(size - 1)
    table = np.full(size, -1, np.int32)
    first = np.empty(count, np.int64)
    for i in range(count):
        slot = np.int64(_mix_bits(rows[i, 0] + _mix_bits(rows[i, 1] + _mix_bits(rows[i, 2]))) & mask)
        while True:
            j = table[slot]
            if j < 0:
                table[slot] = i
                first[i] = i
                break
            if rows[j, 0] == rows[i, 0] and rows[j, 1] == rows[i, 1] and rows[j, 2] == rows[i, 2]:
                first[i] = j
                break
            slot = (slot + 1) & (size - 1)
    return first


@njit(cache=True, nogil=True)
def shells(faces, count):
    """Returns (count,) the shell (connected component) of each vertex. Shells are numbered 0, 1, ... in the
    order of their first vertices.
    """
    parent = np.arange(count)
    for f in range(faces.shape[0]):
        for c in range(1, 3):
            join(parent, faces[f, 0], faces[f, c])
    label = np.full(count, -1, np.int64)
    shell_count = 0
    out = np.empty(count, np.int64)
    for v in range(count):
        r = root_of(parent, v)
        if label[r] < 0:
            label[r] = shell_count
            shell_count += 1
        out[v] = label[r]
    return out


@njit(cache=True, nogil=True)
def edge_lengths(vertices, faces):
    """Returns (F, 3) the lengths of each face's edges 01, 12, 20."""
    out = np.empty((faces.shape[0], 3))
    for f in range(faces.shape[0]):
        for c in range(3):
            a, b = vertices[faces[f, c]], vertices[faces[f, (c + 1) % 3]]
            out[f, c] = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
    return out


@njit(cache=True, nogil=True)
def longest_edge(vertices, faces):
    """Returns the length of the longest edge in metres, zero without faces."""
    longest = 0.0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        ux, uy, uz = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
        vx, vy, vz = vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z
        longest = max(longest, ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
        wx, wy, wz = ux - vx, uy - vy, uz - vz
        longest = max(longest, wx * wx + wy * wy + wz * wz)
    return np.sqrt(longest)


def split_long_edges(vertices: Float, faces: Int32, longest: float) -> tuple[Float, Int32, Any, Any]:
    """Splits long edges at their middles, in one pass.

    Returns:
        (V + S, 3) vertices, (G, 3) faces, (S, 2) the ends of the edge that each new vertex splits, and (G,)
            the old face that contains each new face.
    """
    lengths = edge_lengths(vertices, faces)
    long = lengths > longest
    if not long.any():
        return vertices, faces, np.empty((0, 2), np.int64), np.arange(len(faces))
    count = len(vertices)
    pairs = np.stack([faces, np.roll(faces, -1, 1)], -1)
    pairs.sort(-1)
    keys = pairs[..., 0].astype(np.int64) * count + pairs[..., 1]
    unique, inverse = np.unique(keys[long], return_inverse=True)
    middle = np.full(faces.shape, -1, np.int64)
    middle[long] = inverse.reshape(-1) + count
    parents = np.stack([unique // count, unique % count], -1)
    points = (vertices[parents[:, 0]] + vertices[parents[:, 1]]) / 2
    split, origin = _split_faces(faces, middle, lengths)
    return np.concatenate([vertices, points]), split, parents, origin


@njit(cache=True, nogil=True)
def _split_faces(faces, middle, lengths):
    """Splits each face into 1 to 4 faces at the middles of its edges 01, 12, 20 (-1 for an edge that is not
    split)."""
    total = 0
    for f in range(faces.shape[0]):
        total += 1 + (middle[f, 0] >= 0) + (middle[f, 1] >= 0) + (middle[f, 2] >= 0)
    out = np.empty((total, 3), np.int32)
    origin = np.empty(total, np.int64)
    n = 0
    for f in range(faces.shape[0]):
        cuts = (middle[f, 0] >= 0) + (middle[f, 1] >= 0) + (middle[f, 2] >= 0)
        origin[n : n + cuts + 1] = f
        if cuts == 0:
            out[n, 0], out[n, 1], out[n, 2] = faces[f, 0], faces[f, 1], faces[f, 2]
            n += 1
            continue
        # Rotate the face until its first edge is the longest, which is always split.
        s = np.argmax(lengths[f])
        a, b, c = faces[f, s], faces[f, (s + 1) % 3], faces[f, (s + 2) % 3]
        ab, bc, ca = middle[f, s], middle[f, (s + 1) % 3], middle[f, (s + 2) % 3]
        for side in range(2):
            # Process both halves: a-ab-c may be split at ca, and ab-b-c may be split at bc.
            corner, cut = (a, ca) if side == 0 else (b, bc)
            if cut < 0:
                out[n, 0], out[n, 1], out[n, 2] = (corner, ab, c) if side == 0 else (ab, corner, c)
                n += 1
            elif side == 0:
                out[n, 0], out[n, 1], out[n, 2] = corner, ab, cut
                out[n + 1, 0], out[n + 1, 1], out[n + 1, 2] = cut, ab, c
                n += 2
            else:
                out[n, 0], out[n, 1], out[n, 2] = ab, corner, cut
                out[n + 1, 0], out[n + 1, 1], out[n + 1, 2] = ab, cut, c
                n += 2
    return out, origin
