"""Tests of training samples as tensors: batches equal the data set's samples, and mirroring is correct."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch", reason="PyTorch is not installed (the extra 'training')")

import torch

from enliven.person import MIRROR
from enliven_edge.tracking.estimator.labels import FACINGS, MIRRORED, NOBODY
from enliven_synthesis.training.dataset import Batch, Dataset, render_dataset
from enliven_synthesis.training.pose_network.batches import TensorBatch, TensorDataset

COUNT = 16
NAMES = ("image", "parts", "joints", "facing", "cell")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    return render_dataset(tmp_path_factory.mktemp("album"), COUNT, 0.5, 3)


@pytest.fixture(scope="module")
def samples(dataset) -> TensorDataset:
    return TensorDataset(dataset, torch.device("cpu"))


def same(one: TensorBatch, other: TensorBatch | Batch) -> bool:
    """Returns True if all arrays of two batches are equal. The facing of clutter is NaN in both."""
    pairs = ((np.asarray(getattr(one, name)), np.asarray(getattr(other, name))) for name in NAMES)
    return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def slowly_mirrored(batch: Batch, some: np.ndarray) -> Batch:
    """Mirrors a batch one sample, body part and joint at a time, as a slow reference."""
    arrays = {name: getattr(batch, name).copy() for name in NAMES}
    for n in np.flatnonzero(some):
        arrays["image"][n] = np.flip(batch.image[n], 2)
        for (row, column), part in np.ndenumerate(batch.parts[n]):
            other = part if part == NOBODY else MIRRORED[part]
            arrays["parts"][n, row, batch.parts.shape[2] - 1 - column] = other
        for joint, opposite in enumerate(MIRROR):
            x, y, z = batch.joints[n, opposite]
            arrays["joints"][n, joint] = -x, y, z
        arrays["facing"][n] = -batch.facing[n]
    return Batch(**arrays)


def test_a_batch_has_the_samples_of_the_data_set(dataset, samples):
    assert len(samples) == COUNT
    drawn = samples.batch(torch.tensor([7, 2, 5, 2]))
    assert same(drawn, dataset.batch(np.array([2, 2, 5, 7])))
    assert drawn.image.dtype == torch.float32


@pytest.mark.parametrize("every", [1, 2, 3])
def test_left_and_right_are_exchanged_in_those_asked_for(dataset, samples, every):
    some = np.arange(COUNT) % every == 0
    mirrored = samples.batch(torch.arange(COUNT)).mirrored(torch.from_numpy(some))
    assert same(mirrored, slowly_mirrored(dataset.batch(np.arange(COUNT)), some))


def test_mirroring_twice_changes_nothing(samples):
    some, batch = torch.arange(COUNT) % 3 > 0, samples.batch(torch.arange(COUNT))
    assert same(batch.mirrored(some).mirrored(some), batch)
    assert not same(batch.mirrored(some), batch)


def test_ways_are_eighths_of_a_turn_and_clutter_has_one_of_its_own(samples):
    batch = samples.batch(torch.arange(COUNT))
    for facing, person, way in zip(batch.facing.tolist(), batch.is_person.tolist(), batch.ways, strict=True):
        if not person:
            assert way == FACINGS
            continue
        off = (facing - float(way) * 2 * np.pi / FACINGS + np.pi) % (2 * np.pi) - np.pi
        assert 0 <= way < FACINGS and abs(off) <= np.pi / FACINGS + 1e-6
