"""The shape of every limb of a skeleton (length, size, centre), and the comparison of limbs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton


class LimbShapes:
    """A skeleton with the measures of every limb, by the limb's first joint."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton, self.at = skeleton, skeleton.positions
        count = len(skeleton)
        self.reach, self.length = np.array(skeleton.lengths), np.array(skeleton.lengths)
        self.size, weighted = np.ones(count, np.int64), skeleton.lengths[:, None] * self.at
        weighted = weighted - 0.5 * skeleton.lengths[:, None] * skeleton.vectors
        for joint in range(count - 1, 0, -1):
            above = int(skeleton.parents[joint])
            self.reach[above] = max(self.reach[above], skeleton.lengths[above] + self.reach[joint])
            self.length[above] += self.length[joint]
            self.size[above] += self.size[joint]
            weighted[above] += weighted[joint]
        self.middle = weighted / np.maximum(self.length, 1e-300)[:, None]

    def similar_limbs(self, tolerance: float, shortest: float) -> Iterable[tuple[int, list[int]]]:
        """Yields joints with limbs that could be equal: with the same joint count, similar length and centre
        distance.

        Args:
            tolerance, shortest: of :class:`enliven.matching.symmetry.SymmetrySettings`.
        """
        least = shortest * float(self.reach[1:].max(initial=0.0))
        for joint, children in enumerate(self.skeleton.children):
            remaining = [child for child in children if self.reach[child] > least]
            while remaining:
                first = remaining[0]
                like = [other for other in remaining if self._are_similar(joint, first, other, tolerance)]
                remaining = [other for other in remaining if other not in like]
                if len(like) > 1:
                    yield joint, like

    def _are_similar(self, joint: int, a: int, b: int, tolerance: float) -> bool:
        slack = tolerance * max(self.reach[a], self.reach[b])
        far = [float(np.linalg.norm(self.middle[limb] - self.at[joint])) for limb in (a, b)]
        return bool(
            self.size[a] == self.size[b]
            and abs(self.reach[a] - self.reach[b]) <= 2 * slack
            and abs(far[0] - far[1]) <= 2 * slack
        )

    def match(self, joint: int, a: int, b: int, linear: Float, tolerance: float) -> JointPairing | None:
        """Pairs the joints of limbs a and b if ``linear`` maps a's joints to b's, else returns None."""
        slack = tolerance * max(self.reach[a], self.reach[b])
        centre = self.at[joint]
        pairs, squares, waiting = [], 0.0, [(a, b)]
        while waiting:
            first, second = waiting.pop()
            off = float(np.linalg.norm(centre + linear @ (self.at[first] - centre) - self.at[second]))
            mine, theirs = self.skeleton.children[first], list(self.skeleton.children[second])
            if off > 2 * slack or len(mine) != len(theirs):
                return None
            squares += off * off
            pairs.append((first, second))
            for child in mine:
                goal = centre + linear @ (self.middle[child] - centre)
                nearest = min(theirs, key=lambda k: float(np.linalg.norm(self.middle[k] - goal)))
                theirs.remove(nearest)
                waiting.append((child, nearest))
        error = (squares / len(pairs)) ** 0.5
        return None if error > slack else JointPairing(pairs, error / max(float(self.reach[a]), 1e-300))


@dataclass(frozen=True)
class JointPairing:
    """The pairs of joints of two equal limbs, and their distance as a fraction of the limb's reach."""

    pairs: list[tuple[int, int]]
    error: float
