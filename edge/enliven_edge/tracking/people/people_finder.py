"""Finds new people among the pixels that do not belong to a tracked person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.people.search import Search, classify_candidates
from enliven_edge.tracking.people.spread_search import DetectedBody, SpreadSearch
from enliven_edge.tracking.people.track_manager import TrackManager
from enliven_edge.tracking.scene.background_kernels import BACKGROUND
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.segment.candidate import MAX_YOUNG_AGE_S, Candidate
from enliven_edge.tracking.segment.candidates import Candidates
from enliven_edge.tracking.segment.furniture import MAX_CLOTHES_DISTANCE_M
from enliven_edge.tracking.segment.segmentation import Segments, pixels_near_bodies, segment_people
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import Budget, frame_budget

_STALE_NS = 200_000_000
"""Nanoseconds without a visible candidate after which its search ends. Gaps by noise are shorter."""
_MIN_FREE_OUTLINE = 0.4
"""Minimum free fraction of a candidate's outline. Pixels of such candidates are not learnt as background."""
_FRAGMENT_AREA_M2 = 0.12
"""Maximum visible area in square metres of a fragment of a person, such as a shank that is disconnected from
its thigh.
"""
_FRAGMENT_DISTANCE_M = 0.6
"""Maximum horizontal distance in metres between a person and a small blob that is a fragment of the
person."""
_MIN_BUDGET = 4
"""Minimum search budget of every frame in coarse fits. It remains even if measuring the candidates used up
the budget.
"""
_TRACKING_BUDGET = 0.6
"""Fraction of the search budget while people are tracked in a known scene. The fits of tracked people take
time, too.
"""
_BLOB_BUDGET = 0.35
"""Fraction of the search budget for each searched blob and for each union of blobs, up to 1 in total. It
delays the detection of a single person by two frames, and makes the slowest frames a quarter faster.
"""
_SHAPE_COST = 1 / 3
"""Cost of measuring the shape of one candidate, in coarse fits."""
_MIN_AREA_RATIO = 0.75
"""Minimum ratio of a candidate's areas in two frames, the smaller to the larger, for the blob to count as
unchanged. A smaller ratio means that furniture was attached to the blob or removed from it."""
_HORIZONTAL = np.array([1.0, 0.0, 1.0])
"""Mask of the horizontal coordinates. A found body follows only the horizontal movement of its candidate's
centre, because the centre's height changes with the visible part."""


class PeopleFinder:
    """Watches candidates until they are convincing, and searches them for bodies over several frames."""

    def __init__(self, settings: TrackerSettings, fitter: Fitter, track_manager: TrackManager) -> None:
        self.settings = settings
        self._tracks = track_manager
        self._candidates = Candidates()
        self._search = SpreadSearch(Search(fitter, track_manager.settings_for_candidate))
        self._budget = Budget(0.0)
        self._first_budget: Budget | None = frame_budget(settings.search.first_fits, None)

    @property
    def bystanders(self) -> int:
        """Returns the number of visible people who are not performers."""
        return self._candidates.bystanders

    def clear(self) -> None:
        """Forgets all candidates and aborts the search. The next search has the larger budget of a first
        search.
        """
        self._candidates.clear()
        self._search.stop()
        self._first_budget = frame_budget(self.settings.search.first_fits, None)

    def set_budget(self, budget: Budget) -> None:
        """Sets the budget of the search in this frame."""
        self._budget = budget

    def reject(self, place: Float, time_ns: int) -> None:
        """Rejects candidates near ``place`` (3,) for a while, because an object there was mistaken for a
        person.
        """
        self._candidates.reject(place, time_ns)

    def find_searched_pixels(self, view: FrameView) -> Bool:
        """Returns the (h, w) pixels of the candidates that are being searched."""
        searched = np.zeros(view.z.shape, bool)
        for candidate in self._search.searched_candidates:
            if candidate.seen_ns == view.time_ns:
                searched |= candidate.pixels
        return searched

    def find(
        self,
        view: FrameView,
        kind: UInt8,
        segments: Segments,
        background: BackgroundModel,
        *,
        believe: bool = True,
    ) -> Bool:
        """Finds people among the unassigned pixels. Returns the (h, w) pixels that may become a person.

        Args:
            view: the frame.
            kind: (h, w) from :meth:`BackgroundModel.classify`.
            segments: of this frame; a person who is found gets its own pixels in it.
            background: the background model.
            believe: whether new people may be accepted; False while the sensor may be moving.
        """
        candidates = self._candidates.update(
            view,
            kind,
            segments,
            self._tracks.admits,
            self._tracks.expects_return,
            young=background.age < MAX_YOUNG_AGE_S,
        )
        if self._tracks.people and background.age > MAX_YOUNG_AGE_S:
            self._budget.remaining *= _TRACKING_BUDGET
        self._budget.remaining -= _SHAPE_COST * len(candidates)
        if self.settings.estimator:
            classify_candidates(candidates, view, self._budget)
        free = [
            n
            for n in candidates
            if n.shape.free_fraction > _MIN_FREE_OUTLINE or n in self._search.searched_candidates
        ]
        hold = self._find_held_pixels(view, segments, free, background)
        due = self._find_due(candidates, view, background)
        if not believe or self._has_lost_all(view):
            self._search.stop()
        elif not self._search.is_busy:
            self._start_search(due, view)
        self._limit_search(young=background.age < MAX_YOUNG_AGE_S)
        for body in self._search.advance(self._budget):
            pixels = self._move_to_frame(body, view, kind, segments, background)
            if pixels is not None:
                self._add_body(body, pixels, view, segments)
        return hold

    def _has_lost_all(self, view: FrameView) -> bool:
        """Returns True if no searched candidate was visible recently, because all candidates became
        background.
        """
        searched = self._search.searched_candidates
        return bool(searched) and all(view.time_ns - n.seen_ns > _STALE_NS for n in searched)

    def _limit_search(self, *, young: bool) -> None:
        """Sets the remaining budget of the frame for the search. ``young`` is True if the background model is
        new.

        The first search in a new scene has a larger budget of its own. So people who are present at the
        start are reported in the first frame.
        """
        if self._budget.remaining == np.inf:
            return
        if self._search.is_busy and young and self._first_budget is not None:
            self._budget, self._first_budget = self._first_budget, None
            return
        share = min(1.0, _BLOB_BUDGET * sum(1 + len(n.unions) for n in self._search.searched_candidates))
        self._budget.remaining = max(_MIN_BUDGET, share * self._budget.remaining)

    def _find_held_pixels(
        self, view: FrameView, segments: Segments, free: list[Candidate], background: BackgroundModel
    ) -> Bool:
        """Returns the pixels (h, w) of free candidates, which must not be learnt as background.

        While the background model is young, the result includes fragments next to people.
        """
        hold = np.zeros(view.z.shape, bool)
        for candidate in free:
            hold |= candidate.pixels
        if background.age < MAX_YOUNG_AGE_S:
            hold |= _find_fragments(
                segments, [n.centre for n in free] + [p.place for p in self._tracks.people]
            )
        return hold

    def _find_due(
        self, candidates: list[Candidate], view: FrameView, background: BackgroundModel
    ) -> list[Candidate]:
        """Returns the candidates to search for a body now."""
        has_no_people, missing = not self._tracks.people, self._tracks.has_missing_people
        return [
            n
            for n in candidates
            if not n.is_bystander
            and n.is_due(view.time_ns, background.age, alone=has_no_people, missing=missing)
        ]

    def _start_search(self, due: list[Candidate], view: FrameView) -> None:
        """Starts to search candidates for bodies, unless the maximum number of people is already tracked."""
        sure = [n for n in due if n.is_convincing or n.is_confirmed]
        free_count = self.settings.people.most - len(self._tracks.people)
        if due and free_count > 0:
            others = [n for n in due if n not in sure]
            self._search.start(view, sure, others, alone=not self._tracks.people, max_bodies=free_count)

    def _move_to_frame(
        self,
        body: DetectedBody,
        view: FrameView,
        kind: UInt8,
        segments: Segments,
        background: BackgroundModel,
    ) -> Bool | None:
        """Fits a found body to this frame and returns its (h, w) pixels. Returns None if it is not visible in
        this frame.
        """
        candidate, follower = body.candidate, body.follower
        if self._search.view is view:
            return body.shown.pixels
        same = _MIN_AREA_RATIO < candidate.area / body.shown.area < 1.0 / _MIN_AREA_RATIO
        if same and candidate.seen_ns == view.time_ns:
            # The area is nearly unchanged, so the body moved like the centre of its pixels. If furniture had
            # been attached or removed, the centre would have moved without the body.
            follower.translate((candidate.centre - body.centre) * _HORIZONTAL)
        free = np.where(segments.owner >= 0, BACKGROUND, kind).astype(np.uint8)
        if candidate.seen_ns == view.time_ns and candidate.area > body.shown.area / _MIN_AREA_RATIO:
            came = candidate.pixels & ~pixels_near_bodies(
                view, [follower.posture], 0.0, MAX_CLOTHES_DISTANCE_M
            )
            background.absorb(came & (background.z == 0.0))
            free[came] = BACKGROUND
        pixels = segment_people(view, free, [follower.posture]).pixels(0)
        if follower.follow(view, pixels):
            return pixels
        candidate.postpone_search(view.time_ns)
        return None

    def _add_body(self, body: DetectedBody, pixels: Bool, view: FrameView, segments: Segments) -> None:
        """Starts a track for a found body, and assigns the (h, w) pixels to it in the segments."""
        person = self._tracks.start_track(
            body.candidate, body.shown, body.follower, view.time_ns, has_floor=view.has_floor
        )
        self._candidates.drop(body.candidate)
        segments.owner[pixels & (segments.owner < 0)] = len(self._tracks.segmented)
        self._tracks.segmented.append(person)


def _find_fragments(segments: Segments, places: list[Float]) -> Bool:
    """Returns the (h, w) pixels of small blobs near the (3,) places of people, such as a disconnected
    shank.
    """
    fragments = np.zeros(segments.labels.shape, bool)
    for group in segments.loose:
        beside = any(
            float(np.linalg.norm((group.centre - place)[[0, 2]])) < _FRAGMENT_DISTANCE_M for place in places
        )
        if beside and group.area < _FRAGMENT_AREA_M2:
            fragments |= segments.group(group)
    return fragments
