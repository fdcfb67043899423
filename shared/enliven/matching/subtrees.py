"""The parts of a skeleton's abstraction: branches, sub-trees, and the root."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

Weights = dict[int, float]
"""A point as a weighted average of joints. The weights sum to one."""


@dataclass(frozen=True)
class Branch:
    """One branch of a sub-tree.

    Attributes:
        chain: real joints from the sub-tree's root to the next branch or leaf node, both included.
        extended: the chain, extended along the longest path to a leaf (Figure 5).
        weights: the abstract position as an average of joints.
        length: metres of all bones of the branch and of its sub-branches.
        reach: metres along ``extended``.
    """

    chain: tuple[int, ...]
    extended: tuple[int, ...]
    weights: Weights
    length: float
    reach: float

    def position(self, positions: Float) -> Float:
        """Returns (3,) the abstract position, for (N, 3) joints at rest or in any pose."""
        joints = list(self.weights)
        return np.array(list(self.weights.values())) @ np.asarray(positions, np.float64)[joints]


@dataclass(frozen=True)
class SubTree:
    """A candidate: a root joint and the branches around it.

    Attributes:
        level: the iteration that found it, from 1.
        number: within its level, from 1, by the root joint's number.
        root: the joint where all branches begin.
        branches: by the number of their first joint.
    """

    level: int
    number: int
    root: int
    branches: tuple[Branch, ...]

    @property
    def name(self) -> str:
        """The name used in the paper: "2-1" is the first candidate of the second iteration."""
        return f"{self.level}-{self.number}"


@dataclass(frozen=True)
class Abstraction:
    """The result of the iterations.

    Attributes:
        root: the joint that was given, or found.
        candidates: from the first iteration to the last.
    """

    root: int
    candidates: tuple[SubTree, ...]
