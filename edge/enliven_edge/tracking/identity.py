"""Who somebody is: stable numbers, and who comes back known by stature, proportions and where they left."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking import model
from enliven_edge.tracking.settings import PeopleSettings

_STATURE_SPREAD = 0.03
_PROPORTION_SPREAD = 0.10
_STRIDE, _ELSEWHERE = 2.0, 0.8
_TELLING = [model.SHOULDER, model.ARM, model.FORE, model.THIGH, model.SHIN]
_COMPATIBLE = 9.0
"""A mismatch, in squared standard deviations, beyond which two people are not the same."""


@dataclass
class Looks:
    """What a person is known by: stature and proportions, the better the longer they were seen.

    Attributes:
        lengths: (12,) metres, a running mean of the fit's.
        weight: the number of frames that count.
    """

    lengths: Float = field(default_factory=lambda: model.REFERENCE_LENGTHS.copy())
    weight: float = 0.0
    _crowns: list[float] = field(default_factory=list)

    def see(self, lengths: Float, crown: float | None) -> None:
        """Takes in a frame: the fit's lengths, and the height of the crown above the floor if it is seen."""
        self.weight = min(self.weight + 1.0, 90.0)
        self.lengths = self.lengths + (lengths - self.lengths) / self.weight
        if crown is not None:
            self._crowns.append(crown)
            del self._crowns[:-240]

    @property
    def stature(self) -> float | None:
        """Metres from the floor to the crown when upright; None where it was never seen."""
        return float(np.percentile(self._crowns, 85)) if len(self._crowns) >= 3 else None

    def mismatch(self, other: Looks) -> float:
        """How unlike two people look, in squared standard deviations."""
        relative = (self.lengths[_TELLING] - other.lengths[_TELLING]) / other.lengths[_TELLING]
        cost = float(np.mean(relative**2)) / _PROPORTION_SPREAD**2
        mine, theirs = self.stature, other.stature
        if mine is not None and theirs is not None:
            cost += ((mine - theirs) / _STATURE_SPREAD) ** 2
        return cost


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

    def likeliest(self, looks: Looks, place: Float, time_ns: int) -> tuple[Absent | None, float]:
        """Who of the absent this is, None where it is nobody of them; and the lead over the next likely."""
        costs = sorted(
            ((looks.mismatch(a.looks) + _far(a, place, time_ns), i) for i, a in enumerate(self.absent)),
        )
        if not costs or costs[0][0] > _COMPATIBLE:
            return None, np.inf
        lead = costs[1][0] - costs[0][0] if len(costs) > 1 else np.inf
        return self.absent[costs[0][1]], float(lead)

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
