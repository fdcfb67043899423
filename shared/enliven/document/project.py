"""The project: characters and takes. It is a value: an edit makes another, and undo is the one before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from enliven.document.body_take import BodyTake
from enliven.document.clip import Clip
from enliven.document.graph import GraphShape, PoseStream
from enliven.document.puppet import Puppet
from enliven.document.rig import RigBase
from enliven.document.rigged import Shape
from enliven.document.smoothing import smoothed
from enliven.document.time_map import Playing
from enliven.errors import InputError
from enliven.sounds import Sound

R = TypeVar("R", bound=RigBase)


@dataclass(frozen=True)
class Marker:
    """A moment of the project with a name.

    Attributes:
        id: its name.
        seconds: of the project's time.
    """

    id: str
    seconds: float

    def __post_init__(self) -> None:
        if not (self.id and 0.0 <= self.seconds < float("inf")):
            what = f"a marker {self.id!r} cannot be at {self.seconds} s"
            raise InputError(what, where="project", mend="Give a name, and seconds from 0 on.")


@dataclass(frozen=True)
class CameraMark:
    """A view that was stored, to be taken again.

    Attributes:
        id: its name.
        target: x, y, z in metres, what the camera looks at.
        azimuth: radians around the target from +Z towards +X.
        elevation: radians above the floor.
        distance: metres from the target.
    """

    id: str
    target: tuple[float, float, float]
    azimuth: float
    elevation: float
    distance: float

    def __post_init__(self) -> None:
        numbers = (*self.target, self.azimuth, self.elevation, self.distance)
        if not (all(abs(one) < float("inf") for one in numbers) and self.distance > 0.0):
            raise InputError("it is no view", where=f"view {self.id!r}", mend="Store it again.")


@dataclass(frozen=True)
class Handling:
    """How an artist's window treats a character; exports do not ask.

    Attributes:
        hidden: the window does not draw it.
        locked: it is neither picked nor edited.
        size: how many times its own size it stands on a stage, as performers' hands made it.
        exaggeration: how far its soft parts swing past the motion there; None: as the stage's settings say.
    """

    hidden: bool = False
    locked: bool = False
    size: float = 1.0
    exaggeration: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.size < float("inf"):
            raise InputError(f"its size is {self.size}", where="handling", mend="Give one above 0.")
        if self.exaggeration is not None and not 0.0 <= self.exaggeration < float("inf"):
            what = f"its exaggeration is {self.exaggeration}"
            raise InputError(what, where="handling", mend="Give 0 or more.")


FREE = Handling()
"""A character that is seen, and can be edited."""


@dataclass(frozen=True, eq=False)
class Project:
    """All characters by id, of any rig, and what they play. Takes and streams never change.

    Attributes:
        characters: rigged shapes, possessed meshes, puppets, and what else has a rig.
        takes: what performers did, as motion of a skeleton.
        streams: what possessed meshes did, as motion of their nodes.
        bodies: what performers did, as it was tracked: possessed meshes are solved from it.
        markers: moments with names, in the order in which they were made.
        handling: the characters that are hidden or locked, and how.
        views: camera bookmarks.
        sounds: what is performed along.

    Raises:
        InputError: where a character plays a take that is not there.
    """

    characters: Mapping[str, RigBase] = field(default_factory=dict)
    takes: Mapping[str, Clip] = field(default_factory=dict)
    streams: Mapping[str, PoseStream] = field(default_factory=dict)
    bodies: Mapping[str, BodyTake] = field(default_factory=dict)
    markers: Mapping[str, Marker] = field(default_factory=dict)
    handling: Mapping[str, Handling] = field(default_factory=dict)
    views: Mapping[str, CameraMark] = field(default_factory=dict)
    sounds: Mapping[str, Sound] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for part in fields(self):
            object.__setattr__(self, part.name, MappingProxyType(dict(getattr(self, part.name))))
        kept = {k: one for k, one in self.handling.items() if one != FREE and k in self.characters}
        object.__setattr__(self, "handling", MappingProxyType(kept))
        held = {part.name: getattr(self, part.name) for part in fields(self)}
        for character in self.characters.values():
            character.check(held)

    def with_characters(self, *characters: RigBase) -> Project:
        """A project with these characters added, or put in the place of those of the same id."""
        return replace(self, characters={**self.characters, **{one.id: one for one in characters}})

    def without(self, character_id: str) -> Project:
        """A project without a character; what it played stays.

        Raises:
            InputError: where there is none, with the ids that there are.
        """
        self.character(character_id)
        return replace(self, characters={k: v for k, v in self.characters.items() if k != character_id})

    def with_takes(self, *takes: Clip) -> Project:
        """A project with these takes added."""
        return replace(self, takes={**self.takes, **{take.id: take for take in takes}})

    def with_streams(self, *streams: PoseStream) -> Project:
        """A project with these pose streams added."""
        return replace(self, streams={**self.streams, **{stream.id: stream for stream in streams}})

    def with_bodies(self, *takes: BodyTake) -> Project:
        """A project with these takes of tracked bodies added."""
        return replace(self, bodies={**self.bodies, **{take.id: take for take in takes}})

    def with_sounds(self, *sounds: Sound) -> Project:
        """A project with these sounds added, or put in the place of those of the same id."""
        return replace(self, sounds={**self.sounds, **{one.id: one for one in sounds}})

    def character(self, character_id: str, rig: type[R] = RigBase) -> R:  # type: ignore[assignment]
        """The character of an id.

        Args:
            rig: the kind that it has to be; any, by default.

        Raises:
            InputError: where there is none of that kind, with the ids that there are.
        """
        found = self.characters.get(character_id)
        if isinstance(found, rig):
            return found
        known, word = ", ".join(self.of(rig)), getattr(rig, "word", "character")
        mend = f"Known: {known}." if known else "Add one first."
        raise InputError(f"there is no {word} {character_id!r}", where="project", mend=mend)

    def of(self, rig: type[R]) -> dict[str, R]:
        """The characters of one kind, by id."""
        return {key: one for key, one in self.characters.items() if isinstance(one, rig)}

    def shape(self, shape_id: str) -> Shape:
        """The rigged shape of an id, as :meth:`character` does."""
        return self.character(shape_id, Shape)

    def graph(self, shape_id: str) -> GraphShape:
        """The possessed mesh of an id, as :meth:`character` does."""
        return self.character(shape_id, GraphShape)

    def puppet(self, puppet_id: str) -> Puppet:
        """The puppet of an id, as :meth:`character` does."""
        return self.character(puppet_id, Puppet)

    @property
    def shapes(self) -> dict[str, Shape]:
        """The rigged shapes."""
        return self.of(Shape)

    @property
    def graphs(self) -> dict[str, GraphShape]:
        """The possessed meshes."""
        return self.of(GraphShape)

    @property
    def puppets(self) -> dict[str, Puppet]:
        """The puppets."""
        return self.of(Puppet)

    @property
    def layer_names(self) -> dict[str, None]:
        """The ids of the layers of all shapes."""
        return dict.fromkeys(layer.id for shape in self.shapes.values() for layer in shape.layers)

    def length_of(self, layer: Playing) -> float:
        """Seconds of the take that a layer plays."""
        return self._recorded(layer).duration

    def take_of(self, layer: Playing) -> Clip | PoseStream:
        """The take that a layer plays, as smooth as it plays it."""
        return smoothed(self._recorded(layer), layer.smooth)

    def _recorded(self, layer: Playing) -> Clip | PoseStream:
        held: Mapping[str, Clip | PoseStream] = self.streams if layer.source == "streams" else self.takes
        return held[layer.take]

    def end_of(self, character: RigBase) -> float:
        """The time at which each of a character's layers that is not muted was played once; 0 without."""
        heard = [layer for layer in character.playing if not layer.muted]
        return max((layer.end(self.length_of(layer)) for layer in heard), default=0.0)


def same(a: object, b: object) -> bool:
    """Whether two projects, or two parts of them, are the same value, bit for bit.

    Arrays are the same with the same type, shape and bytes; so -0.0 is not 0.0, and a NaN is itself.
    """
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if is_dataclass(a):
        return all(same(getattr(a, part.name), getattr(b, part.name)) for part in fields(a))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return a.hex() == b.hex()
    return bool(a == b)
