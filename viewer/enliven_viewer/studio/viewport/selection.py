"""The artist's selection: a character of any rig, and parts of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.document import Project


@dataclass(frozen=True)
class Selection:
    """The selection, to which the next command applies.

    Attributes:
        character: id of the active character, or None.
        handle: number of the selected joint, control point or node, or None.
        chain: selected joints from one end to the other; empty without a chain.
        layer: number of the selected layer, or None.
        others: ids of the other selected characters, in the order of selection.
    """

    character: str | None = None
    handle: int | None = None
    chain: tuple[int, ...] = ()
    layer: int | None = None
    others: tuple[str, ...] = ()

    @property
    def characters(self) -> tuple[str, ...]:
        """Returns the ids of all selected characters in the order of selection. The active character is the
        last.
        """
        return (*self.others, self.character) if self.character is not None else ()

    @property
    def has_several(self) -> bool:
        """Returns True if more than one character is selected."""
        return bool(self.others)

    @classmethod
    def from_ids(cls, *characters: str) -> Selection:
        """Returns a selection of these characters. The last one is active."""
        ids = tuple(dict.fromkeys(characters))
        return cls(ids[-1], others=ids[:-1]) if ids else cls()

    def with_active(self, character: str) -> Selection:
        """Returns the selection with another active character. If that was not selected, it becomes the only
        selected character.
        """
        if character == self.character:
            return self
        rest = tuple(other for other in self.characters if other != character)
        return Selection.from_ids(*rest, character) if character in self.others else Selection(character)

    def with_changes(self, **changes: object) -> Selection:
        """Returns the selection with parts changed. Another character clears handle, chain and layer."""
        fresh = changes.get("character", self.character) != self.character
        return replace(Selection() if fresh else self, **changes)  # type: ignore[arg-type]

    def restricted_to(self, project: Project) -> Selection:
        """Returns the selection without objects that a project no longer contains."""
        character = project.characters.get(self.character or "")
        others = tuple(other for other in self.others if other in project.characters)
        if character is None:
            return Selection.from_ids(*others)
        handles, layers = max(len(character.handles), character.keyable), len(character.playing)
        return Selection(
            character.id,
            self.handle if (self.handle or 0) < handles else None,
            self.chain if all(joint < handles for joint in self.chain) else (),
            self.layer if (self.layer or 0) < layers else None,
            others,
        )
