"""Everybody in view: followed, hidden, gone and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from enliven.arrays import Bool, Float, Int, UInt8
from enliven.body import Joint
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.follower import FEWEST_PIXELS, Follower
from enliven_edge.tracking.identity import Absent, Looks, Register
from enliven_edge.tracking.newcomers import Newcomer, Newcomers
from enliven_edge.tracking.person import UNDECIDED, Person, sight
from enliven_edge.tracking.room import Room
from enliven_edge.tracking.segmentation import Segments, segmented
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.view import View
from enliven_edge.tracking.zone import Lock, Zone

_COVERED, _OUTSIDE = 0.55, 0.85
_HANDICAP = 0.06
"""Metres: pixels that somebody in sight may have are not taken by somebody hidden."""
_SAME_PLACE = 0.2
_DOUBT_FRAMES = 6
_DECIDE_NS = 500_000_000
_LEAD = 3.0
_TRIES = 3


class Crowd:
    """Follows several people; new ones are found among the pixels that are nobody's.

    Attributes:
        people: who is followed, those who were found first come first.
        bystanders: how many people are seen who are no performers.
    """

    def __init__(self, settings: TrackerSettings, fitter: Fitter) -> None:
        self.settings = settings
        self.people: list[Person] = []
        self.lock = Lock()
        self.zone = Zone(settings.scene.zone)
        self.register = Register(settings.people)
        self._fitter = fitter
        self._newcomers = Newcomers()
        self._turn = 0
        self._indexed: list[Person] = []
        self._doubts: dict[tuple[int, int], int] = {}

    @property
    def bystanders(self) -> int:
        return self._newcomers.bystanders

    @property
    def performers(self) -> list[Person]:
        """Who is followed, known, and let in by zone and lock."""
        return [p for p in self.people if p.id != UNDECIDED and self.lock.admits(p.id)]

    def owners(self) -> Int:
        """(K,) the ids of those whose pixels the last frame's segments show; -1 for who has never moved."""
        return np.array([p.id if p.travelled else -1 for p in self._indexed], np.int64)

    def lock_to(self, ids: Iterable[int] | None) -> None:
        """Only these, or all who are followed now, are performers from now on."""
        present = [p.id for p in self.people if p.id != UNDECIDED]
        self.lock.ids = frozenset(present if ids is None else ids)
        for person in [p for p in self.people if not self.lock.admits(p.id)]:
            self.people.remove(person)

    def unlock(self) -> None:
        self.lock.ids = None

    def forget(self) -> None:
        """Drops everybody who is followed; who comes next is somebody new."""
        self.people.clear()
        self.register.absent.clear()
        self._newcomers.clear()

    def misplaced(self, time_ns: int) -> None:
        """The sensor was moved: everybody is looked for anew, and known again by their looks alone."""
        for person in list(self.people):
            self._leave(person, time_ns)
        self.register.moved()
        self._newcomers.clear()

    def follow(self, view: View, kind: UInt8) -> Segments:
        """Fits everybody who is known; whose the pixels of the frame are."""
        handicap = np.array([_HANDICAP if p.hidden_ns is not None else 0.0 for p in self.people])
        segments = segmented(view, kind, [p.expected() for p in self.people], handicap)
        self._indexed = list(self.people)
        fitted = self._fitted_now()
        for k, person in enumerate(self._indexed):
            self._follow(person, k, view, segments, fit=person in fitted)
        self._part_doubles()
        self._decide(view.time_ns)
        self.register.forget_old(view.time_ns, self.lock.ids or frozenset())
        return segments

    def _fitted_now(self) -> list[Person]:
        """Who is fitted in this frame: the first ones always, the others in turn."""
        seen = [p for p in self.people if p.hidden_ns is None]
        count = self.settings.people.full_rate
        always, others = seen[:count], seen[count:]
        if others:
            self._turn += 1
            always = [*always, others[self._turn % len(others)]]
        return always

    def _follow(self, person: Person, k: int, view: View, segments: Segments, *, fit: bool) -> None:
        """One person in one frame: fitted, carried along, hidden or gone."""
        pixels = segments.pixels(k)
        covered, outside = sight(view, person.expected(), segments.owner, k)
        few = segments.counts[k] < 2 * FEWEST_PIXELS
        behind = covered > _COVERED or (few and covered > 0.5 * _COVERED and outside < _OUTSIDE)
        if behind or (person.hidden_ns is not None and few):
            person.hide(view.time_ns)
        elif fit or person.hidden_ns is not None:
            person.follow(view, pixels)
            if person.follower.lost:
                self._leave(person, view.time_ns)
        else:
            person.coast(view, pixels)
        waited = 0 if person.hidden_ns is None else view.time_ns - person.hidden_ns
        if waited > self.settings.people.hidden * 1e9 and person in self.people:
            self._leave(person, view.time_ns)

    def _leave(self, person: Person, time_ns: int) -> None:
        """Somebody is no longer followed, but remembered."""
        self.people.remove(person)
        if person.id != UNDECIDED:
            self.register.leave(person.id, person.looks, person.place.copy(), time_ns)

    # --- newcomers -----------------------------------------------------------------------------------------

    def look(self, view: View, kind: UInt8, segments: Segments, room: Room) -> Bool:
        """Finds people among the pixels that are nobody's; the (h, w) pixels that may become somebody."""
        newcomers = self._newcomers.update(view, kind, segments, room, self._admits)
        hold = np.zeros(view.z.shape, bool)
        for newcomer in newcomers:
            hold |= newcomer.pixels
        tries = 1 if self.people else _TRIES
        found: list[tuple[float, Newcomer, Follower]] = []
        for newcomer in newcomers:
            if tries == 0 or len(self.people) + len(found) >= self.settings.people.most:
                break
            if newcomer.bystander or not newcomer.due(view.time_ns, room.age, alone=not self.people):
                continue
            tries -= 1
            made = Follower.found(view, newcomer.pixels, self._expecting(newcomer), self._fitter)
            if made is None:
                newcomer.failed(view.time_ns)
            else:
                found.append((made[1], newcomer, made[0]))
        for _, newcomer, follower in found:
            self._welcome(newcomer, follower, view, segments)
        return hold

    def _admits(self, place: Float) -> bool:
        """Whether somebody new at a place may be a performer."""
        if not self.zone.holds(place):
            return False
        awaited = {a.id for a in self.register.absent} | {
            p.id for p in self.people if p.hidden_ns is not None
        }
        return self.lock.ids is None or bool(self.lock.ids & awaited)

    def _expecting(self, newcomer: Newcomer) -> TrackerSettings:
        """The settings with the height of the one person who may come back, where there is one."""
        awaited = [a.looks.stature for a in self.register.absent]
        awaited += [p.looks.stature for p in self.people if p.hidden_ns is not None]
        if len(awaited) != 1 or awaited[0] is None:
            return self.settings
        return dataclasses.replace(self.settings, body_height=min(2.5, max(0.5, awaited[0])))

    def _welcome(self, newcomer: Newcomer, follower: Follower, view: View, segments: Segments) -> None:
        """Somebody was found: who is it?"""
        looks = Looks()
        looks.see(follower.posture.lengths, None)
        for crown in newcomer.crowns:
            looks.see(follower.posture.lengths, crown)
        person = self._hidden_near(follower, looks, view.time_ns)
        if person is not None:
            person.replaced(follower, view.time_ns)
        else:
            person = Person(UNDECIDED, follower, looks, view.time_ns)
            self.people.append(person)
            self._decide(view.time_ns)
        self._newcomers.drop(newcomer)
        segments.owner[newcomer.pixels & (segments.owner < 0)] = len(self._indexed)
        self._indexed.append(person)

    def _hidden_near(self, follower: Follower, looks: Looks, time_ns: int) -> Person | None:
        """Who was hidden and may have come out here."""
        best, least = None, 9.0
        for person in self.people:
            if person.hidden_ns is None:
                continue
            away = float(np.linalg.norm((person.place - follower.posture.position)[[0, 2]]))
            cost = looks.mismatch(person.looks) + 4.0 * (away / (2 * person.uncertainty(time_ns))) ** 2
            if cost < least:
                best, least = person, cost
        return best

    def _decide(self, time_ns: int) -> None:
        """Gives numbers to who was found: that of who has come back, at once or when it is clear who."""
        for person in [p for p in self.people if p.id == UNDECIDED]:
            absent, lead = self.register.likeliest(person.looks, person.place, time_ns)
            if absent is not None and lead < _LEAD and 0 <= time_ns - person.found_ns < _DECIDE_NS:
                continue
            if absent is not None:
                self._is(person, absent)
            elif self.lock.closed:
                self.people.remove(person)
            else:
                person.id = self.register.new()

    def _is(self, person: Person, absent: Absent) -> None:
        """Somebody who left is back."""
        self.register.take(absent)
        person.id = absent.id
        absent.looks.see(person.follower.posture.lengths, None)
        person.looks = absent.looks

    # --- doubts --------------------------------------------------------------------------------------------

    def _part_doubles(self) -> None:
        """Two fits on one person: the later one goes."""
        ordered = sorted((p for p in self.people if p.hidden_ns is None), key=lambda p: p.found_ns)
        together = set()
        for i, first in enumerate(ordered):
            for second in ordered[i + 1 :]:
                if float(np.linalg.norm(first.place - second.place)) < _SAME_PLACE and _one(first, second):
                    together.add((id(first), id(second)))
                    count = self._doubts.get((id(first), id(second)), 0) + 1
                    self._doubts[id(first), id(second)] = count
                    if count > _DOUBT_FRAMES and second in self.people:
                        self.people.remove(second)
                        if second.id != UNDECIDED:
                            self.register.leave(second.id, second.looks, None, second.seen_ns)
        self._doubts = {pair: n for pair, n in self._doubts.items() if pair in together}


def _one(first: Person, second: Person) -> bool:
    """Whether two fits have their trunks in the same place."""
    a, b = first.follower.posture.joints(), second.follower.posture.joints()
    trunk = [Joint.HIP_CENTER, Joint.SHOULDER_CENTER, Joint.HEAD]
    return bool(np.linalg.norm(a[trunk] - b[trunk], axis=1).mean() < _SAME_PLACE)
