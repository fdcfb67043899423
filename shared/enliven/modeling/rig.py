"""The interface that each kind of rig implements for the edits of whole characters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np

from enliven.arrays import Float
from enliven.deformation.skinning import skin_vertices
from enliven.document import Character, GraphCharacter, MotionKey, Pose, PoseStream, Project
from enliven.errors import InputError
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.mesh.seam import SeamSettings
from enliven.rotation import conjugate, from_matrix, multiply


class CharacterState(NamedTuple):
    """The state of a character at one time: its transforms, and its handles as (H, 3) metres in the world."""

    pose: Pose
    handles: Float


Player = Callable[[float], CharacterState]
"""A function that maps a time of the project, in seconds, to a character's state. It is fast enough to be
called for every frame."""


HandleMotion = Callable[[float], tuple[Float, Float]]
"""A function from a time of the project, in seconds, to the rotation (4,) and the position (3,) in metres of
a handle, a node or a part."""


@dataclass(frozen=True)
class Merge:
    """A request to attach a character to another character, both in their poses at a given time.

    Attributes:
        host, graft: ids of the two characters. The host keeps its id.
        time: seconds of the project's time.
        node: what the graft follows: a handle of the host (by number or name), or a node of its deformation
            graph. None selects the nearest.
        at: position along the host's bone that ends at ``node``, if both characters have bones. 1 is the end
            of the bone.
        loose: if the boolean union of the meshes fails, put both shells into one mesh instead of raising an
            error.
        seam: settings for smoothing the seam.
        notes: a list that receives sentences about the union of the meshes, and about approximations.
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
    """The operations of edits that depend on the kind of rig. Characters are immutable, so edits return new
    characters.

    Edits of the placement have the same effect at every time. Let c be the ``centre``, and x the vertices
    before the edit. Then ``moved`` gives turn (x - about) + about + offset, ``scaled`` gives c + factor (x -
    c), and ``mirror`` gives c + M (x - c), at every time.

    Attributes:
        frames: sampling rate of :meth:`convert_to_graph_shape` in frames per second, high enough that
            interpolation between two frames shows no visible error.
    """

    frames = 60.0

    @abstractmethod
    def centre(self, character: Any, /) -> Float:
        """Returns the fixed point (3,) of rotating, scaling and mirroring the character, in metres in the
        world."""

    def rest(self, character: Any, /) -> Float:
        """Returns the vertices at rest, (V, 3) metres. A skeleton without a mesh returns its joints."""
        return np.asarray(character.mesh.vertices)

    @abstractmethod
    def compute_vertices(self, project: Project, character: Any, time: float, /) -> Float:
        """Returns the vertices at a time of the project, (V, 3) metres. A skeleton without a mesh returns its
        joints."""

    @abstractmethod
    def make_drawing(self, character: Any, /) -> Character:
        """Returns the mesh and its pivots in the form that viewers and the network protocol use."""

    @abstractmethod
    def create_player(self, project: Project, character: Any, /) -> Player:
        """Returns a function from a time of the project to the transforms of the pivots, and the handles."""

    def create_surface_player(self, project: Project, character: Any, /) -> Callable[[float], Float]:
        """Returns a function from a time to the vertices (V, 3), in metres in the world. It is fast enough to
        be called for every frame."""
        player, drawn = self.create_player(project, character), self.make_drawing(character)
        return lambda time: np.asarray(skin_vertices(drawn, player(time).pose), np.float64)

    def find_missing_data(self, project: Project, character: Any, /) -> tuple[str, ...]:
        """Returns sentences about the data that the character still needs before it can move, or () if it can
        move.
        """
        return ()

    def check_layers(self, project: Project, character: Any, numbers: set[int], /) -> None:
        """Raises an error if the changed layers ``numbers`` cannot be played."""
        return

    def drag_handle(
        self, project: Project, character: Any, handle: int, place: Float, time: float, /
    ) -> Project:
        """Poses the character by hand: moves a handle to ``place`` (3,), metres in the world, at a time."""
        remedy = "Move or rotate the whole character, or record the performance again."
        raise InputError(
            "the handles of a recorded motion cannot be dragged", where=character.where, remedy=remedy
        )

    def key_layer(self, project: Project, character: Any, handle: int, /) -> int | None:
        """Returns the index of the layer that plays the keys of a handle or node, or None if no layer plays
        keys of the handle."""
        return None

    def find_keyable(self, character: Any, handle: int | str, /) -> int:
        """Returns the number of a bone or node that can have keys.

        Raises:
            InputError: if the handle does not exist, or if the rig's handles cannot have keys.
        """
        if isinstance(handle, str) or not 0 <= handle < character.keyable:
            count = character.keyable
            remedy = (
                f"The nodes are numbered from 0. Number of nodes: {count}."
                if count
                else "Set keys for the whole character instead."
            )
            raise InputError(
                f"node {handle!r} does not exist or cannot have keys", where=character.where, remedy=remedy
            )
        return handle

    def with_key_layer(self, project: Project, character: Any, handle: int, key: MotionKey, /) -> Project:
        """Adds the first key of a handle or node: a new take, and a layer that plays it on top of all
        others."""
        remedy = "Set keys for the whole character, or change the key poses of a puppet."
        raise InputError(
            "the handles of this character cannot have keys", where=character.where, remedy=remedy
        )

    def handle_motion(
        self, character: Any, player: Player, handle: int | None, layer: int | None, /
    ) -> HandleMotion | None:
        """Returns the motion that the window shows as curves of a handle. It is relative to the handle's
        parent bone, if a parent bone exists.

        Args:
            player: the character's player; see :meth:`player`.
            handle: the selected handle or node, or None.
            layer: the selected layer, or None.
        """
        if handle is None or handle >= len(character.handles):
            return None
        above = int(character.parents[handle])

        def at(time: float) -> tuple[Float, Float]:
            pose, handles = player(time)
            turn = from_matrix(np.asarray(pose.linear[handle], np.float64))
            if above >= 0:
                turn = multiply(conjugate(from_matrix(np.asarray(pose.linear[above], np.float64))), turn)
            return turn, np.asarray(handles[handle], np.float64)

        return at

    @abstractmethod
    def move(self, character: Any, offset: Float, turn: Float, about: Float, /) -> Any:
        """Returns the character, moved rigidly: x becomes turn (x - about) + about + offset."""

    @abstractmethod
    def scale(self, character: Any, factor: float, /) -> Any:
        """Returns the character scaled about its centre."""

    @abstractmethod
    def mirror(self, project: Project, character: Any, axes: Any, /) -> Any:
        """Returns the character with its shape and motion reflected. ``axes`` is the reflection, an
        :class:`~enliven.modeling.rigged.axes.Axes`."""

    @abstractmethod
    def convert_to_graph_shape(
        self, project: Project, character: Any, times: Float, stream_id: str, /
    ) -> tuple[GraphCharacter, PoseStream, str]:
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
    def merge(self, project: Project, merge: Merge, /) -> Project:
        """Merges two characters with this kind of rig, in their poses at the time of the merge."""


def check_names(changes: dict[str, Any], kind: Any, where: str) -> None:
    """Raises InputError if a name in ``changes`` is not an attribute of the dataclass ``kind``."""
    names = [field.name for field in fields(kind)]
    for name in changes:
        if name not in names:
            raise InputError(
                f"the attribute {name!r} does not exist",
                where=where,
                remedy=f"Known attributes: {', '.join(names)}.",
            )
