"""Matches between a performer's limbs and parts of a skeleton, and their ranking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

from enliven.arrays import Float, Int32
from enliven.matching.subtrees import Branch, SubTree


@dataclass(frozen=True)
class Match:
    """One match: the target branch that each source branch drives.

    Attributes:
        candidate: the sub-tree of the target.
        pairs: (m,) the target branch of each source branch, or None if the sub-tree has too few branches.
        score: sum of the cosines between source and target branches, at most m.
    """

    candidate: SubTree
    pairs: tuple[Branch | None, ...]
    score: float

    @property
    def key(self) -> tuple[tuple[int, ...], ...]:
        """The joints that each source branch drives. The key does not depend on the rank."""
        return tuple(() if branch is None else branch.chain for branch in self.pairs)


@dataclass(frozen=True, eq=False)
class Ranking(Sequence[Match]):
    """All matches, the best first, as a sequence that supports slices.

    Attributes:
        candidates: the sub-trees of the target.
        candidate_indices: (R,) index of the candidate of each match.
        columns: (R, m) the candidate's branch that each source branch drives, -1 for none.
        scores: (R,) scores of the matches, descending.
        total: number of all matches, including matches that the ranking omits.
    """

    candidates: tuple[SubTree, ...]
    candidate_indices: Int32
    columns: Int32
    scores: Float
    total: int

    def __len__(self) -> int:
        return len(self.scores)

    @overload
    def __getitem__(self, place: int) -> Match: ...

    @overload
    def __getitem__(self, place: slice) -> tuple[Match, ...]: ...

    def __getitem__(self, place: int | slice) -> Match | tuple[Match, ...]:
        if isinstance(place, slice):
            return tuple(self[number] for number in range(*place.indices(len(self))))
        candidate = self.candidates[self.candidate_indices[place]]
        branches = candidate.branches
        pairs = tuple(branches[j] if j >= 0 else None for j in self.columns[place])
        return Match(candidate, pairs, float(self.scores[place]))

    def identity(self, place: int) -> tuple[int, ...]:
        """Returns the candidate's index and the columns of a match. These numbers identify the match in every
        ranking of the same matcher."""
        return (int(self.candidate_indices[place]), *(int(column) for column in self.columns[place]))

    def find(self, identity: tuple[int, ...]) -> int:
        """Returns the rank of a match, from 0, or -1 if the ranking omits it."""
        if len(identity) != 1 + self.columns.shape[1]:
            return -1
        is_match = (self.candidate_indices == identity[0]) & (self.columns == identity[1:]).all(1)
        return int(is_match.argmax()) if is_match.any() else -1
