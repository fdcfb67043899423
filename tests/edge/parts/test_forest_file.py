"""The forest's file: the same forest comes back, and a damaged file is refused in a sentence."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.errors import InputError
from enliven_edge.parts.features import random_features
from enliven_edge.parts.forest import PartForest, Trees
from enliven_edge.parts.labels import PARTS
from enliven_edge.parts.shipped import shipped_forest


def small(**changes) -> PartForest:
    values = dict(
        roots=np.zeros(1, np.int32), feature=np.zeros(3, np.uint16), threshold=np.zeros(3, np.float32),
        child=np.array([1, -1, -2], np.int32), posterior=np.full((2, PARTS), 15, np.uint8),
        facing=np.full((2, 8), 32, np.uint8),
    )  # fmt: skip
    return PartForest(random_features(4, np.random.default_rng(0)), Trees(**{**values, **changes}))


def test_it_comes_back_as_it_was(tmp_path):
    forest = small()
    forest.save(tmp_path / "f.npz")
    back = PartForest.load(tmp_path / "f.npz")
    assert np.array_equal(back.features, forest.features)
    for name in ("roots", "feature", "threshold", "child", "posterior", "facing"):
        assert np.array_equal(getattr(back.trees, name), getattr(forest.trees, name))


def test_a_missing_file_is_said_to_be_missing(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        PartForest.load(tmp_path / "none.npz")


@pytest.mark.parametrize("keep", [0, 10, 400, -30])
def test_a_cut_file_is_refused(tmp_path, keep):
    small().save(tmp_path / "f.npz")
    whole = (tmp_path / "f.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[:keep])
    with pytest.raises(InputError, match="damaged"):
        PartForest.load(tmp_path / "cut.npz")


def test_no_flipped_byte_changes_the_forest_unnoticed(tmp_path):
    """Some bytes of the container mean nothing (a date); any other flip is refused."""
    forest = small()
    forest.save(tmp_path / "f.npz")
    whole = (tmp_path / "f.npz").read_bytes()
    refused = 0
    for place in range(0, len(whole), 37):
        flipped = bytearray(whole)
        flipped[place] ^= 0x55
        (tmp_path / "flipped.npz").write_bytes(bytes(flipped))
        try:
            back = PartForest.load(tmp_path / "flipped.npz")
        except InputError:
            refused += 1
            continue
        assert np.array_equal(back.features, forest.features)
        for name in ("roots", "feature", "threshold", "child", "posterior", "facing"):
            assert np.array_equal(getattr(back.trees, name), getattr(forest.trees, name))
    assert refused > 10


@pytest.mark.parametrize(
    "changes",
    [
        {"child": np.array([0, -1, -2], np.int32)},
        {"child": np.array([1, -1, -9], np.int32)},
        {"child": np.array([2, -1, -2], np.int32)},
        {"feature": np.full(3, 4, np.uint16)},
        {"roots": np.array([7], np.int32)},
        {"threshold": np.full(3, np.nan, np.float32)},
        {"posterior": np.full((2, 3), 15, np.uint8)},
        {"threshold": np.zeros(2, np.float32)},
        {"facing": np.full((2, 3), 32, np.uint8)},
        {"posterior": np.zeros((2, PARTS), np.uint8)},
    ],
    ids=[
        "circle",
        "no leaf",
        "past the end",
        "no feature",
        "no root",
        "not a number",
        "parts",
        "lengths",
        "ways",
        "nothing",
    ],
)
def test_a_forest_that_would_lead_astray_is_refused(tmp_path, changes):
    small(**changes).save(tmp_path / "f.npz")
    with pytest.raises(InputError, match="damaged"):
        PartForest.load(tmp_path / "f.npz")


def test_another_file_is_refused(tmp_path):
    np.savez(tmp_path / "f.npz", format=np.array([99, PARTS]))
    with pytest.raises(InputError, match="another version"):
        PartForest.load(tmp_path / "f.npz")


def test_the_shipped_one_is_whole_and_small():
    from enliven_edge.assets import PARTS_FOREST

    assert PARTS_FOREST.stat().st_size < 10e6
    assert len(shipped_forest().trees.roots) >= 3
