"""The project: characters and takes. It is immutable: an edit creates a new project, and undo restores the
old one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from enliven.document.body_take import BodyTake
from enliven.document.clip import Clip
from enliven.document.graph.shape import GraphCharacter
from enliven.document.graph.stream import PoseStream
from enliven.document.puppet import ExampleCharacter
from enliven.document.rig import RigBase
from enliven.document.rigged import RiggedCharacter
from enliven.document.smoothing import smooth_take
from enliven.document.time_map import LayerBase
from enliven.errors import InputError
from enliven.sounds import Sound

R = TypeVar("R", bound=RigBase)


@dataclass(frozen=True)
class Marker:
    """A named time of the project.

    Attributes:
        id: its name.
        seconds: time in the project, seconds.
    """

    id: str
    seconds: float

    def __post_init__(self) -> None:
        if not (self.id and 0.0 <= self.seconds < float("inf")):
            problem = (
                f"a marker needs a name and a time of at least 0 s, but has the name {self.id!r} and "
                f"the time {self.seconds} s"
            )
            raise InputError(problem, where="project", remedy="Correct the name or the time of the marker.")


@dataclass(frozen=True)
class CameraMark:
    """A stored camera view (bookmark).

    Attributes:
        id: its name.
        target: the point that the camera looks at: x, y, z in metres.
        azimuth: angle around the target from +Z towards +X, radians.
        elevation: angle above the horizontal, radians.
        distance: distance from the target, metres.
    """

    id: str
    target: tuple[float, float, float]
    azimuth: float
    elevation: float
    distance: float

    def __post_init__(self) -> None:
        numbers = (*self.target, self.azimuth, self.elevation, self.distance)
        if not (all(abs(number) < float("inf") for number in numbers) and self.distance > 0.0):
            raise InputError(
                "a number of the camera view is not finite, or the distance is not above 0",
                where=f"view {self.id!r}",
                remedy="Store the camera view again.",
            )


@dataclass(frozen=True)
class DisplayState:
    """The display state of a character in an artist's window. Exports ignore it.

    Attributes:
        hidden: True if the window does not draw the character.
        locked: True if the character can be neither selected nor edited.
        size: display scale on a stage, relative to the character's own size. Performers set it by gestures.
        exaggeration: factor on the overshoot of its soft parts on a stage. None means the stage's setting.
    """

    hidden: bool = False
    locked: bool = False
    size: float = 1.0
    exaggeration: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.size < float("inf"):
            raise InputError(
                f"the display size {self.size} of a character is not valid",
                where="handling",
                remedy="Set a size above 0.",
            )
        if self.exaggeration is not None and not 0.0 <= self.exaggeration < float("inf"):
            problem = f"the exaggeration {self.exaggeration} of a character is not valid"
            raise InputError(problem, where="handling", remedy="Set an exaggeration of at least 0.")


FREE = DisplayState()
"""The state of a character that is visible and editable."""


@dataclass(frozen=True, eq=False)
class Project:
    """A project: all characters by id, with any kind of rig, and the takes and streams that they play. Takes
    and streams are immutable.

    Attributes:
        characters: rigged shapes, possessed meshes, puppets, and other characters with a rig.
        takes: performances as motion of a skeleton.
        streams: motion of the nodes of possessed meshes.
        bodies: tracked performers, from which the motion of possessed meshes is solved.
        markers: named times, in the order in which they were created.
        handling: the display states (hidden, locked, ...) of characters, by id.
        views: camera bookmarks.
        sounds: audio that is played during a performance.

    Raises:
        InputError: if a character plays a take that does not exist.
    """

    characters: Mapping[str, RigBase] = field(default_factory=dict)
    takes: Mapping[str, Clip] = field(default_factory=dict)
    streams: Mapping[str, PoseStream] = field(default_factory=dict)
    bodies: Mapping[str, BodyTake] = field(default_factory=dict)
    markers: Mapping[str, Marker] = field(default_factory=dict)
    handling: Mapping[str, DisplayState] = field(default_factory=dict)
    views: Mapping[str, CameraMark] = field(default_factory=dict)
    sounds: Mapping[str, Sound] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for part in fields(self):
            object.__setattr__(self, part.name, MappingProxyType(dict(getattr(self, part.name))))
        handlings = {
            k: handling for k, handling in self.handling.items() if handling != FREE and k in self.characters
        }
        object.__setattr__(self, "handling", MappingProxyType(handlings))
        collections = {part.name: getattr(self, part.name) for part in fields(self)}
        for character in self.characters.values():
            character.check(collections)

    def with_characters(self, *characters: RigBase) -> Project:
        """Returns the project with these characters added, or replacing those with the same id."""
        return replace(
            self, characters={**self.characters, **{character.id: character for character in characters}}
        )

    def drop_character(self, character_id: str) -> Project:
        """Returns the project without a character. The takes that it played stay in the project.

        Raises:
            InputError: if the character does not exist. The message lists the existing ids.
        """
        self.character(character_id)
        return replace(self, characters={k: v for k, v in self.characters.items() if k != character_id})

    def with_takes(self, *takes: Clip) -> Project:
        """Returns the project with these takes added."""
        return replace(self, takes={**self.takes, **{take.id: take for take in takes}})

    def with_streams(self, *streams: PoseStream) -> Project:
        """Returns the project with these pose streams added."""
        return replace(self, streams={**self.streams, **{stream.id: stream for stream in streams}})

    def with_bodies(self, *takes: BodyTake) -> Project:
        """Returns the project with these takes of tracked bodies added."""
        return replace(self, bodies={**self.bodies, **{take.id: take for take in takes}})

    def with_sounds(self, *sounds: Sound) -> Project:
        """Returns the project with these sounds added, or replacing those with the same id."""
        return replace(self, sounds={**self.sounds, **{sound.id: sound for sound in sounds}})

    def character(self, character_id: str, rig: type[R] = RigBase) -> R:  # type: ignore[assignment]
        """Returns the character with an id.

        Args:
            rig: the required kind of rig; by default any kind.

        Raises:
            InputError: if no character of this kind has the id. The message lists the existing ids.
        """
        candidate = self.characters.get(character_id)
        if isinstance(candidate, rig):
            return candidate
        names, word = ", ".join(self.select_kind(rig)), getattr(rig, "word", "character")
        advice = f"The project contains: {names}." if names else f"Add a {word} first."
        raise InputError(f"the project has no {word} {character_id!r}", where="project", remedy=advice)

    def select_kind(self, rig: type[R]) -> dict[str, R]:
        """Returns the characters of one kind, by id."""
        return {key: character for key, character in self.characters.items() if isinstance(character, rig)}

    def shape(self, shape_id: str) -> RiggedCharacter:
        """Returns the rigged shape with an id; see :meth:`character`."""
        return self.character(shape_id, RiggedCharacter)

    def graph(self, shape_id: str) -> GraphCharacter:
        """Returns the possessed mesh with an id; see :meth:`character`."""
        return self.character(shape_id, GraphCharacter)

    def puppet(self, puppet_id: str) -> ExampleCharacter:
        """Returns the puppet with an id; see :meth:`character`."""
        return self.character(puppet_id, ExampleCharacter)

    @property
    def shapes(self) -> dict[str, RiggedCharacter]:
        """The rigged shapes."""
        return self.select_kind(RiggedCharacter)

    @property
    def graphs(self) -> dict[str, GraphCharacter]:
        """The possessed meshes."""
        return self.select_kind(GraphCharacter)

    @property
    def puppets(self) -> dict[str, ExampleCharacter]:
        """The puppets."""
        return self.select_kind(ExampleCharacter)

    @property
    def layer_names(self) -> dict[str, None]:
        """The ids of the layers of all shapes."""
        return dict.fromkeys(layer.id for shape in self.shapes.values() for layer in shape.layers)

    def length_of(self, layer: LayerBase) -> float:
        """Returns the duration of the take that a layer plays, in seconds."""
        return self._find_recorded_clip(layer).duration

    def take_of(self, layer: LayerBase) -> Clip | PoseStream:
        """Returns the take that a layer plays, with the layer's smoothing applied."""
        return smooth_take(self._find_recorded_clip(layer), layer.smooth)

    def _find_recorded_clip(self, layer: LayerBase) -> Clip | PoseStream:
        collection: Mapping[str, Clip | PoseStream] = (
            self.streams if layer.source == "streams" else self.takes
        )
        return collection[layer.take]

    def end_of(self, character: RigBase) -> float:
        """Returns the time at which all unmuted layers of a character have been played once, or 0 without
        layers."""
        heard = [layer for layer in character.playing if not layer.muted]
        return max((layer.end(self.length_of(layer)) for layer in heard), default=0.0)


def are_identical(a: object, b: object) -> bool:
    """Returns True if two projects, or two parts of them, are equal bit for bit.

    Arrays are equal if their types, shapes and bytes are equal. So -0.0 differs from 0.0, and a NaN equals
    itself.
    """
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if is_dataclass(a):
        return all(are_identical(getattr(a, part.name), getattr(b, part.name)) for part in fields(a))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(are_identical(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(are_identical(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return a.hex() == b.hex()
    return bool(a == b)
