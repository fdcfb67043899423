"""The options of the next possession: performer, body parts, smoothing, and the lock against other people."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from enliven_viewer.language import tr

PART_CHOICES = (
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
"""The body parts chosen with the keys 1 to 9, names of :data:`enliven.person.body.PARTS`."""


SMOOTHING_AMOUNTS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Amounts of smoothing that the keys step through: 0 is off, 1 is gentle."""
_DEFAULT_SMOOTHING_INDEX = 2
"""Index in SMOOTHING_AMOUNTS of the initial amount."""


class PossessionChoice:
    """The user's options for the next possession.

    Attributes:
        body: the performer's id. None means the next performer who appears.
        parts: the body parts that are attached.
        locked: True if only the performers who were present when the lock was set may possess a character.
    """

    def __init__(self) -> None:
        self.body: int | None = None
        self.parts = PART_CHOICES[0]
        self.locked = False
        self._smoothing: dict[int, int] = {}

    def choose_parts(self, number: int) -> None:
        """Chooses the body parts of a key. ``number`` is the index in PART_CHOICES."""
        self.parts = PART_CHOICES[number]

    def next_performer(self, present: Iterable[int]) -> None:
        """Chooses the next performer in view. After the last one, chooses the next performer who appears."""
        order: list[int | None] = [None, *sorted(set(present))]
        position = order.index(self.body) if self.body in order else 0
        self.body = order[(position + 1) % len(order)]

    def change_smoothing(self, step: int, present: Iterable[int]) -> dict[int, float]:
        """Changes the smoothing of the chosen performer, or of all performers in view. Returns the amounts by
        performer id.
        """
        amounts = {}
        for body in [self.body] if self.body is not None else present:
            index = min(
                max(self._smoothing.get(body, _DEFAULT_SMOOTHING_INDEX) + step, 0), len(SMOOTHING_AMOUNTS) - 1
            )
            self._smoothing[body], amounts[body] = index, SMOOTHING_AMOUNTS[index]
        return amounts

    def describe_choice(self, number_of: Callable[[int], int]) -> str:
        """Returns a description such as "P steps in: the legs of performer 2". ``number_of`` converts a
        performer's id to the displayed number.
        """
        performer_text = (
            tr("the next person") if self.body is None else tr("performer {0}", number_of(self.body))
        )
        text = tr(
            "Press P to step in with the {0} of {1}",
            tr("whole body") if self.parts == "all" else tr(self.parts),
            performer_text,
        )
        if self.body in self._smoothing:
            text += tr(" · smoothing {0:g}", SMOOTHING_AMOUNTS[self._smoothing[self.body]])
        return tr("{0} · locked", text) if self.locked else text
