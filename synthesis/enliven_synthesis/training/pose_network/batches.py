"""Training samples as tensors on the training device. They are drawn and mirrored there."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from enliven.person import MIRROR
from enliven_edge.tracking.estimator.labels import FACINGS
from enliven_synthesis.training.dataset import MIRRORED_LABELS, Dataset


@dataclass(frozen=True)
class TensorBatch:
    """N training samples on one device.

    Attributes:
        image: (N, 4, 80, 64) float32 channels of the crop.
        parts: (N, 40, 32) uint8 the body part at each label cell, or the background label.
        joints: (N, 20, 3) metres, crop coordinates.
        facing: (N,) radians; NaN in samples without a person.
        cell: (N,) size of a cell of the crop in metres.
    """

    image: Tensor
    parts: Tensor
    joints: Tensor
    facing: Tensor
    cell: Tensor

    @property
    def is_person(self) -> Tensor:
        """Returns (N,) True for samples that show a person."""
        return self.facing.isfinite()

    @property
    def ways(self) -> Tensor:
        """Returns the (N,) facing class, 0 to 7, or 8 without a person."""
        classes = torch.round(self.facing.nan_to_num() * FACINGS / (2.0 * torch.pi)).long() % FACINGS
        return torch.where(self.is_person, classes, FACINGS)

    def mirrored(self, mask: Tensor) -> TensorBatch:
        """Returns the batch with left and right exchanged in the samples selected by a mask (N,)."""
        device = self.image.device
        other_side, opposite = (
            torch.from_numpy(MIRRORED_LABELS).to(device),
            torch.tensor(MIRROR, device=device),
        )
        across = torch.tensor([-1.0, 1.0, 1.0], device=device)
        return TensorBatch(
            torch.where(mask[:, None, None, None], self.image.flip(3), self.image),
            torch.where(mask[:, None, None], other_side[self.parts.flip(2).long()], self.parts),
            torch.where(mask[:, None, None], self.joints[:, opposite] * across, self.joints),
            torch.where(mask, -self.facing, self.facing),
            self.cell,
        )


class TensorDataset:
    """A data set as tensors on a device. If the device's memory is too small, the samples stay on disk."""

    def __init__(self, dataset: Dataset, device: torch.device) -> None:
        self._device = device
        tensors = {name: torch.from_numpy(array) for name, array in dataset.arrays.items()}
        try:
            self._tensors = {name: tensor.to(device) for name, tensor in tensors.items()}
        except torch.cuda.OutOfMemoryError:
            self._tensors = tensors

    def __len__(self) -> int:
        return len(self._tensors["cell"])

    def batch(self, which: Tensor) -> TensorBatch:
        """Returns the samples with the given numbers (N,).

        The numbers must be ascending, so that samples are read from disk sequentially.
        """
        indices = which.sort().values.to(self._tensors["cell"].device)
        samples = {name: tensor[indices].to(self._device) for name, tensor in self._tensors.items()}
        return TensorBatch(**(samples | {"image": samples["image"].float()}))
