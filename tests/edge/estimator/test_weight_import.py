"""Tests that a network restored from an exported file gives the same output and can be trained further."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch", reason="PyTorch is not installed (the extra 'training')")

import torch

from enliven.errors import InputError
from enliven_edge.assets import ESTIMATOR
from enliven_edge.onnx_runtime import load_onnxruntime
from enliven_synthesis.training.dataset import Dataset, render_dataset
from enliven_synthesis.training.pose_network import training
from enliven_synthesis.training.pose_network.network import PoseNetwork
from enliven_synthesis.training.pose_network.training import TrainingSettings, export, train
from enliven_synthesis.training.pose_network.weight_import import interpolate_networks, restore_network

ROUNDING = 2e-4
"""Tolerance in metres and logits: sums in a different order in single precision, through twenty layers."""
IN_EIGHT_BITS = 0.02
"""Tolerance of the median in metres: rounding all values to 8 bits moves a joint by millimetres."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    return render_dataset(tmp_path_factory.mktemp("album"), 24, 0.5, 2)


def outputs(network, batch) -> list[np.ndarray]:
    """Returns joints, spread, facing and parts of a batch, by a network or by an exported file."""
    hints = np.stack([np.zeros_like(batch.cell), np.zeros_like(batch.cell), batch.cell], 1)
    if not isinstance(network, PoseNetwork):
        return load_onnxruntime().InferenceSession(network).run(None, {"image": batch.image, "told": hints})
    with torch.no_grad():
        predicted = network.eval()(torch.from_numpy(batch.image), torch.from_numpy(hints))
    return [each.numpy() for each in predicted]


def test_exported_network_is_restored(dataset, tmp_path):
    torch.manual_seed(3)
    network = PoseNetwork()
    for layer in network.modules():
        if isinstance(layer, torch.nn.BatchNorm2d):
            torch.nn.init.uniform_(layer.weight, 0.5, 1.5)
            torch.nn.init.normal_(layer.running_mean, 0.0, 0.2)
            torch.nn.init.uniform_(layer.running_var, 0.5, 2.0)
    path = tmp_path / "whole.onnx"
    export(network, path)
    batch = dataset.batch(np.arange(6))
    for exported, other in zip(
        outputs(path, batch), outputs(restore_network(path, dataset, 0), batch), strict=True
    ):
        np.testing.assert_allclose(exported, other, atol=ROUNDING, rtol=ROUNDING)


def test_shipped_network_is_restored_and_trained_further(dataset, monkeypatch):
    """Its joints are unchanged. One training step changes the loss less than a step from random weights
    does.
    """
    batch = dataset.batch(np.arange(24))
    network = restore_network(ESTIMATOR, dataset, 0)
    apart = np.linalg.norm(outputs(network, batch)[0] - outputs(ESTIMATOR, batch)[0], axis=2)
    assert np.median(apart) < IN_EIGHT_BITS
    monkeypatch.setattr(training, "VALIDATION_SAMPLES", 4)
    losses = []
    monkeypatch.setattr(
        training,
        "training_loss",
        lambda out, of, known=training.training_loss: losses.append(known(out, of)) or losses[-1],
    )
    for start in (network, None):
        train(dataset, TrainingSettings(steps=1, batch=16), start=start)
    assert losses[0] < losses[1] - 1.0


def test_networks_are_interpolated_between_both_ends(dataset):
    network, other = (PoseNetwork().eval() for _ in range(2))
    batch = dataset.batch(np.arange(3))
    for share, end in ((0.0, network), (1.0, other)):
        blended = outputs(interpolate_networks(network, other, share), batch)
        for actual, expected in zip(blended, outputs(end, batch), strict=True):
            np.testing.assert_allclose(actual, expected, atol=ROUNDING, rtol=ROUNDING)
    blended = interpolate_networks(network, other, 0.25)
    for (name, first), last in zip(network.named_parameters(), other.parameters(), strict=True):
        part = blended.get_parameter(name).detach()
        torch.testing.assert_close(part, 0.75 * first.detach() + 0.25 * last.detach())
        assert part.data_ptr() != last.data_ptr()


@pytest.mark.parametrize("text", [b"", b"no network"])
def test_another_file_is_refused(dataset, tmp_path, text):
    path = tmp_path / "other.onnx"
    path.write_bytes(text)
    with pytest.raises(InputError, match=r"other\.onnx") as refused:
        restore_network(path, dataset, 0)
    assert "train-estimator" in str(refused.value)


def test_a_network_of_other_layers_is_refused(dataset, tmp_path):
    path = tmp_path / "wide.onnx"
    export(PoseNetwork((8, 16, 24, 32)), path)
    with pytest.raises(InputError, match="layers"):
        restore_network(path, dataset, 0)
