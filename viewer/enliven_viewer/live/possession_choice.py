"""The choices of the next possession: the performer, the parts, the smoothing, and who may join."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from enliven_viewer.language import tr

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
"""What the keys 1 to 9 choose, names of :data:`enliven.person.body.PARTS`."""


SMOOTHING = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Amounts that the keys go through: 0 is off, 1 is gentle."""
_USUAL = 2
"""The place in SMOOTHING of the amount that the keys start from: gentle."""


class PossessionChoice:
    """The performer and the parts that the next possession takes.

    Attributes:
        body: the performer's id; None: the next performer that comes.
        parts: what takes hold.
        locked: whether only those performers count who were there when it was asked for.
    """

    def __init__(self) -> None:
        self.body: int | None = None
        self.parts = PARTS[0]
        self.locked = False
        self._smoothing: dict[int, int] = {}

    def choose(self, number: int) -> None:
        """The parts of a key, counted from 0."""
        self.parts = PARTS[number]

    def next_performer(self, present: Iterable[int]) -> None:
        """Chooses the next performer in view; after the last of them, the next one that comes."""
        order: list[int | None] = [None, *sorted(set(present))]
        at = order.index(self.body) if self.body in order else 0
        self.body = order[(at + 1) % len(order)]

    def smoother(self, step: int, present: Iterable[int]) -> dict[int, float]:
        """Chooses the next amount of smoothing for the chosen performer, or for all in view; by id."""
        amounts = {}
        for body in [self.body] if self.body is not None else present:
            at = min(max(self._smoothing.get(body, _USUAL) + step, 0), len(SMOOTHING) - 1)
            self._smoothing[body], amounts[body] = at, SMOOTHING[at]
        return amounts

    def words(self, number_of: Callable[[int], int]) -> str:
        """For people: "P steps in: the legs of performer 2"; ``number_of`` gives the number of an id."""
        who = tr("the next person") if self.body is None else tr("performer {0}", number_of(self.body))
        whole = tr(
            "P steps in: the {0} of {1}", tr("whole body") if self.parts == "all" else tr(self.parts), who
        )
        if self.body in self._smoothing:
            whole += tr(" · smoothed by {0:g}", SMOOTHING[self._smoothing[self.body]])
        return tr("{0} · locked", whole) if self.locked else whole
