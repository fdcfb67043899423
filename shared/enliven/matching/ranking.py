"""Ranks all ways in which a source can drive a target by their similarity on the screen (AniMesh, 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import ClassVar, Literal

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.document import Skeleton
from enliven.matching.abstraction import make_abstract_skeleton
from enliven.matching.kernels import rank_rows, seen_branches
from enliven.matching.matches import Ranking
from enliven.matching.subtrees import Abstraction, SubTree
from enliven.matching.views import ScreenView
from enliven.settings import parameter

_MISSING_BRANCH_SCORE = -1.0
"""Score of a source branch without a partner in the sub-tree. It is equal to the score of opposite
directions."""
_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class RankingSettings:
    """Settings for scoring matches."""

    REMOVED_SETTINGS: ClassVar = ("missing",)

    most: int = parameter(
        256,
        "Number of best matches that are kept. All matches are scored.",
        unit="matches",
        low=1,
        high=100_000,
    )
    measure: Literal["cosine", "dot"] = parameter(
        "cosine",
        "Similarity of two branches: the cosine of the angle between them, or their dot product "
        "divided by the longest "
        'branch. With "dot", short branches have little effect.',
    )
    blur: float = parameter(
        0.2,
        "Branches with a smaller visible fraction point towards the viewer and lose weight gradually. "
        'Applies to "cosine" only.',
        low=1e-6,
        high=1.0,
    )
    tie: float = parameter(
        1e-9, "Scores that differ by less than this value count as equal.", low=0.0, high=0.1
    )
    exhaustive: int = parameter(
        50_000,
        "Maximum number of branch combinations in a sub-tree that are all scored. Beyond it, only the "
        "best are searched.",
        unit="choices",
        low=1,
        high=10_000_000,
    )


class Matcher:
    """A matcher for one target. It abstracts the target once, and ranks its matches with a source that
    changes every frame.

    Args:
        target: a skeleton, or an abstraction of any tree.
        positions: (N, 3) metres, the joints at rest. Required only if the target is an abstraction.
        root: the root joint for :func:`make_abstract_skeleton`. If None, the abstraction determines the root.
    """

    def __init__(
        self,
        target: Skeleton | Abstraction,
        positions: Float | None = None,
        root: int | None = 0,
        settings: RankingSettings | None = None,
    ) -> None:
        self.settings = settings or RankingSettings()
        self.abstraction = make_abstract_skeleton(target, root) if isinstance(target, Skeleton) else target
        joint_positions = target.positions if isinstance(target, Skeleton) else positions
        if joint_positions is None:
            raise ValueError("a Matcher for an Abstraction needs the positions of its joints: pass positions")
        trees = self.abstraction.candidates
        self._sizes = tuple(len(tree.branches) for tree in trees)
        self._first = np.concatenate([[0], np.cumsum(self._sizes)]).astype(np.int64)
        self._average = _compute_averaging_weights(trees, len(joint_positions))
        self._rest = self._candidate_points(np.asarray(joint_positions, np.float64))

    def rank(
        self,
        source: Float,
        view: ScreenView,
        source_view: ScreenView | None = None,
        positions: Float | None = None,
    ) -> Ranking:
        """Ranks all matches.

        Args:
            source: (m + 1, 3) metres, root and abstract positions of the branches, from
                :meth:`MatchSource.points`.
            view: the view of the target.
            source_view: the view of the source. None means the target's view.
            positions: (N, 3) metres, the target's joints in the visible pose. None means the rest pose.
        """
        settings = self.settings
        points = (
            self._rest if positions is None else self._candidate_points(np.asarray(positions, np.float64))
        )
        source_points = np.ascontiguousarray(source, np.float64)
        source_first = np.array([0, len(source_points) - 1])
        plan = _make_matching_plan(self._sizes, len(source_points) - 1, settings.exhaustive, settings.most)
        candidate_indices, columns, scores = rank_rows(
            self._find_seen_branches(points, self._first, view),
            self._first,
            self._find_seen_branches(source_points, source_first, source_view or view),
            plan.first,
            plan.is_complete,
            _MISSING_BRANCH_SCORE,
        )
        order = _find_best_indices(scores, settings.most, settings.tie)
        trees = self.abstraction.candidates
        return Ranking(trees, candidate_indices[order], columns[order], scores[order], plan.total)

    def _find_seen_branches(self, points: Float, first: Int, view: ScreenView) -> Float:
        """Returns the normalized branches (B, 2) on the screen."""
        eye = _ORIGIN if view.eye is None else view.eye
        dots = self.settings.measure == "dot"
        branches = seen_branches(
            points, first, view.frame, eye, view.eye is not None, self.settings.blur, dots
        )
        return np.asarray(branches)

    def _candidate_points(self, positions: Float) -> Float:
        """Returns the candidates' roots, followed by the abstract positions of all their branches, (C + B,
        3).
        """
        return np.asarray(self._average @ positions)


@dataclass(frozen=True, eq=False)
class _Plan:
    """The number of matches that are scored for each candidate.

    Attributes:
        first: (C + 1,) index of each candidate's first row.
        is_complete: (C,) 1 if a candidate's rows contain all of its matches, 0 if they contain only the best.
        total: number of all matches.
    """

    first: Int
    is_complete: Int
    total: int


@lru_cache(maxsize=64)
def _make_matching_plan(sizes: tuple[int, ...], m: int, exhaustive: int, max_count: int) -> _Plan:
    rows, are_complete, total = [0], [], 0
    for n in sizes:
        smaller, larger = min(m, n), max(m, n)
        choices = comb(larger, smaller)
        is_complete = sum(comb(larger, k) for k in range(smaller + 1)) <= exhaustive
        rows.append(choices if is_complete else min(choices, max_count))
        are_complete.append(is_complete)
        total += choices
    return _Plan(np.cumsum(rows), np.array(are_complete, np.int64), total)


def _compute_averaging_weights(trees: tuple[SubTree, ...], joints: int) -> scipy.sparse.csr_matrix:
    """Returns the weights (C + B, N) of the roots and of the branches' abstract positions."""
    weights = [{tree.root: 1.0} for tree in trees]
    weights += [branch.weights for tree in trees for branch in tree.branches]
    starts = np.concatenate([[0], np.cumsum([len(row) for row in weights])])
    columns = [joint for row in weights for joint in row]
    values = [value for row in weights for value in row.values()]
    return scipy.sparse.csr_matrix((values, columns, starts), shape=(len(weights), joints))


def _find_best_indices(scores: Float, max_count: int, tie: float) -> Int:
    """Returns the indices of the ``max_count`` highest scores, the highest first. Scores that differ by less
    than ``tie`` keep their order."""
    rounded = np.round(scores / tie) if tie > 0.0 else scores
    if len(rounded) > max_count:
        min_score = np.partition(rounded, len(rounded) - max_count)[len(rounded) - max_count]
        candidates = np.flatnonzero(rounded >= min_score)
    else:
        candidates = np.arange(len(rounded))
    return np.asarray(candidates[np.argsort(-rounded[candidates], kind="stable")[:max_count]])
