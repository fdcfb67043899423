"""Compiled loops of TSDF fusion: allocate the blocks that a depth image needs, find the visible blocks, and
integrate the image.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.scanning.blocks import SIDE, VOXELS, find, insert, key_of
from enliven.scanning.depth_view import TILE, compute_relative_certainty

_MAX_BANDS_BEHIND = 2.0
"""Maximum distance of a voxel behind a surface along the ray, in truncation bands, for any slant of the
surface. A deeper voxel may be behind the other side of a thin part."""
_FREE_SPACE_BANDS = 8.0
"""Minimum distance in front of a surface along the ray, in truncation bands, at which a voxel is free space
for any slant of the surface. It is the inverse of the smallest trusted cosine between ray and normal."""
_MIN_BAND_WEIGHT = 0.1
"""Minimum weight at the edges of the truncation band, as a fraction of the observation's weight. An
observation constrains the surface least at these edges."""
_VOXEL_X = (np.arange(VOXELS) % SIDE).astype(np.float32)
"""(512,) x of each voxel in a block, in voxels. A table keeps the inner loop free of branches."""
_VOXEL_Y = (np.arange(VOXELS) // SIDE % SIDE).astype(np.float32)
"""(512,) y of each voxel in a block, in voxels."""
_VOXEL_Z = (np.arange(VOXELS) // SIDE**2).astype(np.float32)
"""(512,) z of each voxel in a block, in voxels."""
_COLOUR_RANGE_VOXELS = 1.8
"""Distance from a surface, in voxels, within which a voxel stores a colour. It includes the corners of all
cells that the surface crosses."""
_MAX_COLOUR_WEIGHT = 8.0
"""Maximum weight in the running average of a voxel's colour. It lets the lighting of the first observations
fade."""
UNSEEN = 0
"""State of a block that is not visible in an image."""
FREE = 1
"""State of a block in front of all surfaces in an image."""
NEAR = 2
"""State of a block that contains a surface in an image, or is only partly visible."""


@njit(cache=True, nogil=True, error_model="numpy")
def allocate_blocks(points, stride, phase, reach, turn, place, band, keys, slots, places, count):
    """Allocates the missing blocks around the points of a half-size image.

    Args:
        points: the points of the image, as :class:`PointArrays`.
        stride: step in pixels between the points that are used, in each direction.
        phase: index of the first used point, 0 to stride^2 - 1.
        reach: maximum depth of the points, metres. Farther points are left out.
        turn, place: world_from_camera, (3, 3) and (3,).

    Returns:
        The new number of blocks; the length of ``places`` if the table is full.
    """
    size = band.voxel * SIDE
    for v in range(phase // stride, points.places.shape[0], stride):
        for u in range(phase % stride, points.places.shape[1], stride):
            if points.worth[v, u] == 0.0 or points.places[v, u, 2] > reach:
                continue
            for k in range(3):
                # Allocate the blocks in front of the surface, on it and behind it. A block is two truncation
                # distances wide, so three samples are enough.
                off = band.front if k == 0 else (0.0 if k == 1 else -band.behind)
                px = points.places[v, u, 0] + off * points.normals[v, u, 0]
                py = points.places[v, u, 1] + off * points.normals[v, u, 1]
                pz = points.places[v, u, 2] + off * points.normals[v, u, 2]
                x = int(np.floor((turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz + place[0]) / size))
                y = int(np.floor((turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz + place[1]) / size))
                z = int(np.floor((turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz + place[2]) / size))
                key = key_of(x, y, z)
                if find(keys, slots, key) >= 0:
                    continue
                if count == len(places):
                    return count
                insert(keys, slots, key, count)
                places[count, 0], places[count, 1], places[count, 2] = x, y, z
                count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def classify_blocks(places, band, camera, tiles, shape, state, first, last):
    """Sets the ``state`` of some blocks (unseen, free or near) from the depth of the image tiles that they
    cover.
    """
    size = band.voxel * SIDE
    radius = 0.5 * np.sqrt(3.0) * size
    turn, fx, fy, cx, cy = camera.turn, camera.lens[0], camera.lens[1], camera.lens[2], camera.lens[3]
    for b in range(first, last):
        state[b] = UNSEEN
        wx, wy, wz = (places[b, 0] + 0.5) * size, (places[b, 1] + 0.5) * size, (places[b, 2] + 0.5) * size
        x = turn[0, 0] * wx + turn[0, 1] * wy + turn[0, 2] * wz + camera.place[0]
        y = turn[1, 0] * wx + turn[1, 1] * wy + turn[1, 2] * wz + camera.place[1]
        z = turn[2, 0] * wx + turn[2, 1] * wy + turn[2, 2] * wz + camera.place[2]
        if z < camera.limits[0] + radius:
            continue
        # Compute the bounds of the block's bounding sphere in the image. These bounds are slightly too wide,
        # which does no harm.
        u, v = fx * x / z + cx, fy * y / z + cy
        ru = fx * radius / (z - radius) * (1.0 + abs(x) / z)
        rv = fy * radius / (z - radius) * (1.0 + abs(y) / z)
        if u + ru < 0.0 or v + rv < 0.0 or u - ru > shape[1] - 1 or v - rv > shape[0] - 1:
            continue
        left, right = max(int(u - ru), 0) // TILE, min(int(u + ru) + 1, shape[1] - 1) // TILE
        top, bottom = max(int(v - rv), 0) // TILE, min(int(v + rv) + 1, shape[0] - 1) // TILE
        nearest, farthest, is_complete = np.inf, 0.0, u - ru >= 0.0 and v - rv >= 0.0
        is_complete = is_complete and u + ru <= shape[1] - 1 and v + rv <= shape[0] - 1
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                nearest, farthest = min(nearest, tiles[r, c, 0]), max(farthest, tiles[r, c, 1])
                is_complete = is_complete and tiles[r, c, 2] == 0.0
        if z - radius > farthest + _MAX_BANDS_BEHIND * band.behind:
            continue
        free = is_complete and z + radius < nearest - _FREE_SPACE_BANDS * band.front
        state[b] = FREE if free else NEAR


@njit(cache=True, nogil=True, error_model="numpy")
def integrate_image(jobs, state, places, band, camera, image, voxels, first, last):
    """Integrates an image (:class:`ImageArrays`) into the voxels of some blocks as a running average of
    distances.

    Args:
        jobs: (N,) numbers of blocks that are near or free.
        voxels: the contents of the voxels, as :class:`VoxelArrays`; read and written.
    """
    local, pixel = np.empty((3, VOXELS), np.float32), np.empty(VOXELS, np.int32)
    shown, sizes = np.empty(VOXELS, np.float32), np.empty(3, np.float32)
    before, along, worth = (
        np.empty(VOXELS, np.float32),
        np.empty(VOXELS, np.float32),
        np.empty(VOXELS, np.float32),
    )
    sizes[0], sizes[1] = band.front, band.behind
    for j in range(first, last):
        b = jobs[j]
        sizes[2] = compute_relative_certainty(camera.limits, _depth_of(places, b, band, camera))
        if state[b] == FREE:
            voxels.solid[b] = (
                _average_free_space(voxels.distance[b], voxels.weight[b], sizes[0], sizes[2]) > 0
            )
        else:
            _project_voxels(places, b, band, camera, image.shape, local, pixel, shown)
            if not _measure_voxels(pixel, local, image.planes, image.weights, sizes[1], before, along, worth):
                continue
            if len(image.colours) > 0 and len(voxels.hue) > 0:
                near = np.float32(band.voxel * _COLOUR_RANGE_VOXELS)
                _average_colours(
                    pixel, shown, before, worth, near, image.colours, voxels.weight[b], voxels.hue[b]
                )
            stored = voxels.distance[b], voxels.weight[b]
            voxels.solid[b] = _average_distances(sizes, local, shown, before, along, worth, *stored) > 0


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_of(places, b, band, camera):
    """Returns the depth of the centre of block ``b`` in the camera frame, metres."""
    size, turn = band.voxel * SIDE, camera.turn
    return (
        turn[2, 0] * (places[b, 0] + 0.5) * size
        + turn[2, 1] * (places[b, 1] + 0.5) * size
        + turn[2, 2] * (places[b, 2] + 0.5) * size
        + camera.place[2]
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _average_free_space(distance, weight, front, more):
    """Integrates a free-space observation (distance ``front`` with weight ``more``) into all voxels of a
    block. Returns the number of voxels behind a surface.
    """
    inside = 0
    for i in range(VOXELS):
        distance[i] = (distance[i] * weight[i] + front * more) / (weight[i] + more)
        weight[i] += more
        inside += distance[i] < np.float32(0.0)
    return inside


@njit(cache=True, nogil=True, error_model="numpy")
def _project_voxels(places, b, band, camera, shape, local, pixel, shown):
    """Computes the camera-frame positions of a block's voxels and their pixels, without a branch.

    Args:
        shape: (H, W) of the image.
        local: (3, 512) metres, camera frame; written.
        pixel: (512,) int32 index of the pixel; written.
        shown: (512,) 1 if the voxel is in the image, else 0; written.
    """
    turn, lens, size = camera.turn, camera.lens, np.float32(band.voxel * SIDE)
    voxel = np.float32(band.voxel)
    # Copy the values into local scalars, because the compiler loads array elements again after every write to
    # another array.
    xx, xy, xz = voxel * turn[0, 0], voxel * turn[0, 1], voxel * turn[0, 2]
    yx, yy, yz = voxel * turn[1, 0], voxel * turn[1, 1], voxel * turn[1, 2]
    zx, zy, zz = voxel * turn[2, 0], voxel * turn[2, 1], voxel * turn[2, 2]
    wx, wy, wz = (
        np.float32(places[b, 0]) * size,
        np.float32(places[b, 1]) * size,
        np.float32(places[b, 2]) * size,
    )
    x0 = turn[0, 0] * wx + turn[0, 1] * wy + turn[0, 2] * wz + camera.place[0]
    y0 = turn[1, 0] * wx + turn[1, 1] * wy + turn[1, 2] * wz + camera.place[1]
    z0 = turn[2, 0] * wx + turn[2, 1] * wy + turn[2, 2] * wz + camera.place[2]
    fx, fy, left, top = lens[0], lens[1], lens[2] + np.float32(0.5), lens[3] + np.float32(0.5)
    height, width, wide = np.float32(shape[0]), np.float32(shape[1]), np.int32(shape[1])
    zero, unity, least = np.float32(0.0), np.float32(1.0), np.float32(0.01)
    for i in range(VOXELS):
        right, down, deep = _VOXEL_X[i], _VOXEL_Y[i], _VOXEL_Z[i]
        x = x0 + xx * right + xy * down + xz * deep
        y = y0 + yx * right + yy * down + yz * deep
        z = z0 + zx * right + zy * down + zz * deep
        away = unity / (z if z > least else least)
        u, v = fx * x * away + left, fy * y * away + top
        inside = (u >= zero) & (v >= zero) & (u < width) & (v < height) & (z > least)
        u, v = u if inside else zero, v if inside else zero
        pixel[i] = np.int32(v) * wide + np.int32(u)
        shown[i] = unity if inside else zero
        local[0, i], local[1, i], local[2, i] = x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def _measure_voxels(pixel, local, planes, weights, behind, before, along, worth):
    """Computes three values for each voxel. ``before`` is its distance (m) in front of its pixel's plane,
    ``along`` is normal . voxel (m), and ``worth`` is the plane's weight.

    Args:
        planes: (4, H W), weights: (H W,) as in a view.
        behind: metres, truncation distance behind a surface.

    Returns:
        The number of voxels that are observed. The other voxels are occluded in the image.
    """
    observed = np.int32(0)
    for i in range(VOXELS):
        k = np.uint32(pixel[i])
        at = np.uint32(4) * k
        a = (
            planes[at] * local[0, i]
            + planes[at + np.uint32(1)] * local[1, i]
            + planes[at + np.uint32(2)] * local[2, i]
        )
        along[i], before[i] = a, a - planes[at + np.uint32(3)]
        worth[i] = weights[k]
        observed += np.int32(1) if before[i] > -behind else np.int32(0)
    return observed


@njit(cache=True, nogil=True, error_model="numpy")
def _average_distances(sizes, local, shown, before, along, worth, distance, weight):
    """Updates the running averages of distance in the voxels of a block, without a branch (for
    vectorization). Returns the number of voxels behind a surface.

    Args:
        sizes: (3,) the truncation distances in front of and behind a surface, metres, and the weight of free
            space.
    """
    front, behind, free = sizes[0], sizes[1], sizes[2]
    zero, unity, deepest = np.float32(0.0), np.float32(1.0), np.float32(_MAX_BANDS_BEHIND) * behind
    fade, tiny, inside, least = unity / behind, np.float32(1e-30), np.int32(0), np.float32(_MIN_BAND_WEIGHT)
    for i in range(VOXELS):
        d = before[i]
        # A voxel behind a surface is inferred, not observed, so its weight falls with depth. The weight in
        # front of the surface falls equally. Otherwise noise behind the surface would count less than noise
        # in front, and surfaces would sink.
        trust = unity - abs(d) * fade
        more = worth[i] * (trust if trust > least else least)
        more = free if d >= front else more
        # `along` is negative, because the normal points towards the camera.
        is_observed = (d > -behind) & (d * local[2, i] >= deepest * along[i])
        more = (more if is_observed else zero) * shown[i]
        d = front if d >= front else d
        d = d if is_observed else zero
        old_weight, old_distance = weight[i], distance[i]
        new_distance = old_distance + (d - old_distance) * more / (old_weight + more + tiny)
        distance[i], weight[i] = new_distance, old_weight + more
        inside += np.int32(1) if new_distance < zero else np.int32(0)
    return inside


@njit(cache=True, nogil=True, error_model="numpy")
def _average_colours(pixel, shown, before, worth, near, picture, weight, hue):
    """Updates the running averages of colour in the voxels of a block that are near the surface."""
    for i in range(VOXELS):
        if shown[i] == 0.0 or worth[i] == 0.0 or abs(before[i]) > near:
            continue
        share = worth[i] / (min(weight[i], np.float32(_MAX_COLOUR_WEIGHT)) + worth[i])
        # If the earlier observations had no colour, store only the new colour. 0 means no colour, and black
        # is stored as 1.
        share = np.float32(1.0) if hue[i, 0] == 0 else share
        for c in range(3):
            colour = np.float32(hue[i, c])
            colour += (np.float32(256.0) * np.float32(picture[3 * pixel[i] + c]) - colour) * share
            hue[i, c] = np.uint16(max(colour + np.float32(0.5), np.float32(1.0)))
