"""What actors of all kinds have in common: who holds a character, and who would next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from enliven.document import Character
from enliven.errors import InputError
from enliven.person import Body, parts_named
from enliven.possession.highlights import State

Mode = Literal["alone", "join", "extend"]
"""What happens to earlier holds when a performer takes hold: "alone" ends all of them, "join" keeps those of
other performers, "extend" keeps the performer's own too."""


class ActorBase:
    """What actors of all kinds have in common: who holds them, and who would next."""

    character: Character
    holds: Any
    busy: frozenset[int] = frozenset()
    aside: float = 0.0
    size: float = 1.0
    _candidate: tuple[int | None, str] = (None, "all")

    @property
    def state(self) -> State:
        """Whether a performer holds it."""
        return "possessed" if self.holds else "free"

    @property
    def place(self) -> tuple[float, ...]:
        """Where the mesh stands, for an actor that has a placement; else empty."""
        return ()

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The id of the performer who takes hold next, None for the first in view, and the parts."""
        return self._candidate

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """Makes the cues show what this performer (None: the next one) would hold with these parts.

        Raises:
            InputError: for an unknown part.
        """
        parts_named(parts)
        self._candidate = (body, parts)

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """Returns the first of the bodies that neither holds it nor is busy with another character."""
        return next(iter(self._idle(bodies)), None)

    def _idle(self, bodies: Sequence[Body]) -> list[Body]:
        """Returns the bodies that neither hold it nor are busy with another character."""
        holders = {hold.body for hold in self.holds}
        return [body for body in bodies if body.id not in holders and body.id not in self.busy]

    def _need_holder(self, body: int | None, verb: tuple[str, str]) -> None:
        """Raises InputError where a performer (None: any) does not hold it.

        Args:
            verb: what a holder does, such as ("drive", "driven").
        """
        if body is not None and all(hold.body != body for hold in self.holds):
            who = ", ".join(str(hold.body) for hold in self.holds) or "nobody"
            what, mend = f"performer {body} does not {verb[0]} it", f"It is {verb[1]} by: {who}."
            raise InputError(what, where=f"releasing {self.character.id!r}", mend=mend)
