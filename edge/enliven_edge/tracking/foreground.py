"""Which pixels may be a person: not the floor, not the learnt room; grouped by depth continuity."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import ndimage

from enliven.arrays import Bool, Float, Int
from enliven.union_find import join, root_of
from enliven_edge.tracking.settings import SceneSettings

_SMALLEST_AREA, _LARGEST_AREA = 0.06, 1.6
_SHORTEST, _WIDEST, _DEEPEST = 0.3, 2.4, 1.6


class Room:
    """The room's depth at every working pixel, learnt from what is not a person.

    Farther depth replaces the model at once (something was taken away); nearer depth is absorbed slowly
    (something was put there).
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.z = np.zeros(shape)

    def in_front(self, z: Float, *, guess: bool) -> Bool:
        """(h, w) pixels that are known and stand before the room.

        Args:
            guess: where the room was never seen, it is as deep as where it was seen nearest in the image, so
                that the wall behind somebody who left is not taken for somebody. Else anything there counts.
        """
        room, known = self.z, self.z > 0
        if guess and known.any() and not known.all():
            row, column = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
            room = self.z[row, column]
        margin = 0.05 + 0.012 * z * z
        return np.asarray((z > 0) & ((room == 0) | (z < room - margin)))

    def learn(self, z: Float, person: Bool) -> None:
        """Takes in a frame whose ``person`` pixels, widened by two, are left out."""
        _learn(self.z, z, widened(person, 2))


@njit(cache=True, nogil=True)
def _learn(room, z, person):  # type: ignore[no-untyped-def]
    """New pixels are taken as they are, farther ones half-way, nearer ones by a hundredth."""
    height, width = z.shape
    for v in range(height):
        for u in range(width):
            if z[v, u] > 0.0 and not person[v, u]:
                if room[v, u] == 0.0:
                    room[v, u] = z[v, u]
                else:
                    room[v, u] += (0.5 if z[v, u] > room[v, u] else 0.01) * (z[v, u] - room[v, u])


def candidates(z: Float, points: Float, room: Room, settings: SceneSettings, *, guess: bool) -> Bool:
    """(h, w) pixels that are in range, above the floor and in front of the room.

    Args:
        z: (h, w) metres along the optical axis.
        points: (h, w, 3) the pixels in the world frame.
        guess: see :meth:`Room.in_front`.
    """
    in_range = (z > settings.near) & (z < settings.far)
    return np.asarray(in_range & (points[..., 1] > settings.floor_band) & room.in_front(z, guess=guess))


def people(z: Float, points: Float, mask: Bool, pixel_area: float) -> list[Bool]:
    """The groups of pixels that have a person's size, the likeliest first, fragments in front joined.

    Args:
        mask: (h, w) from :func:`candidates`.
        pixel_area: square metres a pixel covers at one metre, 1 / (fx fy).
    """
    labels, count = label(z, mask)
    if count == 0:
        return []
    area = np.bincount(labels[labels > 0], (z[labels > 0] ** 2) * pixel_area, minlength=count + 1)
    scored = []
    for index in np.argsort(-area)[:12]:
        score = _likeness(points[labels == index], float(area[index])) if index else 0.0
        if score > 0:
            scored.append((score, int(index)))
    scored.sort(reverse=True)
    return [_with_fragments(labels, index, points) for _, index in scored]


def _likeness(points: Float, area: float) -> float:
    """How much a group of (M, 3) points is like a person by its size; 0 where it cannot be one."""
    if not _SMALLEST_AREA < area < _LARGEST_AREA:
        return 0.0
    low, high = np.percentile(points, [3, 97], axis=0)
    wide, tall, deep = high - low
    if tall < _SHORTEST or wide > _WIDEST or deep > _DEEPEST:
        return 0.0
    return float(min(area, 0.7) * min(tall, 1.8))


def _with_fragments(labels: Int, main: int, points: Float) -> Bool:
    """The main group and the groups that touch it in the image within 0.6 m, a forearm held forward say."""
    mask = labels == main
    around = widened(mask, 3)
    depth = points[..., 2]
    for other in np.unique(labels[around & (labels > 0) & ~mask]):
        part = labels == other
        contact = widened(part, 3) & mask
        if part.sum() < 0.6 * mask.sum() and contact.any():
            gap = abs(float(np.median(depth[part]) - np.median(depth[contact])))
            if gap < 0.6 and _reaches(points[part], points[contact]):
                mask = mask | part
    return np.asarray(mask)


def _reaches(part: Float, contact: Float) -> bool:
    """Whether a fragment stays within an arm's length of where it touches, unlike a wall."""
    return bool(np.percentile(np.linalg.norm(part - contact.mean(0), axis=1), 90) < 0.8)


def widened(mask: Bool, pixels: int) -> Bool:
    """The mask grown by a square of ``pixels`` to every side."""
    out = mask.copy()
    for _ in range(pixels):
        grown = out.copy()
        grown[1:] |= out[:-1]
        grown[:-1] |= out[1:]
        out = grown.copy()
        out[:, 1:] |= grown[:, :-1]
        out[:, :-1] |= grown[:, 1:]
    return out


@njit(cache=True, nogil=True)
def label(z, mask):  # type: ignore[no-untyped-def]
    """(h, w) groups 1..n of masked pixels that touch with a small step in depth, and n (union-find)."""
    height, width = z.shape
    parent = np.arange(height * width)
    for v in range(height):
        for u in range(width):
            if not mask[v, u]:
                continue
            here = v * width + u
            step = 0.035 + 0.012 * z[v, u] * z[v, u]
            if u > 0 and mask[v, u - 1] and abs(z[v, u] - z[v, u - 1]) < step:
                join(parent, here, here - 1)
            if v > 0 and mask[v - 1, u] and abs(z[v, u] - z[v - 1, u]) < step:
                join(parent, here, here - width)
    labels = np.zeros((height, width), np.int64)
    numbers = np.zeros(height * width, np.int64)
    count = 0
    for v in range(height):
        for u in range(width):
            if mask[v, u]:
                root = root_of(parent, v * width + u)
                if numbers[root] == 0:
                    count += 1
                    numbers[root] = count
                labels[v, u] = numbers[root]
    return labels, count
