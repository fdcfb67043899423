"""Updates skin weights when an edit changes the bones. Weights that an edit does not touch stay bit-exact."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int
from enliven.document import SkinWeights


def renumber_bones(skin: SkinWeights, numbers: Int) -> SkinWeights:
    """Returns the skin with bone j renumbered to ``numbers[j]``. If several bones become one, their weights
    are added."""
    indices = numbers[skin.indices].astype(np.uint16)
    weights = skin.weights.copy()
    for slot in range(1, 4):
        for old_slot in range(slot):
            same = (indices[:, slot] == indices[:, old_slot]) & (weights[:, slot] > 0)
            weights[same, old_slot] += weights[same, slot]
            weights[same, slot] = 0.0
            indices[same, slot] = 0
    return SkinWeights(indices, weights)


def merge_skins(skin: SkinWeights, upper: int, lower: int, part: Float) -> SkinWeights:
    """Moves the fraction ``part`` (V,) in [0, 1] of the skin of bone ``lower`` to bone ``upper``.

    If a vertex already follows four bones, all of the weight goes to the bone with the larger fraction.
    Otherwise the two weights add up exactly to the old weight, because one of them is the difference without
    a rounding error. So removing an inserted node restores the old weights.
    """
    indices, weights = skin.indices.copy(), skin.weights.copy()
    rows, slots = np.nonzero((indices == lower) & (weights > 0))
    old_weights, part = weights[rows, slots], part[rows]
    first, second = _split_exactly(old_weights, part)
    free = weights[rows].argmin(1)
    full = weights[rows, free] > 0
    first = np.where(full, np.where(part >= 0.5, old_weights, 0), first).astype(np.float32)
    second = np.where(full, np.where(part >= 0.5, 0, old_weights), second).astype(np.float32)
    weights[rows, slots] = second
    moved = first > 0
    target = np.where(second > 0, free, slots)
    indices[rows[moved], target[moved]] = upper
    weights[rows[moved], target[moved]] = first[moved]
    return SkinWeights(indices, weights)


def _split_exactly(total: Float32, part: Float) -> tuple[Float32, Float32]:
    """Returns two float32 weights (K,) that add up to ``total`` (K,) without rounding. The first weight is
    about the fraction ``part`` (K,) of the total."""
    larger = np.maximum(part, 1.0 - part).astype(np.float32) * total
    # The larger weight is at least half of the whole, so that the difference is exact (Sterbenz).
    rest = total - larger
    first = part >= 0.5
    return np.where(first, larger, rest), np.where(first, rest, larger)


def upper_part(vertices: Float, start: Float, end: Float, at: float, blend: float) -> Float:
    """Returns the fraction (V,) of each vertex's weight that belongs to the upper half of a bone. The bone
    leads from ``start`` to ``end`` and is split at the fraction ``at``.

    The value is 1 before the node and 0 after it, with a cubic transition. To each side of the node, the
    transition is ``blend`` times as long as the shorter half.
    """
    axis = end - start
    along = (vertices - start) @ axis / max(float(axis @ axis), 1e-300)
    reach = max(blend * min(at, 1.0 - at), 1e-9)
    x = np.clip((along - at) / (2 * reach) + 0.5, 0.0, 1.0)
    return np.asarray(1.0 - x * x * (3.0 - 2.0 * x))


def find_nearest_bone(vertices: Float, starts: Float, ends: Float) -> Int:
    """Returns the number of the nearest bone to each vertex, (V,). Bones lead from ``starts`` to ``ends`` (B,
    3).
    """
    axis = ends - starts
    length = np.maximum((axis * axis).sum(1), 1e-300)
    along = np.clip(((vertices[:, None] - starts) * axis).sum(2) / length, 0.0, 1.0)
    nearest = starts + along[..., None] * axis
    return np.asarray(((vertices[:, None] - nearest) ** 2).sum(2).argmin(1))


def follows_bone(skin: SkinWeights, bone: int) -> Bool:
    """Returns (V,) True for vertices that follow a bone."""
    return np.asarray(((skin.indices == bone) & (skin.weights > 0)).any(1))
