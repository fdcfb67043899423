"""The steps of one iteration of AniMesh, section 4.1, on the remaining tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.matching.subtrees import Branch, Weights


@dataclass(frozen=True)
class _Leaf:
    """A leaf: one joint, or a sub-tree that it represents.

    Attributes:
        tail: the longest path from the leaf's joint to a real leaf.
        reach: metres along it.
    """

    weights: Weights
    length: float
    tail: tuple[int, ...]
    reach: float


class Reduction:
    """The remaining tree.

    Attributes:
        beside: the neighbours of each joint that are not leaves yet.
        forks: the remaining branch nodes, and the given root, if any.
    """

    def __init__(self, positions: Float, beside: list[list[int]], root: int | None) -> None:
        self._positions, self._root = positions, root
        self.beside = beside
        self.forks = {joint for joint, near in enumerate(beside) if len(near) > 2 or joint == root}
        self._done: dict[int, list[Branch]] = {fork: [] for fork in self.forks}
        self._leaf: dict[int, _Leaf] = {}

    def leaves(self) -> list[int]:
        """Returns the leaves of the whole tree."""
        ends = [j for j, near in enumerate(self.beside) if len(near) == 1 and j != self._root]
        self._leaf = {end: _Leaf({end: 1.0}, 0.0, (end,), 0.0) for end in ends}
        return ends

    def attach(self, leaf: int) -> int:
        """Steps 1 and 2: turns the leaf with its chain into a branch of the returned branch node."""
        chain, node = [leaf], self.beside[leaf][0]
        while node not in self.forks:
            first, second = self.beside[node]
            chain, node = [*chain, node], second if first == chain[-1] else first
        self.beside[node].remove(chain[-1])
        self._done[node].append(self._weighted_branch((node, *reversed(chain)), self._leaf[leaf]))
        return node

    def _weighted_branch(self, chain: tuple[int, ...], leaf: _Leaf) -> Branch:
        at = self._positions[list(chain)]
        lengths = np.linalg.norm(np.diff(at, axis=0), axis=1)
        removed = dict(zip(chain[1:-1], lengths[1:], strict=True))
        weights = _normalized_weights(removed) if removed else leaf.weights
        total_length = float(lengths.sum())
        return Branch(
            chain, (*chain[:-1], *leaf.tail), weights, leaf.length + total_length, leaf.reach + total_length
        )

    def is_ready(self, fork: int) -> bool:
        """Step 3: returns True if a sub-tree has its root here."""
        return len(self.beside[fork]) <= (0 if fork == self._root else 1)

    def branches(self, fork: int) -> tuple[Branch, ...]:
        """Returns the branches of a branch node, ordered by their first joint."""
        return tuple(sorted(self._done[fork], key=lambda branch: branch.chain[1]))

    def collapse(self, fork: int) -> None:
        """Step 4: turns the sub-tree into a leaf."""
        branches = self.branches(fork)
        shares = _normalized_weights({i: branch.length for i, branch in enumerate(branches)})
        weights: Weights = {}
        for i, share in shares.items():
            for joint, weight in branches[i].weights.items():
                weights[joint] = weights.get(joint, 0.0) + share * weight
        longest = max(branches, key=lambda branch: branch.reach)
        length = sum(branch.length for branch in branches)
        self._leaf[fork] = _Leaf(weights, length, longest.extended, longest.reach)
        self.forks.discard(fork)

    def nearest_to_mass(self, beside: list[list[int]], start: int) -> int:
        """Returns the node of the remaining chain that is nearest to the centre of mass of all bones."""
        chain, before = [start], -1
        while ahead := [j for j in self.beside[chain[-1]] if j != before]:
            before = chain[-1]
            chain.append(ahead[0])
        distances = np.linalg.norm(self._positions[chain] - centre_of_mass(self._positions, beside), axis=1)
        # Round the distances, so that noise does not decide between equal ones.
        return chain[int(np.argmin(np.round(distances / (distances.max() or 1.0), 9)))]


def centre_of_mass(positions: Float, beside: Sequence[Sequence[int]]) -> Float:
    """Returns (3,) metres, the centre of mass of a tree of bones, each a rod of the same mass per metre."""
    links = [(a, b) for a, near in enumerate(beside) for b in near if a < b]
    pairs = np.array(links, np.int64).reshape(-1, 2)
    lengths = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    if lengths.sum() <= 0.0:
        return np.asarray(positions.mean(0))
    middles = positions[pairs].mean(1)
    return np.asarray(lengths @ middles / lengths.sum())


def _normalized_weights(weights: Weights) -> Weights:
    """Scales the weights to sum one. If all are zero, they become equal."""
    total = float(sum(weights.values()))
    if total <= 0.0:
        return dict.fromkeys(weights, 1.0 / len(weights))
    return {key: float(weight) / total for key, weight in weights.items()}
