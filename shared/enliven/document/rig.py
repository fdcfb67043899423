"""The rig of a character: what every kind of it has, whatever moves its mesh.

A character is one value, and its rig is its class: it is not put together of a mesh, a rig, layers and a
placement. Only the mesh could be taken out of all three. The layers of a skeleton are named by the spans of
its bones, and go when no span names them; those of a deformation graph are its nodes, each part with its own
place in the world and what it rides on; so neither is whole without the other. The placement of a skeleton is
the first of its modeling rotations, and that of a graph is in every part. What is common is here, and the
edits are written once against :class:`enliven.modeling.rig.RigEdits`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from enliven.arrays import Int32
from enliven.document.layers import RootLayer
from enliven.document.time_map import Playing
from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.meshes import Mesh


@dataclass(frozen=True, eq=False, kw_only=True)
class RigBase:
    """A character of a project: a mesh, what moves it, and the layers that it plays.

    The edits of all rigs are in :mod:`enliven.modeling.edits`; each rig's part of them in the rig's own room.

    Attributes:
        kind: its number among the rigs: "bones", "graph" or "points", in files and on the wire.
        word: what it is called in messages.
        played: the attribute that holds its layers.
        drawn_by: the attributes on which its surface at rest depends.
        kinds: every rig by its kind; a class enters itself.
        id: its name in the project.
        mesh: the surface at rest, or None.
        root_layers: what turns and moves the whole of it over what it plays, the innermost first.
    """

    kind: ClassVar[str]
    word: ClassVar[str]
    played: ClassVar[str] = "layers"
    drawn_by: ClassVar[tuple[str, ...]] = ("mesh",)
    kinds: ClassVar[dict[str, type[RigBase]]] = {}
    root_layers: tuple[RootLayer, ...] = ()
    if TYPE_CHECKING:

        @property
        def id(self) -> str: ...

        @property
        def mesh(self) -> Mesh | None: ...

    def __init_subclass__(cls) -> None:
        RigBase.kinds[cls.kind] = cls

    @property
    def where(self) -> str:
        """How messages name it."""
        return f"{self.word} {self.id!r}"

    @property
    def handles(self) -> tuple[str, ...]:
        """The names of what it is posed by: joints or control points. Nodes of a graph have numbers alone."""
        return ()

    @property
    def keyable(self) -> int:
        """How many handles, or nodes, can have keys of their own over its motion."""
        return 0

    @property
    def parents(self) -> Int32:
        """(H,) the handle that each handle hangs on by a bone; -1 where none is."""
        return np.full(len(self.handles), -1, np.int32)

    @property
    def playing(self) -> tuple[Playing, ...]:
        """Its layers, each a take with a time map; those of its root last."""
        return (*getattr(self, self.played), *self.root_layers)

    def with_playing(self, *layers: Playing) -> Self:
        """The same with other layers."""
        own = tuple(one for one in layers if not isinstance(one, RootLayer))
        root = tuple(one for one in layers if isinstance(one, RootLayer))
        return self.with_changes(**{self.played: own, "root_layers": root})

    def without_layer(self, number: int) -> Self:
        """The same without a layer; the take stays."""
        return self.with_playing(*self.playing[:number], *self.playing[number + 1 :])

    def with_changes(self, **changes: object) -> Self:
        """A copy with some attributes changed; this one stays as it is."""
        return replace(self, **changes)  # type: ignore[type-var]

    def later(self, delay: float) -> Self:
        """The same, playing ``delay`` seconds later."""
        return self.with_playing(*(layer.later(delay) for layer in self.playing))

    def at_rest(self, mesh: Mesh | None) -> tuple[Self, tuple[Any, ...]]:
        """The same without motion, with another mesh of as many vertices, and the streams that it needs."""
        return self.with_playing().with_changes(mesh=mesh), ()

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
