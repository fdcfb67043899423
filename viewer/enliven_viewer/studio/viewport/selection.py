"""The selection of an artist: a character of any rig, and parts of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.document import Project


@dataclass(frozen=True)
class Selection:
    """What the next command applies to.

    Attributes:
        character: its id, or None.
        handle: the number of a joint or control point of it, or None.
        chain: joints of it from one end to the other; empty without a chain.
        layer: the number of a layer of it, or None.
    """

    character: str | None = None
    handle: int | None = None
    chain: tuple[int, ...] = ()
    layer: int | None = None

    def changed(self, **changes: object) -> Selection:
        """The selection with parts changed; another character forgets those of the one before."""
        fresh = changes.get("character", self.character) != self.character
        return replace(Selection() if fresh else self, **changes)  # type: ignore[arg-type]

    def within(self, project: Project) -> Selection:
        """The selection without what a project no longer has."""
        character = project.characters.get(self.character or "")
        if character is None:
            return Selection()
        handles, layers = len(character.handles), len(character.playing)
        return Selection(
            character.id,
            self.handle if (self.handle or 0) < handles else None,
            self.chain if all(joint < handles for joint in self.chain) else (),
            self.layer if (self.layer or 0) < layers else None,
        )
