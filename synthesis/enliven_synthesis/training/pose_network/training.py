"""Trains the pose network on rendered samples, and exports it for ONNX Runtime.

The loss of a joint is its negative log-likelihood under a distribution. The network predicts the width of
that distribution, which is the expected error. So occluded joints contribute less to the loss, because their
expected error is larger.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import cross_entropy

from enliven.arrays import AnyArray
from enliven.errors import InputError
from enliven.settings import parameter, setting
from enliven_edge.onnx_runtime import load_onnxruntime
from enliven_edge.tracking.estimator.crop import CHANNELS, COLUMNS, ROWS
from enliven_edge.tracking.estimator.labels import FACINGS, NOBODY
from enliven_synthesis.training.dataset import Batch, Dataset
from enliven_synthesis.training.pose_network.batches import TensorBatch, TensorDataset
from enliven_synthesis.training.pose_network.network import PoseNetwork

FRONTAL_FRACTION = 0.5
"""Fraction of people who face the sensor. The others face any direction. Most performers face the screen."""
VALIDATION_SAMPLES = 3000
"""Number of samples, from the start of a data set, that are held out for validation."""
_CONDITIONED_FRACTION = 0.6
"""Fraction of samples in which the network is conditioned on the facing. It must also work without it."""
_CONDITION_ERROR_RAD = 0.35
"""Standard deviation in radians of the error of the given facing: 20 degrees."""
_REVERSED_FRACTION = 0.04
"""Fraction of samples in which the given facing is reversed. It teaches the network not to rely on the facing
blindly."""
_MIN_LOG_SPREAD = -5.0
"""Minimum logarithm of a predicted error (7 mm). The loss does not reward a higher accuracy."""
_MAX_LOG_SPREAD = 1.0
"""Maximum logarithm of a predicted error (2.7 m). An error larger than a person is meaningless."""
_LIKELIHOOD_WEIGHT = 0.3
"""Weight of the joints' negative log-likelihood in the loss."""
_DISTANCE_WEIGHT = 2.0
"""Weight in the loss of the joints' mean distance in metres. It makes this term comparable with the
others."""
_JOINT_WEIGHTS = [1.0] * 4 + [1.0, 2.0, 2.0, 2.0] * 2 + [1.0] * 8
"""(20,) weights of the joints in the loss. Elbows, wrists and hands are the hardest to find in depth, and
legs are easy."""
_FACING_WEIGHT = 0.3
"""Weight of the facing's cross-entropy in the loss."""
_PARTS_WEIGHT = 0.5
"""Weight of the body parts' cross-entropy in the loss."""
_MAX_GRADIENT_NORM = 5.0
"""Maximum norm of the gradient (clipping). It limits the effect of a rare sample on the training."""
_WARM_UP_STEPS = 300
"""Number of steps of the learning-rate warm-up, during which Adam's averages settle."""
_FINAL_RATE = 0.02
"""Final learning rate as a fraction of the peak."""


FINE_TUNING_RATE = 1.5e-3
"""Peak learning rate for fine-tuning a trained network. A higher rate would first undo its training."""


@dataclass(frozen=True)
class TrainingSettings:
    """The size of the data set and the length of the training."""

    pictures: int = setting(
        110_000, "Number of rendered images.", low=2 * VALIDATION_SAMPLES, high=10_000_000
    )
    steps: int = setting(12_000, "Number of training steps.", low=1)
    batch: int = setting(128, "Number of images per training step.", low=1)
    rate: float = parameter(4e-3, "Maximum learning rate.", low=1e-6, high=1.0)
    seed: int = setting(0, "Random seed of the training.", low=0, high=2**31)


@dataclass(frozen=True)
class NetworkScores:
    """The scores of a network on validation samples.

    Attributes:
        within: fraction of joints within 10 cm, with and without the facing as a condition.
        facing: fraction of samples with the correct facing class (an eighth of a turn).
        parts: fraction of cells with the correct body part.
        persons: fraction of samples that are correctly classified as person or clutter.
    """

    within: tuple[float, float]
    facing: float
    parts: float
    persons: float


def train(
    dataset: Dataset,
    settings: TrainingSettings,
    stepped: Callable[[int, PoseNetwork], object] = lambda _n, _network: None,
    start: PoseNetwork | None = None,
) -> PoseNetwork:
    """Returns a network trained on a data set.

    Args:
        start: a network to fine-tune; None starts from random weights.
        stepped: called after each step with its number and the current network.

    Raises:
        InputError: if no samples are left for training.
    """
    if len(dataset) <= VALIDATION_SAMPLES:
        raise InputError(
            f"{len(dataset)} samples are too few, because {VALIDATION_SAMPLES} samples are reserved "
            "for validation",
            where="train-estimator",
            remedy="Render more pictures.",
        )
    torch.manual_seed(settings.seed)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    samples = TensorDataset(dataset, device)
    network = (start or PoseNetwork()).to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    network.train()
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=1e-2)
    for step in range(settings.steps):
        for group in optimizer.param_groups:
            group["lr"] = settings.rate * _schedule(step, settings.steps)
        indices = torch.randint(VALIDATION_SAMPLES, len(samples), (settings.batch,), device=device)
        batch = samples.batch(indices)
        batch = batch.mirrored(torch.rand(settings.batch, device=device) < 0.5)
        image = batch.image.contiguous(memory_format=torch.channels_last)
        with torch.autocast(device.type, torch.bfloat16):
            out = network(image, _network_condition(batch))
        optimizer.zero_grad(set_to_none=True)
        training_loss(out, batch).solve_backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), _MAX_GRADIENT_NORM)
        optimizer.step()
        stepped(step, network)
    return network.eval().cpu()


def measure(path: Path, dataset: Dataset) -> NetworkScores:
    """Evaluates an exported network on the held-out samples, in the same way as the tracker runs it."""
    session = load_onnxruntime().InferenceSession(path, providers=["CPUExecutionProvider"])
    near: list[list[AnyArray]] = [[], []]
    facing, parts, persons = [], [], []
    for first in range(0, VALIDATION_SAMPLES, 250):
        batch = dataset.batch(np.arange(first, first + 250))
        people = batch.is_person
        for k, sure in enumerate((1.0, 0.0)):
            angle = sure * np.nan_to_num(batch.facing)
            condition = np.stack([sure * np.cos(angle), sure * np.sin(angle), batch.cell], 1)
            inputs = {"image": batch.image, "told": condition.astype(np.float32)}
            joints, _, facing_logits, part_logits = session.run(None, inputs)
            near[k].append(np.linalg.norm(joints - batch.joints, axis=2)[people] < 0.1)
        facing.append((facing_logits[:, :FACINGS].argmax(1) == _classify_facings(batch))[people])
        persons.append((facing_logits.argmax(1) < FACINGS) == people)
        is_body = batch.parts != NOBODY
        parts.append((part_logits.argmax(1) == batch.parts)[is_body])
    shares = [float(np.concatenate(values).mean()) for values in (*near, facing, parts, persons)]
    return NetworkScores((shares[0], shares[1]), *shares[2:])


def export(network: PoseNetwork, path: Path) -> None:
    """Writes a network as an ONNX file that accepts any batch size."""
    # Import it here. If PyTorch, which belongs to the same extra, is missing, PyTorch is then reported first.
    import onnx

    example = (torch.zeros(2, CHANNELS, ROWS, COLUMNS), torch.zeros(2, 3))
    crops = torch.export.Dim("crops", min=1)
    program = torch.onnx.export(
        network.eval(),
        example,
        input_names=["image", "told"],
        output_names=["joints", "spread", "facing", "parts"],
        dynamic_shapes=({0: crops}, {0: crops}),
        dynamo=True,
        verbose=False,
    )
    assert program is not None
    model = program.model_proto
    _strip_source_locations(model.graph)
    onnx.save(model, path)


def _strip_source_locations(graph: Any) -> None:
    """Removes the source location of every node, because it contains folder names of the training machine."""
    for part in (graph, *graph.node, *graph.input, *graph.output, *graph.value_info, *graph.initializer):
        part.ClearField("doc_string")
        part.ClearField("metadata_props")


def _schedule(step: int, steps: int) -> float:
    """Returns the learning rate at a step as a fraction of the peak: linear warm-up, then cosine decay."""
    falling = _FINAL_RATE + (1.0 - _FINAL_RATE) * 0.5 * (1.0 + np.cos(np.pi * step / steps))
    return min(1.0, (step + 1) / _WARM_UP_STEPS) * float(falling)


def _network_condition(batch: TensorBatch) -> Tensor:
    """Returns the (N, 3) condition of the network.

    It consists of the facing with noise, reversed or unknown, and the cell size in metres.
    """
    anywhere = torch.pi * (2.0 * torch.rand_like(batch.cell) - 1.0)
    angle = torch.where(batch.is_person, batch.facing, anywhere)
    angle = angle + _CONDITION_ERROR_RAD * torch.randn_like(angle)
    angle = angle + torch.pi * (torch.rand_like(angle) < _REVERSED_FRACTION)
    has_facing = torch.rand_like(angle) < _CONDITIONED_FRACTION
    return torch.stack([angle.cos() * has_facing, angle.sin() * has_facing, batch.cell], 1)


def training_loss(out: tuple[Tensor, Tensor, Tensor, Tensor], batch: TensorBatch) -> Tensor:
    """Returns the training loss, a scalar.

    It is the sum of likelihood, distance, and cross-entropies of facing and body parts.
    """
    joints, spread, facing, parts = out
    weight = torch.tensor(_JOINT_WEIGHTS, device=joints.device) * batch.is_person[:, None]
    weight = weight / weight.sum().clamp(min=1.0)
    distance = ((joints - batch.joints).square().sum(2) + 1e-6).sqrt()
    spread = spread.clamp(_MIN_LOG_SPREAD, _MAX_LOG_SPREAD)
    likelihood = distance * torch.exp(-spread) + 3.0 * spread
    joints_off = _LIKELIHOOD_WEIGHT * likelihood + _DISTANCE_WEIGHT * distance
    facing_loss = cross_entropy(facing.float(), batch.ways, label_smoothing=0.05)
    true_parts = batch.parts.long()
    parts_loss = cross_entropy(parts.float(), true_parts.masked_fill(true_parts == NOBODY, -100))
    return (weight * joints_off).sum() + _FACING_WEIGHT * facing_loss + _PARTS_WEIGHT * parts_loss


def _classify_facings(batch: Batch) -> AnyArray:
    """Returns the facing class (N,), 0 to 7, or 8 without a person."""
    classes = np.round(np.nan_to_num(batch.facing) * FACINGS / (2.0 * np.pi)).astype(np.int64) % FACINGS
    return np.where(batch.is_person, classes, FACINGS)
