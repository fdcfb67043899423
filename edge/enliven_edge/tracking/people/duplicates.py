"""Duplicate tracks: where two fits lie on one person, the later one goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.person import Joint
from enliven_edge.tracking.people.person import Person

_SAME_PLACE = 0.2
"""Metres between two hip centres, and on average between two trunks, below which they are one person."""
_FRAMES = 6
"""Frames for which two fits must share a place: people who squeeze past each other do so for fewer."""
_TRUNK = [Joint.HIP_CENTER, Joint.SHOULDER_CENTER, Joint.HEAD]


class Duplicates:
    """Watches for people who are followed twice."""

    def __init__(self) -> None:
        self._doubts: dict[tuple[int, int], int] = {}

    def found(self, people: Sequence[Person]) -> list[Person]:
        """Returns the people who have shared the place of one found earlier for some frames."""
        ordered = sorted((p for p in people if not p.hidden), key=lambda p: p.found_ns)
        together, duplicates = set(), []
        for i, first in enumerate(ordered):
            for second in ordered[i + 1 :]:
                if not _one(first, second):
                    continue
                pair = (id(first), id(second))
                together.add(pair)
                self._doubts[pair] = self._doubts.get(pair, 0) + 1
                if self._doubts[pair] > _FRAMES and second not in duplicates:
                    duplicates.append(second)
        self._doubts = {pair: n for pair, n in self._doubts.items() if pair in together}
        return duplicates


def _one(first: Person, second: Person) -> bool:
    """Whether two fits have their trunks in the same place."""
    if float(np.linalg.norm(first.place - second.place)) >= _SAME_PLACE:
        return False
    a, b = first.follower.posture.joints(), second.follower.posture.joints()
    return bool(np.linalg.norm(a[_TRUNK] - b[_TRUNK], axis=1).mean() < _SAME_PLACE)
