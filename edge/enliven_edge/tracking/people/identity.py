"""Who somebody is: stable numbers, and who comes back known by stature, proportions and where they left."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.matching import least_cost
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.settings import PeopleSettings

_STATURE_SPREAD = 0.03
_PROPORTION_SPREAD = 0.10
_STRIDE, _ELSEWHERE = 2.0, 0.8
_JUST_NS, _THERE, _PLAINLY_OTHER = 2_000_000_000, 0.5, 0.15
"""Nanoseconds, metres and metres of stature within which who is alone where somebody was lost is them."""
_TELLING = [model.SHOULDER, model.ARM, model.FORE, model.THIGH, model.SHIN]
_COMPATIBLE = 9.0
"""A mismatch, in squared standard deviations, beyond which two people are not the same."""
_KNOWN_FRAMES, _LEAD = 6, 3.0
"""Frames after which somebody's looks can be told from another's, and by how much they must differ."""


@dataclass
class Looks:
    """What a person is known by: stature and proportions, the better the longer they were seen.

    Attributes:
        lengths: (12,) metres, a running mean of the fit's.
        weight: the number of frames that count.
        stature: metres from the floor to the crown when upright; None where it was never seen.
    """

    lengths: Float = field(default_factory=lambda: model.REFERENCE_LENGTHS.copy())
    weight: float = 0.0
    stature: float | None = None
    _crowns: list[float] = field(default_factory=list)

    def see(self, lengths: Float, crown: float | None) -> None:
        """Takes in a frame: the fit's lengths, and the height of the crown above the floor if it is seen."""
        self.weight = min(self.weight + 1.0, 90.0)
        self.lengths = self.lengths + (lengths - self.lengths) / self.weight
        if crown is not None:
            self._crowns.append(crown)
            del self._crowns[:-240]
            self.stature = percentile(self._crowns, 0.85)

    def mismatch(self, other: Looks) -> float:
        """How unlike two people look, in squared standard deviations."""
        relative = (self.lengths[_TELLING] - other.lengths[_TELLING]) / other.lengths[_TELLING]
        cost = float(np.mean(relative**2)) / _PROPORTION_SPREAD**2
        mine, theirs = self.stature, other.stature
        if mine is not None and theirs is not None:
            cost += ((mine - theirs) / _STATURE_SPREAD) ** 2
        return cost


def percentile(values: Float | list[float], share: float) -> float:
    """The number below which a share in [0, 1] of (N,) values is, between two of them linearly.

    What ``np.percentile`` says, at a tenth of its cost for some hundred values.
    """
    ordered = np.sort(values)
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))


@dataclass
class Absent:
    """Somebody who was followed and is not in view."""

    id: int
    looks: Looks
    place: Float | None
    left_ns: int


class Register:
    """Gives people their numbers, and remembers who left."""

    def __init__(self, settings: PeopleSettings) -> None:
        self.settings = settings
        self.absent: list[Absent] = []
        self._last = 0

    def new(self) -> int:
        """A number that nobody had."""
        self._last += 1
        return self._last

    def leave(self, identity: int, looks: Looks, place: Float | None, time_ns: int) -> None:
        """Somebody is out of view; ``place`` (3,) is where they were last seen, if that says anything."""
        self.absent.append(Absent(identity, looks, place, time_ns))

    def forget_old(self, time_ns: int, keep: frozenset[int]) -> None:
        """Drops who has been away for too long, but not those of ``keep``."""
        limit = self.settings.remember * 1e9
        self.absent = [a for a in self.absent if a.id in keep or 0 <= time_ns - a.left_ns <= limit]

    def moved(self) -> None:
        """The sensor was moved: where people left says nothing any more."""
        for absent in self.absent:
            absent.place = None

    def matched(self, found: list[tuple[Looks, Float]], time_ns: int) -> list[tuple[Absent | None, bool]]:
        """By looks and (3,) place: who of the absent it is, None for nobody; and whether that is sure.

        All are matched together, at the least sum of mismatches, so that two who come back are not mistaken
        for each other while either fits better.
        """
        if not self.absent:
            return [(None, True)] * len(found)
        cost = np.array(
            [[looks.mismatch(a.looks) + _far(a, at, time_ns) for a in self.absent] for looks, at in found]
        )
        if len(found) == len(self.absent) == 1 and self._just_there(found[0], time_ns):
            return [(self.absent[0], True)]
        # Being somebody new costs as much as being incompatible, for each.
        padded = np.concatenate([cost, np.full((len(found), len(found)), _COMPATIBLE)], 1)
        rows, columns = least_cost(padded)
        made: list[tuple[Absent | None, bool]] = []
        for row, column in zip(rows, columns, strict=True):
            absent = self.absent[column] if column < len(self.absent) else None
            others = np.delete(padded[row, : len(self.absent) + 1], column if absent else -1)
            lead = float(others.min() - padded[row, column])
            known = found[row][0].weight >= _KNOWN_FRAMES
            back = absent is not None and found[row][0].weight > 0
            sure = lead > _LEAD and (known or (back and len(self.absent) == 1 and len(found) == 1))
            made.append((absent, sure))
        return made

    def _just_there(self, found: tuple[Looks, Float], time_ns: int) -> bool:
        """Whether the one who is found stands where the one who is absent was lost just now."""
        (absent,), (looks, at) = self.absent, found
        if absent.place is None or not 0 <= time_ns - absent.left_ns < _JUST_NS:
            return False
        mine, theirs = looks.stature, absent.looks.stature
        other = mine is not None and theirs is not None and abs(mine - theirs) > _PLAINLY_OTHER
        return not other and float(np.linalg.norm((at - absent.place)[[0, 2]])) < _THERE

    def take(self, absent: Absent) -> None:
        """Somebody is back."""
        self.absent.remove(absent)


def _far(absent: Absent, place: Float, time_ns: int) -> float:
    """The cost of having come from where they left, in squared standard deviations, at most 4."""
    if absent.place is None:
        return 0.0
    away = float(np.linalg.norm((place - absent.place)[[0, 2]]))
    reach = _ELSEWHERE + _STRIDE * max(0.0, (time_ns - absent.left_ns) * 1e-9)
    return min(4.0, (away / reach) ** 2)
