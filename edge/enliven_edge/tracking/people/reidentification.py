"""Re-identification: a person that returns is matched by stature, proportions and the place of leaving."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.kernels import quantile
from enliven.matching import least_cost
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.settings import PeopleSettings

_STATURE_SPREAD = 0.03
"""Standard deviation in metres of one person's measured stature, from shoes, posture and depth noise."""
_PROPORTION_SPREAD = 0.10
"""Standard deviation of one person's fitted bone lengths, as a fraction of each length."""
_RETURN_SPEED = 2.0
"""Speed in metres per second at which the possible area of return of an absent person grows: a brisk walk."""
_RETURN_DISTANCE_M = 0.8
"""Distance in metres from the place of leaving at which an immediate return costs one squared standard
deviation."""
_MAX_DISTANCE_COST = 4.0
"""Maximum cost of a far place in squared standard deviations. People also walk around behind the sensor."""
_BRIEF_ABSENCE_NS = 2_000_000_000
"""Maximum absence in nanoseconds for the only absent person to be matched with the only new one at the same
place."""
_SAME_PLACE_M = 0.5
"""Horizontal distance in metres that counts as the same place for that: a step."""
_MIN_STATURE_DIFFERENCE_M = 0.15
"""Minimum difference in stature, in metres, of two clearly different people, whatever the place: five
standard deviations."""
_DISTINCTIVE_LENGTHS = [model.SHOULDER, model.ARM, model.FORE, model.THIGH, model.SHIN]
"""The lengths that distinguish people: those of the limbs, which the fit measures best."""
_MAX_MISMATCH = 9.0
"""Maximum mismatch of the same person in squared standard deviations: three sigma."""
_KNOWN_FRAMES = 6
"""Minimum number of frames with the whole body in view before proportions can distinguish a person."""
_CERTAIN_LEAD = 3.0
"""Minimum lead of the best match over the next one to be certain, in squared standard deviations."""
_MAX_MEAN_FRAMES = 90.0
"""Maximum number of frames in the running mean of the lengths. They may still drift after that."""
_CROWN_SAMPLES = 240
"""Number of crown heights that are kept for the stature."""
_STATURE_QUANTILE = 0.85
"""Quantile of these heights that is the stature. People stoop more often than they stretch."""


@dataclass
class BodyMeasurements:
    """The stature and proportions for re-identification of a person. They improve with every frame.

    Attributes:
        lengths: (12,) metres, a running mean of the fit's lengths.
        weight: the number of frames in that mean.
        stature: metres from the floor to the crown when upright; None if it was never visible.
    """

    lengths: Float = field(default_factory=lambda: model.REFERENCE_LENGTHS.copy())
    weight: float = 0.0
    stature: float | None = None
    _crowns: list[float] = field(default_factory=list)

    def see(self, lengths: Float, crown: float | None) -> None:
        """Takes in (12,) lengths of a frame's fit, and the visible crown's metres above the floor."""
        self.weight = min(self.weight + 1.0, _MAX_MEAN_FRAMES)
        self.lengths = self.lengths + (lengths - self.lengths) / self.weight
        if crown is not None:
            self._crowns.append(crown)
            del self._crowns[:-_CROWN_SAMPLES]
            self.stature = float(quantile(np.sort(self._crowns), _STATURE_QUANTILE))

    def mismatch(self, other: BodyMeasurements) -> float:
        """Returns how much two people differ, in squared standard deviations."""
        relative = (self.lengths[_DISTINCTIVE_LENGTHS] - other.lengths[_DISTINCTIVE_LENGTHS]) / other.lengths[
            _DISTINCTIVE_LENGTHS
        ]
        cost = float(np.mean(relative**2)) / _PROPORTION_SPREAD**2
        mine, theirs = self.stature, other.stature
        if mine is not None and theirs is not None:
            cost += ((mine - theirs) / _STATURE_SPREAD) ** 2
        return cost


@dataclass
class AbsentPerson:
    """A person that was tracked and is out of view."""

    id: int
    looks: BodyMeasurements
    place: Float | None
    left_ns: int


class PersonGallery:
    """Assigns ids to people, and remembers those out of view."""

    def __init__(self, settings: PeopleSettings) -> None:
        self.settings = settings
        self.absent: list[AbsentPerson] = []
        self._last = 0

    def new(self) -> int:
        """Returns an id that no person has had."""
        self._last += 1
        return self._last

    def leave(self, identity: int, looks: BodyMeasurements, place: Float | None, time_ns: int) -> None:
        """Remembers a person that is out of view. ``place`` (3,) is None if it is meaningless."""
        self.absent.append(AbsentPerson(identity, looks, place, time_ns))

    def forget_old(self, time_ns: int, keep: frozenset[int]) -> None:
        """Forgets people that have been away for too long, except the ids in ``keep``."""
        limit = self.settings.remember * 1e9
        self.absent = [a for a in self.absent if a.id in keep or 0 <= time_ns - a.left_ns <= limit]

    def moved(self) -> None:
        """Forgets the places of leaving, because the sensor was moved."""
        for absent in self.absent:
            absent.place = None

    def matched(
        self, found: list[tuple[BodyMeasurements, Float]], time_ns: int
    ) -> list[tuple[AbsentPerson | None, bool]]:
        """Matches new people, by looks and (3,) place, to absent people or None.

        Returns each match and whether it is certain.

        All are matched together by least-cost assignment. So two people that return are not confused while
        one assignment fits better.
        """
        if not self.absent:
            return [(None, True)] * len(found)
        cost = np.array(
            [
                [looks.mismatch(a.looks) + _distance_cost(a, at, time_ns) for a in self.absent]
                for looks, at in found
            ]
        )
        if len(found) == len(self.absent) == 1 and self._is_same_place(found[0], time_ns):
            return [(self.absent[0], True)]
        # Add columns for new people. Being a new person costs as much as the largest mismatch that is still
        # accepted.
        padded = np.concatenate([cost, np.full((len(found), len(found)), _MAX_MISMATCH)], 1)
        rows, columns = least_cost(padded)
        matches: list[tuple[AbsentPerson | None, bool]] = []
        for row, column in zip(rows, columns, strict=True):
            absent = self.absent[column] if column < len(self.absent) else None
            others = np.delete(padded[row, : len(self.absent) + 1], column if absent else -1)
            lead = float(others.min() - padded[row, column])
            is_well_known = found[row][0].weight >= _KNOWN_FRAMES
            back = absent is not None and found[row][0].weight > 0
            sure = lead > _CERTAIN_LEAD and (
                is_well_known or (back and len(self.absent) == 1 and len(found) == 1)
            )
            matches.append((absent, sure))
        return matches

    def _is_same_place(self, found: tuple[BodyMeasurements, Float], time_ns: int) -> bool:
        """Returns True if the only new person stands where the only absent one was lost just before."""
        (absent,), (looks, at) = self.absent, found
        if absent.place is None or not 0 <= time_ns - absent.left_ns < _BRIEF_ABSENCE_NS:
            return False
        mine, theirs = looks.stature, absent.looks.stature
        other = mine is not None and theirs is not None and abs(mine - theirs) > _MIN_STATURE_DIFFERENCE_M
        return not other and float(np.linalg.norm((at - absent.place)[[0, 2]])) < _SAME_PLACE_M

    def take(self, absent: AbsentPerson) -> None:
        """Removes a person that has returned from the absent ones."""
        self.absent.remove(absent)


def _distance_cost(absent: AbsentPerson, place: Float, time_ns: int) -> float:
    """Returns the cost of the distance from the place of leaving, in squared standard deviations."""
    if absent.place is None:
        return 0.0
    away = float(np.linalg.norm((place - absent.place)[[0, 2]]))
    reach = _RETURN_DISTANCE_M + _RETURN_SPEED * max(0.0, (time_ns - absent.left_ns) * 1e-9)
    return min(_MAX_DISTANCE_COST, (away / reach) ** 2)
