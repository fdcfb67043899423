"""A skeleton as a hierarchy of sub-trees, from small to large (AniMesh, section 4.1).

A node is a *leaf* (one neighbour), a *chain* node (two) or a *branch* node (more). Every iteration

1. removes the chains between a leaf and a branch node,
2. moves the leaf to the average of the chain's nodes, each weighted by the length of its bone outwards, and
   adds up the lengths of the bones on the way,
3. makes a candidate of every branch node with one neighbour that is no leaf, and
4. turns each candidate into a leaf, at the average of its leaves weighted by their accumulated lengths,

until one node is left, the root, or a chain, whose node nearest to the centre of mass is the root.

Where the text leaves it open: a branch node all of whose neighbours are leaves, the last there is, is a
candidate too (a star would have none); a tree without any branch node is one candidate at its root; all
lengths are of the real bones. A root that is given never becomes a leaf: the iterations end with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.skeleton import Skeleton, skeleton_of

Weights = dict[int, float]
"""A point as an average of joints: their weights add up to one."""


@dataclass(frozen=True)
class Branch:
    """One branch of a sub-tree.

    Attributes:
        chain: real joints from the sub-tree's root to the next branch or leaf node, both included.
        extended: the same, on along the longest way to a leaf (Figure 5).
        weights: the abstract position as an average of joints.
        length: metres of all bones of the branch, those that hang on it included.
        reach: metres along ``extended``.
    """

    chain: tuple[int, ...]
    extended: tuple[int, ...]
    weights: Weights
    length: float
    reach: float

    def position(self, positions: Float) -> Float:
        """(3,) the abstract position, for (N, 3) joints at rest or in any pose."""
        joints = list(self.weights)
        return np.array(list(self.weights.values())) @ np.asarray(positions, np.float64)[joints]


@dataclass(frozen=True)
class SubTree:
    """A candidate: a root joint and the branches around it.

    Attributes:
        level: the iteration that found it, from 1.
        number: within its level, from 1, by the root joint's number.
        root: the joint all branches begin at.
        branches: by the number of their first joint.
    """

    level: int
    number: int
    root: int
    branches: tuple[Branch, ...]

    @property
    def name(self) -> str:
        """As the paper calls it: "2-1" is the first of the second iteration."""
        return f"{self.level}-{self.number}"


@dataclass(frozen=True)
class Abstraction:
    """What the iterations found.

    Attributes:
        root: the joint that was given, or found.
        candidates: from the first iteration to the last.
    """

    root: int
    candidates: tuple[SubTree, ...]


def abstract_skeleton(skeleton: Skeleton, root: int | None = 0) -> Abstraction:
    """The hierarchy of a skeleton; ``root`` None looks for the root as if none were known."""
    links = [(int(parent), joint) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    return _reduced(skeleton.positions, _neighbours(len(skeleton), links), root)


def abstract(
    positions: Float | Sequence[Sequence[float]],
    links: Iterable[tuple[int, int]],
    root: int | None = None,
    names: Sequence[str] | None = None,
) -> Abstraction:
    """The hierarchy of a tree of joints.

    Args:
        positions: (N, 3) metres.
        links: pairs of joints, in any order.
        root: the joint that stays the root, or None to find one.
        names: of the joints, for errors.

    Raises:
        InputError: where the links make a cycle or leave joints apart, with the names of those joints.
    """
    at = np.array(positions, np.float64).reshape(-1, 3)
    pairs = [(int(a), int(b)) for a, b in links]
    if root is not None and not 0 <= root < len(at):
        raise InputError(
            f"there is no joint {root} of {len(at)}", where="skeleton", mend="Give another root."
        )
    skeleton_of(names or [f"joint {j}" for j in range(len(at))], pairs, at, root)
    return _reduced(at, _neighbours(len(at), pairs), root)


def _neighbours(count: int, links: Iterable[tuple[int, int]]) -> list[list[int]]:
    beside: list[list[int]] = [[] for _ in range(count)]
    for a, b in links:
        beside[a].append(b)
        beside[b].append(a)
    return beside


def _reduced(positions: Float, beside: list[list[int]], root: int | None) -> Abstraction:
    """The iterations."""
    work = _Reduction(positions, [list(near) for near in beside], root)
    candidates: list[SubTree] = []
    leaves = work.leaves()
    level = 0
    while leaves and work.forks:
        level += 1
        touched = {work.attach(leaf) for leaf in leaves}
        leaves = []
        ready = (fork for fork in sorted(touched) if work.is_ready(fork))
        for number, fork in enumerate(ready, 1):
            candidates.append(SubTree(level, number, fork, work.branches(fork)))
            if not work.beside[fork]:
                return Abstraction(fork, tuple(candidates))
            leaves.append(fork)
        for fork in leaves:
            work.collapse(fork)
    found = work.nearest_to_mass(beside, leaves[0] if leaves else 0)
    if not candidates and len(beside) > 1:
        return _reduced(positions, beside, found)
    return Abstraction(found, tuple(candidates))


@dataclass(frozen=True)
class _Leaf:
    """What a leaf stands for: itself, or a sub-tree.

    Attributes:
        tail: the longest way from the leaf's joint to a real leaf.
        reach: metres along it.
    """

    weights: Weights
    length: float
    tail: tuple[int, ...]
    reach: float


class _Reduction:
    """The tree that is left.

    Attributes:
        beside: the neighbours of each joint that are no leaves yet.
        forks: the branch nodes that are left, and the root where one is given.
    """

    def __init__(self, positions: Float, beside: list[list[int]], root: int | None) -> None:
        self._positions, self._root = positions, root
        self.beside = beside
        self.forks = {joint for joint, near in enumerate(beside) if len(near) > 2 or joint == root}
        self._done: dict[int, list[Branch]] = {fork: [] for fork in self.forks}
        self._leaf: dict[int, _Leaf] = {}

    def leaves(self) -> list[int]:
        """The leaves of the whole tree."""
        ends = [j for j, near in enumerate(self.beside) if len(near) == 1 and j != self._root]
        self._leaf = {end: _Leaf({end: 1.0}, 0.0, (end,), 0.0) for end in ends}
        return ends

    def attach(self, leaf: int) -> int:
        """Steps 1 and 2: the leaf with its chain becomes a branch of the branch node that is returned."""
        chain, node = [leaf], self.beside[leaf][0]
        while node not in self.forks:
            one, other = self.beside[node]
            chain, node = [*chain, node], other if one == chain[-1] else one
        self.beside[node].remove(chain[-1])
        self._done[node].append(self._branch((node, *reversed(chain)), self._leaf[leaf]))
        return node

    def _branch(self, chain: tuple[int, ...], leaf: _Leaf) -> Branch:
        at = self._positions[list(chain)]
        lengths = np.linalg.norm(np.diff(at, axis=0), axis=1)
        removed = dict(zip(chain[1:-1], lengths[1:], strict=True))
        weights = _shared(removed) if removed else leaf.weights
        whole = float(lengths.sum())
        return Branch(chain, (*chain[:-1], *leaf.tail), weights, leaf.length + whole, leaf.reach + whole)

    def is_ready(self, fork: int) -> bool:
        """Step 3: whether a sub-tree is rooted here."""
        return len(self.beside[fork]) <= (0 if fork == self._root else 1)

    def branches(self, fork: int) -> tuple[Branch, ...]:
        """Those of a branch node, by their first joint."""
        return tuple(sorted(self._done[fork], key=lambda branch: branch.chain[1]))

    def collapse(self, fork: int) -> None:
        """Step 4: the sub-tree becomes a leaf."""
        branches = self.branches(fork)
        shares = _shared({i: branch.length for i, branch in enumerate(branches)})
        weights: Weights = {}
        for i, share in shares.items():
            for joint, weight in branches[i].weights.items():
                weights[joint] = weights.get(joint, 0.0) + share * weight
        longest = max(branches, key=lambda branch: branch.reach)
        length = sum(branch.length for branch in branches)
        self._leaf[fork] = _Leaf(weights, length, longest.extended, longest.reach)
        self.forks.discard(fork)

    def nearest_to_mass(self, beside: list[list[int]], start: int) -> int:
        """Of the chain that is left, the node nearest to the centre of mass of all bones."""
        chain, before = [start], -1
        while ahead := [j for j in self.beside[chain[-1]] if j != before]:
            before = chain[-1]
            chain.append(ahead[0])
        distances = np.linalg.norm(self._positions[chain] - centre_of_mass(self._positions, beside), axis=1)
        # Of two that are equally near, noise must not choose.
        return chain[int(np.argmin(np.round(distances / (distances.max() or 1.0), 9)))]


def centre_of_mass(positions: Float, beside: Sequence[Sequence[int]]) -> Float:
    """(3,) of a tree whose bones are rods of equal mass a metre."""
    links = [(a, b) for a, near in enumerate(beside) for b in near if a < b]
    pairs = np.array(links, np.int64).reshape(-1, 2)
    lengths = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    if lengths.sum() <= 0.0:
        return np.asarray(positions.mean(0))
    middles = positions[pairs].mean(1)
    return np.asarray(lengths @ middles / lengths.sum())


def _shared(weights: Weights) -> Weights:
    """The weights scaled to add up to one; equal ones where all are zero."""
    total = float(sum(weights.values()))
    if total <= 0.0:
        return dict.fromkeys(weights, 1.0 / len(weights))
    return {key: float(weight) / total for key, weight in weights.items()}
