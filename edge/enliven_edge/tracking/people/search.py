"""The search for bodies in blobs that may be new people, and the network's classification of the blobs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from enliven.arrays import Bool
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.visibility import compute_visible_trunk_fraction
from enliven_edge.tracking.segment.candidate import Candidate
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import NETWORK_COST, Budget, Steps

_CERTAIN_PERSON = 0.97
"""Above this probability the network's classification outweighs the shape. Of objects mistaken for people, 95
% stay below 0.43."""


def person_probability(view: FrameView, pixels: Bool) -> float:
    """Returns the network's probability in [0, 1] that the (h, w) pixels are one person."""
    camera, pose = view.camera.camera, view.world_from_camera
    return load_shipped_estimator().estimate(view.z, pixels, camera, pose, None).person_probability


def classify_candidates(candidates: Iterable[Candidate], view: FrameView, budget: Budget) -> None:
    """Runs the network at intervals on candidates with a doubtful shape, within the budget."""
    for candidate in candidates:
        if budget.remaining > 0.0 and candidate.needs_recognition(view.time_ns):
            candidate.is_recognised = person_probability(view, candidate.pixels) > _CERTAIN_PERSON
            budget.remaining -= NETWORK_COST


MAX_TRIES = 3
"""Maximum number of blobs per search while no person is tracked. While people are tracked, their fits need
the time, so the maximum is one."""
_MIN_EXPLAINED_LEAD = 0.05
"""A less likely blob wins only if its fraction of explained points is higher by at least this value."""
_MIN_VISIBLE_TRUNK = 0.6
"""Minimum fraction of the visible trunk of a doubtful body that is on the blob's pixels. Most people behind
objects exceed it.
"""
_MIN_CONFIDENCE = 0.36
"""Minimum mean confidence of the joints of a doubtful body. With less, few of its joints are visible."""
_MAX_HIP_HEIGHT_M = 1.3
"""Maximum height above the floor in metres of a doubtful body's hip centre. Bodies with higher hips are walls
or shelves.
"""
_UNLIKELY_EXPLAINED = 0.8
"""Minimum fraction of explained points, and minimum fraction of visible trunk, for an unlikely blob to be a
person.
"""
_UNLIKELY_CONFIDENCE = 0.68
"""Minimum mean confidence of the joints for an unlikely blob to be a person. It is high, because a false body
does more harm than a late one."""
_MIN_PERSON_PROBABILITY = 0.8
"""Minimum network probability for a body to be a person. Nearly all people exceed 0.85."""
_CERTAIN_EXPLAINED = 0.9
"""Minimum fraction of explained points that compensates for a lower network probability, if a head is visible
above shoulders."""
_SINGLE_PERSON = 0.9
"""Minimum network probability, and minimum fraction of points explained by one body, for the split parts of a
blob to count as one person.
"""
_SAME_PERSON_M = 0.25
"""Minimum distance in metres between the hip centres of two people. Raised arms were once detected as a
second person."""
_MAX_OVERLAP = 0.5
"""If more than this fraction of a blob overlaps a body that was just found, the blob is not searched."""
ScoredDetection = tuple[Candidate, Follower, float]
"""The candidate in which a body was found, its fitted track, and the quality of the fit (up to 1)."""


class Search:
    """Finds bodies in candidates.

    Args:
        fitter: fits the bodies.
        expecting: returns the settings for a candidate at a given time, with the height of the person who
            may return there.
    """

    def __init__(self, fitter: Fitter, expecting: Callable[[Candidate, int], TrackerSettings]) -> None:
        self._fitter, self._expecting = fitter, expecting

    def search_candidates(
        self,
        view: FrameView,
        sure: Sequence[Candidate],
        others: Sequence[Candidate],
        detections: list[ScoredDetection],
        *,
        alone: bool,
        max_bodies: int,
    ) -> Steps[None]:
        """Searches the certain candidates, or else the best of the others. Adds found bodies to
        ``detections``.

        Args:
            view: the frame.
            sure: candidates that are certainly people.
            others: other candidates.
            detections: receives the bodies.
            alone: whether no person is tracked.
            max_bodies: maximum number of bodies.
        """
        yield from self.search_each(
            view, sure[: min(max_bodies, MAX_TRIES if alone else 1)], detections, alone=alone
        )
        if not detections and max_bodies > 0 and (alone or not sure):
            detections += yield from self.find_best_guess(view, others, alone=alone)

    def search_each(
        self,
        view: FrameView,
        candidates: Sequence[Candidate],
        detections: list[ScoredDetection],
        *,
        alone: bool,
    ) -> Steps[None]:
        """Adds each candidate in which a body is found to ``detections``. Set ``alone`` if no person is
        tracked.
        """
        failed_unions: list[Bool] = []
        for candidate in candidates:
            body = (
                None
                if _overlaps_detection(candidate, detections)
                else (yield from self._search_body(view, candidate, failed_unions))
            )
            if (
                body is None
                or not _is_probably_person(view, candidate, *body)
                or _is_duplicate(body[0], detections)
            ):
                candidate.postpone_search(view.time_ns)
            elif (
                candidate.is_tall
                or candidate.is_awaited
                or alone
                or _is_certainly_person(view, candidate, *body)
            ):
                detections.append((candidate, *body))
            else:
                candidate.postpone_search(view.time_ns)

    def _search_body(
        self, view: FrameView, candidate: Candidate, failed_unions: list[Bool]
    ) -> Steps[tuple[Follower, float] | None]:
        """Searches the union of the candidate with parts that were split from it, then the candidate alone.

        Args:
            view: the frame.
            candidate: the blob to search.
            failed_unions: (h, w) unions that were already searched without success. Failed unions of this
                candidate are appended.
        """
        expecting = self._expecting(candidate, view.time_ns)
        for union in candidate.unions if expecting.estimator else []:
            if any(np.array_equal(union, other) for other in failed_unions):
                continue
            failed_unions.append(union)
            probability = person_probability(view, union)
            yield NETWORK_COST
            if probability < _SINGLE_PERSON:
                continue
            body = yield from Follower.detect_incrementally(view, union, expecting, self._fitter, entire=True)
            if body is not None and body[1] > _SINGLE_PERSON:
                candidate.grow(view, union)
                return body
        return (yield from Follower.detect_incrementally(view, candidate.pixels, expecting, self._fitter))

    def find_best_guess(
        self, view: FrameView, due: Sequence[Candidate], *, alone: bool
    ) -> Steps[list[ScoredDetection]]:
        """Returns the body in the likeliest doubtful candidate.

        A less likely candidate wins if its body explains clearly more points.

        The list has at most one item.
        """
        best: list[ScoredDetection] = []
        guesses: list[ScoredDetection] = []
        yield from self.search_each(view, due[: MAX_TRIES if alone else 1], guesses, alone=alone)
        for guess in guesses:
            visible_trunk = compute_visible_trunk_fraction(view, guess[1].posture, guess[0].pixels)
            is_supported = (
                visible_trunk > _MIN_VISIBLE_TRUNK and float(guess[1].confidence.mean()) > _MIN_CONFIDENCE
            )
            is_supported = is_supported and float(guess[1].posture.position[1]) < _MAX_HIP_HEIGHT_M
            if not is_supported or not (alone or guess[0].is_awaited or _is_certainly_person(view, *guess)):
                guess[0].postpone_search(view.time_ns)
            elif not best or guess[2] > best[0][2] + _MIN_EXPLAINED_LEAD:
                best = [guess]
        return best


def _is_probably_person(view: FrameView, candidate: Candidate, follower: Follower, explained: float) -> bool:
    """Returns True if a found body is probably a person and not an object.

    An upright shape is evidence only above a known floor. Above a guessed floor a cupboard may be as tall as
    a person.
    """
    if follower.person_probability > _MIN_PERSON_PROBABILITY:
        return True
    return view.has_floor and candidate.shape.is_upright and explained > _CERTAIN_EXPLAINED


def _overlaps_detection(candidate: Candidate, detections: list[ScoredDetection]) -> bool:
    """Returns True if most of the candidate overlaps a person who was just found."""
    size = max(1, int(candidate.pixels.sum()))
    return any(
        int((candidate.pixels & other.pixels).sum()) > _MAX_OVERLAP * size for other, _, _ in detections
    )


def _is_duplicate(follower: Follower, detections: list[ScoredDetection]) -> bool:
    """Returns True if the same person was just found in another blob of its pixels, at the same place."""
    place = follower.posture.position
    return any(
        float(np.linalg.norm(other.posture.position - place)) < _SAME_PERSON_M for _, other, _ in detections
    )


def _is_certainly_person(view: FrameView, candidate: Candidate, follower: Follower, explained: float) -> bool:
    """Returns True if the evidence for a body is sufficient to accept it in an unlikely blob."""
    visible_trunk = compute_visible_trunk_fraction(view, follower.posture, candidate.pixels)
    return (
        min(explained, visible_trunk) > _UNLIKELY_EXPLAINED
        and float(follower.confidence.mean()) > _UNLIKELY_CONFIDENCE
    )
