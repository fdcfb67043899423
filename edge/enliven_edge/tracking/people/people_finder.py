"""Finds new people among the pixels that do not belong to a tracked person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.search import Search, classify_candidates
from enliven_edge.tracking.people.spread_search import DetectedBody, SpreadSearch
from enliven_edge.tracking.people.track_manager import TrackManager
from enliven_edge.tracking.scene import BACKGROUND, BackgroundModel
from enliven_edge.tracking.segment import (
    MAX_CLOTHES_DISTANCE_M,
    MAX_YOUNG_AGE_S,
    Candidate,
    Candidates,
    Segments,
    pixels_near_bodies,
    segment_people,
)
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import Budget, frame_budget

_STALE_NS = 200_000_000
"""Time after which an unseen candidate is no longer searched, in nanoseconds. Noise lasts for a shorter
time."""
_MIN_FREE_OUTLINE = 0.4
"""Minimum free fraction of a candidate's outline for its pixels to be kept out of the background model."""
_FRAGMENT_AREA_M2 = 0.12
"""Maximum visible area in square metres of a fragment of a person: a shank seen apart from its thigh."""
_FRAGMENT_DISTANCE_M = 0.6
"""Maximum horizontal distance in metres between a person and a small blob that is a fragment of the
person."""
_MIN_BUDGET = 4
"""Minimum search budget of every frame in coarse fits, however many candidates are measured in it."""
_TRACKING_BUDGET = 0.6
"""Fraction of the search budget while people are tracked in a known scene. Their fits take time too."""
_BLOB_BUDGET = 0.35
"""Fraction of the search budget for each searched blob, and for each union of its parts, up to 1. So a single
person appears two frames later, and the slowest frames are a quarter faster."""
_SHAPE_COST = 1 / 3
"""Cost of measuring the shape of one candidate, in coarse fits."""
_MIN_AREA_RATIO = 0.75
"""Minimum ratio of a candidate's areas in two frames to be the same blob. Below it furniture was attached or
removed."""
_HORIZONTAL = np.array([1.0, 0.0, 1.0])
"""The horizontal part of a step of a candidate's centre, which moves its body. Its height changes with its
visible part."""


class PeopleFinder:
    """Watches candidates until they are convincing, and searches them for bodies over several frames."""

    def __init__(self, settings: TrackerSettings, fitter: Fitter, track_manager: TrackManager) -> None:
        self.settings = settings
        self._tracks = track_manager
        self._newcomers = Candidates()
        self._search = SpreadSearch(Search(fitter, track_manager.expecting))
        self._budget = Budget(0.0)
        self._first_budget: Budget | None = frame_budget(settings.search.first_fits, None)

    @property
    def bystanders(self) -> int:
        """Returns the number of visible people that are not performers."""
        return self._newcomers.bystanders

    def clear(self) -> None:
        """Forgets all candidates and aborts the search.

        The next search in a new scene counts as a first one.
        """
        self._newcomers.clear()
        self._search.stop()
        self._first_budget = frame_budget(self.settings.search.first_fits, None)

    def allot(self, budget: Budget) -> None:
        """Sets the budget of the search in this frame."""
        self._budget = budget

    def refuse(self, place: Float, time_ns: int) -> None:
        """Treats whatever stands at a (3,) place as an object, because a body was found there by mistake."""
        self._newcomers.refuse(place, time_ns)

    def searched_pixels(self, view: FrameView) -> Bool:
        """Returns the (h, w) pixels of the candidates that are being searched."""
        searched = np.zeros(view.z.shape, bool)
        for newcomer in self._search.sought:
            if newcomer.seen_ns == view.time_ns:
                searched |= newcomer.pixels
        return searched

    def find(
        self, view: FrameView, kind: UInt8, segments: Segments, room: BackgroundModel, *, believe: bool = True
    ) -> Bool:
        """Finds people among the unassigned pixels. Returns the (h, w) pixels that may become a person.

        Args:
            view: the frame.
            kind: (h, w) from :meth:`BackgroundModel.classify`.
            segments: of this frame; a person that is found gets its own pixels in it.
            room: the background model.
            believe: False in a frame of a sensor that may be moving: no new person is accepted then.
        """
        newcomers = self._newcomers.update(
            view,
            kind,
            segments,
            self._tracks.admits,
            self._tracks.awaits,
            young=room.age < MAX_YOUNG_AGE_S,
        )
        if self._tracks.people and room.age > MAX_YOUNG_AGE_S:
            self._budget.left *= _TRACKING_BUDGET
        self._budget.left -= _SHAPE_COST * len(newcomers)
        if self.settings.estimator:
            classify_candidates(newcomers, view, self._budget)
        free = [n for n in newcomers if n.shape.free > _MIN_FREE_OUTLINE or n in self._search.sought]
        hold = self._held_pixels(view, segments, free, room)
        due = self._find_due(newcomers, view, room)
        if not believe or self._has_lost_all(view):
            self._search.stop()
        elif not self._search.busy:
            self._start_search(due, view)
        self._limit_search(young=room.age < MAX_YOUNG_AGE_S)
        for body in self._search.go_on(self._budget):
            pixels = self._move_to_frame(body, view, kind, segments, room)
            if pixels is not None:
                self._add_body(body, pixels, view, segments)
        return hold

    def _has_lost_all(self, view: FrameView) -> bool:
        """Returns True if none of the searched candidates was visible recently: they became background."""
        sought = self._search.sought
        return bool(sought) and all(view.time_ns - n.seen_ns > _STALE_NS for n in sought)

    def _limit_search(self, *, young: bool) -> None:
        """Sets the rest of the frame's budget for the search. ``young``: the background model is new.

        The first search in a new scene has its own budget, once. So people that are present at the start are
        reported in that frame.
        """
        if self._budget.left == np.inf:
            return
        if self._search.busy and young and self._first_budget is not None:
            self._budget, self._first_budget = self._first_budget, None
            return
        share = min(1.0, _BLOB_BUDGET * sum(1 + len(n.unions) for n in self._search.sought))
        self._budget.left = max(_MIN_BUDGET, share * self._budget.left)

    def _held_pixels(
        self, view: FrameView, segments: Segments, free: list[Candidate], room: BackgroundModel
    ) -> Bool:
        """Returns the (h, w) pixels of free candidates.

        While the background model is young it adds fragments next to people.
        """
        hold = np.zeros(view.z.shape, bool)
        for newcomer in free:
            hold |= newcomer.pixels
        if room.age < MAX_YOUNG_AGE_S:
            hold |= _find_fragments(
                segments, [n.centre for n in free] + [p.place for p in self._tracks.people]
            )
        return hold

    def _find_due(
        self, newcomers: list[Candidate], view: FrameView, room: BackgroundModel
    ) -> list[Candidate]:
        """Returns the candidates to search for a body now."""
        alone, missing = not self._tracks.people, self._tracks.missing
        return [
            n
            for n in newcomers
            if not n.bystander and n.due(view.time_ns, room.age, alone=alone, missing=missing)
        ]

    def _start_search(self, due: list[Candidate], view: FrameView) -> None:
        """Starts to search candidates for bodies, unless the maximum number of people is already tracked."""
        sure = [n for n in due if n.convincing or n.proven]
        most = self.settings.people.most - len(self._tracks.people)
        if due and most > 0:
            others = [n for n in due if n not in sure]
            self._search.start(view, sure, others, alone=not self._tracks.people, most=most)

    def _move_to_frame(
        self, body: DetectedBody, view: FrameView, kind: UInt8, segments: Segments, room: BackgroundModel
    ) -> Bool | None:
        """Fits a found body to this frame and returns its (h, w) pixels. None if it is not visible here."""
        newcomer, follower = body.newcomer, body.follower
        if self._search.view is view:
            return body.shown.pixels
        same = _MIN_AREA_RATIO < newcomer.area / body.shown.area < 1.0 / _MIN_AREA_RATIO
        if same and newcomer.seen_ns == view.time_ns:
            # The area is nearly unchanged, so the centre shows how the body moved. If furniture was attached
            # to the body or removed from it, the centre would not show this.
            follower.carry((newcomer.centre - body.centre) * _HORIZONTAL)
        free = np.where(segments.owner >= 0, BACKGROUND, kind).astype(np.uint8)
        if newcomer.seen_ns == view.time_ns and newcomer.area > body.shown.area / _MIN_AREA_RATIO:
            came = newcomer.pixels & ~pixels_near_bodies(
                view, [follower.posture], 0.0, MAX_CLOTHES_DISTANCE_M
            )
            room.absorb(came & (room.z == 0.0))
            free[came] = BACKGROUND
        pixels = segment_people(view, free, [follower.posture]).pixels(0)
        if follower.follow(view, pixels):
            return pixels
        newcomer.failed(view.time_ns)
        return None

    def _add_body(self, body: DetectedBody, pixels: Bool, view: FrameView, segments: Segments) -> None:
        """Adds a found body to the tracks, and assigns the (h, w) pixels to the person in the segments."""
        person = self._tracks.welcome(
            body.newcomer, body.shown, body.follower, view.time_ns, has_floor=view.has_floor
        )
        self._newcomers.drop(body.newcomer)
        segments.owner[pixels & (segments.owner < 0)] = len(self._tracks.segmented)
        self._tracks.segmented.append(person)


def _find_fragments(segments: Segments, places: list[Float]) -> Bool:
    """Returns the (h, w) small blobs near (3,) places of people, such as a shank apart from its thigh."""
    fragments = np.zeros(segments.labels.shape, bool)
    for group in segments.loose:
        beside = any(
            float(np.linalg.norm((group.centre - at)[[0, 2]])) < _FRAGMENT_DISTANCE_M for at in places
        )
        if beside and group.area < _FRAGMENT_AREA_M2:
            fragments |= segments.group(group)
    return fragments
