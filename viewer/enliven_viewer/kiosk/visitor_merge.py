"""Merges the visitors of several edges. A visitor who is seen by two edges at the same place counts once."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from enliven.kiosk.visitors import Place
from enliven.person import Body, Joint
from enliven_viewer.live.followed_edge import find_shared_performer_id

SAME_VISITOR_M = 0.45
"""Bodies of two edges within this distance in metres are the same visitor. It is less than the distance
between two people side by side, and more than a calibration error.
"""
LEAVING_FACTOR = 1.4
"""Factor on ``SAME_VISITOR_M`` for bodies that were the same visitor in the previous frame (hysteresis)."""


class VisitorMerge:
    """Merges bodies from frame to frame.

    A visitor's body comes from the same edge as long as that edge sees the visitor, so that a character does
    not jump between edges. A body that controls a character has priority.
    """

    def __init__(self) -> None:
        self._shown: set[int] = set()
        self._hidden: dict[int, int] = {}

    def merge(self, bodies: Mapping[int, Sequence[Body]], holding: Collection[int]) -> dict[int, Body]:
        """Returns the bodies of one frame by their shared ids.

        Args:
            bodies: the bodies of each edge in the shared space, by the number of the edge.
            holding: the shared ids of the bodies that control a character.
        """
        edges = {
            find_shared_performer_id(n, body.id): n
            for n, edge_bodies in bodies.items()
            for body in edge_bodies
        }
        shared = {
            (number := find_shared_performer_id(n, body.id)): replace(body, id=number)
            for n, edge_bodies in bodies.items()
            for body in edge_bodies
        }
        order = sorted(shared, key=lambda k: (k not in holding, k not in self._shown, edges[k], k))
        kept_bodies: dict[int, Body] = {}
        hidden: dict[int, int] = {}
        for number in order:
            double = self._find_double(number, shared, kept_bodies, edges, hidden)
            if double is None or number in holding:
                kept_bodies[number] = shared[number]
            else:
                hidden[number] = double
        self._shown, self._hidden = set(kept_bodies), hidden
        return dict(sorted(kept_bodies.items()))

    def _find_double(
        self,
        number: int,
        bodies: Mapping[int, Body],
        kept: Mapping[int, Body],
        edges: Mapping[int, int],
        hidden: Mapping[int, int],
    ) -> int | None:
        """Returns the id of the nearest kept body of another edge at the same place, or None if there is
        none. A kept body has at most one duplicate on each edge. A duplicate of the previous frame has
        priority if it is still close.
        """
        old_pairs = {
            other: kept_number
            for other, kept_number in self._hidden.items()
            if other != number
            and {other, kept_number} <= bodies.keys()
            and _hip_distance(bodies[other], bodies[kept_number]) <= SAME_VISITOR_M * LEAVING_FACTOR
        }
        pairs = old_pairs | dict(hidden)
        taken_numbers = {kept_number for other, kept_number in pairs.items() if edges[other] == edges[number]}
        candidates = []
        for other, body in kept.items():
            if edges[other] == edges[number] or other in taken_numbers:
                continue
            was_double = self._hidden.get(number) == other
            distance = _hip_distance(bodies[number], body)
            if distance <= SAME_VISITOR_M * (LEAVING_FACTOR if was_double else 1.0):
                candidates.append((distance, other))
        return min(candidates)[1] if candidates else None


def _hip_distance(first: Body, second: Body) -> float:
    """Returns the horizontal distance between the hips of two bodies in metres, or infinity if
    it is unknown.
    """
    a, b = _floor_position(first), _floor_position(second)
    return math.inf if a is None or b is None else math.dist(a, b)


def _floor_position(body: Body) -> Place | None:
    hips = body.joints[Joint.HIP_CENTER, [0, 2]]
    return (float(hips[0]), float(hips[1])) if np.isfinite(hips).all() else None
