"""The selection of an artist: a character of any rig, and parts of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.document import Project


@dataclass(frozen=True)
class Selection:
    """What the next command applies to.

    Attributes:
        character: its id, or None.
        handle: the number of a joint, control point or node of it, or None.
        chain: joints of it from one end to the other; empty without a chain.
        layer: the number of a layer of it, or None.
        others: ids of the characters that are chosen with it, in the order in which they were.
    """

    character: str | None = None
    handle: int | None = None
    chain: tuple[int, ...] = ()
    layer: int | None = None
    others: tuple[str, ...] = ()

    @property
    def characters(self) -> tuple[str, ...]:
        """Returns the ids of all chosen characters; the one that was chosen last comes last."""
        return (*self.others, self.character) if self.character is not None else ()

    @property
    def several(self) -> bool:
        """Returns True if more than one character is chosen."""
        return bool(self.others)

    @classmethod
    def of(cls, *characters: str) -> Selection:
        """These characters, the last one leading."""
        ids = tuple(dict.fromkeys(characters))
        return cls(ids[-1], others=ids[:-1]) if ids else cls()

    def led_by(self, character: str) -> Selection:
        """Returns all that is chosen, another of them leading; that one alone where it was not chosen."""
        if character == self.character:
            return self
        rest = tuple(one for one in self.characters if one != character)
        return Selection.of(*rest, character) if character in self.others else Selection(character)

    def changed(self, **changes: object) -> Selection:
        """Returns the selection with parts changed; another character forgets those of the one before."""
        fresh = changes.get("character", self.character) != self.character
        return replace(Selection() if fresh else self, **changes)  # type: ignore[arg-type]

    def within(self, project: Project) -> Selection:
        """Returns the selection without what a project no longer has."""
        character = project.characters.get(self.character or "")
        others = tuple(one for one in self.others if one in project.characters)
        if character is None:
            return Selection.of(*others)
        handles, layers = max(len(character.handles), character.keyable), len(character.playing)
        return Selection(
            character.id,
            self.handle if (self.handle or 0) < handles else None,
            self.chain if all(joint < handles for joint in self.chain) else (),
            self.layer if (self.layer or 0) < layers else None,
            others,
        )
