"""A literal, slow implementation of section 4.1, which examines the whole tree in every step."""

from __future__ import annotations

import itertools

import numpy as np


def literal_candidates(positions, links, root=None):
    """Returns the found root, and for each level {a candidate's root: {first joint of a branch: position,
    length}}.
    """
    positions = np.asarray(positions, float)
    tree = {joint: set() for joint in range(len(positions))}
    for a, b in links:
        tree[a].add(b)
        tree[b].add(a)
    at = {joint: positions[joint] for joint in tree}
    accumulated = dict.fromkeys(tree, 0.0)
    first = {}
    levels = []

    def length(a, b):
        return float(np.linalg.norm(positions[a] - positions[b]))

    def is_leaf(joint):
        return len(tree[joint]) == 1 and joint != root

    def is_branch(joint):
        return len(tree[joint]) > 2 or joint == root

    while any(is_branch(j) and tree[j] for j in tree):
        # Steps 1 and 2: remove the chains between leaves and branch nodes, leaf by leaf.
        for leaf in [j for j in tree if is_leaf(j)]:
            way, node = [leaf], next(iter(tree[leaf]))
            while not is_branch(node):
                way.append(node)
                (node,) = tree[node] - {way[-2]}
            if (leaf, node) not in first:
                # The nodes of the chain with their bones outwards: from each node to the previous one on the
                # path.
                bones = [length(a, b) for a, b in itertools.pairwise(way)]
                if len(way) > 1:
                    at[leaf] = np.average([positions[j] for j in way[1:]], axis=0, weights=bones)
                accumulated[leaf] += sum(bones) + length(way[-1], node)
                first[leaf, node] = way[-1]
            for removed in way[1:]:
                del tree[removed]
            tree[node] = (tree[node] - {way[-1]}) | {leaf}
            tree[leaf] = {node}
        # Step 3: find branch nodes with only one neighbour that is not a leaf.
        roots = [
            j
            for j in tree
            if is_branch(j) and sum(not is_leaf(k) for k in tree[j]) <= (0 if j == root else 1)
        ]
        leaves = {j: [k for k in tree[j] if is_leaf(k)] for j in roots}
        levels.append({j: {first[k, j]: (at[k], accumulated[k]) for k in leaves[j]} for j in roots})
        # Step 4: make each of them a leaf.
        for j in roots:
            if j == root or len(leaves[j]) == len(tree[j]):
                return j, levels
            weights = [accumulated[k] for k in leaves[j]]
            at[j] = np.average([at[k] for k in leaves[j]], axis=0, weights=weights)
            accumulated[j] = sum(weights)
        for j in roots:
            for k in leaves[j]:
                del tree[k]
                tree[j].discard(k)
    ends = np.array(links)
    bones = np.linalg.norm(positions[ends[:, 0]] - positions[ends[:, 1]], axis=1)
    mass = np.average(positions[ends].mean(1), axis=0, weights=bones)
    return min(tree, key=lambda j: np.linalg.norm(positions[j] - mass)), levels
