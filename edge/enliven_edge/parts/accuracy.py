"""How well a forest names parts on fresh pictures: bodies and postures that it was not trained on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven_edge.parts.facing import facing_number
from enliven_edge.parts.forest import PartForest
from enliven_edge.parts.labels import FACINGS, MIRRORED, PARTS, Part
from enliven_edge.parts.pictures import Studio

_FRESH = 7919
"""Keeps the dice of a test apart from those of a training."""


@dataclass(frozen=True)
class Accuracy:
    """What was measured.

    Attributes:
        confusion: (17, 17) pixels by true part and likeliest part.
        facing: (8, 8) pictures by the true way to face and the likeliest one.
    """

    confusion: Float
    facing: Float

    @property
    def pixels(self) -> float:
        """The share of all pixels whose likeliest part is the true one."""
        return float(np.trace(self.confusion) / self.confusion.sum())

    @property
    def parts(self) -> Float:
        """(17,) that share, of the pixels of each part."""
        return np.asarray(np.diag(self.confusion) / np.maximum(self.confusion.sum(1), 1.0))

    @property
    def sideless(self) -> Float:
        """(17,) the same where left taken for right is no fault."""
        index = np.arange(PARTS)
        other = np.where(index == MIRRORED, 0.0, self.confusion[index, MIRRORED])
        return np.asarray((np.diag(self.confusion) + other) / np.maximum(self.confusion.sum(1), 1.0))

    def table(self) -> str:
        """A line a part."""
        lines = [f"{'part':20s} {'right':>6s} {'either side':>12s}"]
        for part in Part:
            name = part.name.lower().replace("_", " ")
            lines.append(f"{name:20s} {self.parts[part]:6.2f} {self.sideless[part]:12.2f}")
        lines.append(f"{'mean of the parts':20s} {self.parts.mean():6.2f} {self.sideless.mean():12.2f}")
        lines.append(f"{'all pixels':20s} {self.pixels:6.2f}")
        turned = np.abs((np.arange(FACINGS)[:, None] - np.arange(FACINGS) + 4) % FACINGS - 4)
        near = float(self.facing[turned <= 1].sum() / self.facing.sum())
        lines.append(f"{'faces, within 67 deg':20s} {near:6.2f}")
        return "\n".join(lines)


def measure(forest: PartForest, pictures: int, seed: int, family: str | None = None) -> Accuracy:
    """The accuracy on so many fresh pictures."""
    studio, dice = Studio(), np.random.default_rng([seed, _FRESH])
    confusion, facing = np.zeros((PARTS, PARTS)), np.zeros((FACINGS, FACINGS))
    for _ in range(pictures):
        picture = studio.picture(dice, family)
        rows, columns = np.nonzero(picture.z > 0)
        leaves = forest.leaves(picture.z.astype(np.float64), picture.camera, rows, columns)
        found = forest.parts_of(leaves).argmax(1)
        np.add.at(confusion, (picture.label[rows, columns], found), 1)
        facing[facing_number(picture), forest.facing_of(leaves).argmax()] += 1
    return Accuracy(confusion, facing)
