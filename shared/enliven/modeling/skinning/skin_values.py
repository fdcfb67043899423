"""Conversions of skin weights: to and from dense matrices, subsets, concatenation, and the number of
bones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import SkinWeights


def make_dense_weights(skin: SkinWeights, bones: int) -> Float:
    """Returns the weight (V, bones) of every bone at every vertex."""
    out = np.zeros((len(skin.indices), bones))
    rows = np.repeat(np.arange(len(out)), 4)
    np.add.at(out, (rows, skin.indices.ravel().astype(np.int64)), skin.weights.ravel().astype(np.float64))
    return out


def keep_largest_weights(weights: Float, smooth: bool = False) -> SkinWeights:
    """Keeps the four largest weights in each row of (V, B), largest first, scaled to sum one.

    Args:
        smooth: True to subtract the fifth largest weight from each, so that weights stay continuous if the
            set of four changes.
    """
    count, bones = weights.shape
    kept_count = min(4, bones)
    order = np.argsort(-weights, axis=1, kind="stable")[:, :kept_count]
    chosen = np.take_along_axis(weights, order, 1)
    if smooth and bones > 4:
        fifth = np.partition(weights, bones - 5, axis=1)[:, bones - 5]
        less = chosen - fifth[:, None]
        chosen = np.where(less.sum(1, keepdims=True) > 0, less, chosen)
    chosen = np.maximum(chosen, 0.0)
    total = chosen.sum(1, keepdims=True)
    # A vertex without weights follows its first bone.
    chosen = np.where(total > 0, chosen / np.where(total > 0, total, 1.0), np.eye(1, kept_count))
    indices, kept_weights = np.zeros((count, 4), np.uint16), np.zeros((count, 4), np.float32)
    indices[:, :kept_count], kept_weights[:, :kept_count] = np.where(chosen > 0, order, 0), chosen
    return SkinWeights(indices, kept_weights)


def select_vertices(skin: SkinWeights, vertices: AnyArray) -> SkinWeights:
    """Returns the skin of a subset of the vertices, bit-exactly."""
    return SkinWeights(skin.indices[vertices], skin.weights[vertices])


def concatenate_skins(skins: Sequence[SkinWeights]) -> SkinWeights:
    """Concatenates the skins of consecutive groups of vertices."""
    return SkinWeights(
        np.concatenate([skin.indices for skin in skins]), np.concatenate([skin.weights for skin in skins])
    )


def bone_count(skin: SkinWeights) -> int:
    """Returns one more than the largest bone number in the skin."""
    return int(skin.indices.max(initial=0)) + 1
