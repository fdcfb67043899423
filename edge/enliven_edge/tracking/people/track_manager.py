"""Manages the list of tracked people: ids, admission as performers, return, and duplicate tracks."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.person import Joint
from enliven_edge.tracking.body_model.model import body_height_from_lengths
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.person import UNDECIDED, Person
from enliven_edge.tracking.people.reidentification import AbsentPerson, BodyMeasurements, PersonGallery
from enliven_edge.tracking.scene.zone import Zone, ZoneLock
from enliven_edge.tracking.segment.candidate import Candidate
from enliven_edge.tracking.settings import TrackerSettings

_MAX_UNDECIDED_NS = 1_500_000_000
"""Maximum time in nanoseconds until a new person gets an id, even if re-identification is not certain. It
bounds the waiting time of performers.
"""
_RETURN_RADIUS_M = 1.5
"""Horizontal radius in metres around the place of leaving in which a lost person may reappear: two steps."""
_CROWN_TOLERANCE_M = 0.12
"""Maximum height difference in metres of a candidate's crown above a hidden person's stature: a hat, and
noise."""
_KNOWN_FRAMES = 10
"""Number of frames after which a person's proportions are known well enough for a search."""
_MIN_BODY_HEIGHT_M = 0.5
"""Minimum body height in metres for a search. It is the lower bound of the setting ``body_height``."""
_MAX_BODY_HEIGHT_M = 2.5
"""Maximum body height in metres for a search. It is the upper bound of the setting ``body_height``."""


class TrackManager:
    """The tracked people. Decides on the identity of each new person.

    Attributes:
        settings: the settings.
        people: the tracked people, in the order of their detection.
        segmented: the people by their index in the last frame's segments.
        lock: the ids that may perform.
        zone: the area on the floor for performers.
        gallery: assigns ids, and remembers the people who are out of view.
    """

    def __init__(self, settings: TrackerSettings) -> None:
        self.settings = settings
        self.people: list[Person] = []
        self.segmented: list[Person] = []
        self.lock = ZoneLock()
        self.zone = Zone(settings.scene.zone)
        self.gallery = PersonGallery(settings.people)
        self._dropped: list[Float] = []

    @property
    def performers(self) -> list[Person]:
        """Returns the people with an id that the lock admits."""
        return [p for p in self.people if p.id != UNDECIDED and self.lock.admits(p.id)]

    @property
    def has_missing_people(self) -> bool:
        """Returns True if a person is out of view or hidden."""
        return bool(self.gallery.absent) or any(p.is_hidden for p in self.people)

    def lock_to(self, ids: Iterable[int] | None) -> None:
        """Admits only these ids, or all people tracked now, as performers from now on."""
        present = [p.id for p in self.people if p.id != UNDECIDED]
        self.lock.ids = frozenset(present if ids is None else ids)
        for person in [p for p in self.people if not self.lock.admits(p.id)]:
            self.people.remove(person)

    def forget(self) -> None:
        """Drops all people, including absent ones. A person who is still present gets a new id."""
        self._dropped = [p.place.copy() for p in self.people]
        self.people.clear()
        self.gallery.absent.clear()

    def leave(self, person: Person, time_ns: int) -> None:
        """Stops tracking a person, and remembers the person."""
        self.people.remove(person)
        if person.id != UNDECIDED and not person.is_doubtful:
            self.gallery.leave(person.id, person.measurements, person.place.copy(), time_ns)

    def drop_duplicate(self, person: Person) -> None:
        """Drops a duplicate track. Remembers no place of leaving, because the person has not left."""
        self.people.remove(person)
        if person.id != UNDECIDED:
            self.gallery.leave(person.id, person.measurements, None, person.seen_ns)

    def sensor_moved(self, time_ns: int) -> None:
        """Treats all people as absent, because the sensor was moved. So only proportions can re-identify
        them.
        """
        self.leave_all(time_ns)
        self.gallery.forget_places()

    def leave_all(self, time_ns: int) -> None:
        """Treats all people as absent. They are re-identified by their places and proportions."""
        for person in list(self.people):
            self.leave(person, time_ns)

    def admits(self, place: Float) -> bool:
        """Returns True if a new person at a (3,) place may be a performer."""
        if not self.zone.contains(place):
            return False
        awaited = {a.id for a in self.gallery.absent}
        awaited |= {p.id for p in self.people if p.is_hidden}
        return self.lock.ids is None or bool(self.lock.ids & awaited)

    def expects_return(self, place: Float) -> bool:
        """Returns True if a person was lost near a (3,) place."""
        if any(
            float(np.linalg.norm((place - lost_place)[[0, 2]])) < _RETURN_RADIUS_M
            for lost_place in self._dropped
        ):
            return True
        if len(self.gallery.absent) <= sum(1 for p in self.people if p.id == UNDECIDED):
            return False
        lost = [a.place for a in self.gallery.absent]
        return any(
            lost_place is None or float(np.linalg.norm((place - lost_place)[[0, 2]])) < _RETURN_RADIUS_M
            for lost_place in lost
        )

    def settings_for_candidate(self, candidate: Candidate, time_ns: int) -> TrackerSettings:
        """Returns the settings with the height of the person who may return, if there is exactly one."""
        hidden = self.find_hidden_person(candidate, time_ns)
        awaited = [a.measurements for a in self.gallery.absent] if hidden is None else [hidden.measurements]
        return self.settings_for_person(awaited[0]) if len(awaited) == 1 else self.settings

    def settings_for_person(self, looks: BodyMeasurements) -> TrackerSettings:
        """Returns the settings with a person's own height, if its proportions are well known."""
        if looks.weight < _KNOWN_FRAMES:
            return self.settings
        height = min(_MAX_BODY_HEIGHT_M, max(_MIN_BODY_HEIGHT_M, body_height_from_lengths(looks.lengths)))
        return dataclasses.replace(self.settings, body_height=height)

    def find_hidden_person(self, candidate: Candidate, time_ns: int) -> Person | None:
        """Returns the nearest hidden person who may have reappeared as this candidate, or None.

        People much shorter than the candidate are excluded.
        """
        best, min_distance = None, np.inf
        for person in self.people:
            if person.hidden_ns is None:
                continue
            distance = float(np.linalg.norm((person.place - candidate.centre)[[0, 2]]))
            stature = person.measurements.stature
            taller = stature is not None and candidate.shape.crown > stature + _CROWN_TOLERANCE_M
            if distance < min(min_distance, person.search_radius(time_ns)) and not taller:
                best, min_distance = person, distance
        return best

    def start_track(
        self,
        candidate: Candidate,
        shown: Candidate,
        follower: Follower,
        time_ns: int,
        *,
        has_floor: bool = True,
    ) -> Person:
        """Starts to track a found body: as a hidden person who reappeared, or as a new person without an id.

        Args:
            candidate: the candidate in its current state.
            shown: a copy of the candidate from the frame in which the body was found.
            follower: the fit.
            time_ns: the frame's time.
            has_floor: whether the floor is known. If not, no stature is measured.
        """
        person = self.find_hidden_person(candidate, time_ns)
        if person is not None:
            person.replace_fit(follower, time_ns)
        else:
            measurements = BodyMeasurements()
            if shown.shape.shows_crown:
                measurements.update(follower.posture.lengths, shown.shape.crown if has_floor else None)
            person = Person(UNDECIDED, follower, measurements, time_ns)
            person.is_doubtful = not (shown.is_convincing or shown.is_awaited)
            person.has_person_outline = shown.shape.is_upright
            self.people.append(person)
            self.decide_identities(time_ns)
        self._dropped = [
            lost_place
            for lost_place in self._dropped
            if np.linalg.norm((person.place - lost_place)[[0, 2]]) > _RETURN_RADIUS_M
        ]
        return person

    def decide_identities(self, time_ns: int) -> None:
        """Assigns ids to new people.

        A person gets the id of an absent person once the match is certain, or else a new id.
        """
        undecided = [p for p in self.people if p.id == UNDECIDED]
        if not undecided:
            return
        match = self.gallery.match([(p.measurements, p.place) for p in undecided], time_ns)
        for person, (absent, is_certain) in zip(undecided, match, strict=True):
            if not is_certain and 0 <= time_ns - person.found_ns < _MAX_UNDECIDED_NS:
                continue
            if absent is not None:
                self._adopt_identity(person, absent)
            elif self.lock.is_closed:
                self.people.remove(person)
            else:
                person.id = self.gallery.make_new_id()

    def _adopt_identity(self, person: Person, absent: AbsentPerson) -> None:
        """Assigns the id and the looks of an absent person to a person."""
        self.gallery.remove(absent)
        person.id = absent.id
        person.measurements = absent.measurements


_DUPLICATE_DISTANCE_M = 0.2
"""Minimum distance in metres of two different people, between their hip centres and between their trunks on
average.
"""
_DUPLICATE_FRAMES = 6
"""Number of frames in which two fits must be at the same place to count as duplicates. People that squeeze
past each other overlap for fewer frames.
"""
_TRUNK = [Joint.HIP_CENTER, Joint.SHOULDER_CENTER, Joint.HEAD]


class Duplicates:
    """Detects duplicate tracks: people who are tracked twice."""

    def __init__(self) -> None:
        self._doubts: dict[tuple[int, int], int] = {}

    def find(self, people: Sequence[Person]) -> list[Person]:
        """Returns the people who have been at the place of an earlier track for some frames."""
        ordered = sorted((p for p in people if not p.is_hidden), key=lambda p: p.found_ns)
        together, duplicates = set(), []
        for i, first in enumerate(ordered):
            for second in ordered[i + 1 :]:
                if not _share_place(first, second):
                    continue
                pair = (id(first), id(second))
                together.add(pair)
                self._doubts[pair] = self._doubts.get(pair, 0) + 1
                if self._doubts[pair] > _DUPLICATE_FRAMES and second not in duplicates:
                    duplicates.append(second)
        self._doubts = {pair: n for pair, n in self._doubts.items() if pair in together}
        return duplicates


def _share_place(first: Person, second: Person) -> bool:
    """Returns True if the trunks of two fits are at the same place."""
    if math.dist(first.place, second.place) >= _DUPLICATE_DISTANCE_M:
        return False
    a, b = first.follower.posture.joints(), second.follower.posture.joints()
    return bool(np.linalg.norm(a[_TRUNK] - b[_TRUNK], axis=1).mean() < _DUPLICATE_DISTANCE_M)
