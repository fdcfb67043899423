"""Re-identification: matches new people to absent ones by stature, proportions and the place where they
left.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.kernels import quantile
from enliven.matching.assignment import solve_assignment
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.settings import PeopleSettings

_STATURE_SPREAD = 0.03
"""Standard deviation in metres of one person's measured stature, from shoes, posture and depth noise."""
_PROPORTION_SPREAD = 0.10
"""Standard deviation of one person's fitted bone lengths, as a fraction of each length."""
_RETURN_SPEED = 2.0
"""Speed in metres per second at which the radius grows in which an absent person may return: a brisk walk."""
_RETURN_DISTANCE_M = 0.8
"""Distance in metres from the place of leaving at which a person who returns at once costs one squared
standard deviation.
"""
_MAX_DISTANCE_COST = 4.0
"""Maximum cost of a distant place in squared standard deviations. It is bounded, because people may also walk
around behind the sensor.
"""
_BRIEF_ABSENCE_NS = 2_000_000_000
"""Maximum absence in nanoseconds for a match by place alone, if there is exactly one absent and one new
person.
"""
_SAME_PLACE_M = 0.5
"""Maximum horizontal distance in metres for a match by place alone: a step."""
_MIN_STATURE_DIFFERENCE_M = 0.15
"""Minimum difference in stature in metres, five standard deviations, that excludes a match even at the same
place."""
_DISTINCTIVE_LENGTHS = [model.SHOULDER, model.ARM, model.FORE, model.THIGH, model.SHIN]
"""The lengths that distinguish people: the lengths of the limbs, which the fit measures best."""
_MAX_MISMATCH = 9.0
"""Maximum mismatch of the same person in squared standard deviations: three sigma."""
_KNOWN_FRAMES = 6
"""Minimum number of frames with the whole body in view before proportions can distinguish a person."""
_CERTAIN_LEAD = 3.0
"""Minimum lead of the best match over the next one to be certain, in squared standard deviations."""
_MAX_MEAN_FRAMES = 90.0
"""Maximum number of frames in the running mean of the lengths. They may still drift after that."""
_CROWN_SAMPLES = 240
"""Number of crown heights for computing the stature."""
_STATURE_QUANTILE = 0.85
"""Quantile of the crown heights that is used as the stature. People stoop more often than they stretch."""


@dataclass
class BodyMeasurements:
    """The stature and proportions for re-identification of a person. They improve with every frame.

    Attributes:
        lengths: (12,) metres, a running mean of the fit's lengths.
        weight: the number of frames in that mean.
        stature: metres from the floor to the crown of the upright person; None if the crown was never
            visible.
    """

    lengths: Float = field(default_factory=lambda: model.REFERENCE_LENGTHS.copy())
    weight: float = 0.0
    stature: float | None = None
    _crowns: list[float] = field(default_factory=list)

    def update(self, lengths: Float, crown: float | None) -> None:
        """Adds a frame's fitted (12,) lengths, and its crown height above the floor in metres if visible."""
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
        own_stature, other_stature = self.stature, other.stature
        if own_stature is not None and other_stature is not None:
            cost += ((own_stature - other_stature) / _STATURE_SPREAD) ** 2
        return cost


@dataclass
class AbsentPerson:
    """A person who was tracked and is out of view."""

    id: int
    measurements: BodyMeasurements
    place: Float | None
    left_ns: int


class PersonGallery:
    """Assigns ids to people, and remembers those out of view."""

    def __init__(self, settings: PeopleSettings) -> None:
        self.settings = settings
        self.absent: list[AbsentPerson] = []
        self._last = 0

    def make_new_id(self) -> int:
        """Returns an id that no person has had."""
        self._last += 1
        return self._last

    def leave(self, identity: int, looks: BodyMeasurements, place: Float | None, time_ns: int) -> None:
        """Remembers a person who left the view at the (3,) ``place``. The place is None if it is
        unreliable.
        """
        self.absent.append(AbsentPerson(identity, looks, place, time_ns))

    def forget_old(self, time_ns: int, keep: frozenset[int]) -> None:
        """Forgets people who have been away for too long, except the ids in ``keep``."""
        limit = self.settings.remember * 1e9
        self.absent = [a for a in self.absent if a.id in keep or 0 <= time_ns - a.left_ns <= limit]

    def forget_places(self) -> None:
        """Forgets the places of leaving, because the sensor was moved."""
        for absent in self.absent:
            absent.place = None

    def match(
        self, newcomers: list[tuple[BodyMeasurements, Float]], time_ns: int
    ) -> list[tuple[AbsentPerson | None, bool]]:
        """Matches each new person, given by looks and (3,) place, to an absent person or None.

        Returns each match, and whether the match is certain.

        A single least-cost assignment matches all people together. So two people who return at the same time
        are not confused.
        """
        if not self.absent:
            return [(None, True)] * len(newcomers)
        cost = np.array(
            [
                [
                    measurements.mismatch(a.measurements) + _distance_cost(a, place, time_ns)
                    for a in self.absent
                ]
                for measurements, place in newcomers
            ]
        )
        if len(newcomers) == len(self.absent) == 1 and self._is_same_place(newcomers[0], time_ns):
            return [(self.absent[0], True)]
        # Add columns for "new person", at the cost of the largest accepted mismatch.
        padded = np.concatenate([cost, np.full((len(newcomers), len(newcomers)), _MAX_MISMATCH)], 1)
        rows, columns = solve_assignment(padded)
        matches: list[tuple[AbsentPerson | None, bool]] = []
        for row, column in zip(rows, columns, strict=True):
            absent = self.absent[column] if column < len(self.absent) else None
            others = np.delete(padded[row, : len(self.absent) + 1], column if absent else -1)
            lead = float(others.min() - padded[row, column])
            is_well_known = newcomers[row][0].weight >= _KNOWN_FRAMES
            back = absent is not None and newcomers[row][0].weight > 0
            is_certain = lead > _CERTAIN_LEAD and (
                is_well_known or (back and len(self.absent) == 1 and len(newcomers) == 1)
            )
            matches.append((absent, is_certain))
        return matches

    def _is_same_place(self, newcomer: tuple[BodyMeasurements, Float], time_ns: int) -> bool:
        """Returns True if the single new person is where the single absent person was lost just before."""
        (absent,), (measurements, place) = self.absent, newcomer
        if absent.place is None or not 0 <= time_ns - absent.left_ns < _BRIEF_ABSENCE_NS:
            return False
        own_stature, absent_stature = measurements.stature, absent.measurements.stature
        other = (
            own_stature is not None
            and absent_stature is not None
            and abs(own_stature - absent_stature) > _MIN_STATURE_DIFFERENCE_M
        )
        return not other and float(np.linalg.norm((place - absent.place)[[0, 2]])) < _SAME_PLACE_M

    def remove(self, absent: AbsentPerson) -> None:
        """Removes a person who has returned from the absent ones."""
        self.absent.remove(absent)


def _distance_cost(absent: AbsentPerson, place: Float, time_ns: int) -> float:
    """Returns the cost of the distance from the place of leaving, in squared standard deviations."""
    if absent.place is None:
        return 0.0
    distance = float(np.linalg.norm((place - absent.place)[[0, 2]]))
    reach = _RETURN_DISTANCE_M + _RETURN_SPEED * max(0.0, (time_ns - absent.left_ns) * 1e-9)
    return min(_MAX_DISTANCE_COST, (distance / reach) ** 2)
