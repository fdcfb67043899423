"""Skin weights that follow the bones through an edit; what an edit does not touch stays to the bit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int
from enliven.document import SkinWeights
from enliven.settings import setting


@dataclass(frozen=True)
class InsertSettings:
    """How a new node shares the skin of its bone."""

    blend: float = setting(
        0.5, "how far from the new node the two bones blend, of the shorter of the two", low=0.0, high=1.0
    )


def renumbered(skin: SkinWeights, numbers: Int) -> SkinWeights:
    """The skin with bone j called ``numbers[j]``; two that become one are added up."""
    indices = numbers[skin.indices].astype(np.uint16)
    weights = skin.weights.copy()
    for slot in range(1, 4):
        for before in range(slot):
            same = (indices[:, slot] == indices[:, before]) & (weights[:, slot] > 0)
            weights[same, before] += weights[same, slot]
            weights[same, slot] = 0.0
            indices[same, slot] = 0
    return SkinWeights(indices, weights)


def shared_skin(skin: SkinWeights, upper: int, lower: int, part: Float) -> SkinWeights:
    """The skin of bone ``lower`` given in part to bone ``upper``: ``part`` (V,) in [0, 1] of it.

    A vertex that already follows four bones goes with the one that has the larger part. The two weights add
    up to the old one exactly (one is rounded, the other is the difference), so a node taken out again leaves
    the weights as they were.
    """
    indices, weights = skin.indices.copy(), skin.weights.copy()
    rows, slots = np.nonzero((indices == lower) & (weights > 0))
    whole, part = weights[rows, slots], part[rows]
    first, second = _halves(whole, part)
    free = weights[rows].argmin(1)
    full = weights[rows, free] > 0
    first = np.where(full, np.where(part >= 0.5, whole, 0), first).astype(np.float32)
    second = np.where(full, np.where(part >= 0.5, 0, whole), second).astype(np.float32)
    weights[rows, slots] = second
    moved = first > 0
    target = np.where(second > 0, free, slots)
    indices[rows[moved], target[moved]] = upper
    weights[rows[moved], target[moved]] = first[moved]
    return SkinWeights(indices, weights)


def _halves(whole: Float32, part: Float) -> tuple[Float32, Float32]:
    """Two float32 weights that sum to ``whole`` without rounding; the first is about ``part`` of it."""
    larger = np.maximum(part, 1.0 - part).astype(np.float32) * whole
    # The larger is at least half of the whole, so the difference is exact (Sterbenz).
    rest = whole - larger
    first = part >= 0.5
    return np.where(first, larger, rest), np.where(first, rest, larger)


def upper_part(vertices: Float, start: Float, end: Float, at: float, blend: float) -> Float:
    """(V,) how much of a vertex on the bone from ``start`` to ``end`` belongs above the node at ``at``.

    1 before the node, 0 after it, smooth (cubic) over ``blend`` of the shorter of the two bones.
    """
    axis = end - start
    along = (vertices - start) @ axis / max(float(axis @ axis), 1e-300)
    reach = max(blend * min(at, 1.0 - at), 1e-9)
    x = np.clip((along - at) / (2 * reach) + 0.5, 0.0, 1.0)
    return np.asarray(1.0 - x * x * (3.0 - 2.0 * x))


def nearest_bone(vertices: Float, starts: Float, ends: Float) -> Int:
    """(V,) which of the segments from ``starts`` (B, 3) to ``ends`` (B, 3) is nearest to each vertex."""
    axis = ends - starts
    length = np.maximum((axis * axis).sum(1), 1e-300)
    along = np.clip(((vertices[:, None] - starts) * axis).sum(2) / length, 0.0, 1.0)
    nearest = starts + along[..., None] * axis
    return np.asarray(((vertices[:, None] - nearest) ** 2).sum(2).argmin(1))


def follows(skin: SkinWeights, bone: int) -> Bool:
    """(V,) the vertices that follow a bone."""
    return np.asarray(((skin.indices == bone) & (skin.weights > 0)).any(1))
