"""Simplifies a skeleton to a hierarchy of sub-trees, from small to large (AniMesh, section 4.1).

A node is a *leaf* (one neighbour), a *chain* node (two) or a *branch* node (more). Every iteration

1. removes the chains between a leaf and a branch node,
2. moves the leaf to the average of the chain's nodes, each weighted by the length of its outward bone, and
adds up the lengths of the bones of the chain,
3. makes every branch node with at most one neighbour that is not a leaf a candidate, and 4. turns each
candidate into a leaf, at the average of its leaves weighted by their accumulated lengths,

until only one node or one chain is left. A single node is the root. In a chain, the root is the node nearest
to the centre of mass.

The paper leaves some cases open. Here the last branch node is a candidate even if all its neighbours are
leaves (otherwise a star would have no candidate). A tree without any branch node is one candidate at its
root. All lengths are those of the real bones. A given root never becomes a leaf: the iterations end with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton, skeleton_of
from enliven.errors import InputError
from enliven.matching.reduction import Reduction
from enliven.matching.subtrees import Abstraction, SubTree


def abstract_skeleton(skeleton: Skeleton, root: int | None = 0) -> Abstraction:
    """Returns the hierarchy of a skeleton. If ``root`` is None, the iterations determine the root."""
    links = [(int(parent), joint) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    return _reduced_positions(skeleton.positions, _neighbour_lists(len(skeleton), links), root)


def abstract(
    positions: Float | Sequence[Sequence[float]],
    links: Iterable[tuple[int, int]],
    root: int | None = None,
    names: Sequence[str] | None = None,
) -> Abstraction:
    """Returns the hierarchy of a tree of joints.

    Args:
        positions: (N, 3) metres.
        links: pairs of joints, in any order.
        root: the joint that stays the root, or None to find one.
        names: of the joints, for errors.

    Raises:
        InputError: if the links form a cycle or leave joints unconnected; the message names those joints.
    """
    at = np.array(positions, np.float64).reshape(-1, 3)
    pairs = [(int(a), int(b)) for a, b in links]
    if root is not None and not 0 <= root < len(at):
        raise InputError(
            f"joint {root} does not exist; the skeleton has {len(at)}",
            where="skeleton",
            mend="Give another root.",
        )
    skeleton_of(names or [f"joint {j}" for j in range(len(at))], pairs, at, root)
    return _reduced_positions(at, _neighbour_lists(len(at), pairs), root)


def _neighbour_lists(count: int, links: Iterable[tuple[int, int]]) -> list[list[int]]:
    beside: list[list[int]] = [[] for _ in range(count)]
    for a, b in links:
        beside[a].append(b)
        beside[b].append(a)
    return beside


def _reduced_positions(positions: Float, beside: list[list[int]], root: int | None) -> Abstraction:
    """Runs the iterations."""
    work = Reduction(positions, [list(near) for near in beside], root)
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
    central = work.nearest_to_mass(beside, leaves[0] if leaves else 0)
    if not candidates and len(beside) > 1:
        return _reduced_positions(positions, beside, central)
    return Abstraction(central, tuple(candidates))
