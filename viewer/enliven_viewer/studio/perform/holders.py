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
"""The artist's words for body parts; others are used unchanged."""


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
        """Returns a text for an audience: "Performer 1 is in the horse: both arms"."""
        parts = [tr(_PART_LABELS.get(part, part)) for part in self.parts]
        return tr(
            "Performer {0} is in the {1}: {2}",
            self.number or self.body,
            self.character,
            tr(" and ").join(parts),
        )


class Holders:
    """The attachments of all characters, and the messages since each was last free."""

    def __init__(self) -> None:
        self._parts: dict[str, dict[int, tuple[str, ...]]] = {}
        self.since_free: dict[str, list[HoldMessage]] = {}

    @property
    def now(self) -> tuple[Holder, ...]:
        """Returns all performers that control something, by id."""
        holders = [
            Holder(body, name, own) for name, held in self._parts.items() for body, own in held.items()
        ]
        return tuple(sorted(holders, key=lambda holder: (holder.body, holder.character)))

    def take(self, said: HoldMessage) -> None:
        """Processes a change of attachments."""
        before = self._parts.get(said.character, {})
        if not before:
            self.since_free[said.character] = []
        self.since_free[said.character].append(said)
        own = before.get(said.former if said.mode == "take over" else said.body, ())
        held = {} if said.mode in ("alone", "remove") else dict(before)
        if said.mode in ("alone", "join"):
            held[said.body] = (said.parts,)
        elif said.mode == "extend":
            held[said.body] = (*(part for part in own if part != said.parts), said.parts)
        elif said.mode == "take over":
            held[said.body] = own or (said.parts,)
        held = {who: held.get(who, (said.parts,)) for who in said.holders}
        self._parts[said.character] = held
        if not held:
            self.since_free[said.character] = []

    def forget(self) -> None:
        """Discards everything, for example after a restart of an edge."""
        self._parts, self.since_free = {}, {}
