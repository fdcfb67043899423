"""Measures every limb of a skeleton (length, size, centre), and compares limbs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton


class LimbShapes:
    """The reach, length, joint count and centre of every limb of a skeleton, indexed by the limb's first
    joint."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton, self.at = skeleton, skeleton.positions
        count = len(skeleton)
        self.reach, self.length = np.array(skeleton.lengths), np.array(skeleton.lengths)
        self.size, weighted = np.ones(count, np.int64), skeleton.lengths[:, None] * self.at
        weighted = weighted - 0.5 * skeleton.lengths[:, None] * skeleton.vectors
        for joint in range(count - 1, 0, -1):
            parent = int(skeleton.parents[joint])
            self.reach[parent] = max(self.reach[parent], skeleton.lengths[parent] + self.reach[joint])
            self.length[parent] += self.length[joint]
            self.size[parent] += self.size[joint]
            weighted[parent] += weighted[joint]
        self.middle = weighted / np.maximum(self.length, 1e-300)[:, None]

    def find_similar_limbs(self, tolerance: float, shortest: float) -> Iterable[tuple[int, list[int]]]:
        """Yields each joint with several child limbs that may be equal. These limbs have the same number of
        joints, and similar lengths and distances of their centres from the joint.

        Args:
            tolerance, shortest: settings from :class:`enliven.matching.symmetry.SymmetrySettings`.
        """
        min_reach = shortest * float(self.reach[1:].max(initial=0.0))
        for joint, children in enumerate(self.skeleton.children):
            remaining = [child for child in children if self.reach[child] > min_reach]
            while remaining:
                first = remaining[0]
                similar = [other for other in remaining if self._are_similar(joint, first, other, tolerance)]
                remaining = [other for other in remaining if other not in similar]
                if len(similar) > 1:
                    yield joint, similar

    def _are_similar(self, joint: int, a: int, b: int, tolerance: float) -> bool:
        max_distance = tolerance * max(self.reach[a], self.reach[b])
        centre_distances = [float(np.linalg.norm(self.middle[limb] - self.at[joint])) for limb in (a, b)]
        return bool(
            self.size[a] == self.size[b]
            and abs(self.reach[a] - self.reach[b]) <= 2 * max_distance
            and abs(centre_distances[0] - centre_distances[1]) <= 2 * max_distance
        )

    def match(self, joint: int, a: int, b: int, linear: Float, tolerance: float) -> JointPairing | None:
        """Returns the pairs of joints if the map ``linear`` (3, 3) maps limb a to limb b, otherwise None."""
        max_distance = tolerance * max(self.reach[a], self.reach[b])
        centre = self.at[joint]
        pairs, squares, open_pairs = [], 0.0, [(a, b)]
        while open_pairs:
            first, second = open_pairs.pop()
            distance = float(np.linalg.norm(centre + linear @ (self.at[first] - centre) - self.at[second]))
            first_children, second_children = (
                self.skeleton.children[first],
                list(self.skeleton.children[second]),
            )
            if distance > 2 * max_distance or len(first_children) != len(second_children):
                return None
            squares += distance * distance
            pairs.append((first, second))
            for child in first_children:
                mapped_centre = centre + linear @ (self.middle[child] - centre)
                nearest = min(
                    second_children, key=lambda k: float(np.linalg.norm(self.middle[k] - mapped_centre))
                )
                second_children.remove(nearest)
                open_pairs.append((child, nearest))
        error = (squares / len(pairs)) ** 0.5
        return (
            None if error > max_distance else JointPairing(pairs, error / max(float(self.reach[a]), 1e-300))
        )


@dataclass(frozen=True)
class JointPairing:
    """The pairs of corresponding joints of two equal limbs, and the distance of the joints as a fraction of
    the limb's reach."""

    pairs: list[tuple[int, int]]
    error: float
