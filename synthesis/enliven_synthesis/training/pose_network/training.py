"""Training the network on rendered lessons, and writing it down for ONNX Runtime.

Positions are learnt by their likelihood under a distribution whose width the network says itself, so that the
spread it gives means something; what it cannot see pulls less than what it can.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import torch
from torch import Tensor
from torch.nn.functional import cross_entropy

from enliven.arrays import AnyArray
from enliven.errors import InputError
from enliven.settings import setting
from enliven_edge.tracking.estimator import CHANNELS, COLUMNS, FACINGS, NOBODY, ROWS
from enliven_synthesis.training.dataset import Album, Batch
from enliven_synthesis.training.pose_network.network import PoseNetwork

Dice = np.random.Generator

KEPT_BACK = 3000
"""The first lessons, which are only measured on."""
_TOLD, _TOLD_OFF, _TOLD_WRONGLY = 0.6, 0.35, 0.04
"""Share of the lessons in which the facing is told, radians (one deviation) that it is off then, and the
share in which it is turned about."""
_CLEAREST, _VAGUEST = -5.0, 1.0
"""Logarithms of the least and the largest spread, metres."""
_LIKELIHOOD, _DISTANCE, _FACING, _PARTS = 0.3, 2.0, 0.3, 0.5
_LONGEST_GRADIENT, _WARM_UP, _LAST_RATE = 5.0, 300, 0.02


@dataclass(frozen=True)
class TrainingSettings:
    """How much is rendered and how long it is learnt."""

    pictures: int = setting(110_000, "Rendered pictures.", low=2 * KEPT_BACK, high=10_000_000)
    steps: int = setting(12_000, "Steps of the training.", low=1)
    batch: int = setting(128, "Pictures in a step.", low=1)
    rate: float = setting(4e-3, "The highest learning rate.", low=1e-6, high=1.0)
    frontal: float = setting(
        0.4, "Share of the people who look at the sensor; the others face anywhere.", low=0.0, high=1.0
    )
    seed: int = setting(0, "Fixes everything random.", low=0, high=2**31)


@dataclass(frozen=True)
class Measured:
    """What a network is worth on lessons that it has not learnt.

    Attributes:
        within: share of the joints within 10 cm when told the facing, and when not.
        facing: share of the pictures whose facing is told rightly, to an eighth of a turn.
        parts: share of the cells whose part is told rightly.
        somebody: share of the pictures in which a person is told from a thing.
    """

    within: tuple[float, float]
    facing: float
    parts: float
    somebody: float


def train(
    album: Album,
    settings: TrainingSettings,
    stepped: Callable[[int, PoseNetwork], object] = lambda _n, _network: None,
) -> PoseNetwork:
    """A network that has learnt an album.

    Raises:
        InputError: where there is nothing left to learn from.

    Args:
        stepped: called after each step with its number and the network so far.
    """
    if len(album) <= KEPT_BACK:
        raise InputError(
            f"{len(album)} lessons are too few: {KEPT_BACK} are kept back to measure on",
            where="train-estimator",
            mend="Render more pictures.",
        )
    torch.manual_seed(settings.seed)
    dice = np.random.default_rng([settings.seed, 5])
    network = PoseNetwork().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    network.train()
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=1e-2)
    for step in range(settings.steps):
        for group in optimizer.param_groups:
            group["lr"] = settings.rate * _schedule(step, settings.steps)
        batch = album.batch(dice.integers(KEPT_BACK, len(album), settings.batch))
        batch = batch.mirrored(dice.random(len(batch.cell)) < 0.5)
        told = _told(batch, dice)
        with torch.autocast("cpu", torch.bfloat16):
            out = network(_tensor(batch.image), told)
        optimizer.zero_grad(set_to_none=True)
        _loss(out, batch).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), _LONGEST_GRADIENT)
        optimizer.step()
        stepped(step, network)
    return network.eval()


def measure(path: Path, album: Album) -> Measured:
    """What a written network is worth, as the tracker runs it, on the lessons kept back."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    near: list[list[AnyArray]] = [[], []]
    facing, parts, somebody = [], [], []
    for first in range(0, KEPT_BACK, 250):
        batch = album.batch(np.arange(first, first + 250))
        people = batch.somebody
        for k, sure in enumerate((1.0, 0.0)):
            angle = sure * np.nan_to_num(batch.facing)
            told = np.stack([sure * np.cos(angle), sure * np.sin(angle), batch.cell], 1)
            given = {"image": batch.image, "told": told.astype(np.float32)}
            joints, _, ways, seen = session.run(None, given)
            near[k].append(np.linalg.norm(joints - batch.joints, axis=2)[people] < 0.1)
        facing.append((ways[:, :FACINGS].argmax(1) == _ways(batch))[people])
        somebody.append((ways.argmax(1) < FACINGS) == people)
        shown = batch.parts != NOBODY
        parts.append((seen.argmax(1) == batch.parts)[shown])
    shares = [float(np.concatenate(each).mean()) for each in (*near, facing, parts, somebody)]
    return Measured((shares[0], shares[1]), *shares[2:])


def export(network: PoseNetwork, path: Path) -> None:
    """Writes a network as an ONNX file, for any number of crops at once."""
    import onnx  # of the same extra as PyTorch, whose absence is to be told first

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
    _strip(model.graph)
    onnx.save(model, path)


def _strip(graph: Any) -> None:
    """Takes out where in the source every node comes from: it names the folders of whoever trained."""
    for part in (graph, *graph.node, *graph.input, *graph.output, *graph.value_info, *graph.initializer):
        part.ClearField("doc_string")
        part.ClearField("metadata_props")


def _schedule(step: int, steps: int) -> float:
    """The share of the highest rate: rising at first, then falling as a cosine."""
    falling = _LAST_RATE + (1.0 - _LAST_RATE) * 0.5 * (1.0 + np.cos(np.pi * step / steps))
    return min(1.0, (step + 1) / _WARM_UP) * float(falling)


def _told(batch: Batch, dice: Dice) -> Tensor:
    """(N, 3) what the network is told: the facing roughly, wrongly or not at all, and the cell."""
    count = len(batch.cell)
    angle = np.where(batch.somebody, batch.facing, dice.uniform(-np.pi, np.pi, count))
    angle += dice.normal(0.0, _TOLD_OFF, count)
    angle += np.pi * (dice.random(count) < _TOLD_WRONGLY)
    known = dice.random(count) < _TOLD
    told = np.stack([np.cos(angle) * known, np.sin(angle) * known, batch.cell], 1)
    return torch.from_numpy(told.astype(np.float32))


def _loss(out: tuple[Tensor, Tensor, Tensor, Tensor], batch: Batch) -> Tensor:
    """What is to become small."""
    joints, spread, facing, parts = out
    people = torch.from_numpy(batch.somebody)
    off = (joints - torch.from_numpy(batch.joints))[people]
    distance = (off.square().sum(2) + 1e-6).sqrt()
    spread = spread[people].clamp(_CLEAREST, _VAGUEST)
    likelihood = (distance * torch.exp(-spread) + 3.0 * spread).mean()
    ways = cross_entropy(facing.float(), torch.from_numpy(_ways(batch)), label_smoothing=0.05)
    wanted = torch.from_numpy(np.where(batch.parts == NOBODY, -100, batch.parts.astype(np.int64)))
    seen = cross_entropy(parts.float(), wanted)
    return _LIKELIHOOD * likelihood + _DISTANCE * distance.mean() + _FACING * ways + _PARTS * seen


def _ways(batch: Batch) -> AnyArray:
    """(N,) which of the eight ways people face, or that nobody is there."""
    ways = np.round(np.nan_to_num(batch.facing) * FACINGS / (2.0 * np.pi)).astype(np.int64) % FACINGS
    return np.where(batch.somebody, ways, FACINGS)


def _tensor(image: AnyArray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(image)).contiguous(memory_format=torch.channels_last)
