"""Where a surface passes through a mesh: crossed faces, and the loops that they form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.deformation.graph import components


@dataclass(frozen=True)
class Crossings:
    """The faces that a field crosses.

    Attributes:
        faces: (K,) the crossed faces, ascending.
        edges: (E, 2) crossed edges, the smaller vertex first.
        pairs: (K, 2) the two crossed edges of each crossed face, directed as the border of the cap
            that closes the near side.
        loops: (K,) which loop each crossed face belongs to.
    """

    faces: Int
    edges: Int
    pairs: Int
    loops: Int


def crossings_of(faces: Int, far: Bool) -> Crossings:
    """The crossed faces of ``faces`` (F, 3): some of their vertices, not all, are ``far`` (V,)."""
    side = far[faces]
    many = side.sum(1)
    crossed = np.flatnonzero((many == 1) | (many == 2))
    corners, side = faces[crossed], side[crossed]
    # Turn each face so that its lonely corner is first.
    lonely = np.where(side.sum(1) == 1, np.argmax(side, 1), np.argmin(side, 1))
    turn = (lonely[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, turn, 1)
    out_of, into = corners[:, [0, 1]], corners[:, [2, 0]]
    both = np.sort(np.stack([out_of, into], 1).reshape(-1, 2), 1)
    edges, number = np.unique(both, axis=0, return_inverse=True)
    pairs = number.reshape(-1, 2)
    # The border of the near part runs from the last edge to the first where the lonely corner is far.
    lonely_far = np.take_along_axis(side, lonely[:, None], 1)[:, 0]
    pairs = np.where(lonely_far[:, None], pairs, pairs[:, ::-1])
    label = components(len(edges), pairs) if len(edges) else np.zeros(0, np.int64)
    return Crossings(crossed, edges, pairs, label[pairs[:, 0]])


def chains_of(pairs: Int) -> list[tuple[Int, bool]]:
    """Ordered edges of each loop, along the direction of most pairs, and whether it closes.

    Args:
        pairs: (K, 2) links between edges; some may be the wrong way about.
    """
    beside: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(pairs.tolist()):
        beside.setdefault(a, []).append(k)
        beside.setdefault(b, []).append(k)
    ends = [edge for edge, links in beside.items() if len(links) % 2]
    unused, found = np.ones(len(pairs), bool), []
    for start in [*ends, *beside]:
        while any(unused[k] for k in beside[start]):
            found.append(_walk(start, pairs, beside, unused))
    return found


def _walk(start: int, pairs: Int, beside: dict[int, list[int]], unused: Bool) -> tuple[Int, bool]:
    """One chain from an edge on, until it comes back or cannot go on."""
    chain, forward, at = [start], 0, start
    while True:
        free = [k for k in beside[at] if unused[k]]
        # Straight on in the direction of the links where there is a choice.
        k = next((k for k in free if pairs[k, 0] == at), free[0] if free else -1)
        if k < 0:
            break
        unused[k] = False
        ahead = pairs[k, 0] == at
        forward += 1 if ahead else -1
        at = int(pairs[k, 1] if ahead else pairs[k, 0])
        if at == start:
            order = np.array(chain)
            return (order if forward >= 0 else order[::-1]), True
        chain.append(at)
    order = np.array(chain)
    return (order if forward >= 0 else order[::-1]), False


def joined(chains: list[tuple[Int, bool]], places: Float, gap: float) -> list[tuple[Int, bool]]:
    """The chains, with open ones joined where their ends are near, and closed where they nearly close.

    Args:
        places: (E, 2) where each edge is crossed, on the surface.
        gap: how much of the length of a chain may be missing.
    """
    closed = [chain for chain in chains if chain[1]]
    waiting = [order for order, shut in chains if not shut]
    while waiting:
        order = waiting.pop()
        while True:
            allowed = gap * _length(places[order])
            gaps = [float(np.linalg.norm(places[order[-1]] - places[other[0]])) for other in waiting]
            home = float(np.linalg.norm(places[order[-1]] - places[order[0]]))
            if gaps and min(gaps) < min(home, allowed):
                order = np.concatenate([order, waiting.pop(int(np.argmin(gaps)))])
                continue
            closed.append((order, bool(home <= allowed and len(order) > 2)))
            break
    return closed


def _length(points: Float) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def winding(polygon: Float, point: Float) -> float:
    """How often a polygon (P, 2), closed, runs around a point: about 0 outside, 1 or -1 inside."""
    rays = polygon - point
    ahead = np.roll(rays, -1, 0)
    cross = rays[:, 0] * ahead[:, 1] - rays[:, 1] * ahead[:, 0]
    return float(np.arctan2(cross, (rays * ahead).sum(1)).sum() / (2 * np.pi))


def area(polygon: Float) -> float:
    """The signed area of a polygon (P, 2)."""
    ahead = np.roll(polygon, -1, 0)
    return float((polygon[:, 0] * ahead[:, 1] - polygon[:, 1] * ahead[:, 0]).sum() / 2)
