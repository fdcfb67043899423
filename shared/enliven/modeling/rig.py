"""The interface of the edits that each kind of rig implements in its own way."""

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


class CharacterState(NamedTuple):
    """A character at one moment: its transforms, and its handles as (H, 3) metres in the world."""

    pose: Pose
    handles: Float


Player = Callable[[float], CharacterState]
"""A function for frequent evaluation of a character: maps a time of the project, in seconds, to the
character's state."""


@dataclass(frozen=True)
class Merge:
    """The request to attach one character to another, each in its pose at a given time.

    Attributes:
        host, graft: ids of the two characters. The host keeps its id.
        time: seconds of the project's time.
        node: the part of the host that carries the graft: a handle (by number or name), or a node of the
            host's deformation graph. None takes the nearest.
        at: position along the host's bone that ends at ``node``, if both characters have bones. 1 is the end
            of the bone.
        loose: if the boolean union of the meshes fails, put both shells into one mesh instead of raising an
            error.
        seam: how the seam is smoothed.
        notes: receives sentences about how the meshes were united, and what was approximated.
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
    """The part of each edit that depends on the kind of rig. Characters are immutable, so edits return new
    ones.

    Edits of the placement have the same effect at every time. Let c be the ``centre``. Let x be the vertices
    before the edit. At every time, ``moved`` gives turn (x - about) + about + offset, ``scaled`` gives c +
    factor (x
    - c), and ``mirrored`` gives c + M (x - c).

    Attributes:
        frames: sampling rate of :meth:`as_graph` in frames per second, high enough that interpolation between
            two frames shows no visible error.
    """

    frames = 60.0

    @abstractmethod
    def centre(self, character: Any, /) -> Float:
        """Returns the point about which the character is turned, scaled and mirrored, (3,) metres in the
        world."""

    def rest(self, character: Any, /) -> Float:
        """Returns the vertices at rest, (V, 3) metres. A skeleton without a mesh returns its joints."""
        return np.asarray(character.mesh.vertices)

    @abstractmethod
    def seen(self, project: Project, character: Any, time: float, /) -> Float:
        """Returns the vertices at a time of the project, (V, 3) metres. A skeleton without a mesh returns its
        joints."""

    @abstractmethod
    def drawn(self, character: Any, /) -> Character:
        """Returns the mesh and its pivots in the form that viewers and the network protocol use."""

    @abstractmethod
    def player(self, project: Project, character: Any, /) -> Player:
        """Returns a function that gives the transforms of the pivots, and the handles, at any time of the
        project."""

    def surface(self, project: Project, character: Any, /) -> Callable[[float], Float]:
        """Returns a function for frequent use that gives the vertices (V, 3), metres in the world, at any
        time."""
        player, drawn = self.player(project, character), self.drawn(character)
        return lambda time: np.asarray(skin_vertices(drawn, player(time).pose), np.float64)

    def lacking(self, project: Project, character: Any, /) -> tuple[str, ...]:
        """Returns sentences about the data that the character still needs before it can move, or nothing."""
        return ()

    def check_layers(self, project: Project, character: Any, numbers: set[int], /) -> None:
        """Raises an error if the changed layers cannot be played."""
        return

    def dragged(self, project: Project, character: Any, handle: int, place: Float, time: float, /) -> Project:
        """Poses the character by hand: moves a handle to ``place`` (3,), metres in the world, at a time."""
        mend = "Move or turn the whole, or perform it again."
        raise InputError("a recorded motion cannot be posed by hand", where=character.where, mend=mend)

    def key_layer(self, project: Project, character: Any, handle: int, /) -> int | None:
        """Returns the index of the layer that plays the keys of a handle or node, or None if there is no such
        layer."""
        return None

    def with_key_layer(self, project: Project, character: Any, handle: int, key: MotionKey, /) -> Project:
        """Adds the first key of a handle or node: a new take, and a layer that plays it on top of all
        others."""
        mend = "Choose the whole character: keys turn and move it. A puppet is posed by its key poses."
        raise InputError("its handles take no keys", where=character.where, mend=mend)

    @abstractmethod
    def moved(self, character: Any, offset: Float, turn: Float, about: Float, /) -> Any:
        """Returns the character moved as one rigid piece."""

    @abstractmethod
    def scaled(self, character: Any, factor: float, /) -> Any:
        """Returns the character scaled about its centre."""

    @abstractmethod
    def mirrored(self, project: Project, character: Any, axes: Any, /) -> Any:
        """Returns the character and its motion reflected by axes
        (:class:`~enliven.modeling.rigged.axes.Axes`)."""

    @abstractmethod
    def as_graph(
        self, project: Project, character: Any, times: Float, stream_id: str, /
    ) -> tuple[GraphShape, PoseStream, str]:
        """Converts the motion at evenly spaced times (T,) to a deformation graph.

        Returns:
            The graph, its stream, and a sentence about the error of the conversion.
        """

    @abstractmethod
    def cut(
        self, project: Project, name: str, stroke: CutSurface, time: float, /, *, notes: list[str]
    ) -> tuple[Project, tuple[str, ...]]:
        """Cuts the character along a stroke, in its pose at a time. The first of the parts keeps the id."""

    @abstractmethod
    def merged(self, project: Project, merge: Merge, /) -> Project:
        """Merges two characters with this kind of rig, in their poses at the time of the merge."""


def check_names(changes: dict[str, Any], kind: Any, where: str) -> None:
    """Raises an error for names that are not attributes of the dataclass ``kind``."""
    names = [field.name for field in fields(kind)]
    for name in changes:
        if name not in names:
            raise InputError(f"it has no {name!r}", where=where, mend=f"Known: {', '.join(names)}.")
