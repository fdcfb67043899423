"""The search for new people, spread over several frames."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

from enliven.arrays import Float
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.search import ScoredDetection, Search
from enliven_edge.tracking.segment.candidate import Candidate
from enliven_edge.tracking.work_budget import Budget, BudgetedTask


@dataclass(frozen=True)
class DetectedBody:
    """A body that was found.

    Attributes:
        candidate: the candidate that contains the body, in its current state.
        shown: a copy of the candidate from the frame that was searched.
        centre: (3,) centre of the candidate in that frame in metres, world frame.
        follower: the fit to that frame.
    """

    candidate: Candidate
    shown: Candidate
    centre: Float
    follower: Follower


class SpreadSearch:
    """Searches the candidates of one frame for bodies, and spreads the work over several frames.

    Attributes:
        view: the frame in which the search runs.
    """

    def __init__(self, search: Search) -> None:
        self._search = search
        self._task: BudgetedTask[None] | None = None
        self._searched: list[tuple[Candidate, Candidate, Float]] = []
        self._detections: list[ScoredDetection] = []
        self.view: FrameView | None = None

    @property
    def is_busy(self) -> bool:
        """Returns True if a search is in progress."""
        return self._task is not None

    @property
    def searched_candidates(self) -> list[Candidate]:
        """Returns the candidates of the running search."""
        return [candidate for candidate, _, _ in self._searched]

    def stop(self) -> None:
        """Aborts the search in progress."""
        self._task, self._searched, self._detections, self.view = None, [], [], None

    def start(
        self,
        view: FrameView,
        sure: Sequence[Candidate],
        others: Sequence[Candidate],
        *,
        alone: bool,
        max_bodies: int,
    ) -> None:
        """Starts a search in a frame. Arguments are those of :meth:`Search.search_candidates`."""
        self.stop()
        self._searched = [(n, copy.copy(n), n.centre) for n in (*sure, *others)]
        copies = [copied for _, copied, _ in self._searched]
        certain, uncertain = copies[: len(sure)], copies[len(sure) :]
        self._task = BudgetedTask(
            self._search.search_candidates(
                view, certain, uncertain, self._detections, alone=alone, max_bodies=max_bodies
            )
        )
        self.view = view

    def advance(self, budget: Budget) -> list[DetectedBody]:
        """Continues the search. Returns all found bodies when it is done, and an empty list before.

        Bodies are returned together, because people may hold hands. Otherwise the first tracked person would
        be fitted to the pixels of both.
        """
        if self._task is None or not self._task.advance(budget):
            return []
        for candidate, tried, _ in self._searched:
            candidate.copy_search_times(tried)
        bodies = [self._body_of(detection) for detection in self._detections]
        self._task, self._searched = None, []
        return bodies

    def _body_of(self, detection: ScoredDetection) -> DetectedBody:
        candidate, centre = next(
            (n, centre_of_body) for n, copied, centre_of_body in self._searched if copied is detection[0]
        )
        return DetectedBody(candidate, detection[0], centre, detection[1])
