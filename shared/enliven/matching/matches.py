"""A ranking of matches, and its entries."""

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
        pairs: (m,) the target branch of each source branch, or None if the sub-tree has too few.
        score: sum of cosines, at most m.
    """

    candidate: SubTree
    pairs: tuple[Branch | None, ...]
    score: float

    @property
    def key(self) -> tuple[tuple[int, ...], ...]:
        """The joints that each source branch drives. It identifies the match in any order of the ranking."""
        return tuple(() if branch is None else branch.chain for branch in self.pairs)


@dataclass(frozen=True, eq=False)
class Ranking(Sequence[Match]):
    """All matches, the best first, as a sequence that supports slices.

    Attributes:
        candidates: the sub-trees of the target.
        which: (R,) the candidate of each match.
        columns: (R, m) the candidate's branch that each source branch drives, -1 for none.
        scores: (R,) descending.
        total: number of matches, including those that are not kept.
    """

    candidates: tuple[SubTree, ...]
    which: Int32
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
        candidate = self.candidates[self.which[place]]
        branches = candidate.branches
        pairs = tuple(branches[j] if j >= 0 else None for j in self.columns[place])
        return Match(candidate, pairs, float(self.scores[place]))

    def identity(self, place: int) -> tuple[int, ...]:
        """Returns the candidate and the columns of a match. They identify it in every ranking of the same
        matcher."""
        return (int(self.which[place]), *(int(column) for column in self.columns[place]))

    def find(self, identity: tuple[int, ...]) -> int:
        """Returns the position of a match, or -1 if it is not among those kept."""
        if len(identity) != 1 + self.columns.shape[1]:
            return -1
        same = (self.which == identity[0]) & (self.columns == identity[1:]).all(1)
        return int(same.argmax()) if same.any() else -1
