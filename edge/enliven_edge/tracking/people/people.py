"""Everybody in view: followed, hidden, gone and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int, UInt8
from enliven_edge.tracking.body_model import Posture, height_of
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.duplicates import Doubles
from enliven_edge.tracking.people.follower import FEWEST_PIXELS, Follower
from enliven_edge.tracking.people.identity import Absent, Looks, Register
from enliven_edge.tracking.people.person import UNDECIDED, Person, sight
from enliven_edge.tracking.people.recognition import recognise
from enliven_edge.tracking.people.search import Search
from enliven_edge.tracking.people.spread_search import Lookout, Sighting
from enliven_edge.tracking.scene import ROOM, RoomModel, Zone, ZoneLock
from enliven_edge.tracking.segment import YOUNG, Candidate, Candidates, Segments, segmented
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import Budget, frame_budget

_COVERED, _OUTSIDE = 0.55, 0.85
_HANDICAP = 0.06
"""Metres: pixels that somebody in sight may have are not taken by somebody hidden."""
_DARK = 0.01
"""Share of the pixels below which nothing is seen: a covered lens still shows a few."""
_LONG_BLIND_NS = 250_000_000
"""Nanoseconds of dark, or of the same image again, after which people are looked for anew: they moved on."""
_DECIDE_NS = 1_500_000_000
_DOUBT_NS = 4_000_000_000
_WHOLE, _LOOSE = 0.12, 0.4
_FRAGMENT, _FRAGMENT_NEAR = 0.12, 0.6
"""Square metres that a fragment of somebody shows at most, and metres in plan within which it is theirs."""
_ZONE_MARGIN = 0.15
"""Metres outside the zone at which a performer has left it."""
_ABOUT, _TALLER = 1.5, 0.12
_WELL_KNOWN = 10
"""Frames after which somebody's proportions are known."""
_ANEW, _LEAST, _MEASURED = 1 / 4, 6, 1 / 3
"""What looking anew for people who are followed may cost, of what the search for new ones may; the coarse
fits that the latter may cost in every frame, however many groups of pixels are measured in it; and what to
measure one of these costs, in coarse fits."""
_IN_PLAN = np.array([1.0, 0.0, 1.0])
"""What of a step of a group's middle is one of the person's: its height changes with what is seen of them."""


@dataclass
class _Glance:
    """What a frame shows of somebody: their pixels, whether they are hidden, whether all of them is seen."""

    person: Person
    pixels: Bool
    behind: bool
    whole: bool
    fitted: bool = False


class Crowd:
    """Follows several people; new ones are found among the pixels that are nobody's.

    Attributes:
        people: who is followed, those who were found first come first.
        bystanders: how many people are seen who are no performers.
    """

    def __init__(self, settings: TrackerSettings, fitter: Fitter) -> None:
        self.settings = settings
        self.people: list[Person] = []
        self.lock = ZoneLock()
        self.zone = Zone(settings.scene.zone)
        self.register = Register(settings.people)
        self._fitter = fitter
        self._newcomers = Candidates()
        self._turn = 0
        self._blind_ns: int | None = None
        self._before: Float | None = None
        self._dropped: list[Float] = []
        self._indexed: list[Person] = []
        self._doubles = Doubles()
        self._lookout = Lookout(Search(fitter, self._expecting))
        self._budget = Budget(0.0)
        self._before_ns: int | None = None
        self._first = True
        self._threads: ThreadPoolExecutor | None = None

    @property
    def bystanders(self) -> int:
        return self._newcomers.bystanders

    @property
    def performers(self) -> list[Person]:
        """Who is followed, known, and let in by zone and lock."""
        return [p for p in self.people if p.id != UNDECIDED and self.lock.admits(p.id)]

    def indexed(self) -> Int:
        """(K,) the ids of those whose pixels the last frame's segments show."""
        return np.array([p.id for p in self._indexed], np.int64)

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
        """Drops everybody who is followed; who comes next, or is still there, is somebody new."""
        self._dropped = [p.place.copy() for p in self.people]
        self.people.clear()
        self.register.absent.clear()
        self._newcomers.clear()
        self._lookout.stop()

    def misplaced(self, time_ns: int) -> None:
        """The sensor was moved: everybody is looked for anew, and known again by their looks alone."""
        for person in list(self.people):
            self._leave(person, time_ns)
        self.register.moved()
        self._newcomers.clear()
        self._lookout.stop()

    def follow(self, view: FrameView, kind: UInt8) -> Segments:
        """Fits everybody who is known; whose the pixels of the frame are."""
        self._share_out(view.time_ns)
        dark = np.count_nonzero(view.z > 0.0) < _DARK * view.z.size
        frozen = self._before is not None and np.array_equal(view.z, self._before)
        self._before = view.z
        if self._blind_ns is None and (dark or frozen):
            self._blind_ns = view.time_ns
        if dark:
            return self._wait_in_the_dark(view, kind)
        handicap = np.array([_HANDICAP if p.hidden else 0.0 for p in self.people])
        expected = [p.expected() for p in self.people]
        segments = segmented(view, kind, expected, handicap)
        self._indexed = list(self.people)
        if self._blind_ns is not None and not frozen:
            if view.time_ns - self._blind_ns > _LONG_BLIND_NS:
                for k, person in enumerate(self._indexed):
                    person.seen_ns = min(person.seen_ns, self._blind_ns)
                    self._refind(person, k, view, segments)
                expected = [p.expected() for p in self.people]
            self._blind_ns = None
        fitted = self._fitted_now()
        glances = [self._glance(p, expected[k], k, view, segments) for k, p in enumerate(self._indexed)]
        self._fit_all([g for g in glances if not g.behind and (g.person in fitted or g.person.hidden)], view)
        for glance in glances:
            self._settle(glance, view)
        for second in self._doubles.parted(self.people):
            self.people.remove(second)
            if second.id != UNDECIDED:
                self.register.leave(second.id, second.looks, None, second.seen_ns)
        self._decide(view.time_ns)
        self.register.forget_old(view.time_ns, self.lock.ids or frozenset())
        return segments

    def _share_out(self, time_ns: int) -> None:
        """Gives the search for new people, and those who are looked for anew, their parts of the frame."""
        elapsed = None if self._before_ns is None else (time_ns - self._before_ns) * 1e-9
        self._before_ns, self._first = time_ns, elapsed is None
        whole = frame_budget(self.settings.search.fits_per_frame, elapsed).left
        looking = [p.follower for p in self.people if p.follower.looking]
        for person in self.people:
            # A search that begins in a frame goes on from the next one: its share is not known before.
            person.follower.budget = Budget(whole if whole == np.inf else 0.0)
        for follower in looking:
            follower.budget = Budget(_ANEW * whole / len(looking))
        self._budget = Budget(whole)

    def _wait_in_the_dark(self, view: FrameView, kind: UInt8) -> Segments:
        """A frame of a covered lens: everybody stays where they were going, as somebody hidden does."""
        for person in list(self.people):
            person.hide(view.time_ns)
            if person.hidden_for(view.time_ns) > self.settings.people.hidden:
                self._leave(person, view.time_ns)
        self._indexed = list(self.people)
        return segmented(view, kind, [])

    def _refind(self, person: Person, k: int, view: FrameView, segments: Segments) -> None:
        """Looks for somebody in any posture about where they were: much may have happened unseen."""
        pixels = segments.pixels(k)
        reach = person.uncertainty(view.time_ns)
        for group in segments.loose:
            away = [float(np.linalg.norm((group.centre - p.place)[[0, 2]])) for p in self._indexed]
            if away[k] < reach and away[k] == min(away):
                pixels = pixels | segments.group(group)
        found = Follower.found(view, pixels, self._of_height(person.looks), self._fitter)
        if found is not None:
            person.replaced(found[0], view.time_ns)
            segments.owner[pixels], segments.labels[pixels] = k, 0
            segments.counts[k] = np.count_nonzero(pixels)

    def _of_height(self, looks: Looks) -> TrackerSettings:
        """The settings with the height of somebody, where it is well known."""
        if looks.weight < _WELL_KNOWN:
            return self.settings
        height = min(2.5, max(0.5, height_of(looks.lengths)))
        return dataclasses.replace(self.settings, body_height=height)

    def _fitted_now(self) -> list[Person]:
        """Who is fitted in this frame: the first ones always, the others in turn."""
        seen = [p for p in self.people if p.hidden_ns is None]
        count = self.settings.people.full_rate
        always, others = seen[:count], seen[count:]
        if others:
            self._turn += 1
            always = [*always, others[self._turn % len(others)]]
        return always

    def _glance(
        self, person: Person, expected: Posture, k: int, view: FrameView, segments: Segments
    ) -> _Glance:
        """What a frame shows of somebody."""
        covered, outside = sight(view, expected, segments.owner, k)
        few = bool(segments.counts[k] < 2 * FEWEST_PIXELS)
        behind = covered > _COVERED or (few and covered > 0.5 * _COVERED and outside < _OUTSIDE)
        whole = covered < _WHOLE and outside < _WHOLE
        return _Glance(person, segments.pixels(k), bool(behind or (person.hidden and few)), bool(whole))

    def _fit_all(self, glances: list[_Glance], view: FrameView) -> None:
        """Fits people side by side: nobody's fit looks at another's, so the order makes no difference."""

        def fit(glance: _Glance) -> None:
            glance.person.follow(view, glance.pixels, whole=glance.whole)
            glance.fitted = True

        if len(glances) < 2 or self.settings.people.threads < 2:
            for glance in glances:
                fit(glance)
            return
        if self._threads is None:
            self._threads = ThreadPoolExecutor(self.settings.people.threads, "fit")
        for _ in self._threads.map(fit, glances):
            pass

    def _settle(self, glance: _Glance, view: FrameView) -> None:
        """One person after a frame: fitted, carried along, hidden or gone."""
        person = glance.person
        if glance.behind and person.fleeting:
            self._refuse(person, view.time_ns)
        elif glance.behind:
            person.hide(view.time_ns)
        elif glance.fitted:
            if person.follower.lost or not self.zone.holds(person.place, _ZONE_MARGIN):
                self._leave(person, view.time_ns)
            elif person.vague or (person.doubted and not 0 <= view.time_ns - person.found_ns < _DOUBT_NS):
                self._refuse(person, view.time_ns)
        else:
            person.coast(view, glance.pixels)
        if person.hidden_for(view.time_ns) > self.settings.people.hidden and person in self.people:
            self._leave(person, view.time_ns)

    def _leave(self, person: Person, time_ns: int) -> None:
        """Somebody is no longer followed, but remembered."""
        self.people.remove(person)
        if person.id != UNDECIDED and not person.doubted:
            self.register.leave(person.id, person.looks, person.place.copy(), time_ns)

    def _refuse(self, person: Person, time_ns: int) -> None:
        """Somebody never moved and does not look like a person: a thing."""
        self.people.remove(person)
        self._newcomers.refuse(person.place, time_ns)

    # --- newcomers -----------------------------------------------------------------------------------------

    def look(
        self, view: FrameView, kind: UInt8, segments: Segments, room: RoomModel, *, believe: bool = True
    ) -> Bool:
        """Finds people among the pixels that are nobody's; the (h, w) pixels that may become somebody.

        Args:
            believe: False in a frame that may show a sensor that is being moved: nobody new is found then.
        """
        newcomers = self._newcomers.update(
            view, kind, segments, self._admits, self._awaits, young=room.age < YOUNG
        )
        self._budget.left -= _MEASURED * len(newcomers)
        if self.settings.estimator:
            recognise(newcomers, view, self._budget)
        hold = np.zeros(view.z.shape, bool)
        free = [n for n in newcomers if n.shape.free > _LOOSE or n in self._lookout.sought]
        for newcomer in free:
            hold |= newcomer.pixels
        if room.age < YOUNG:
            hold |= _fragments(segments, [n.centre for n in free] + [p.place for p in self.people])
        due = self._due(newcomers, view, room)
        if not believe:
            self._lookout.stop()
        elif not self._lookout.busy:
            self._look_at(due, view)
        if not self._first:
            self._budget.left = max(_LEAST, self._budget.left)
        elif self._budget.left < np.inf:
            # All that stands in the room was measured in this frame: the search begins in the next one.
            self._budget.left = 0.0
        for sighting in self._lookout.go_on(self._budget):
            pixels = self._caught_up(sighting, view, kind, segments)
            if pixels is not None:
                self._welcome(sighting, pixels, view, segments)
        return hold

    def _due(self, newcomers: list[Candidate], view: FrameView, room: RoomModel) -> list[Candidate]:
        """The newcomers in which a body should be looked for now."""
        alone = not self.people
        missing = bool(self.register.absent) or any(p.hidden for p in self.people)
        return [
            n
            for n in newcomers
            if not n.bystander and n.due(view.time_ns, room.age, alone=alone, missing=missing)
        ]

    def _look_at(self, due: list[Candidate], view: FrameView) -> None:
        """Begins a search for bodies in newcomers, where there is room for one more."""
        sure = [n for n in due if n.convincing or n.proven]
        most = self.settings.people.most - len(self.people)
        if due and most > 0:
            others = [n for n in due if n not in sure]
            self._lookout.start(view, sure, others, alone=not self.people, most=most)

    def _caught_up(self, sighting: Sighting, view: FrameView, kind: UInt8, segments: Segments) -> Bool | None:
        """(h, w) the pixels of a body that was found, brought to this frame; None: it is not seen here."""
        newcomer, follower = sighting.newcomer, sighting.follower
        if self._lookout.view is view:
            return sighting.shown.pixels
        if newcomer.seen_ns == view.time_ns:
            follower.carry((newcomer.centre - sighting.centre) * _IN_PLAN)
        free = np.where(segments.owner >= 0, ROOM, kind).astype(np.uint8)
        pixels = segmented(view, free, [follower.posture]).pixels(0)
        if follower.follow(view, pixels):
            return pixels
        newcomer.failed(view.time_ns)
        return None

    def sought(self, view: FrameView) -> Bool:
        """(h, w) the pixels of those who may be people and are being looked at."""
        made = np.zeros(view.z.shape, bool)
        for newcomer in self._lookout.sought:
            if newcomer.seen_ns == view.time_ns:
                made |= newcomer.pixels
        return made

    def _admits(self, place: Float) -> bool:
        """Whether somebody new at a place may be a performer."""
        if not self.zone.holds(place):
            return False
        awaited = {a.id for a in self.register.absent}
        awaited |= {p.id for p in self.people if p.hidden}
        return self.lock.ids is None or bool(self.lock.ids & awaited)

    def _awaits(self, place: Float) -> bool:
        """Whether somebody was lost about there."""
        if any(float(np.linalg.norm((place - at)[[0, 2]])) < _ABOUT for at in self._dropped):
            return True
        if len(self.register.absent) <= sum(1 for p in self.people if p.id == UNDECIDED):
            return False
        lost = [a.place for a in self.register.absent]
        return any(at is None or float(np.linalg.norm((place - at)[[0, 2]])) < _ABOUT for at in lost)

    def _expecting(self, newcomer: Candidate, time_ns: int) -> TrackerSettings:
        """The settings with the height of the one person who may come back, where there is one."""
        hidden = self._hidden_near(newcomer, time_ns)
        awaited = [a.looks for a in self.register.absent] if hidden is None else [hidden.looks]
        return self._of_height(awaited[0]) if len(awaited) == 1 else self.settings

    def _welcome(self, sighting: Sighting, pixels: Bool, view: FrameView, segments: Segments) -> None:
        """A person was found in the (h, w) pixels: who is it?"""
        newcomer, follower, shown = sighting.newcomer, sighting.follower, sighting.shown
        person = self._hidden_near(newcomer, view.time_ns)
        if person is not None:
            person.replaced(follower, view.time_ns)
        else:
            looks = Looks()
            if shown.shape.whole:
                looks.see(follower.posture.lengths, shown.shape.crown)
            person = Person(UNDECIDED, follower, looks, view.time_ns)
            person.doubted = not (shown.convincing or shown.awaited)
            person.shapely = shown.shape.upright
            self.people.append(person)
            self._decide(view.time_ns)
        self._newcomers.drop(newcomer)
        self._dropped = [at for at in self._dropped if np.linalg.norm((person.place - at)[[0, 2]]) > _ABOUT]
        segments.owner[pixels & (segments.owner < 0)] = len(self._indexed)
        self._indexed.append(person)

    def _hidden_near(self, newcomer: Candidate, time_ns: int) -> Person | None:
        """Who was hidden and may have come out here, the nearest; not who is much shorter."""
        best, least = None, np.inf
        for person in self.people:
            if person.hidden_ns is None:
                continue
            away = float(np.linalg.norm((person.place - newcomer.centre)[[0, 2]]))
            stature = person.looks.stature
            taller = stature is not None and newcomer.shape.crown > stature + _TALLER
            if away < min(least, person.uncertainty(time_ns)) and not taller:
                best, least = person, away
        return best

    def _decide(self, time_ns: int) -> None:
        """Gives numbers to who was found: that of who has come back, at once or when it is clear who."""
        undecided = [p for p in self.people if p.id == UNDECIDED]
        if not undecided:
            return
        match = self.register.matched([(p.looks, p.place) for p in undecided], time_ns)
        for person, (absent, sure) in zip(undecided, match, strict=True):
            if not sure and 0 <= time_ns - person.found_ns < _DECIDE_NS:
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
        person.looks = absent.looks


def _fragments(segments: Segments, places: list[Float]) -> Bool:
    """(h, w) small groups of pixels near somebody: a shank that is seen apart from its thigh, say."""
    made = np.zeros(segments.labels.shape, bool)
    for group in segments.loose:
        beside = any(float(np.linalg.norm((group.centre - at)[[0, 2]])) < _FRAGMENT_NEAR for at in places)
        if beside and group.area < _FRAGMENT:
            made |= segments.group(group)
    return made
