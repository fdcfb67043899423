"""Tests of the network in training: its shapes, its joint decoding, its learning, and its export."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import assert_alike

pytest.importorskip("torch", reason="PyTorch is not installed (the extra 'training')")

import torch

from enliven.errors import InputError
from enliven_edge.onnx_runtime import load_onnxruntime
from enliven_edge.tracking.estimator.crop import CHANNELS, COLUMNS, ROWS, Crop
from enliven_edge.tracking.estimator.estimator import PoseEstimator
from enliven_edge.tracking.estimator.labels import FACINGS, PARTS
from enliven_synthesis.training.dataset import Dataset, render_dataset
from enliven_synthesis.training.pose_network import training
from enliven_synthesis.training.pose_network.batches import TensorDataset
from enliven_synthesis.training.pose_network.network import JOINTS, WIDTHS, PoseNetwork
from enliven_synthesis.training.pose_network.quantisation import quantise
from enliven_synthesis.training.pose_network.training import TrainingSettings, export, measure, train

COUNT, BACK = 40, 8
NEARLY, MOSTLY = 0.01, 0.8
"""Maximum median joint difference of the 8-bit network in metres. Minimum fraction of equal body parts."""
LEARNT = 0.8
"""Maximum ratio of the loss after a few training steps to the first loss."""


@pytest.fixture(scope="module")
def album(tmp_path_factory) -> Dataset:
    return render_dataset(tmp_path_factory.mktemp("album"), COUNT, 0.5, 1)


@pytest.fixture
def few_kept_back(monkeypatch):
    """Makes the validation set small, so that the album and the training can be small too."""
    monkeypatch.setattr(training, "VALIDATION_SAMPLES", BACK)
    monkeypatch.setattr(training, "_WARM_UP_STEPS", 3)


def seen_by(network, count: int, seed: int = 0):
    """Returns the network's outputs for ``count`` crops of noise, and the (image, told) inputs."""
    dice = np.random.default_rng(seed)
    image = dice.normal(size=(count, CHANNELS, ROWS, COLUMNS)).astype(np.float32)
    facing = dice.uniform(-3, 3, count)
    hints = np.stack([np.cos(facing), np.sin(facing), dice.uniform(0.02, 0.036, count)], 1).astype(np.float32)
    with torch.no_grad():
        outputs = network.eval()(torch.from_numpy(image), torch.from_numpy(hints))
    return [each.numpy() for each in outputs], image, hints


def test_network_outputs_have_the_documented_shapes():
    (joints, spread, facing, parts), _, _ = seen_by(PoseNetwork(), 3)
    assert joints.shape == (3, JOINTS, 3) and spread.shape == (3, JOINTS)
    assert facing.shape == (3, FACINGS + 1) and parts.shape == (3, PARTS, ROWS // 2, COLUMNS // 2)


def test_a_joint_is_where_its_heat_is():
    """The joint is at the centre of a map cell, which covers four crop cells, at the depth stored in the
    map.
    """
    network = PoseNetwork()
    rows, columns = ROWS // 4, COLUMNS // 4
    maps = torch.zeros(1, 3 * JOINTS, rows, columns)
    places = [(j % rows, (3 * j) % columns) for j in range(JOINTS)]
    for j, (row, column) in enumerate(places):
        maps[0, j, row, column] = 1e4
        maps[0, JOINTS + j, row, column], maps[0, 2 * JOINTS + j, row, column] = 0.1 * j, -0.2 * j
    joints, spread = network.decode_maps(maps.flatten(2), torch.tensor([[0.03]]))
    for j, (row, column) in enumerate(places):
        flat = 0.03 * (np.array([4 * column + 2, 4 * row + 2]) - [COLUMNS / 2, ROWS / 2])
        np.testing.assert_allclose(joints[0, j].numpy(), [*flat, 0.1 * j], atol=1e-5)
    np.testing.assert_allclose(spread[0].numpy(), -0.2 * np.arange(JOINTS), atol=1e-5)


def test_facing_output_does_not_depend_on_the_input_facing():
    network = PoseNetwork()
    (_, _, facing, _), image, hints = seen_by(network, 2)
    with torch.no_grad():
        other = network(torch.from_numpy(image), torch.from_numpy(-hints))[2].numpy()
    assert_alike(facing, other)


def run_exported(path, image, hints):
    """Returns the outputs of an exported network."""
    session = load_onnxruntime().InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.run(None, {"image": image, "told": hints})


def test_exported_network_gives_the_same_outputs(tmp_path):
    """This holds for any number of crops, and through the estimator."""
    network = PoseNetwork()
    export(network, tmp_path / "made.onnx")
    estimator = PoseEstimator(tmp_path / "made.onnx")
    for count in (1, 2, 5):
        expected, image, hints = seen_by(network, count, count)
        outputs = run_exported(tmp_path / "made.onnx", image, hints)
        for actual, other in zip(outputs, expected, strict=True):
            np.testing.assert_allclose(actual, other, atol=1e-3)
    crop = Crop(image[0], 2.0, float(hints[0, 2]), np.eye(2), np.zeros(2))
    estimates = estimator.estimates(crop, np.eye(4), [float(np.arctan2(hints[0, 1], hints[0, 0])), None])
    np.testing.assert_allclose(estimates[0].joints, crop.to_camera(expected[0][0].astype(float)), atol=1e-2)


def loss_of(network, album: Dataset) -> float:
    """Returns the loss on the training lessons, with the facing as input."""
    batch = TensorDataset(album, torch.device("cpu")).batch(torch.arange(BACK, COUNT))
    is_person, facing = batch.is_person, batch.facing.nan_to_num()
    hints = torch.stack([is_person * facing.cos(), is_person * facing.sin(), batch.cell], 1)
    with torch.no_grad():
        return float(training.training_loss(network.train()(batch.image, hints), batch))


def test_a_few_steps_of_training_reduce_the_loss(album, few_kept_back):
    torch.manual_seed(0)
    steps = []
    trained = train(album, TrainingSettings(steps=25, batch=16, seed=0), lambda n, _: steps.append(n))
    assert steps == list(range(25))
    torch.manual_seed(0)
    assert loss_of(trained, album) < LEARNT * loss_of(PoseNetwork(), album)


def test_the_same_seed_learns_the_same_and_another_does_not(album, few_kept_back):
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        first, same, other = (
            train(album, TrainingSettings(steps=2, batch=4, seed=seed)).maps.weight.detach().numpy()
            for seed in (3, 3, 4)
        )
    finally:
        torch.set_num_threads(threads)
    np.testing.assert_array_equal(first, same)
    assert not np.array_equal(first, other)


def test_lessons_that_are_kept_back_are_not_learnt(album, few_kept_back, monkeypatch):
    drawn = []
    batch = TensorDataset.batch
    monkeypatch.setattr(
        TensorDataset, "batch", lambda self, which: drawn.extend(which.tolist()) or batch(self, which)
    )
    train(album, TrainingSettings(steps=3, batch=64))
    assert min(drawn) >= BACK and max(drawn) < COUNT


def test_network_scores_are_fractions(album, monkeypatch, tmp_path):
    """Measured on the validation lessons, 250 at a time. A small album repeats its lessons."""
    batch = Dataset.batch
    monkeypatch.setattr(training, "VALIDATION_SAMPLES", 250)
    monkeypatch.setattr(Dataset, "batch", lambda self, which: batch(self, which % COUNT))
    export(PoseNetwork(), tmp_path / "made.onnx")
    scores = measure(tmp_path / "made.onnx", album)
    assert all(0 <= share <= 1 for share in (*scores.within, scores.facing, scores.parts))


def test_8_bit_network_is_smaller_and_nearly_equal(album, tmp_path, few_kept_back):
    """Joints agree to millimetres, facing and parts in most cases. The network was trained for a few
    steps.
    """
    network = train(album, TrainingSettings(steps=25, batch=16, seed=0))
    full, small = tmp_path / "whole.onnx", tmp_path / "small.onnx"
    export(network, full)
    quantise(full, small, album, BACK)
    batch = album.batch(np.arange(BACK))
    facing = np.nan_to_num(batch.facing)  # clutter has no facing
    hints = np.stack([np.cos(facing), np.sin(facing), batch.cell], 1).astype(np.float32)
    (joints, _, _, parts), (near, _, _, small_parts) = (
        run_exported(path, batch.image, hints) for path in (full, small)
    )
    assert np.median(np.linalg.norm(joints - near, axis=2)) < NEARLY
    assert (parts.argmax(1) == small_parts.argmax(1)).mean() > MOSTLY
    assert small.stat().st_size < 0.4 * full.stat().st_size


def test_the_first_layer_and_the_maps_of_the_joints_stay_in_full_precision(album, tmp_path):
    import onnx

    whole, small = tmp_path / "whole.onnx", tmp_path / "small.onnx"
    export(PoseNetwork(), whole)
    quantise(whole, small, album, BACK)
    graph = onnx.load(small).graph
    exact = {w.name: tuple(w.dims) for w in graph.initializer if w.data_type == onnx.TensorProto.FLOAT}
    kept = [exact[n.input[1]] for n in graph.node if n.op_type == "Conv" and n.input[1] in exact]
    assert [shape[:2] for shape in kept] == [(WIDTHS[0], CHANNELS), (3 * JOINTS, 2 * WIDTHS[1])]


def test_an_album_that_is_too_small_is_refused(tmp_path):
    from enliven_synthesis.commands.train_estimator import train_estimator

    with pytest.raises(InputError, match="pictures"):
        train_estimator(tmp_path / "made.onnx", pictures=10)
