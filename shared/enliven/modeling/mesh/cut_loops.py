"""The intersection of a surface with a mesh: crossed faces, and the loops that they form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.deformation.graph.connectivity import label_components


@dataclass(frozen=True)
class Crossings:
    """The faces of a mesh that the zero level of a scalar field crosses.

    Attributes:
        faces: (K,) the crossed faces, ascending.
        edges: (E, 2) the crossed edges, with the smaller vertex number first.
        pairs: (K, 2) the two crossed edges of each crossed face. Their order is the direction of the border
            of the cap that closes the near side.
        loops: (K,) the loop that each crossed face belongs to.
    """

    faces: Int
    edges: Int
    pairs: Int
    loops: Int


def find_crossings(faces: Int, is_far: Bool) -> Crossings:
    """Finds the crossed faces among ``faces`` (F, 3). A face is crossed if one or two of its vertices are on
    the far side (``is_far`` (V,))."""
    side = is_far[faces]
    far_count = side.sum(1)
    crossed = np.flatnonzero((far_count == 1) | (far_count == 2))
    corners, side = faces[crossed], side[crossed]
    # Rotate the corners of each face so that the single corner on one side of the cut comes first.
    single_corner = np.where(side.sum(1) == 1, np.argmax(side, 1), np.argmin(side, 1))
    turn = (single_corner[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, turn, 1)
    out_of, into = corners[:, [0, 1]], corners[:, [2, 0]]
    both = np.sort(np.stack([out_of, into], 1).reshape(-1, 2), 1)
    edges, number = np.unique(both, axis=0, return_inverse=True)
    pairs = number.reshape(-1, 2)
    # If the single corner is on the far side, the border of the near part runs from the last edge to the
    # first edge. So reverse the pair.
    lonely_far = np.take_along_axis(side, single_corner[:, None], 1)[:, 0]
    pairs = np.where(lonely_far[:, None], pairs, pairs[:, ::-1])
    label = label_components(len(edges), pairs) if len(edges) else np.zeros(0, np.int64)
    return Crossings(crossed, edges, pairs, label[pairs[:, 0]])


def order_chains(pairs: Int) -> list[tuple[Int, bool]]:
    """Orders the edges of each loop in the direction of most pairs.

    Args:
        pairs: (K, 2) links between edges; some may have the wrong direction.

    Returns:
        A pair for each chain: its edges in order, and True if it is closed.
    """
    beside: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(pairs.tolist()):
        beside.setdefault(a, []).append(k)
        beside.setdefault(b, []).append(k)
    ends = [edge for edge, links in beside.items() if len(links) % 2]
    unused, chains = np.ones(len(pairs), bool), []
    for start in [*ends, *beside]:
        while any(unused[k] for k in beside[start]):
            chains.append(_follow_chain(start, pairs, beside, unused))
    return chains


def _follow_chain(start: int, pairs: Int, beside: dict[int, list[int]], unused: Bool) -> tuple[Int, bool]:
    """Follows one chain from the edge ``start`` until it ends or returns to the start. Returns the edges (C,)
    of the chain, and True if it is closed."""
    chain, forward, vertex = [start], 0, start
    while True:
        free_links = [k for k in beside[vertex] if unused[k]]
        # If several unused links touch this edge, prefer a link that starts at it, because this link has the
        # direction of the chain.
        k = next((k for k in free_links if pairs[k, 0] == vertex), free_links[0] if free_links else -1)
        if k < 0:
            break
        unused[k] = False
        next_edge = pairs[k, 0] == vertex
        forward += 1 if next_edge else -1
        vertex = int(pairs[k, 1] if next_edge else pairs[k, 0])
        if vertex == start:
            order = np.array(chain)
            return (order if forward >= 0 else order[::-1]), True
        chain.append(vertex)
    order = np.array(chain)
    return (order if forward >= 0 else order[::-1]), False


def join_chains(chains: list[tuple[Int, bool]], places: Float, gap: float) -> list[tuple[Int, bool]]:
    """Joins open chains with nearby ends, and closes chains with a small gap. Returns all chains.

    Args:
        places: (E, 2) coordinates of each crossing on the cutting surface.
        gap: maximum length of a gap, as a fraction of the chain's length.
    """
    closed = [chain for chain in chains if chain[1]]
    open_chains = [order for order, is_closed in chains if not is_closed]
    while open_chains:
        order = open_chains.pop()
        while True:
            allowed = gap * _polyline_length(places[order])
            gaps = [float(np.linalg.norm(places[order[-1]] - places[other[0]])) for other in open_chains]
            gap_to_start = float(np.linalg.norm(places[order[-1]] - places[order[0]]))
            if gaps and min(gaps) < min(gap_to_start, allowed):
                order = np.concatenate([order, open_chains.pop(int(np.argmin(gaps)))])
                continue
            closed.append((order, bool(gap_to_start <= allowed and len(order) > 2)))
            break
    return closed


def _polyline_length(points: Float) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def winding_number(polygon: Float, point: Float) -> float:
    """Returns the winding number of a closed polygon (P, 2) around a point: about 0 outside, 1 or -1
    inside."""
    rays = polygon - point
    ahead = np.roll(rays, -1, 0)
    cross = rays[:, 0] * ahead[:, 1] - rays[:, 1] * ahead[:, 0]
    return float(np.arctan2(cross, (rays * ahead).sum(1)).sum() / (2 * np.pi))


def signed_area(polygon: Float) -> float:
    """Computes the signed area of a polygon (P, 2)."""
    ahead = np.roll(polygon, -1, 0)
    return float((polygon[:, 0] * ahead[:, 1] - polygon[:, 1] * ahead[:, 0]).sum() / 2)
