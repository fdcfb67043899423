"""A simple matcher with networkx for comparison. It processes one graph, subset and permutation at a time."""

from __future__ import annotations

import itertools

import networkx as nx
import numpy as np


def candidates(graph: nx.Graph) -> list[tuple[int, list[np.ndarray]]]:
    """Returns the root joint and abstract branch vectors of every sub-tree (AniMesh 4.1). Joints have a
    "pos".
    """
    graph = graph.copy()
    at = dict(graph.nodes(data="pos"))
    length = dict.fromkeys(graph, 0.0)
    branches = []
    while any(degree > 2 for _, degree in graph.degree):
        for leaf in [n for n, degree in graph.degree if degree == 1]:
            way, node = [leaf], next(iter(graph[leaf]))
            while graph.degree[node] == 2:
                way.append(node)
                node = next(n for n in graph[node] if n not in way)
            total = sum(graph.edges[a, b]["length"] for a, b in itertools.pairwise([*way, node]))
            if len(way) > 1:
                weights = [graph.edges[a, b]["length"] for a, b in itertools.pairwise(way)]
                at[leaf] = np.average([at[n] for n in way[1:]], axis=0, weights=weights)
                graph.remove_nodes_from(way[1:])
                graph.add_edge(node, leaf, length=0.0)
                length[leaf] += total
            elif total > 0.0:
                length[leaf] += total
                graph.edges[leaf, node]["length"] = 0.0
        roots = [
            n
            for n, degree in graph.degree
            if degree > 2 and sum(graph.degree[other] > 1 for other in graph[n]) <= 1
        ]
        ends = {n: [other for other in graph[n] if graph.degree[other] == 1] for n in roots}
        for n in sorted(roots):
            branches.append((n, [at[end] - graph.nodes[n]["pos"] for end in ends[n]]))
        if any(len(ends[n]) == len(graph[n]) for n in roots):
            break
        for n in roots:
            weights = [length[end] for end in ends[n]]
            at[n] = np.average([at[end] for end in ends[n]], axis=0, weights=weights)
            length[n] = sum(weights)
            graph.remove_nodes_from(ends[n])
    return branches


def rank_choices(
    found: list[tuple[int, list[np.ndarray]]], source: np.ndarray, axes: np.ndarray, blur: float
) -> list[tuple[float, int]]:
    """Returns score and root of every choice of branches, sorted by score. A choice has the same number of
    branches as the source.
    """

    def direction(vector: np.ndarray) -> np.ndarray:
        seen = axes @ vector
        return seen / max(np.linalg.norm(seen), blur * np.linalg.norm(vector))

    ours = [direction(point - source[0]) for point in source[1:]]
    matches = []
    for root, vectors in found:
        theirs = [direction(vector) for vector in vectors]
        for chosen in itertools.combinations(theirs, len(ours)):
            best = max(
                sum(float(a @ b) for a, b in zip(ours, order, strict=True))
                for order in itertools.permutations(chosen)
            )
            matches.append((best, root))
    return sorted(matches, reverse=True)
