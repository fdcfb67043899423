"""Tracks all people in view: divides the pixels of each frame among them, fits them, and drops lost ones."""

from __future__ import annotations

from collections import deque
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int, UInt8
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.frame.reduction import is_same, known_pixels
from enliven_edge.tracking.people.follower import MIN_PERSON_PIXELS, Follower
from enliven_edge.tracking.people.people_finder import PeopleFinder
from enliven_edge.tracking.people.person import Person
from enliven_edge.tracking.people.track_manager import Duplicates, TrackManager
from enliven_edge.tracking.people.visibility import compute_occluded_fractions
from enliven_edge.tracking.segment.segmentation import Segments, segment_people
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import frame_budget

_MAX_HIDDEN_S = 4.0
"""Seconds for which an occluded person is kept before the track ends. Then the person is searched again."""
_HIDDEN_OCCLUSION = 0.55
"""Maximum occluded fraction of a visible person. Above it the person counts as hidden, because few visible
pixels seldom give a good fit."""
_LEFT_IMAGE_FRACTION = 0.85
"""If more than this fraction of a body is outside the image and few pixels remain, the person has left and is
not hidden."""
_HIDDEN_PENALTY_M = 0.06
"""Metres added to a pixel's distance from a hidden person, because visible people have priority."""
_COVERED_DEPTH = 0.01
"""Minimum fraction of pixels with depth. Below it the lens is covered. A covered lens still measures a few
pixels."""
_LONG_BLIND_NS = 250_000_000
"""Duration in nanoseconds of a covered or frozen image after which all people are searched again, because
they may have moved in the meantime."""
_DOUBT_NS = 4_000_000_000
"""Nanoseconds within which a doubtful person must move; otherwise it is dropped. Few people stand still that
long."""
_WHOLE_BODY_TOLERANCE = 0.12
"""The whole body counts as visible if at most this fraction of it is occluded or outside the image: a hand or
a foot.
"""
_ZONE_MARGIN_M = 0.15
"""A performer has left the zone at this distance outside it in metres, so that people at the border do not
flicker."""


@dataclass
class _Visibility:
    """The visibility of a person in a frame.

    Attributes:
        person: the person.
        expected: the posture predicted for the frame.
        pixels: (h, w) the person's pixels.
        is_hidden: whether another object hides the person, or too few pixels are left.
        is_whole: whether the whole body is visible.
        is_fitted: whether the person was fitted in this frame.
    """

    person: Person
    expected: Posture
    pixels: Bool
    is_hidden: bool
    is_whole: bool
    is_fitted: bool = False


class MultiPersonTracker:
    """Tracks several people, and finds new ones among the unassigned pixels.

    Attributes:
        settings: the settings.
        track_manager: the people, and which of them may perform.
        finder: finds new people, after :meth:`follow` in each frame.
    """

    def __init__(self, settings: TrackerSettings, fitter: Fitter) -> None:
        self.settings = settings
        self.track_manager = TrackManager(settings)
        self.finder = PeopleFinder(settings, fitter, self.track_manager)
        self._fitter = fitter
        self._duplicates = Duplicates()
        self._turn = 0
        self._blind_ns: int | None = None
        self._before: Float | None = None
        self._before_ns: int | None = None
        self._threads: ThreadPoolExecutor | None = None

    @property
    def people(self) -> list[Person]:
        """Returns the tracked people, in the order of their detection."""
        return self.track_manager.people

    def segment_ids(self) -> Int:
        """Returns (K,) ids of the people by their index in the last frame's segments."""
        return np.array([p.id for p in self.track_manager.segmented], np.int64)

    def find_moved_ids(self) -> Int:
        """Returns (K,) ids like :meth:`segment_ids`, with -1 for each person who has never moved."""
        return np.array([p.id if p.has_moved else -1 for p in self.track_manager.segmented], np.int64)

    def forget(self) -> None:
        """Drops all people. A person who comes next, or is still present, gets a new id."""
        self.track_manager.forget()
        self.finder.clear()

    def sensor_moved(self, time_ns: int) -> None:
        """Drops all people until they are found again.

        The sensor was moved, so their positions are invalid.
        """
        self.track_manager.sensor_moved(time_ns)
        self.finder.clear()

    def search_again(self, time_ns: int) -> None:
        """Drops all people until they are found again at their positions. Use it if the sensor was not
        moved.
        """
        self.track_manager.leave_all(time_ns)
        self.finder.clear()

    def follow(self, view: FrameView, kind: UInt8) -> Segments:
        """Fits the tracked people. Returns the person at each pixel of the frame."""
        self._set_budget(view.time_ns)
        dark = known_pixels(view.z) < _COVERED_DEPTH * view.z.size
        frozen = self._before is not None and is_same(view.z, self._before)
        self._before = view.z
        if self._blind_ns is None and (dark or frozen):
            self._blind_ns = view.time_ns
        if dark:
            return self._wait_while_covered(view, kind)
        handicap = np.array([_HIDDEN_PENALTY_M if p.is_hidden else 0.0 for p in self.people])
        expected = [p.predict_posture() for p in self.people]
        segments = segment_people(view, kind, expected, handicap)
        self.track_manager.segmented = list(self.people)
        if self._blind_ns is not None and not frozen:
            if view.time_ns - self._blind_ns > _LONG_BLIND_NS:
                self._redetect_all(self._blind_ns, view, segments)
                expected = [p.predict_posture() for p in self.people]
            self._blind_ns = None
        fitted = self._choose_fitted()
        visibilities = [
            self._estimate_visibility(p, expected[k], k, view, segments)
            for k, p in enumerate(self.track_manager.segmented)
        ]
        self._fit_all(
            [v for v in visibilities if not v.is_hidden and (v.person in fitted or v.person.is_hidden)], view
        )
        for visibility in visibilities:
            self._update_status(visibility, view)
        for second in self._duplicates.find(self.people):
            self.track_manager.drop_duplicate(second)
        self.track_manager.decide_identities(view.time_ns)
        self.track_manager.gallery.forget_old(view.time_ns, self.track_manager.lock.ids or frozenset())
        return segments

    def _set_budget(self, time_ns: int) -> None:
        """Sets the budget of this frame for the search for new people."""
        elapsed = None if self._before_ns is None else (time_ns - self._before_ns) * 1e-9
        self._before_ns = time_ns
        self.finder.set_budget(frame_budget(self.settings.search.fits_per_frame, elapsed))

    def _wait_while_covered(self, view: FrameView, kind: UInt8) -> Segments:
        """Handles a frame with a covered lens: treats all people as hidden."""
        for person in list(self.people):
            person.hide(view.time_ns)
            if person.seconds_hidden(view.time_ns) > _MAX_HIDDEN_S:
                self.track_manager.leave(person, view.time_ns)
        self.track_manager.segmented = list(self.people)
        return segment_people(view, kind, [])

    def _redetect_all(self, blind_ns: int, view: FrameView, segments: Segments) -> None:
        """Searches for every person after a covered or frozen image that began at ``blind_ns``."""
        for k, person in enumerate(self.track_manager.segmented):
            person.seen_ns = min(person.seen_ns, blind_ns)
            self._redetect(person, k, view, segments)

    def _redetect(self, person: Person, k: int, view: FrameView, segments: Segments) -> None:
        """Detects a person again, in any posture, around its last position after a time without usable
        images.
        """
        pixels = segments.pixels(k)
        reach = person.search_radius(view.time_ns)
        for group in segments.loose:
            places = [p.place for p in self.track_manager.segmented]
            distances = [float(np.linalg.norm((group.centre - place)[[0, 2]])) for place in places]
            if distances[k] < reach and distances[k] == min(distances):
                pixels = pixels | segments.group(group)
        detection = Follower.detect(
            view, pixels, self.track_manager.settings_for_person(person.measurements), self._fitter
        )
        if detection is not None:
            person.replace_fit(detection[0], view.time_ns)
            segments.owner[pixels], segments.labels[pixels] = k, 0
            segments.counts[k] = np.count_nonzero(pixels)

    def _choose_fitted(self) -> list[Person]:
        """Returns the people to fit in this frame: the first ones always, the others in turn."""
        visible_people = [p for p in self.people if p.hidden_ns is None]
        count = self.settings.people.full_rate
        always, others = visible_people[:count], visible_people[count:]
        if others:
            self._turn += 1
            always = [*always, others[self._turn % len(others)]]
        return always

    def _estimate_visibility(
        self, person: Person, expected: Posture, k: int, view: FrameView, segments: Segments
    ) -> _Visibility:
        """Estimates from the expected posture how much of a person a frame shows.

        ``k`` is the person's index in the segments.
        """
        covered, outside = compute_occluded_fractions(view, expected, segments.owner, k)
        has_few_pixels = bool(segments.counts[k] < 2 * MIN_PERSON_PIXELS)
        behind = covered > _HIDDEN_OCCLUSION or (
            has_few_pixels and covered > 0.5 * _HIDDEN_OCCLUSION and outside < _LEFT_IMAGE_FRACTION
        )
        whole = covered < _WHOLE_BODY_TOLERANCE and outside < _WHOLE_BODY_TOLERANCE
        return _Visibility(
            person,
            expected,
            segments.pixels(k),
            bool(behind or (person.is_hidden and has_few_pixels)),
            bool(whole),
        )

    def _fit_all(self, visible: list[_Visibility], view: FrameView) -> None:
        """Fits people in parallel threads.

        The fits are independent, so their order makes no difference. The calling thread fits as well, because
        waking another thread takes longer than starting at once.
        """
        waiting = deque(visible)

        def fit() -> None:
            while True:
                try:
                    track = waiting.popleft()
                except IndexError:  # Another thread has taken the last item.
                    return
                track.person.follow(
                    view, track.pixels, is_fully_visible=track.is_whole, expected=track.expected
                )
                track.is_fitted = True

        beside = min(len(visible), self.settings.people.threads) - 1
        if beside > 0 and self._threads is None:
            self._threads = ThreadPoolExecutor(self.settings.people.threads - 1, "fit")
        others = [self._threads.submit(fit) for _ in range(beside)] if self._threads is not None else []
        try:
            fit()
        finally:  # Wait for the other threads, because none of them may continue into the next frame.
            wait(others)
        for other in others:
            other.result()

    def _update_status(self, visibility: _Visibility, view: FrameView) -> None:
        """Decides after a frame whether a person is still tracked, is hidden, has left, or is an object."""
        person = visibility.person
        if visibility.is_hidden and person.is_too_weak_to_hide:
            self._reject(person, view.time_ns)
        elif visibility.is_hidden:
            person.hide(view.time_ns)
        elif visibility.is_fitted:
            if person.follower.lost or not self.track_manager.zone.contains(person.place, _ZONE_MARGIN_M):
                self.track_manager.leave(person, view.time_ns)
            elif person.is_probably_object or (
                person.is_doubtful and not 0 <= view.time_ns - person.found_ns < _DOUBT_NS
            ):
                self._reject(person, view.time_ns)
        else:
            person.move_with_pixels(view, visibility.pixels)
        if person.seconds_hidden(view.time_ns) > _MAX_HIDDEN_S and person in self.people:
            self.track_manager.leave(person, view.time_ns)

    def _reject(self, person: Person, time_ns: int) -> None:
        """Drops a body that never moved and does not look like a person: an object."""
        self.people.remove(person)
        self.finder.reject(person.place, time_ns)
