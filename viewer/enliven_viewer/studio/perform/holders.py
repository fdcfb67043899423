"""Tracks which performers control which characters with which body parts, from an edge's messages."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.wire import HoldMessage
from enliven_viewer.language import later, tr

_PART_LABELS = {
    "all": later("the whole body"),
    "arms": later("both arms"),
    "legs": later("both legs"),
    "hands": later("both hands"),
    "hip + right arm": later("hip and the right arm"),
}
"""Displayed words for body parts. Names that are not listed are displayed unchanged."""


@dataclass(frozen=True)
class Holder:
    """A performer that controls a character.

    Attributes:
        body: the performer's id.
        character: id of the controlled character.
        parts: names of the controlling body parts, in the order of attachment.
        number: the performer's number as shown to people; 0 if unknown.
    """

    body: int
    character: str
    parts: tuple[str, ...]
    number: int = 0

    @property
    def words(self) -> str:
        """Returns a text for an audience, such as "Performer 1 is in the horse: both arms"."""
        parts = [tr(_PART_LABELS.get(part, part)) for part in self.parts]
        return tr(
            "Performer {0} is in the {1}: {2}",
            self.number or self.body,
            self.character,
            tr(" and ").join(parts),
        )


class Holders:
    """Tracks the attachments of all characters. For each character, stores the messages since it was last
    free.
    """

    def __init__(self) -> None:
        self._parts: dict[str, dict[int, tuple[str, ...]]] = {}
        self.since_free: dict[str, list[HoldMessage]] = {}

    @property
    def now(self) -> tuple[Holder, ...]:
        """Returns all performers that control a character, sorted by id."""
        holders = [
            Holder(body, name, own) for name, held in self._parts.items() for body, own in held.items()
        ]
        return tuple(sorted(holders, key=lambda holder: (holder.body, holder.character)))

    def take(self, message: HoldMessage) -> None:
        """Processes a change of attachments."""
        before = self._parts.get(message.character, {})
        if not before:
            self.since_free[message.character] = []
        self.since_free[message.character].append(message)
        parts_before = before.get(message.former if message.mode == "take over" else message.body, ())
        held = {} if message.mode in ("alone", "remove") else dict(before)
        if message.mode in ("alone", "join"):
            held[message.body] = (message.parts,)
        elif message.mode == "extend":
            held[message.body] = (*(part for part in parts_before if part != message.parts), message.parts)
        elif message.mode == "take over":
            held[message.body] = parts_before or (message.parts,)
        held = {who: held.get(who, (message.parts,)) for who in message.holders}
        self._parts[message.character] = held
        if not held:
            self.since_free[message.character] = []

    def forget(self) -> None:
        """Discards everything, for example after a restart of an edge."""
        self._parts, self.since_free = {}, {}
