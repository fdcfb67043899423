"""Growing a tree: at every node the best of many random depth differences and thresholds, by entropy."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float32
from enliven.settings import setting
from enliven_edge.parts.facing import tabulate_facing
from enliven_edge.parts.features import random_features, response
from enliven_edge.parts.forest import PartForest, Trees
from enliven_edge.parts.labels import FACINGS, PARTS
from enliven_edge.parts.pictures import Picture, Studio
from enliven_edge.parts.samples import Album, collect


@dataclass(frozen=True)
class TrainingSettings:
    """How much is rendered and how far the trees grow."""

    pictures: int = setting(20000, "Rendered pictures.", low=1, high=1_000_000)
    pixels: int = setting(25, "Pixels of every part drawn from a picture, anew for every tree.", low=1)
    trees: int = setting(3, "Trees of the forest.", low=1, high=20)
    frontal: float = setting(
        0.35, "Share of the people who look at the sensor; the others face anywhere.", low=0.0, high=1.0
    )
    facing: int = setting(
        4000, "Pictures of people who face anywhere, from which each leaf learns how people face.", low=0
    )
    depth: int = setting(18, "Questions from a root to a leaf, at most.", low=1, high=30)
    fewest: int = setting(40, "Pixels below which a node is not split.", low=2)
    pool: int = setting(2000, "Random features that every node draws from.", low=1, high=65535)
    features: int = setting(160, "Features tried at a deep node; more are tried near the root.", low=1)
    thresholds: int = setting(12, "Thresholds tried of every feature.", low=1, high=100)
    subset: int = setting(3000, "Pixels of a node on which its question is chosen.", low=10)
    seed: int = setting(0, "Fixes everything random.", low=0, high=2**31)


def render_album(settings: TrainingSettings, seen: Callable[[Picture], object] = lambda _: None) -> Album:
    """The pictures to train on; ``seen`` is called with each."""
    studio, dice = Studio(), np.random.default_rng([settings.seed, 0])

    def pictures():  # type: ignore[no-untyped-def]
        for _ in range(settings.pictures):
            picture = studio.picture(dice, frontal=settings.frontal)
            seen(picture)
            yield picture

    return collect(pictures())


def train(album: Album, settings: TrainingSettings, grown: Callable[[int, float], object]) -> PartForest:
    """A forest from an album.

    Args:
        grown: called with the number of a tree and its seconds when it is complete.
    """
    features = random_features(settings.pool, np.random.default_rng([settings.seed, 1]))
    trees = []
    for number in range(settings.trees):
        began = time.perf_counter()
        places, parts = album.draw(settings.pixels, np.random.default_rng([settings.seed, 2, number]))
        trees.append(grow(album, places, parts, features, settings, settings.seed + number))
        grown(number, time.perf_counter() - began)
    return PartForest(features, Trees.joined(trees))


def with_facing(
    forest: PartForest, settings: TrainingSettings, seen: Callable[[Picture], object] = lambda _: None
) -> PartForest:
    """The forest whose leaves also know how people face."""
    table = tabulate_facing(forest, settings.facing, settings.seed, seen)
    return PartForest(forest.features, replace(forest.trees, facing=table))


def grow(
    album: Album, places: AnyArray, parts: AnyArray, features: Float32, settings: TrainingSettings, seed: int
) -> Trees:
    """One tree over (M, 3) pixels of an album with their (M,) parts."""
    capacity = 4 * len(places) // settings.fewest + 3
    feature, threshold = np.zeros(capacity, np.uint16), np.zeros(capacity, np.float32)
    child, counts = np.full(capacity, -1, np.int32), np.zeros((capacity, PARTS), np.int32)
    table = np.arange(max(settings.subset, 2) + 1, dtype=np.float64)
    table[1:] *= np.log(table[1:])
    used = _grow(
        album.pixels, album.boxes, album.focal, places, parts, features, settings.depth, settings.fewest,
        settings.features, settings.thresholds, settings.subset, np.random.default_rng(seed), table,
        feature, threshold, child, counts,
    )  # fmt: skip
    leaf = child[:used] < 0
    numbered = child[:used].copy()
    numbered[leaf] = -1 - np.arange(np.count_nonzero(leaf))
    share = counts[:used][leaf] / counts[:used][leaf].sum(1, keepdims=True)
    return Trees(
        np.zeros(1, np.int32),
        feature[:used],
        threshold[:used],
        numbered,
        np.rint(share * 255).astype(np.uint8),
        np.full((len(share), FACINGS), 32, np.uint8),
    )


@njit(cache=True, nogil=True)
def _grow(  # type: ignore[no-untyped-def]
    pixels, boxes, focal, places, parts, features, depth, fewest, tried, cuts, subset, dice, table, feature,
    threshold, child, counts,
):  # fmt: skip
    """Splits nodes until they are deep, small or pure; how many nodes there are.

    The pixels of a node are a run of ``order``; a split keeps their order, so that pixels of one picture
    stay together and its memory is read together.
    """
    order, spare = np.arange(len(places)), np.empty(len(places), np.int64)
    where, scale, value = np.empty((1, 5), np.int64), np.empty((1, 3), np.float32), np.empty(1, np.float32)
    stack = [(0, 0, len(places), 0)]
    used = 1
    while len(stack) > 0:
        node, low, high, level = stack.pop()
        for i in range(low, high):
            counts[node, parts[order[i]]] += 1
        if level >= depth or high - low < fewest or counts[node].max() == high - low:
            continue
        trials = min(len(features), tried * (12 if level < 6 else 4 if level < 10 else 1))
        best, cut = _best_question(
            pixels, boxes, focal, places, parts, features, order[low:high], trials, cuts, subset, dice, table,
            counts.shape[1],
        )  # fmt: skip
        if best < 0:
            continue
        middle, right = low, 0
        for i in range(low, high):
            k = order[i]
            _locate(pixels, boxes, focal, places[k], where[0], scale[0])
            _answers(pixels, where, scale, features[best], value)
            if value[0] < cut:
                order[middle] = k
                middle += 1
            else:
                spare[right] = k
                right += 1
        order[middle:high] = spare[:right]
        if middle == low or right == 0:
            continue
        feature[node], threshold[node], child[node] = best, cut, used
        stack.append((used, low, middle, level + 1))
        stack.append((used + 1, middle, high, level + 1))
        used += 2
    return used


@njit(cache=True, nogil=True, error_model="numpy")
def _locate(pixels, boxes, focal, place, where, scale):  # type: ignore[no-untyped-def]
    """What :func:`response` needs of a (3,) picture, row and column: (5,) integers and (3,) z, x, y."""
    start, height, width = boxes[place[0]]
    where[0], where[1], where[2], where[3], where[4] = start, height, width, place[1], place[2]
    z = np.float32(pixels[start + place[1] * width + place[2]]) * np.float32(1e-3)
    scale[0], scale[1], scale[2] = z, np.float32(focal[place[0], 0]) / z, np.float32(focal[place[0], 1]) / z


@njit(cache=True, nogil=True, error_model="numpy")
def _answers(pixels, where, scale, feature, values):  # type: ignore[no-untyped-def]
    """The responses of a feature at located pixels, into ``values``."""
    for i in range(len(values)):
        start, height, width, row, column = where[i]
        values[i] = response(
            pixels, start, height, width, row, column, scale[i, 0], scale[i, 1], scale[i, 2], feature
        )


@njit(cache=True, nogil=True)
def _best_question(  # type: ignore[no-untyped-def]
    pixels, boxes, focal, places, parts, features, members, trials, cuts, subset, dice, table, kinds
):
    """The feature and threshold that leave the least entropy on a subset of the members; -1: none helps."""
    count = min(len(members), subset)
    where, scale, part = (
        np.empty((count, 5), np.int64),
        np.empty((count, 3), np.float32),
        np.empty(count, np.int64),
    )
    whole = np.zeros(kinds, np.int64)
    for i in range(count):
        k = members[i * len(members) // count]
        part[i] = parts[k]
        whole[part[i]] += 1
        _locate(pixels, boxes, focal, places[k], where[i], scale[i])
    values, side = np.empty(count, np.float32), np.empty(count, np.int8)
    limits = np.empty(cuts, np.float32)
    histogram, left = np.empty((cuts + 1, kinds), np.int64), np.empty(kinds, np.int64)
    best, best_cut, least = -1, np.float32(0.0), table[count] - 1e-9
    for p in range(kinds):
        least -= table[whole[p]]
    for _ in range(trials):
        f = dice.integers(0, len(features))
        _answers(pixels, where, scale, features[f], values)
        for c in range(cuts):
            one, other = values[dice.integers(0, count)], values[dice.integers(0, count)]
            limits[c] = np.float32(0.5) * (one + other)
        limits.sort()
        _sides(values, limits, side)
        histogram[:] = 0
        for i in range(count):
            histogram[side[i], part[i]] += 1
        c, entropy = _best_cut(histogram, whole, count, table, left)
        if entropy < least:
            best, best_cut, least = f, limits[c], entropy
    return best, best_cut


@njit(cache=True, nogil=True)
def _sides(values, limits, side):  # type: ignore[no-untyped-def]
    """How many of the limits each value has reached."""
    side[:] = 0
    for c in range(len(limits)):
        limit = limits[c]
        for i in range(len(values)):
            side[i] += values[i] >= limit


@njit(cache=True, nogil=True)
def _best_cut(histogram, whole, count, table, left):  # type: ignore[no-untyped-def]
    """The limit that leaves the least entropy (times the count), and that entropy."""
    best, least = 0, np.inf
    left[:] = 0
    on_left = 0
    for c in range(len(histogram) - 1):
        for p in range(len(whole)):
            left[p] += histogram[c, p]
            on_left += histogram[c, p]
        if on_left == 0 or on_left == count:
            continue
        entropy = table[on_left] + table[count - on_left]
        for p in range(len(whole)):
            entropy -= table[left[p]] + table[whole[p] - left[p]]
        if entropy < least:
            best, least = c, entropy
    return best, least
