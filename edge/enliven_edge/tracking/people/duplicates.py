"""Two fits on one person: the later one goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.person import Joint
from enliven_edge.tracking.people.person import Person

_SAME_PLACE = 0.2
_FRAMES = 6
"""For which two are in one place until one of them is taken for a double."""
_TRUNK = [Joint.HIP_CENTER, Joint.SHOULDER_CENTER, Joint.HEAD]


class Doubles:
    """Watches for people who are in one place."""

    def __init__(self) -> None:
        self._doubts: dict[tuple[int, int], int] = {}

    def parted(self, people: Sequence[Person]) -> list[Person]:
        """Who has been where somebody else is, who was found before, for too long."""
        ordered = sorted((p for p in people if not p.hidden), key=lambda p: p.found_ns)
        together, doubles = set(), []
        for i, first in enumerate(ordered):
            for second in ordered[i + 1 :]:
                if not _one(first, second):
                    continue
                pair = (id(first), id(second))
                together.add(pair)
                self._doubts[pair] = self._doubts.get(pair, 0) + 1
                if self._doubts[pair] > _FRAMES and second not in doubles:
                    doubles.append(second)
        self._doubts = {pair: n for pair, n in self._doubts.items() if pair in together}
        return doubles


def _one(first: Person, second: Person) -> bool:
    """Whether two fits have their trunks in the same place."""
    if float(np.linalg.norm(first.place - second.place)) >= _SAME_PLACE:
        return False
    a, b = first.follower.posture.joints(), second.follower.posture.joints()
    return bool(np.linalg.norm(a[_TRUNK] - b[_TRUNK], axis=1).mean() < _SAME_PLACE)
