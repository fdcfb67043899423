"""The rig of a character: the common part of all kinds of rigs.

A character is a single value, and its class is its kind of rig. It is not composed of separate objects for
mesh, rig, layers and placement, because only the mesh could be separated in all three kinds. The layers of a
skeleton are referenced by the spans of its bones, and removed with the last reference. In a deformation
graph, the parts define both nodes and layers. Each part has its own placement in the world and its own
carrying node. So rig and layers depend on each other. The placement of a skeleton is the first of its
modeling rotations. The placement of a graph is in every part. This module contains the common part, and the
edits are written once against :class:`enliven.modeling.rig.RigEdits`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from enliven.arrays import Int32
from enliven.document.layers import RootLayer
from enliven.document.time_map import LayerBase
from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.document.skeleton import Skeleton
    from enliven.meshes import Mesh


@dataclass(frozen=True, eq=False, kw_only=True)
class RigBase:
    """A character of a project: a mesh, the rig that moves it, and the layers that it plays.

    The edits of all rigs are in :mod:`enliven.modeling.edits`; the part that depends on the rig is in the
    rig's own package.

    Attributes:
        kind: identifies the rig in files and on the network: "bones", "graph" or "points".
        word: name of the rig kind in messages.
        played: name of the attribute that contains the layers.
        drawn_by: names of the attributes that determine the surface at rest.
        kinds: all rig classes by kind. Each class registers itself.
        jointed: True if the handles are joints. A joint is rotated by its bone, and cannot be moved
            independently.
        is_solved: True if the surface is solved from the handles in every pose, so that an exact export needs
            morph targets.
        locks_feet: True if the feet of its recorded motion can be locked. False if the rig has its own
            contacts.
        sent_by: names of the attributes that an edge needs, if it does not need the motion. Empty if it needs
            all.
        id: its name in the project.
        mesh: the surface at rest, or None.
        root_layers: layers that rotate and move the whole character on top of all other layers, the innermost
            first.
    """

    kind: ClassVar[str]
    word: ClassVar[str]
    played: ClassVar[str] = "layers"
    drawn_by: ClassVar[tuple[str, ...]] = ("mesh",)
    kinds: ClassVar[dict[str, type[RigBase]]] = {}
    jointed: ClassVar[bool] = False
    is_solved: ClassVar[bool] = False
    locks_feet: ClassVar[bool] = True
    sent_by: ClassVar[tuple[str, ...]] = ()
    root_layers: tuple[RootLayer, ...] = ()
    if TYPE_CHECKING:

        @property
        def id(self) -> str:
            """The name of the character, unique in its project."""
            ...

        @property
        def mesh(self) -> Mesh | None:
            """The surface at rest, or None for a skeleton without a surface."""
            ...

    def __init_subclass__(cls) -> None:
        RigBase.kinds[cls.kind] = cls

    @property
    def where(self) -> str:
        """A phrase with the kind and id of the character, for error messages."""
        return f"{self.word} {self.id!r}"

    @property
    def handles(self) -> tuple[str, ...]:
        """The names of the handles: joints or control points. Graph nodes have only numbers."""
        return ()

    @property
    def performed_parts(self) -> tuple[str, ...]:
        """The takes of the parts that were performed one by one, in their order. Empty for other rigs."""
        return ()

    def find_skeleton(self) -> Skeleton | None:
        """Returns the skeleton that moves the character, or None if it has none."""
        return None

    @property
    def keyable(self) -> int:
        """The number of handles or nodes that can get keyframes on top of the motion."""
        return 0

    @property
    def parents(self) -> Int32:
        """(H,) the parent of each handle along a bone, or -1 for a handle without a parent."""
        return np.full(len(self.handles), -1, np.int32)

    @property
    def is_possessable(self) -> bool:
        """True if performers can only move the character by attaching to its surface, because it has no bones
        and too few examples.
        """
        return False

    def examples_of(self, layer: LayerBase) -> Sequence[tuple[int, Any]]:
        """Returns the example poses in the take of one of its layers, each with its number. Only
        example-driven characters have example poses.
        """
        return ()

    @property
    def playing(self) -> tuple[LayerBase, ...]:
        """All layers of the character, each with a take and a time map. The root layers come last."""
        return (*getattr(self, self.played), *self.root_layers)

    def with_playing(self, *layers: LayerBase) -> Self:
        """Returns the character with other layers."""
        own_layers = tuple(layer for layer in layers if not isinstance(layer, RootLayer))
        root = tuple(layer for layer in layers if isinstance(layer, RootLayer))
        return self.with_changes(**{self.played: own_layers, "root_layers": root})

    def without_layer(self, number: int) -> Self:
        """Returns the character without a layer. The take stays in the project."""
        return self.with_playing(*self.playing[:number], *self.playing[number + 1 :])

    def with_changes(self, **changes: object) -> Self:
        """Returns a copy with some attributes changed."""
        return replace(self, **changes)  # type: ignore[type-var]

    def delay_motion(self, delay: float) -> Self:
        """Returns the character with its motion delayed by ``delay`` seconds."""
        return self.with_playing(*(layer.add_delay(delay) for layer in self.playing))

    def at_rest(self, mesh: Mesh | None) -> tuple[Self, tuple[Any, ...]]:
        """Returns the character without motion and with another mesh of the same vertex count, and the
        streams that it needs.
        """
        return self.with_playing().with_changes(mesh=mesh), ()

    def find_needed_ids(self) -> Mapping[str, set[str]]:
        """Returns the ids to which the character refers in the project's collections "takes", "streams" and
        "bodies".
        """
        ids: dict[str, set[str]] = {"takes": set(), "streams": set(), "bodies": set()}
        for layer in self.playing:
            for collection, name in layer.needs():
                ids[collection].add(name)
        return ids

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """Returns the character with renamed ids of takes. The new names are given by the project's
        collection and the old id.
        """
        return self.with_playing(*(layer.with_takes_named(names) for layer in self.playing))

    def check(self, held: Mapping[str, Mapping[str, Any]]) -> None:
        """Raises InputError if a take does not exist or is incompatible.

        Args:
            held: the collections of the project, by name.

        Raises:
            InputError: if a take is missing. The message names it.
        """
        for collection, names in self.find_needed_ids().items():
            missing = names - set(held[collection])
            if missing:
                first_missing = min(missing)
                problem = (
                    f"the project has no {collection[:-1]} {first_missing!r}, but the character needs it"
                )
                raise InputError(
                    (
                        f"the project has no recorded performers {first_missing!r}, but the character needs "
                        "them"
                    )
                    if collection == "bodies"
                    else problem,
                    where=self.where,
                )
