"""The steps of one iteration that simplifies a skeleton (AniMesh, section 4.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.matching.subtrees import Branch, Weights


@dataclass(frozen=True)
class _Leaf:
    """A leaf of the simplified tree. It is a joint that may represent a sub-tree.

    Attributes:
        tail: the joints on the longest path from the leaf's joint to a leaf of the original tree.
        reach: length of this path in metres.
    """

    weights: Weights
    length: float
    tail: tuple[int, ...]
    reach: float


class Reduction:
    """The tree of joints that remains during the simplification of a skeleton.

    Attributes:
        neighbours: the neighbours of each joint that are not leaves yet.
        branch_nodes: the remaining branch nodes, and the given root if there is one.
    """

    def __init__(self, positions: Float, neighbours: list[list[int]], root: int | None) -> None:
        self._positions, self._root = positions, root
        self.neighbours = neighbours
        self.branch_nodes = {
            joint for joint, adjacent in enumerate(neighbours) if len(adjacent) > 2 or joint == root
        }
        self._done: dict[int, list[Branch]] = {node: [] for node in self.branch_nodes}
        self._leaf: dict[int, _Leaf] = {}

    def leaves(self) -> list[int]:
        """Returns the leaf joints of the whole tree. Call it once, before the first iteration."""
        ends = [j for j, adjacent in enumerate(self.neighbours) if len(adjacent) == 1 and j != self._root]
        self._leaf = {end: _Leaf({end: 1.0}, 0.0, (end,), 0.0) for end in ends}
        return ends

    def attach(self, leaf: int) -> int:
        """Turns the leaf with its chain into a branch of the returned branch node (steps 1 and 2)."""
        chain, node = [leaf], self.neighbours[leaf][0]
        while node not in self.branch_nodes:
            first, second = self.neighbours[node]
            chain, node = [*chain, node], second if first == chain[-1] else first
        self.neighbours[node].remove(chain[-1])
        self._done[node].append(self._weight_branch((node, *reversed(chain)), self._leaf[leaf]))
        return node

    def _weight_branch(self, chain: tuple[int, ...], leaf: _Leaf) -> Branch:
        positions = self._positions[list(chain)]
        lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        removed = dict(zip(chain[1:-1], lengths[1:], strict=True))
        weights = _normalize_weights(removed) if removed else leaf.weights
        total_length = float(lengths.sum())
        return Branch(
            chain, (*chain[:-1], *leaf.tail), weights, leaf.length + total_length, leaf.reach + total_length
        )

    def is_ready(self, node: int) -> bool:
        """Returns True if the branch node is the root of a candidate sub-tree (step 3)."""
        return len(self.neighbours[node]) <= (0 if node == self._root else 1)

    def branches(self, node: int) -> tuple[Branch, ...]:
        """Returns the branches of a branch node, ordered by their first joint."""
        return tuple(sorted(self._done[node], key=lambda branch: branch.chain[1]))

    def collapse_to_leaf(self, node: int) -> None:
        """Turns the sub-tree at a branch node into a leaf (step 4)."""
        branches = self.branches(node)
        shares = _normalize_weights({i: branch.length for i, branch in enumerate(branches)})
        weights: Weights = {}
        for i, share in shares.items():
            for joint, weight in branches[i].weights.items():
                weights[joint] = weights.get(joint, 0.0) + share * weight
        longest = max(branches, key=lambda branch: branch.reach)
        length = sum(branch.length for branch in branches)
        self._leaf[node] = _Leaf(weights, length, longest.extended, longest.reach)
        self.branch_nodes.discard(node)

    def find_nearest_to_centre_of_mass(self, all_neighbours: list[list[int]], start: int) -> int:
        """Returns the node of the remaining chain that is nearest to the centre of mass of all bones."""
        chain, previous = [start], -1
        while next_nodes := [j for j in self.neighbours[chain[-1]] if j != previous]:
            previous = chain[-1]
            chain.append(next_nodes[0])
        distances = np.linalg.norm(
            self._positions[chain] - centre_of_mass(self._positions, all_neighbours), axis=1
        )
        # Round the distances, so that numerical noise does not decide between equal distances.
        return chain[int(np.argmin(np.round(distances / (distances.max() or 1.0), 9)))]


def centre_of_mass(positions: Float, neighbours: Sequence[Sequence[int]]) -> Float:
    """Returns the centre of mass of a tree of bones, (3,) in metres. Each bone is a rod with the same mass
    per metre.
    """
    links = [(a, b) for a, adjacent in enumerate(neighbours) for b in adjacent if a < b]
    pairs = np.array(links, np.int64).reshape(-1, 2)
    lengths = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    if lengths.sum() <= 0.0:
        return np.asarray(positions.mean(0))
    middles = positions[pairs].mean(1)
    return np.asarray(lengths @ middles / lengths.sum())


def _normalize_weights(weights: Weights) -> Weights:
    """Scales the weights so that their sum is one. If all are zero, they become equal."""
    total = float(sum(weights.values()))
    if total <= 0.0:
        return dict.fromkeys(weights, 1.0 / len(weights))
    return {key: float(weight) / total for key, weight in weights.items()}
