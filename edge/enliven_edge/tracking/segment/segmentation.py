"""Segmentation: assigns each foreground pixel to a person if it lies on the person's predicted body.

The other pixels are grouped into connected components in three dimensions. A small group that touches a
person is assigned to that person, because an arm that the fit lost is still connected to its body. A large
group may be a new person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Bool, Float, Int, Int16, UInt8
from enliven.kernels import njit
from enliven.masks import pixels_of
from enliven.union_find import root_of
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.scene.background_kernels import BACKGROUND, UNLIKELY, UNSEEN
from enliven_edge.tracking.segment.pixel_labels import image_boxes, label_pixels
from enliven_edge.tracking.segment.surface_growing import grow_surfaces, reassign_detached_pieces

REACH = 0.22
"""Maximum distance in metres between a pixel and the predicted surface of its person."""
_UNLIKELY_REACH_M = 0.08
"""Like ``REACH``, for pixels of class UNLIKELY. It is smaller, because these pixels are probably background.
Only pixels on the body itself are then assigned.
"""
_MAX_LIMB_AREA_M2 = 0.12
"""Maximum visible area in square metres of a limb, a group that touches a person: a leg seen from the
front.
"""
_MAX_LIMB_LENGTH_M = 0.95
"""Maximum diagonal in metres of the bounding box of a limb, a group that touches a person: the length of a
leg.
"""
MIN_GROUP_AREA_M2 = 0.004
"""Minimum visible area of a loose group in square metres. Smaller groups are noise."""


@dataclass(frozen=True)
class LooseGroup:
    """A group of pixels that do not belong to a person.

    Attributes:
        label: its number in ``Segments.labels``.
        area: visible area in square metres.
        low, high: (3,) the corners of its bounding box in the world.
        centre: (3,) the mean of its points.
        contact: (K,) the number of its pixels that touch each person.
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
    def height(self) -> float:
        """Returns the height difference in metres between the lowest and the highest point of the group."""
        return float(self.high[1] - self.low[1])


@dataclass(frozen=True)
class Segments:
    """The pixels of a frame, by person and by loose group.

    Attributes:
        owner: (h, w) the index of the person, or -1.
        labels: (h, w) the number of the loose group, or 0.
        loose: the loose groups that are larger than noise, the largest first.
        counts: (K,) the number of each person's pixels.
    """

    owner: Int16
    labels: Int
    loose: list[LooseGroup]
    counts: Int

    def pixels(self, person: int) -> Bool:
        """Returns the pixels (h, w) of a person, by index."""
        return np.asarray(self.owner == person)

    def group(self, loose: LooseGroup) -> Bool:
        """Returns the pixels (h, w) of a loose group."""
        return np.asarray(self.labels == loose.label)


def segment_people(
    view: FrameView, kind: UInt8, postures: Sequence[Posture], handicap: Float | None = None
) -> Segments:
    """Segments a frame by the predicted postures of the people in it.

    Args:
        view: the frame.
        kind: (h, w) from :meth:`BackgroundModel.classify`.
        postures: the predicted posture of each person, world frame.
        handicap: (K,) metres added to a person's distances. It is positive for people who are probably
            hidden, so that they get fewer pixels.
    """
    shape, count = kind.shape, len(postures)
    handicap = np.zeros(count) if handicap is None else handicap
    owner = np.full(shape, -1, np.int16)
    distance = np.full(shape if count else (0, 0), np.inf)
    if count:
        capsules = [posture.capsules() for posture in postures]
        ends, radii = np.stack([c[0] for c in capsules]), np.stack([c[1] for c in capsules])
        boxes = image_boxes(view, ends, radii, REACH)
        label_pixels(
            view.points, kind, boxes, ends, radii, handicap, REACH, _UNLIKELY_REACH_M, owner, distance
        )
    if count > 1:
        grow_surfaces(owner, distance, view.z)
    pixels = find_candidate_pixels(kind, owner)
    labels, groups = label_groups(view.z, pixels, 1.0)
    loose, joined = _classify_groups(_group_measures(view, pixels, labels, groups, owner, count))
    counts = _assign_limbs(owner, labels, pixels, joined, count) if count else np.zeros(0, np.int64)
    if count > 1:
        counts_before, counts = counts, reassign_detached_pieces(owner, view.z, counts)
        if (counts_before != counts).any():
            # The owners have changed, so count again which people each group touches.
            table = _group_measures(view, pixels, labels, groups, owner, count)
            loose = [replace(group, contact=table[group.label, 15:].astype(np.int64)) for group in loose]
    return Segments(owner, labels, loose, counts)


def pixels_near_bodies(
    view: FrameView, postures: Sequence[Posture], above: float, reach: float, among: Bool | None = None
) -> Bool:
    """Returns (h, w) pixels near a person's surface and more than ``above`` metres high.

    Args:
        view: the frame.
        postures: the people's postures, world frame.
        above: metres above the floor.
        reach: metres.
        among: (h, w) the pixels to examine. If None, examines all.
    """
    kind = _solid_pixels(view.z, view.points, above)
    if among is not None:
        kind[~among] = BACKGROUND
    owner, distance = np.full(kind.shape, -1, np.int16), np.full(kind.shape, np.inf)
    ends, radii = (np.stack(values) for values in zip(*(p.capsules() for p in postures), strict=True))
    boxes, none = image_boxes(view, ends, radii, reach), np.zeros(len(postures))
    label_pixels(view.points, kind, boxes, ends, radii, none, reach, reach, owner, distance)
    return np.asarray(owner >= 0)


@njit(cache=True, nogil=True)
def _solid_pixels(z, points, above):
    """Returns (h, w) classes: UNSEEN for measurements more than ``above`` metres high, else BACKGROUND."""
    out = np.empty(z.shape, np.uint8)
    for v in range(z.shape[0]):
        for u in range(z.shape[1]):
            out[v, u] = UNSEEN if (z[v, u] > 0.0) & (points[v, u, 1] > above) else BACKGROUND
    return out


@njit(cache=True, nogil=True)
def find_candidate_pixels(kind, owner):
    """Returns (M,) flat indices, in reading order, of the pixels without an owner that may be a person's."""
    kind, owner = kind.ravel(), owner.ravel()
    mask = np.empty(len(kind), np.bool_)
    for i in range(len(kind)):
        mask[i] = (kind[i] != BACKGROUND) & (kind[i] != UNLIKELY) & (owner[i] < 0)
    return pixels_of(mask)


@njit(cache=True, nogil=True)
def label_groups(z, pixels, tightness):
    """Returns (h, w) connected components 1..n of pixels joined by small depth steps, and n.

    All other pixels are 0. The kernel is a union-find with one pass in reading order.

    Args:
        z: (h, w) metres.
        pixels: (M,) int32 the flat indices of the pixels in reading order.
        tightness: factor on the maximum depth step.
    """
    shape, width, z = z.shape, z.shape[1], z.ravel()
    # Until the groups are numbered, use a pixel's position in ``pixels``, counted from 1, as its label.
    labels, parent, row = np.zeros(len(z), np.int32), np.arange(len(pixels), dtype=np.int32), 0
    for n in range(len(pixels)):
        here = pixels[n]
        labels[here] = n + 1
        while here >= row + width:
            row += width
        step = (0.035 + 0.012 * z[here] * z[here]) * tightness
        left, above = here - 1 if here > row else -1, here - width
        root = n
        if left >= 0 and labels[left] > 0 and abs(z[here] - z[left]) < step:
            root = root_of(parent, n - 1)
        if above >= 0 and labels[above] > 0 and abs(z[here] - z[above]) < step:
            other = root_of(parent, labels[above] - 1)
            # The root of a group is its first pixel, so join by the smaller root.
            root, later = min(root, other), max(root, other)
            parent[later] = root
        parent[n] = root
    count = 0
    for n in range(len(pixels)):
        root = root_of(parent, n)
        # The root comes first in its group, so it is numbered before the other pixels.
        count += root == n
        labels[pixels[n]] = count if root == n else labels[pixels[root]]
    return labels.reshape(shape), count


def _group_measures(
    view: FrameView, pixels: Int, labels: Int, groups: int, owner: Int16, people: int
) -> Float:
    """Returns (groups + 1, 15 + K) measures of each group.

    They are its area, low and high corner, sum of points, number of pixels, box and contacts.
    """
    camera = view.camera.intrinsics
    pixel = 1.0 / (camera.fx * camera.fy)
    return np.asarray(_group_table(view.z, view.points, pixels, labels, groups, owner, people, pixel))


@njit(cache=True, nogil=True)
def _group_table(z, points, pixels, labels, groups, owner, people, pixel):
    """Computes the table for :func:`_group_measures`."""
    height, width = z.shape
    out = np.zeros((groups + 1, 15 + people))
    out[:, 1:4], out[:, 4:7] = np.inf, -np.inf
    out[:, 11:13] = 1e9
    depth, label, place, v = z.ravel(), labels.ravel(), points.reshape(-1, 3), 0
    for n in range(len(pixels)):
        i = np.uintp(pixels[n])
        while pixels[n] >= (v + 1) * width:
            v += 1
        u, row = pixels[n] - v * width, out[np.uintp(label[i])]
        row[0] += depth[i] * depth[i] * pixel
        for a in range(3):
            p = place[i, a]
            # Compare before storing, because few pixels extend the box, and a comparison is cheaper than a
            # store.
            if p < row[1 + a]:
                row[1 + a] = p
            if p > row[4 + a]:
                row[4 + a] = p
            row[7 + a] += p
        row[10] += 1.0
        row[11], row[12] = min(row[11], v), min(row[12], u)
        row[13], row[14] = max(row[13], v + 1.0), max(row[14], u + 1.0)
        if people == 0:
            continue
        step = 0.035 + 0.012 * z[v, u] * z[v, u]
        for q, p in ((v - 1, u), (v + 1, u), (v, u - 1), (v, u + 1)):
            if 0 <= q < height and 0 <= p < width and owner[q, p] >= 0 and abs(z[q, p] - z[v, u]) < step:
                row[15 + owner[q, p]] += 1.0
    return out


def _classify_groups(table: Float) -> tuple[list[LooseGroup], Int]:
    """Returns the groups that stay loose, and (groups + 1,) the index of the person that each other group
    joins, or -1.
    """
    area, joined = table[:, 0], _limb_owners(table)
    large = np.flatnonzero((area >= MIN_GROUP_AREA_M2) & (joined < 0))
    return [_make_loose_group(int(g), table[g]) for g in sorted(large, key=lambda g: -area[g])], joined


@njit(cache=True, nogil=True)
def _limb_owners(table):
    """Returns (groups + 1,) the index of the person that each limb touches most. The value is -1 for groups
    that are not limbs.
    """
    joined = np.full(len(table), -1)
    for g in range(len(table)):
        row, contacts = table[g], table[g, 15:]
        length = np.sqrt((row[4] - row[1]) ** 2 + (row[5] - row[2]) ** 2 + (row[6] - row[3]) ** 2)
        if row[0] < _MAX_LIMB_AREA_M2 and length < _MAX_LIMB_LENGTH_M and contacts.any():
            joined[g] = np.argmax(contacts)
    return joined


def _make_loose_group(g: int, row: Float) -> LooseGroup:
    top, left, bottom, right = (int(x) for x in row[11:15])
    centre, contact = row[7:10] / row[10], row[15:].astype(np.int64)
    return LooseGroup(g, float(row[0]), row[1:4], row[4:7], centre, contact, (top, left, bottom, right))


@njit(cache=True, nogil=True)
def _assign_limbs(owner, labels, pixels, joined, people):
    """Assigns the (M,) pixels of joined groups to their owners, in place.

    Returns each person's number of pixels.
    """
    owner, labels = owner.ravel(), labels.ravel()
    for i in pixels:
        person = joined[labels[i]]
        if person >= 0:
            owner[i], labels[i] = person, 0
    counts = np.zeros(people, np.int64)
    for k in owner:
        if k >= 0:
            counts[k] += 1
    return counts
