"""Records how holds started, so that performers can possess a new revision of a character in the same way."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

from enliven.errors import InputError
from enliven.person import Body
from enliven.possession import Actor, Mode

log = logging.getLogger(__name__)

_SETTLING_SOLVES = 12
"""Number of times that one frame is solved to move a character from the hold's starting pose to the current
pose. Each solve halves the remaining distance approximately."""


@dataclass(frozen=True, eq=False)
class HoldStart:
    """The state in which a performer possessed a character. ``body`` is the performer at that moment."""

    body: Body
    parts: str = "all"
    mode: Mode = "join"


HoldStarts = tuple[HoldStart, ...]
"""The starts of the holds of a character, the oldest first."""


class HoldMemory:
    """Stores for each character the first performer in view, and how its holds started."""

    def __init__(self) -> None:
        self._first_performers: dict[str, Body] = {}
        self._starts: dict[str, HoldStarts] = {}

    def remember_performer(self, character: str, bodies: Sequence[Body]) -> None:
        """Stores the first performer in view. The character is placed relative to this performer."""
        if bodies and character not in self._first_performers:
            self._first_performers[character] = bodies[0]

    def remember(self, character: str, body: Body, parts: str, mode: Mode) -> None:
        """Stores that a performer possessed the character."""
        earlier = self._starts.get(character, ()) if mode != "alone" else ()
        earlier = tuple(hold for hold in earlier if mode == "extend" or hold.body.id != body.id)
        self._starts[character] = (*earlier, HoldStart(body, parts, "join" if mode == "alone" else mode))

    def release(self, character: str, body: int | None) -> None:
        """Stores that a performer released the character. If ``body`` is None, all performers did."""
        remaining = (
            hold for hold in self._starts.get(character, ()) if body is not None and hold.body.id != body
        )
        self._starts[character] = tuple(remaining)

    def forget(self, character: str) -> None:
        """Deletes the records of a character that was removed."""
        self._first_performers.pop(character, None)
        self._starts.pop(character, None)

    def find_holds(self, actor: Actor, bodies: Sequence[Body]) -> HoldStarts:
        """Returns how the current holds of an actor started.

        A hold without a record counts as started in this frame.
        """
        name, holders = actor.character.id, [hold.body for hold in actor.holds]
        recorded = tuple(hold for hold in self._starts.get(name, ()) if hold.body.id in holders)
        recorded_ids = {hold.body.id for hold in recorded}
        return recorded + tuple(HoldStart(b) for b in bodies if b.id in holders and b.id not in recorded_ids)

    def carry_over(self, previous_actor: Actor, actor: Actor, bodies: list[Body], time_ns: int) -> HoldStarts:
        """Moves all holds from one actor to another and returns how the holds started.

        Each performer possesses the new actor in the pose with which the hold started, and then moves to the
        current pose. If the new actor refuses a performer, this is logged and the hold ends.
        """
        starts = self.find_holds(previous_actor, bodies)
        actor.release()
        actor.aside = previous_actor.aside
        if previous_actor.growth != 1.0:
            actor.resize(previous_actor.growth)
        if previous_actor.exaggeration is not None:
            actor.exaggerate(previous_actor.exaggeration)
        first_performer = self._first_performers.get(previous_actor.character.id)
        if first_performer is not None:
            actor.perform([first_performer], 0)
        for start in starts:
            try:
                actor.possess(start.body, start.parts, start.mode)
            except InputError as error:
                log.warning("%s", error)
        for _ in range(_SETTLING_SOLVES if starts else 0):
            actor.perform(bodies, time_ns)
        return starts
