"""What every rig can do, written down: the part of each edit that it does its own way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np

from enliven.arrays import Float
from enliven.deformation import skin_vertices
from enliven.document import Character, GraphShape, MotionKey, Pose, PoseStream, Project
from enliven.errors import InputError
from enliven.modeling.mesh import CutSurface, SeamSettings


class Posed(NamedTuple):
    """A character at a moment: its transforms, and (H, 3) metres in the world, its handles."""

    pose: Pose
    handles: Float


Player = Callable[[float], Posed]
"""A character prepared to be evaluated often: from seconds of the project's time to the moment."""


@dataclass(frozen=True)
class Merge:
    """One character put onto another where the two are at a time.

    Attributes:
        host, graft: their ids; the host keeps its own.
        time: seconds of the project's time.
        node: what the graft rides on: a handle of the host, by number or name, or a node of its graph; None
            takes the nearest.
        at: where on the host's bone that ends at ``node``, where both have bones: 1 is its end.
        loose: where no union of the meshes can be made, put both shells into one mesh.
        seam: how the seam is smoothed.
        notes: takes sentences about how the meshes were united, and what was approximated.
    """

    host: str
    graft: str
    time: float
    node: int | str | None = None
    at: float = 1.0
    loose: bool = False
    seam: SeamSettings = field(default_factory=SeamSettings)
    notes: list[str] = field(default_factory=list)


class RigEdits(ABC):
    """The part of each edit that a rig does its own way. A character is a value: these return another one.

    With ``centre`` c, all of them commute with time: at every time the vertices of ``moved`` are at
    turn (x - about) + about + offset, those of ``scaled`` at c + factor (x - c), and those of ``mirrored``
    at c + M (x - c), with x where the vertices were.

    Attributes:
        frames: a second, that :meth:`as_graph` is asked for: so many that between two no error is seen.
    """

    frames = 60.0

    @abstractmethod
    def centre(self, character: Any, /) -> Float:
        """(3,) metres in the world: what it is turned, scaled and mirrored about."""

    def rest(self, character: Any, /) -> Float:
        """(V, 3) metres: its vertices at rest; of a skeleton without a mesh, its joints."""
        return np.asarray(character.mesh.vertices)

    @abstractmethod
    def seen(self, project: Project, character: Any, time: float, /) -> Float:
        """(V, 3) metres: its vertices at a time of the project; of a skeleton without a mesh, its joints."""

    @abstractmethod
    def drawn(self, character: Any, /) -> Character:
        """Its mesh and pivots, as viewers and the wire know it."""

    @abstractmethod
    def player(self, project: Project, character: Any, /) -> Player:
        """What gives the transforms of those pivots, and its handles, at any time of the project."""

    def surface(self, project: Project, character: Any, /) -> Callable[[float], Float]:
        """What gives its vertices (V, 3), metres in the world, at any time; to be asked often."""
        player, drawn = self.player(project, character), self.drawn(character)
        return lambda time: np.asarray(skin_vertices(drawn, player(time).pose), np.float64)

    def lacking(self, project: Project, character: Any, /) -> tuple[str, ...]:
        """Sentences about what it needs before it can move; none where nothing is missing."""
        return ()

    def check_layers(self, project: Project, character: Any, numbers: set[int], /) -> None:
        """Refuse layers that were changed to what cannot be played."""
        return

    def dragged(self, project: Project, character: Any, handle: int, place: Float, time: float, /) -> Project:
        """Posed by hand: a handle is at ``place`` (3,) metres in the world at a time."""
        mend = "Move or turn the whole, or perform it again."
        raise InputError("what was recorded is not posed by hand", where=character.where, mend=mend)

    def key_layer(self, project: Project, character: Any, handle: int, /) -> int | None:
        """The number among its layers of the one that plays the keys of a handle or node; None without."""
        return None

    def with_key_layer(self, project: Project, character: Any, handle: int, key: MotionKey, /) -> Project:
        """With the first key of a handle or node: a take, and a layer that plays it over all others."""
        mend = "Choose the whole: keys turn and move it. A puppet is posed by its key poses."
        raise InputError("its handles take no keys", where=character.where, mend=mend)

    @abstractmethod
    def moved(self, character: Any, offset: Float, turn: Float, about: Float, /) -> Any:
        """Moved as one rigid piece."""

    @abstractmethod
    def scaled(self, character: Any, factor: float, /) -> Any:
        """Larger or smaller."""

    @abstractmethod
    def mirrored(self, project: Project, character: Any, axes: Any, /) -> Any:
        """Reflected by axes (:class:`~enliven.modeling.rigged.axes.Axes`), and so is its motion."""

    @abstractmethod
    def as_graph(
        self, project: Project, character: Any, times: Float, stream_id: str, /
    ) -> tuple[GraphShape, PoseStream, str]:
        """What it does at even times (T,), as a graph with its stream; and in words how far that is off."""

    @abstractmethod
    def cut(
        self, project: Project, name: str, stroke: CutSurface, time: float, /, *, notes: list[str]
    ) -> tuple[Project, tuple[str, ...]]:
        """Cut along a stroke, as it is seen at a time; the first of the parts keeps the id."""

    @abstractmethod
    def merged(self, project: Project, merge: Merge, /) -> Project:
        """Two of this rig as one, put together where they are at a time."""


def check_names(changes: dict[str, Any], kind: Any, where: str) -> None:
    """Refuse names that are no attribute of the dataclass ``kind``."""
    known = [field.name for field in fields(kind)]
    for name in changes:
        if name not in known:
            raise InputError(f"it has no {name!r}", where=where, mend=f"Known: {', '.join(known)}.")
