"""Pixels to people: each candidate pixel goes to the person whose predicted body it lies on.

What lies on nobody is grouped in three dimensions; a small group that touches somebody is theirs (an arm
that was lost hangs together with the body), a large one may be somebody new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from enliven.arrays import Bool, Float, Int, UInt8
from enliven.union_find import join, root_of
from enliven_edge.tracking.belonging import given_back, grown
from enliven_edge.tracking.capsules import foot
from enliven_edge.tracking.posture import Posture
from enliven_edge.tracking.room import ROOM, UNLIKELY, UNSEEN
from enliven_edge.tracking.view import View

REACH = 0.22
"""Metres from the predicted surface within which a pixel is taken for the person's."""
_REACH_UNLIKELY = 0.08
_ON_SURFACE = 0.025
_LIMB_AREA, _LIMB_LENGTH = 0.12, 0.95
"""A group that touches somebody is a limb of theirs up to this visible area and extent."""
SPECKLE = 0.004
"""Square metres: smaller loose groups are noise."""


@dataclass(frozen=True)
class Loose:
    """A group of pixels that are nobody's.

    Attributes:
        label: its number in ``Segments.labels``.
        area: square metres that are seen.
        low, high: (3,) the corners of its box in the world.
        centre: (3,) the mean of its points.
        contact: (K,) pixels that touch each person.
        box: (top, left, bottom, right) pixels, the last two exclusive.
    """

    label: int
    area: float
    low: Float
    high: Float
    centre: Float
    contact: Int
    box: tuple[int, int, int, int]

    @property
    def tall(self) -> float:
        """Metres from its lowest to its highest point."""
        return float(self.high[1] - self.low[1])


@dataclass(frozen=True)
class Segments:
    """Whose the pixels of a frame are.

    Attributes:
        owner: (h, w) the index of the person, or -1.
        labels: (h, w) the number of the loose group, or 0.
        loose: the loose groups that are no speckles, the largest first.
        counts: (K,) each person's pixels.
    """

    owner: Int
    labels: Int
    loose: list[Loose]
    counts: Int

    def pixels(self, person: int) -> Bool:
        """(h, w) the pixels of a person, by index."""
        return np.asarray(self.owner == person)

    def group(self, loose: Loose) -> Bool:
        """(h, w) the pixels of a loose group."""
        return np.asarray(self.labels == loose.label)


def segmented(
    view: View, kind: UInt8, postures: Sequence[Posture], handicap: Float | None = None
) -> Segments:
    """Whose the pixels of a frame are.

    Args:
        kind: (h, w) from :meth:`Room.classify`.
        postures: where each person is expected, world frame.
        handicap: (K,) metres by which a person's claim is weaker, one who is probably hidden say.
    """
    shape, count = kind.shape, len(postures)
    handicap = np.zeros(count) if handicap is None else handicap
    owner, distance = np.full(shape, -1, np.int64), np.full(shape, np.inf)
    if count:
        capsules = [posture.capsules() for posture in postures]
        ends, radii = np.stack([c[0] for c in capsules]), np.stack([c[1] for c in capsules])
        boxes = image_boxes(view, ends, radii, REACH)
        claim(view.points, kind, boxes, ends, radii, handicap, REACH, _REACH_UNLIKELY, owner, distance)
    if count > 1:
        grown(owner, distance, view.z)
    labels, groups = loose_groups(view.z, kind, owner)
    table = _table(view, labels, groups, owner, count)
    loose, joined = _judged(table, groups, count)
    counts = _join(owner, labels, joined, count)
    if count > 1:
        counts = given_back(owner, view.z, counts)
    return Segments(owner, labels, loose, counts)


def lying_on(view: View, postures: Sequence[Posture], above: float, reach: float) -> Bool:
    """(h, w) pixels within ``reach`` metres of somebody's surface and more than ``above`` metres high."""
    kind = np.where(view.points[..., 1] > above, UNSEEN, ROOM).astype(np.uint8)
    kind[view.z <= 0.0] = ROOM
    owner, distance = np.full(kind.shape, -1, np.int64), np.full(kind.shape, np.inf)
    ends, radii = (np.stack(each) for each in zip(*(p.capsules() for p in postures), strict=True))
    boxes, none = image_boxes(view, ends, radii, reach), np.zeros(len(postures))
    claim(view.points, kind, boxes, ends, radii, none, reach, reach, owner, distance)
    return np.asarray(owner >= 0)


def image_boxes(view: View, ends: Float, radii: Float, reach: float) -> Int:
    """(K, 4) top, left, bottom and right of what each person's (C, 2, 3) capsules and their reach cover."""
    return np.asarray(_boxes(ends, radii, reach, view.camera.camera, view.world_from_camera, view.z.shape))


@njit(cache=True, nogil=True)
def _boxes(ends, radii, reach, camera, pose, shape):  # type: ignore[no-untyped-def]
    """See :func:`image_boxes`; what is behind the sensor, or right before it, covers a lot."""
    out = np.empty((len(ends), 4), np.int64)
    for k in range(len(ends)):
        top, left, bottom, right = np.inf, np.inf, -np.inf, -np.inf
        for c in range(ends.shape[1]):
            for e in range(2):
                x, y, z = 0.0, 0.0, 0.0
                for b in range(3):
                    offset = ends[k, c, e, b] - pose[b, 3]
                    x += pose[b, 0] * offset
                    y += pose[b, 1] * offset
                    z += pose[b, 2] * offset
                z, around = max(z, 0.2), radii[k, c, e] + reach
                u, v = camera[0] * x / z + camera[2], camera[1] * y / z + camera[3]
                du, dv = camera[0] * around / z, camera[1] * around / z
                top, bottom = min(top, v - dv), max(bottom, v + dv)
                left, right = min(left, u - du), max(right, u + du)
        if not (bottom > top and right > left):  # no number among them
            out[k] = 0
            continue
        out[k, 0] = int(min(max(np.floor(top), 0.0), shape[0]))
        out[k, 1] = int(min(max(np.floor(left), 0.0), shape[1]))
        out[k, 2] = int(min(max(np.ceil(bottom) + 1.0, 0.0), shape[0]))
        out[k, 3] = int(min(max(np.ceil(right) + 1.0, 0.0), shape[1]))
    return out


@njit(cache=True, nogil=True)
def claim(points, kind, boxes, ends, radii, handicap, reach, reach_unlikely, owner, distance):  # type: ignore[no-untyped-def]
    """Each candidate pixel to the person whose capsules are nearest, within reach, into ``owner``.

    A pixel that lies on a surface ends the search; neighbours mostly lie on the same capsule, which is tried
    first.
    """
    capsules = ends.shape[1]
    for k in range(len(boxes)):
        last = 0
        for v in range(boxes[k, 0], boxes[k, 2]):
            for u in range(boxes[k, 1], boxes[k, 3]):
                if kind[v, u] == ROOM:
                    continue
                x, y, z = points[v, u, 0], points[v, u, 1], points[v, u, 2]
                _, best = foot(x, y, z, ends[k, last], radii[k, last])
                if best > _ON_SURFACE:
                    for c in range(capsules):
                        _, d = foot(x, y, z, ends[k, c], radii[k, c])
                        if d < best:
                            best, last = d, c
                            if d < _ON_SURFACE:
                                break
                best = max(best, 0.0) + handicap[k]
                limit = reach_unlikely if kind[v, u] == UNLIKELY else reach
                if best < limit and best < distance[v, u]:
                    owner[v, u], distance[v, u] = k, best


@njit(cache=True, nogil=True)
def loose_groups(z, kind, owner, tightness=1.0):  # type: ignore[no-untyped-def]
    """(h, w) groups 1..n of nobody's candidate pixels that touch with a small step in depth, and n."""
    height, width = z.shape
    labels = np.zeros((height, width), np.int64)
    parent = np.empty(height * width, np.int64)
    for v in range(height):
        for u in range(width):
            if kind[v, u] == ROOM or kind[v, u] == UNLIKELY or owner[v, u] >= 0:
                continue
            here = v * width + u
            parent[here], labels[v, u] = here, -1
            step = (0.035 + 0.012 * z[v, u] * z[v, u]) * tightness
            if u > 0 and labels[v, u - 1] != 0 and abs(z[v, u] - z[v, u - 1]) < step:
                join(parent, here, here - 1)
            if v > 0 and labels[v - 1, u] != 0 and abs(z[v, u] - z[v - 1, u]) < step:
                join(parent, here, here - width)
    count = 0
    for v in range(height):
        for u in range(width):
            if labels[v, u] != 0:
                here = v * width + u
                root = root_of(parent, here)
                # A root is the smallest index of its group, so it was numbered before all others.
                if root == here:
                    count += 1
                    labels[v, u] = count
                else:
                    labels[v, u] = labels[root // width, root % width]
    return labels, count


def _table(view: View, labels: Int, groups: int, owner: Int, people: int) -> Float:
    """(groups + 1, 15 + K) area, low and high corner, sum of points, pixels, box, contacts."""
    camera = view.camera.intrinsics
    pixel = 1.0 / (camera.fx * camera.fy)
    return np.asarray(_measured(view.z, view.points, labels, groups, owner, people, pixel))


@njit(cache=True, nogil=True)
def _measured(z, points, labels, groups, owner, people, pixel):  # type: ignore[no-untyped-def]
    """See :func:`_table`."""
    height, width = z.shape
    out = np.zeros((groups + 1, 15 + people))
    out[:, 1:4], out[:, 4:7] = np.inf, -np.inf
    out[:, 11:13] = 1e9
    if groups == 0:
        return out
    for v in range(height):
        for u in range(width):
            g = labels[v, u]
            if g == 0:
                continue
            row = out[g]
            row[0] += z[v, u] * z[v, u] * pixel
            for a in range(3):
                p = points[v, u, a]
                row[1 + a], row[4 + a] = min(row[1 + a], p), max(row[4 + a], p)
                row[7 + a] += p
            row[10] += 1.0
            row[11], row[12] = min(row[11], v), min(row[12], u)
            row[13], row[14] = max(row[13], v + 1.0), max(row[14], u + 1.0)
            step = 0.035 + 0.012 * z[v, u] * z[v, u]
            for q, p in ((v - 1, u), (v + 1, u), (v, u - 1), (v, u + 1)):
                if 0 <= q < height and 0 <= p < width and owner[q, p] >= 0 and abs(z[q, p] - z[v, u]) < step:
                    row[15 + owner[q, p]] += 1.0
    return out


def _judged(table: Float, groups: int, people: int) -> tuple[list[Loose], Int]:
    """The loose groups that stay, and (groups + 1,) whose the others are, -1 for nobody's."""
    area, contacts = table[:, 0], table[:, 15:]
    joined = np.full(groups + 1, -1)
    limbs = np.zeros(groups + 1, bool)
    if people:
        with np.errstate(invalid="ignore"):
            short = np.linalg.norm(table[:, 4:7] - table[:, 1:4], axis=1) < _LIMB_LENGTH
        limbs = contacts.any(1) & (area < _LIMB_AREA) & short
        joined[limbs] = np.argmax(contacts[limbs], axis=1)
    large = np.flatnonzero((area >= SPECKLE) & ~limbs)
    large = large[np.argsort(-area[large], kind="stable")]
    return [_loose(int(g), table[g]) for g in large if g > 0], joined


def _loose(g: int, row: Float) -> Loose:
    top, left, bottom, right = (int(x) for x in row[11:15])
    centre, contact = row[7:10] / row[10], row[15:].astype(np.int64)
    return Loose(g, float(row[0]), row[1:4], row[4:7], centre, contact, (top, left, bottom, right))


@njit(cache=True, nogil=True)
def _join(owner, labels, joined, people):  # type: ignore[no-untyped-def]
    """Gives joined groups to their owners, in place; each person's number of pixels."""
    height, width = owner.shape
    counts = np.zeros(people, np.int64)
    for v in range(height):
        for u in range(width):
            if labels[v, u] > 0 and joined[labels[v, u]] >= 0:
                owner[v, u], labels[v, u] = joined[labels[v, u]], 0
            if owner[v, u] >= 0:
                counts[owner[v, u]] += 1
    return counts
