"""Stable ids: a person who comes back is recognised by stature, proportions and the place of leaving."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.kernels import quantile
from enliven.matching import least_cost
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.settings import PeopleSettings

_STATURE_SPREAD = 0.03
"""Metres: standard deviation of one person's measured stature, from shoes, posture and depth noise."""
_PROPORTION_SPREAD = 0.10
"""Standard deviation of one person's fitted bone lengths, as a share of each length."""
_STRIDE = 2.0
"""Metres a second at which the area where an absent person may come back grows: a brisk walk."""
_ELSEWHERE = 0.8
"""Metres from the place of leaving at which a return at once costs one squared standard deviation."""
_FARTHEST_COST = 4.0
"""Squared standard deviations that a far place costs at most: people also walk round behind the sensor."""
_JUST_NS = 2_000_000_000
"""Nanoseconds within which the only absent person is taken for the only new one at the same place."""
_THERE = 0.5
"""Metres in plan that count as the same place for that: a step."""
_PLAINLY_OTHER = 0.15
"""Metres of stature by which two people plainly differ, whatever the place: five standard deviations."""
_TELLING = [model.SHOULDER, model.ARM, model.FORE, model.THIGH, model.SHIN]
"""The lengths that people are told apart by: those of the limbs, which the fit measures best."""
_COMPATIBLE = 9.0
"""A mismatch, in squared standard deviations, beyond which two people are not the same: three sigma."""
_KNOWN_FRAMES = 6
"""Frames with the whole body in sight after which a person's proportions can be told from another's."""
_LEAD = 3.0
"""Squared standard deviations by which the best match must beat the next one to be sure."""
_MOST_FRAMES = 90.0
"""Frames that the running mean of the lengths remembers at most: they may still drift after that."""
_CROWNS = 240
"""Heights of the crown that are kept for the stature."""
_STATURE_SHARE = 0.85
"""The percentile of these heights that is the stature: people stoop more often than they stretch."""


@dataclass
class Looks:
    """The stature and proportions that a person is recognised by; they get better with every frame.

    Attributes:
        lengths: (12,) metres, a running mean of the fit's.
        weight: the number of frames in that mean.
        stature: metres from the floor to the crown when upright; None where it was never seen.
    """

    lengths: Float = field(default_factory=lambda: model.REFERENCE_LENGTHS.copy())
    weight: float = 0.0
    stature: float | None = None
    _crowns: list[float] = field(default_factory=list)

    def see(self, lengths: Float, crown: float | None) -> None:
        """Takes in (12,) lengths of a frame's fit, and the seen crown's metres above the floor."""
        self.weight = min(self.weight + 1.0, _MOST_FRAMES)
        self.lengths = self.lengths + (lengths - self.lengths) / self.weight
        if crown is not None:
            self._crowns.append(crown)
            del self._crowns[:-_CROWNS]
            self.stature = float(quantile(np.sort(self._crowns), _STATURE_SHARE))

    def mismatch(self, other: Looks) -> float:
        """Returns how much two people differ, in squared standard deviations."""
        relative = (self.lengths[_TELLING] - other.lengths[_TELLING]) / other.lengths[_TELLING]
        cost = float(np.mean(relative**2)) / _PROPORTION_SPREAD**2
        mine, theirs = self.stature, other.stature
        if mine is not None and theirs is not None:
            cost += ((mine - theirs) / _STATURE_SPREAD) ** 2
        return cost


@dataclass
class Absent:
    """A person who was followed and is not in view."""

    id: int
    looks: Looks
    place: Float | None
    left_ns: int


class Register:
    """Gives people their ids, and remembers those out of view."""

    def __init__(self, settings: PeopleSettings) -> None:
        self.settings = settings
        self.absent: list[Absent] = []
        self._last = 0

    def new(self) -> int:
        """Returns an id that no person has had."""
        self._last += 1
        return self._last

    def leave(self, identity: int, looks: Looks, place: Float | None, time_ns: int) -> None:
        """Remembers a person who is out of view; ``place`` (3,) is None where it says nothing."""
        self.absent.append(Absent(identity, looks, place, time_ns))

    def forget_old(self, time_ns: int, keep: frozenset[int]) -> None:
        """Forgets people who have been away for too long, but not the ids of ``keep``."""
        limit = self.settings.remember * 1e9
        self.absent = [a for a in self.absent if a.id in keep or 0 <= time_ns - a.left_ns <= limit]

    def moved(self) -> None:
        """Forgets where people left: the sensor was moved."""
        for absent in self.absent:
            absent.place = None

    def matched(self, found: list[tuple[Looks, Float]], time_ns: int) -> list[tuple[Absent | None, bool]]:
        """Matches new people, by looks and (3,) place, to absent ones or None; says of each whether it is
        sure.

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
        # Being a new person costs as much as being incompatible, for each.
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
        """Whether the only new person stands where the only absent one was lost just now."""
        (absent,), (looks, at) = self.absent, found
        if absent.place is None or not 0 <= time_ns - absent.left_ns < _JUST_NS:
            return False
        mine, theirs = looks.stature, absent.looks.stature
        other = mine is not None and theirs is not None and abs(mine - theirs) > _PLAINLY_OTHER
        return not other and float(np.linalg.norm((at - absent.place)[[0, 2]])) < _THERE

    def take(self, absent: Absent) -> None:
        """Takes a person who is back from the absent ones."""
        self.absent.remove(absent)


def _far(absent: Absent, place: Float, time_ns: int) -> float:
    """Returns the cost of the way from the place of leaving, in squared standard deviations."""
    if absent.place is None:
        return 0.0
    away = float(np.linalg.norm((place - absent.place)[[0, 2]]))
    reach = _ELSEWHERE + _STRIDE * max(0.0, (time_ns - absent.left_ns) * 1e-9)
    return min(_FARTHEST_COST, (away / reach) ** 2)
