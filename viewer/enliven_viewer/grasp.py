"""What the next possession is asked for with: whose body, and what of it."""

from __future__ import annotations

from collections.abc import Iterable

PARTS = (
    "all",
    "upper body",
    "legs",
    "arms",
    "left arm",
    "right arm",
    "hip + right arm",
    "torso",
    "head",
)
"""What the keys 1 to 9 choose, names of :data:`enliven.body.PARTS`."""


class Grasp:
    """A choice of performer and parts.

    Attributes:
        body: the performer's id; None: whoever comes next.
        parts: what takes hold.
    """

    def __init__(self) -> None:
        self.body: int | None = None
        self.parts = PARTS[0]

    def choose(self, number: int) -> None:
        """The parts of a key, counted from 0."""
        self.parts = PARTS[number]

    def next_performer(self, present: Iterable[int]) -> None:
        """The next of those in view, after the last of them whoever comes."""
        order: list[int | None] = [None, *sorted(set(present))]
        at = order.index(self.body) if self.body in order else 0
        self.body = order[(at + 1) % len(order)]

    @property
    def words(self) -> str:
        """For people: "legs of performer 2"."""
        who = "whoever is next" if self.body is None else f"performer {self.body}"
        return f"P takes hold: {'the whole' if self.parts == 'all' else self.parts} of {who}"
