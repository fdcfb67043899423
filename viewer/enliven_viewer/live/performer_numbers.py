"""Displayed numbers of performers. They start at 1, and stay constant while a performer is present."""

from __future__ import annotations

from collections.abc import Iterable


class PerformerNumbers:
    """Small numbers for the performers in view.

    An edge never reuses an id, and a performer who returns gets a new one. So the window shows numbers
    instead of ids. Each new performer in view gets the lowest free number.
    """

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}

    def update_performers(self, present: Iterable[int]) -> None:
        """Updates the numbers from the ids of all performers who are in view or control a character. Other
        numbers become free.
        """
        ids = sorted(set(present))
        self._numbers = {body: number for body, number in self._numbers.items() if body in ids}
        for body in ids:
            self.number_of(body)

    def number_of(self, body: int) -> int:
        """Returns the number of a performer, starting at 1."""
        if body not in self._numbers:
            taken_numbers = set(self._numbers.values())
            self._numbers[body] = next(n for n in range(1, len(taken_numbers) + 2) if n not in taken_numbers)
        return self._numbers[body]
