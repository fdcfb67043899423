"""The way somebody faces, from the leaves that their pixels reach: a second table beside that of the parts.

No question of a tree was chosen for it; but what tells a left arm from a right one tells a front from a back.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from enliven.arrays import UInt8
from enliven_edge.parts.forest import PartForest
from enliven_edge.parts.labels import FACINGS, facing_of
from enliven_edge.parts.pictures import Picture, Studio
from enliven_edge.synthesis.performer import Limb

_PIXELS = 300
"""Of each picture, so that near people count no more than far ones."""
_PRIOR = 2.0
"""Pictures' worth of every way of facing alike that each leaf begins with."""


def facing_number(picture: Picture) -> int:
    """Which of the eight ways the person faces."""
    chest = picture.figure.frames[Limb.CHEST]
    angle = facing_of(chest[:, 0], chest[:, 3], picture.world_from_camera[:3, 3])
    return round(angle / (2.0 * np.pi / FACINGS)) % FACINGS


def tabulate_facing(
    forest: PartForest, pictures: int, seed: int, seen: Callable[[Picture], object] = lambda _: None
) -> UInt8:
    """(leaves, 8) uint8 how the people face whose pixels reach each leaf, from so many fresh pictures."""
    studio, dice = Studio(), np.random.default_rng([seed, 3])
    table, count = np.zeros((len(forest.trees.posterior), FACINGS)), np.ones(FACINGS)
    for _ in range(pictures):
        picture = studio.picture(dice)
        rows, columns = np.nonzero(picture.z > 0)
        kept = np.linspace(0, len(rows) - 1, min(_PIXELS, len(rows))).astype(int)
        leaves = forest.leaves(picture.z.astype(np.float64), picture.camera, rows[kept], columns[kept])
        number = facing_number(picture)
        np.add.at(table[:, number], leaves.ravel(), _PIXELS / 3.0 / len(kept))
        count[number] += 1.0
        seen(picture)
    table = table * (count.mean() / count) + _PRIOR / FACINGS
    shares = 255.0 * table / table.sum(1, keepdims=True)
    return np.maximum(np.rint(shares), 1.0).astype(np.uint8)
