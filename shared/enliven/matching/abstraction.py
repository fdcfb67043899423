"""Simplifies a skeleton to a hierarchy of sub-trees, from small to large (AniMesh, section 4.1).

A node is a *leaf* (one neighbour), a *chain* node (two neighbours) or a *branch* node (more neighbours). Each
iteration has four steps:

1. Remove the chains between a leaf and a branch node.
2. Move the leaf to the average of the chain's nodes, each weighted by the length of its outward bone, and add
   up the lengths of the bones of the chain.
3. Make every branch node with at most one neighbour that is not a leaf a candidate.
4. Turn each candidate into a leaf, at the average of its leaves weighted by their accumulated lengths.

The iterations end when only one node or one chain is left. A single node is the root. In a chain, the root is
the node nearest to the centre of mass.

The paper leaves some cases open. Here the last branch node is a candidate even if all its neighbours are
leaves. Otherwise a star would have no candidate. A tree without a branch node is a single candidate at its
root. All lengths are lengths of real bones. A given root never becomes a leaf, so it is always the last
candidate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton, skeleton_from_links
from enliven.errors import InputError
from enliven.matching.reduction import Reduction
from enliven.matching.subtrees import Abstraction, SubTree


def make_abstract_skeleton(skeleton: Skeleton, root: int | None = 0) -> Abstraction:
    """Returns the hierarchy of a skeleton. If ``root`` is None, the iterations determine the root."""
    links = [(int(parent), joint) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    return _reduce_positions(skeleton.positions, _neighbour_lists(len(skeleton), links), root)


def make_abstract_joint_tree(
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
        names: the joints' names for error messages. None means that the joints are numbered.

    Raises:
        InputError: if the links form a cycle or leave joints unconnected. The message names these joints.
    """
    joint_positions = np.array(positions, np.float64).reshape(-1, 3)
    pairs = [(int(a), int(b)) for a, b in links]
    if root is not None and not 0 <= root < len(joint_positions):
        raise InputError(
            f"joint {root} does not exist; the skeleton has {len(joint_positions)} joints",
            where="skeleton",
            remedy=f"Choose a root from 0 to {len(joint_positions) - 1}.",
        )
    skeleton_from_links(
        names or [f"joint {j}" for j in range(len(joint_positions))], pairs, joint_positions, root
    )
    return _reduce_positions(joint_positions, _neighbour_lists(len(joint_positions), pairs), root)


def _neighbour_lists(count: int, links: Iterable[tuple[int, int]]) -> list[list[int]]:
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for a, b in links:
        neighbours[a].append(b)
        neighbours[b].append(a)
    return neighbours


def _reduce_positions(positions: Float, neighbours: list[list[int]], root: int | None) -> Abstraction:
    """Runs the iterations for joints at ``positions`` (N, 3) with the given neighbours."""
    tree = Reduction(positions, [list(joints) for joints in neighbours], root)
    candidates: list[SubTree] = []
    leaves = tree.leaves()
    level = 0
    while leaves and tree.branch_nodes:
        level += 1
        branch_nodes = {tree.attach(leaf) for leaf in leaves}
        leaves = []
        sub_tree_roots = (branch_node for branch_node in sorted(branch_nodes) if tree.is_ready(branch_node))
        for number, branch_node in enumerate(sub_tree_roots, 1):
            candidates.append(SubTree(level, number, branch_node, tree.branches(branch_node)))
            if not tree.neighbours[branch_node]:
                return Abstraction(branch_node, tuple(candidates))
            leaves.append(branch_node)
        for branch_node in leaves:
            tree.collapse_to_leaf(branch_node)
    central_joint = tree.find_nearest_to_centre_of_mass(neighbours, leaves[0] if leaves else 0)
    if not candidates and len(neighbours) > 1:
        return _reduce_positions(positions, neighbours, central_joint)
    return Abstraction(central_joint, tuple(candidates))
