"""Training: a tree learns what can be learnt, the same again by the same seed, and only what it was shown."""

from __future__ import annotations

import numpy as np
import pytest

from enliven_edge.parts.features import random_features
from enliven_edge.parts.labels import NOBODY, PARTS
from enliven_edge.parts.pictures import Picture
from enliven_edge.parts.samples import Album, collect
from enliven_edge.parts.training import TrainingSettings, _best_cut, _sides, grow, train

CAMERA = np.array([150.0, 150.0, 20.0, 30.0])


def toy(seed: int) -> Picture:
    """A post: its top third is part 0, its middle part 3, its bottom part 15."""
    dice = np.random.default_rng(seed)
    z, label = np.zeros((60, 40), np.float32), np.full((60, 40), NOBODY, np.uint8)
    left, wide = dice.integers(5, 20), dice.integers(6, 14)
    for part, rows in ((0, slice(6, 22)), (3, slice(22, 38)), (15, slice(38, 54))):
        z[rows, left : left + wide] = 2.0 + 0.005 * dice.normal(size=(16, wide))
        label[rows, left : left + wide] = part
    return Picture(z, label, CAMERA, np.eye(4), None)


def toy_album(seeds: range) -> Album:
    return collect(toy(seed) for seed in seeds)


SETTINGS = TrainingSettings(
    pictures=1, pixels=60, trees=2, depth=7, fewest=6, pool=300, features=40, subset=800, seed=5
)


def test_it_learns_a_toy_problem_and_knows_fresh_examples():
    forest = train(toy_album(range(40)), SETTINGS, lambda *_: None)
    right = []
    for seed in range(100, 110):
        picture = toy(seed)
        rows, columns = np.nonzero(picture.z)
        found = forest.probabilities(picture.z, picture.camera, rows, columns).argmax(1)
        right.append((found == picture.label[rows, columns]).mean())
    assert np.mean(right) > 0.93


def test_the_same_seed_grows_the_same_forest_and_another_does_not():
    album = toy_album(range(12))
    one, same = (train(album, SETTINGS, lambda *_: None) for _ in range(2))
    other = train(album, TrainingSettings(**{**SETTINGS.__dict__, "seed": 6}), lambda *_: None)
    for name in ("feature", "threshold", "child", "posterior"):
        assert np.array_equal(getattr(one.trees, name), getattr(same.trees, name))
    assert not np.array_equal(one.features, other.features)


def test_a_tree_keeps_to_its_depth_and_every_leaf_is_a_distribution():
    album = toy_album(range(12))
    places, parts = album.draw(30, np.random.default_rng(0))
    features = random_features(100, np.random.default_rng(1))
    tree = grow(album, places, parts, features, TrainingSettings(depth=3, fewest=4, pool=100), 0)
    depth = np.zeros(len(tree.child), int)
    for node, child in enumerate(tree.child):
        if child >= 0:
            depth[child] = depth[child + 1] = depth[node] + 1
    assert depth.max() == 3
    assert np.abs(tree.posterior.sum(1).astype(int) - 255).max() <= PARTS


def test_pixels_are_drawn_evenly_over_the_parts():
    album = toy_album(range(5))
    places, parts = album.draw(10, np.random.default_rng(0))
    assert np.array_equal(np.bincount(parts, minlength=PARTS)[[0, 3, 15]], [50, 50, 50])
    start, _, width = album.boxes[places[:, 0]].T
    assert np.array_equal(album.labels[start + places[:, 1] * width + places[:, 2]], parts)


def test_the_cut_is_the_best_of_all_cuts():
    dice = np.random.default_rng(3)
    values, parts = dice.normal(size=200).astype(np.float32), dice.integers(0, 4, 200)
    parts[values > 0.3] = 2
    limits = np.sort(dice.normal(size=9)).astype(np.float32)
    side = np.empty(200, np.int8)
    _sides(values, limits, side)
    assert np.array_equal(side, (values[:, None] >= limits).sum(1))
    histogram = np.zeros((10, 4), np.int64)
    np.add.at(histogram, (side, parts), 1)
    table = np.arange(201.0)
    table[1:] *= np.log(table[1:])

    def entropy(members: np.ndarray) -> float:
        share = np.bincount(members, minlength=4) / max(1, len(members))
        return -len(members) * float(np.sum(share[share > 0] * np.log(share[share > 0])))

    slow = [entropy(parts[values < limit]) + entropy(parts[values >= limit]) for limit in limits]
    cut, least = _best_cut(histogram, np.bincount(parts, minlength=4), 200, table, np.zeros(4, np.int64))
    assert cut == np.argmin(slow)
    assert least == pytest.approx(min(slow))
