"""Finds new people among the pixels that belong to no person who is followed."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.roster import Roster
from enliven_edge.tracking.people.search import Search, recognise
from enliven_edge.tracking.people.spread_search import FoundBody, SpreadSearch
from enliven_edge.tracking.scene import ROOM, RoomModel
from enliven_edge.tracking.segment import BESIDE, YOUNG, Candidate, Candidates, Segments, lying_on, segmented
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import Budget, frame_budget

_GONE_NS = 200_000_000
"""Nanoseconds after which an unseen newcomer is no longer searched: longer than noise lasts."""
_LOOSE = 0.4
"""Share of a newcomer's outline that nothing surrounds from which its pixels are kept out of the room."""
_FRAGMENT = 0.12
"""Square metres that a fragment of a person shows at most: a shank seen apart from its thigh."""
_FRAGMENT_NEAR = 0.6
"""Metres in plan from a person within which a small group of pixels is a fragment of that person."""
_LEAST = 4
"""Coarse fits that a search may cost in every frame, however many newcomers are measured in it."""
_WHILE_FOLLOWING = 0.6
"""Share of the search budget while people are followed in a known room: their fits take time too."""
_FOR_ONE = 0.35
"""Share of the search budget for each group of pixels that is sought, and for each way to join its parts,
up to all of it: one person alone appears two frames later, and the slowest frames are a quarter faster."""
_MEASURED = 1 / 3
"""Coarse fits: the cost of measuring the shape of one newcomer."""
_ALIKE = 0.75
"""Share of a newcomer's area from which it is the same group in two frames, without or with furniture."""
_IN_PLAN = np.array([1.0, 0.0, 1.0])
"""The part of a step of a newcomer's middle that moves its body: its height changes with what is seen."""


class PeopleFinder:
    """Watches newcomers until they convince, and searches them for bodies over several frames."""

    def __init__(self, settings: TrackerSettings, fitter: Fitter, roster: Roster) -> None:
        self.settings = settings
        self._roster = roster
        self._newcomers = Candidates()
        self._search = SpreadSearch(Search(fitter, roster.expecting))
        self._budget = Budget(0.0)
        self._first_budget: Budget | None = frame_budget(settings.search.first_fits, None)

    @property
    def bystanders(self) -> int:
        """How many people are seen who are no performers."""
        return self._newcomers.bystanders

    def clear(self) -> None:
        """Forgets all newcomers and gives up the search; the next search in a new room is a first one."""
        self._newcomers.clear()
        self._search.stop()
        self._first_budget = frame_budget(self.settings.search.first_fits, None)

    def allot(self, budget: Budget) -> None:
        """Sets what the search may cost in this frame."""
        self._budget = budget

    def refuse(self, place: Float, time_ns: int) -> None:
        """Takes what stands at a (3,) place for a thing, where a body was found by mistake."""
        self._newcomers.refuse(place, time_ns)

    def searched_pixels(self, view: FrameView) -> Bool:
        """Returns the (h, w) pixels of the newcomers that are being searched."""
        made = np.zeros(view.z.shape, bool)
        for newcomer in self._search.sought:
            if newcomer.seen_ns == view.time_ns:
                made |= newcomer.pixels
        return made

    def find(
        self, view: FrameView, kind: UInt8, segments: Segments, room: RoomModel, *, believe: bool = True
    ) -> Bool:
        """Finds people among the pixels of no person; returns the (h, w) pixels that may become a person.

        Args:
            kind: (h, w) as of :meth:`Room.classify`.
            segments: of this frame; a person who is found gets pixels of their own in it.
            believe: False in a frame that may show a sensor that is being moved: none is found then.
        """
        newcomers = self._newcomers.update(
            view, kind, segments, self._roster.admits, self._roster.awaits, young=room.age < YOUNG
        )
        if self._roster.people and room.age > YOUNG:
            self._budget.left *= _WHILE_FOLLOWING
        self._budget.left -= _MEASURED * len(newcomers)
        if self.settings.estimator:
            recognise(newcomers, view, self._budget)
        free = [n for n in newcomers if n.shape.free > _LOOSE or n in self._search.sought]
        hold = self._held_pixels(view, segments, free, room)
        due = self._due(newcomers, view, room)
        if not believe or self._has_lost_all(view):
            self._search.stop()
        elif not self._search.busy:
            self._start_search(due, view)
        self._limit_search(young=room.age < YOUNG)
        for body in self._search.go_on(self._budget):
            pixels = self._caught_up(body, view, kind, segments, room)
            if pixels is not None:
                self._welcome(body, pixels, view, segments)
        return hold

    def _has_lost_all(self, view: FrameView) -> bool:
        """Returns True if none of the newcomers that are searched was seen lately: they became the room."""
        sought = self._search.sought
        return bool(sought) and all(view.time_ns - n.seen_ns > _GONE_NS for n in sought)

    def _limit_search(self, *, young: bool) -> None:
        """Sets what is left of the frame's budget for the search; ``young``: the room is new.

        The first search in a new room has a budget of its own, once: who is there at the start is then
        reported in that frame.
        """
        if self._budget.left == np.inf:
            return
        if self._search.busy and young and self._first_budget is not None:
            self._budget, self._first_budget = self._first_budget, None
            return
        share = min(1.0, _FOR_ONE * sum(1 + len(n.unions) for n in self._search.sought))
        self._budget.left = max(_LEAST, share * self._budget.left)

    def _held_pixels(
        self, view: FrameView, segments: Segments, free: list[Candidate], room: RoomModel
    ) -> Bool:
        """Returns the (h, w) pixels of free newcomers, in a young room also fragments beside people."""
        hold = np.zeros(view.z.shape, bool)
        for newcomer in free:
            hold |= newcomer.pixels
        if room.age < YOUNG:
            hold |= _fragments(segments, [n.centre for n in free] + [p.place for p in self._roster.people])
        return hold

    def _due(self, newcomers: list[Candidate], view: FrameView, room: RoomModel) -> list[Candidate]:
        """Returns the newcomers to search for a body now."""
        alone, missing = not self._roster.people, self._roster.missing
        return [
            n
            for n in newcomers
            if not n.bystander and n.due(view.time_ns, room.age, alone=alone, missing=missing)
        ]

    def _start_search(self, due: list[Candidate], view: FrameView) -> None:
        """Begins to search newcomers for bodies, unless as many people are followed as the settings allow."""
        sure = [n for n in due if n.convincing or n.proven]
        most = self.settings.people.most - len(self._roster.people)
        if due and most > 0:
            others = [n for n in due if n not in sure]
            self._search.start(view, sure, others, alone=not self._roster.people, most=most)

    def _caught_up(
        self, body: FoundBody, view: FrameView, kind: UInt8, segments: Segments, room: RoomModel
    ) -> Bool | None:
        """Fits a found body to this frame and returns its (h, w) pixels; None: it is not seen here."""
        newcomer, follower = body.newcomer, body.follower
        if self._search.view is view:
            return body.shown.pixels
        same = _ALIKE < newcomer.area / body.shown.area < 1.0 / _ALIKE
        if same and newcomer.seen_ns == view.time_ns:
            # Where furniture came on or off, its middle says nothing of how the body moved.
            follower.carry((newcomer.centre - body.centre) * _IN_PLAN)
        free = np.where(segments.owner >= 0, ROOM, kind).astype(np.uint8)
        if newcomer.seen_ns == view.time_ns and newcomer.area > body.shown.area / _ALIKE:
            came = newcomer.pixels & ~lying_on(view, [follower.posture], 0.0, BESIDE)
            room.absorb(came & (room.z == 0.0))
            free[came] = ROOM
        pixels = segmented(view, free, [follower.posture]).pixels(0)
        if follower.follow(view, pixels):
            return pixels
        newcomer.failed(view.time_ns)
        return None

    def _welcome(self, body: FoundBody, pixels: Bool, view: FrameView, segments: Segments) -> None:
        """Hands a found body to the roster, and the (h, w) pixels to the person in the segments."""
        person = self._roster.welcome(
            body.newcomer, body.shown, body.follower, view.time_ns, has_floor=view.has_floor
        )
        self._newcomers.drop(body.newcomer)
        segments.owner[pixels & (segments.owner < 0)] = len(self._roster.segmented)
        self._roster.segmented.append(person)


def _fragments(segments: Segments, places: list[Float]) -> Bool:
    """Returns the (h, w) small groups of pixels near (3,) places of people, a shank apart from its thigh."""
    made = np.zeros(segments.labels.shape, bool)
    for group in segments.loose:
        beside = any(float(np.linalg.norm((group.centre - at)[[0, 2]])) < _FRAGMENT_NEAR for at in places)
        if beside and group.area < _FRAGMENT:
            made |= segments.group(group)
    return made
