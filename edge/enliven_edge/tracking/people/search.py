"""The search for bodies in blobs that may be new people, and the network's classification of the blobs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from enliven.arrays import Bool
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.visibility import visible_trunk_fraction
from enliven_edge.tracking.segment import Candidate
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import NETWORK_COST, Budget, Steps

_CERTAIN_PERSON = 0.97
"""Probability above which the network's classification outweighs the shape. Of objects found by mistake 95 %
stay below 0.43."""


def person_probability(view: FrameView, pixels: Bool) -> float:
    """Returns the network's probability in [0, 1] that the (h, w) pixels are one person."""
    camera, pose = view.camera.camera, view.world_from_camera
    return shipped_estimator().estimate(view.z, pixels, camera, pose, None).person_probability


def classify_candidates(newcomers: Iterable[Candidate], view: FrameView, budget: Budget) -> None:
    """Runs the network at intervals on candidates with a doubtful shape, within the budget."""
    for newcomer in newcomers:
        if budget.left > 0.0 and newcomer.needs_recognition(view.time_ns):
            newcomer.recognised = person_probability(view, newcomer.pixels) > _CERTAIN_PERSON
            budget.left -= NETWORK_COST


MAX_TRIES = 3
"""Blobs per search while no person is tracked. Otherwise it is one, because the fits need the time."""
_MIN_EXPLAINED_LEAD = 0.05
"""Minimum lead of a less likely blob over a likelier one, as a fraction of explained points."""
_MIN_VISIBLE_TRUNK = 0.6
"""Minimum fraction of a guessed body's trunk on the blob's pixels. Most people behind objects exceed it."""
_MIN_CONFIDENCE = 0.36
"""Minimum mean confidence of the joints of a guessed body. With less, few of its joints are visible."""
_MAX_HIP_HEIGHT_M = 1.3
"""Maximum height above the floor in metres of a guessed body's hip centre. A higher one is a wall or a
shelf."""
_UNLIKELY_EXPLAINED = 0.8
"""Minimum fraction of explained points, and of visible trunk, for an unlikely blob to be a person."""
_UNLIKELY_CONFIDENCE = 0.68
"""Minimum mean confidence of the joints for the same decision. A false body does more harm than a late
one."""
_MIN_PERSON_PROBABILITY = 0.8
"""Minimum network probability for a body to be a person's. Nearly all people exceed 0.85."""
_CERTAIN_EXPLAINED = 0.9
"""Fraction of explained points that compensates for a lower probability, if a head is visible above
shoulders."""
_SINGLE_PERSON = 0.9
"""Minimum probability of being one person, and fraction explained by one body, for split parts to be one
person."""
_SAME_PERSON_M = 0.25
"""Distance in metres between two hip centres below which both belong to one person. Raised arms were found as
a second person."""
_MAX_OVERLAP = 0.5
"""If more than this fraction of a blob lies on a body that was just found, the blob is not searched."""
ScoredDetection = tuple[Candidate, Follower, float]
"""The candidate in which a body was found, its fit, and how well that explains the pixels (up to 1)."""


class Search:
    """Finds bodies in candidates.

    Args:
        fitter: fits the bodies.
        expecting: returns the settings for a candidate at a time, for example with the height of an awaited
            person.
    """

    def __init__(self, fitter: Fitter, expecting: Callable[[Candidate, int], TrackerSettings]) -> None:
        self._fitter, self._expecting = fitter, expecting

    def looked(
        self,
        view: FrameView,
        sure: Sequence[Candidate],
        others: Sequence[Candidate],
        made: list[ScoredDetection],
        *,
        alone: bool,
        most: int,
    ) -> Steps[None]:
        """Adds bodies to ``made``: those of candidates that are certainly people, or else the best body of
        the other candidates.

        Args:
            view: the frame.
            sure: candidates that are certainly people.
            others: other candidates.
            made: receives the bodies.
            alone: whether no person is tracked.
            most: maximum number of bodies.
        """
        yield from self.found(view, sure[: min(most, MAX_TRIES if alone else 1)], made, alone=alone)
        if not made and most > 0 and (alone or not sure):
            made += yield from self.best_guess(view, others, alone=alone)

    def found(
        self, view: FrameView, newcomers: Sequence[Candidate], made: list[ScoredDetection], *, alone: bool
    ) -> Steps[None]:
        """Adds the candidates in which a body is found to ``made``. ``alone``: no person is tracked."""
        vain: list[Bool] = []
        for newcomer in newcomers:
            body = (
                None
                if _overlaps_found(newcomer, made)
                else (yield from self._search_body(view, newcomer, vain))
            )
            if body is None or not _likely(view, newcomer, *body) or _is_found_already(body[0], made):
                newcomer.failed(view.time_ns)
            elif newcomer.tall or newcomer.awaited or alone or _certain(view, newcomer, *body):
                made.append((newcomer, *body))
            else:
                newcomer.failed(view.time_ns)

    def _search_body(
        self, view: FrameView, newcomer: Candidate, failed_unions: list[Bool]
    ) -> Steps[tuple[Follower, float] | None]:
        """Searches the candidate joined with parts that were split from it, then the candidate alone.

        Args:
            view: the frame.
            newcomer: the candidate.
            failed_unions: (h, w) unions that were already searched without success. Those of this candidate
                are added.
        """
        expecting = self._expecting(newcomer, view.time_ns)
        for union in newcomer.unions if expecting.estimator else []:
            if any(np.array_equal(union, other) for other in failed_unions):
                continue
            failed_unions.append(union)
            likely = person_probability(view, union)
            yield NETWORK_COST
            if likely < _SINGLE_PERSON:
                continue
            body = yield from Follower.sought(view, union, expecting, self._fitter, entire=True)
            if body is not None and body[1] > _SINGLE_PERSON:
                newcomer.grow(view, union)
                return body
        return (yield from Follower.sought(view, newcomer.pixels, expecting, self._fitter))

    def best_guess(
        self, view: FrameView, due: Sequence[Candidate], *, alone: bool
    ) -> Steps[list[ScoredDetection]]:
        """Returns the likeliest of some doubtful candidates, or one that is explained clearly better.

        It returns at most one.
        """
        best: list[ScoredDetection] = []
        guesses: list[ScoredDetection] = []
        yield from self.found(view, due[: MAX_TRIES if alone else 1], guesses, alone=alone)
        for guess in guesses:
            shown = visible_trunk_fraction(view, guess[1].posture, guess[0].pixels)
            borne_out = shown > _MIN_VISIBLE_TRUNK and float(guess[1].confidence.mean()) > _MIN_CONFIDENCE
            borne_out = borne_out and float(guess[1].posture.position[1]) < _MAX_HIP_HEIGHT_M
            if not borne_out or not (alone or guess[0].awaited or _certain(view, *guess)):
                guess[0].failed(view.time_ns)
            elif not best or guess[2] > best[0][2] + _MIN_EXPLAINED_LEAD:
                best = [guess]
        return best


def _likely(view: FrameView, newcomer: Candidate, follower: Follower, explained: float) -> bool:
    """Returns True if the pixels of a found body are likely a person and not an object.

    An upright shape counts only above a known floor. Above a guessed floor a cupboard may be as tall as a
    person.
    """
    if follower.person_probability > _MIN_PERSON_PROBABILITY:
        return True
    return view.has_floor and newcomer.shape.upright and explained > _CERTAIN_EXPLAINED


def _overlaps_found(newcomer: Candidate, found: list[ScoredDetection]) -> bool:
    """Returns True if most of the candidate belongs to a person that was just found."""
    size = max(1, int(newcomer.pixels.sum()))
    return any(int((newcomer.pixels & other.pixels).sum()) > _MAX_OVERLAP * size for other, _, _ in found)


def _is_found_already(follower: Follower, found: list[ScoredDetection]) -> bool:
    """Returns True if a person was just found at the same place, in another piece of the same person."""
    place = follower.posture.position
    return any(
        float(np.linalg.norm(other.posture.position - place)) < _SAME_PERSON_M for _, other, _ in found
    )


def _certain(view: FrameView, newcomer: Candidate, follower: Follower, explained: float) -> bool:
    """Returns True if the evidence for a body is sufficient to accept it in an unlikely blob."""
    shown = visible_trunk_fraction(view, follower.posture, newcomer.pixels)
    return (
        min(explained, shown) > _UNLIKELY_EXPLAINED
        and float(follower.confidence.mean()) > _UNLIKELY_CONFIDENCE
    )
