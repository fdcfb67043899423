"""The parts of a skeleton's abstraction: branches, sub-trees, and the root."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

Weights = dict[int, float]
"""A point as a weighted average of joints. Maps joint numbers to weights, which sum to one."""


@dataclass(frozen=True)
class Branch:
    """A branch of a sub-tree.

    Attributes:
        chain: real joints from the sub-tree's root to the next branch or leaf node, both included.
        extended: the chain, extended along the longest path to a leaf (Figure 5).
        weights: the abstract position as a weighted average of joints.
        length: total length of all bones of the branch and of its sub-branches, metres.
        reach: length of ``extended``, metres.
    """

    chain: tuple[int, ...]
    extended: tuple[int, ...]
    weights: Weights
    length: float
    reach: float

    def position(self, positions: Float) -> Float:
        """Returns the abstract position (3,) in metres, for joints at ``positions`` (N, 3) in any pose."""
        joints = list(self.weights)
        return np.array(list(self.weights.values())) @ np.asarray(positions, np.float64)[joints]


@dataclass(frozen=True)
class SubTree:
    """A candidate for a match: a root joint and the branches around it.

    Attributes:
        level: number of the iteration that found the sub-tree, from 1.
        number: number within its level, from 1. Candidates are sorted by the number of their root joint.
        root: the joint at which all branches begin.
        branches: the branches, sorted by the number of their first joint.
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
    """The hierarchy of sub-trees that results from the iterations.

    Attributes:
        root: the root joint, given by the caller or determined by the iterations.
        candidates: all sub-trees, from the first iteration to the last.
    """

    root: int
    candidates: tuple[SubTree, ...]
