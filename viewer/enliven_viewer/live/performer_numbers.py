"""Numbers of performers: from 1 on, constant while they are present."""

from __future__ import annotations

from collections.abc import Iterable


class PerformerNumbers:
    """Small numbers for the performers in view.

    The ids of an edge only increase, and a performer that is found again gets a new id. So each new performer
    in view gets the lowest free number instead.
    """

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}

    def see(self, present: Iterable[int]) -> None:
        """Updates the numbers with the ids of all performers in view or in control of something.

        Other numbers become free.
        """
        ids = sorted(set(present))
        self._numbers = {body: number for body, number in self._numbers.items() if body in ids}
        for body in ids:
            self.number_of(body)

    def number_of(self, body: int) -> int:
        """Returns the number of a performer, from 1 on."""
        if body not in self._numbers:
            taken = set(self._numbers.values())
            self._numbers[body] = next(n for n in range(1, len(taken) + 2) if n not in taken)
        return self._numbers[body]
