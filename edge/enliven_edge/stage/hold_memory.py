"""Records how holds started, so that a later revision of a character can be possessed in the same way."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

from enliven.errors import InputError
from enliven.person import Body
from enliven.possession import Actor, Mode

log = logging.getLogger(__name__)

_SETTLING_SOLVES = 12
"""Number of solves of one frame, from the starting pose of the hold to the current pose. Each solve about
halves the remaining distance."""


@dataclass(frozen=True, eq=False)
class HoldStart:
    """The state in which a performer possessed a character. ``body`` is the performer at that moment."""

    body: Body
    parts: str = "all"
    mode: Mode = "join"


HoldStarts = tuple[HoldStart, ...]
"""How the holds of a character started, the oldest first."""


class HoldMemory:
    """Stores, for each character, the first performer that it met and how its holds started."""

    def __init__(self) -> None:
        self._met: dict[str, Body] = {}
        self._taken: dict[str, HoldStarts] = {}

    def remember_performer(self, character: str, bodies: Sequence[Body]) -> None:
        """Remembers the first performer in view: the character is placed relative to this performer."""
        if bodies and character not in self._met:
            self._met[character] = bodies[0]

    def take(self, character: str, body: Body, parts: str, mode: Mode) -> None:
        """Remembers that a performer possessed the character."""
        earlier = self._taken.get(character, ()) if mode != "alone" else ()
        earlier = tuple(hold for hold in earlier if mode == "extend" or hold.body.id != body.id)
        self._taken[character] = (*earlier, HoldStart(body, parts, "join" if mode == "alone" else mode))

    def release(self, character: str, body: int | None) -> None:
        """Remembers that a performer released the character. If ``body`` is None, all performers did."""
        remaining = (
            hold for hold in self._taken.get(character, ()) if body is not None and hold.body.id != body
        )
        self._taken[character] = tuple(remaining)

    def forget(self, character: str) -> None:
        """Forgets a character that was removed."""
        self._met.pop(character, None)
        self._taken.pop(character, None)

    def find_holds(self, actor: Actor, bodies: Sequence[Body]) -> HoldStarts:
        """Returns how the current holds of an actor started.

        A hold without a record counts as started now.
        """
        name, holders = actor.character.id, [hold.body for hold in actor.holds]
        recorded = tuple(hold for hold in self._taken.get(name, ()) if hold.body.id in holders)
        asked = {hold.body.id for hold in recorded}
        return recorded + tuple(HoldStart(b) for b in bodies if b.id in holders and b.id not in asked)

    def carry_over(self, before: Actor, actor: Actor, bodies: list[Body], time_ns: int) -> HoldStarts:
        """Moves all holds from one actor to another and returns how the holds started.

        Each performer possesses the new actor in the pose with which the hold started, and then moves to the
        current pose. If the new actor refuses a performer, this is logged and the hold ends.
        """
        held = self.find_holds(before, bodies)
        actor.release()
        actor.aside = before.aside
        if before.growth != 1.0:
            actor.resize(before.growth)
        if before.exaggeration is not None:
            actor.exaggerate(before.exaggeration)
        met = self._met.get(before.character.id)
        if met is not None:
            actor.perform([met], 0)
        for taken in held:
            try:
                actor.possess(taken.body, taken.parts, taken.mode)
            except InputError as error:
                log.warning("%s", error)
        for _ in range(_SETTLING_SOLVES if held else 0):
            actor.perform(bodies, time_ns)
        return held
