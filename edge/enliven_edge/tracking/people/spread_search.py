"""The search for new people, spread over several frames."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

from enliven.arrays import Float
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.search import ScoredDetection, Search
from enliven_edge.tracking.segment import Candidate
from enliven_edge.tracking.work_budget import Budget, BudgetedTask


@dataclass(frozen=True)
class DetectedBody:
    """A body that was found.

    Attributes:
        newcomer: the candidate with the body, in its current state.
        shown: a copy of the candidate from the frame that was searched.
        centre: (3,) metres, world frame, of the candidate in that frame.
        follower: the fit to that frame.
    """

    newcomer: Candidate
    shown: Candidate
    centre: Float
    follower: Follower


class SpreadSearch:
    """Searches the candidates of one frame for bodies, with a part of the work in each frame.

    Attributes:
        view: the frame that is searched.
    """

    def __init__(self, search: Search) -> None:
        self._search = search
        self._task: BudgetedTask[None] | None = None
        self._tried: list[tuple[Candidate, Candidate, Float]] = []
        self._made: list[ScoredDetection] = []
        self.view: FrameView | None = None

    @property
    def busy(self) -> bool:
        """Returns True if a search is in progress."""
        return self._task is not None

    @property
    def sought(self) -> list[Candidate]:
        """Returns the candidates that are searched."""
        return [newcomer for newcomer, _, _ in self._tried]

    def stop(self) -> None:
        """Aborts the search in progress."""
        self._task, self._tried, self._made, self.view = None, [], [], None

    def start(
        self,
        view: FrameView,
        sure: Sequence[Candidate],
        others: Sequence[Candidate],
        *,
        alone: bool,
        most: int,
    ) -> None:
        """Starts to search a frame. Arguments are those of :meth:`Search.looked`."""
        self.stop()
        self._tried = [(n, copy.copy(n), n.centre) for n in (*sure, *others)]
        shown = [copied for _, copied, _ in self._tried]
        here, there = shown[: len(sure)], shown[len(sure) :]
        self._task = BudgetedTask(self._search.looked(view, here, there, self._made, alone=alone, most=most))
        self.view = view

    def go_on(self, budget: Budget) -> list[DetectedBody]:
        """Continues the search. Returns the bodies that were found, all at once when it is done.

        They are returned together because of people that hold hands: the first one that is tracked would be
        fitted to both.
        """
        if self._task is None or not self._task.go_on(budget):
            return []
        for newcomer, tried, _ in self._tried:
            newcomer.settle(tried)
        bodies = [self._found_body(each) for each in self._made]
        self._task, self._tried = None, []
        return bodies

    def _found_body(self, found: ScoredDetection) -> DetectedBody:
        newcomer, centre = next((n, at) for n, shown, at in self._tried if shown is found[0])
        return DetectedBody(newcomer, found[0], centre, found[1])
