"""The rig of a character: what every kind of it has, whatever moves its mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

from enliven.document.time_map import Playing
from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.meshes import Mesh


class RigBase:
    """A character of a project: a mesh, what moves it, and the layers that it plays.

    The edits of all rigs are in :mod:`enliven.modeling.edits`; each rig's part of them in the rig's own room.

    Attributes:
        kind: its number among the rigs: "bones", "graph" or "points", in files and on the wire.
        word: what it is called in messages.
        played: the attribute that holds its layers.
        id: its name in the project.
        mesh: the surface at rest, or None.
    """

    kind: ClassVar[str]
    word: ClassVar[str]
    played: ClassVar[str] = "layers"
    if TYPE_CHECKING:

        @property
        def id(self) -> str: ...

        @property
        def mesh(self) -> Mesh | None: ...

    @property
    def where(self) -> str:
        """How messages name it."""
        return f"{self.word} {self.id!r}"

    @property
    def playing(self) -> tuple[Playing, ...]:
        """Its layers, each a take with a time map."""
        return tuple(getattr(self, self.played))

    def with_playing(self, *layers: Playing) -> Self:
        """The same with other layers."""
        return self.with_changes(**{self.played: layers})

    def with_changes(self, **changes: object) -> Self:
        """A copy with some attributes changed; this one stays as it is."""
        return replace(self, **changes)  # type: ignore[type-var]

    def later(self, delay: float) -> Self:
        """The same, playing ``delay`` seconds later."""
        return self.with_playing(*(layer.later(delay) for layer in self.playing))

    def needed(self) -> Mapping[str, set[str]]:
        """The ids that it refers to in each map of takes of the project: "takes", "streams" and "bodies"."""
        found: dict[str, set[str]] = {"takes": set(), "streams": set(), "bodies": set()}
        for layer in self.playing:
            for held, name in layer.needs():
                found[held].add(name)
        return found

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """The same with other ids of the takes that it refers to, by the map of the project and the id."""
        return self.with_playing(*(one.with_takes_named(names) for one in self.playing))

    def check(self, held: Mapping[str, Mapping[str, Any]]) -> None:
        """Refuse takes that are not there, or that are of something else.

        Args:
            held: the maps of the project, by their names.

        Raises:
            InputError: which one is missing.
        """
        for kind, names in self.needed().items():
            missing = names - set(held[kind])
            if missing:
                what = f"there are no {kind}" if kind == "bodies" else f"there is no {kind[:-1]}"
                raise InputError(f"{what} {min(missing)!r}", where=self.where)
