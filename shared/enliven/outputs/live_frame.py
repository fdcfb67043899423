"""A frame for live outputs: an immutable object with the parts of the edge's result that other programs
receive."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import Character, Pose, Props, Skeleton
from enliven.frames import DepthFrame
from enliven.outputs.humanoid_map import HumanoidMap, humanoid_map
from enliven.outputs.row_kernels import write_bone_rows, write_placement
from enliven.person import Body, HumanPose, Joint, human_of_body
from enliven.rotation import IDENTITY, from_matrix

PERFORMER = "performer-"
"""Prefix of performers' names in addresses and messages, such as performer-1."""


Layout = tuple[str, tuple[str, ...], tuple[str, ...], bytes, int]
"""The id of a character, the names of its joints, its humanoid bones, the bytes of its array of edges, and
its number of pivots. Names and bones may be empty."""


@dataclass(frozen=True, eq=False)
class CharacterInfo:
    """The constant parts of a character on the stage.

    Attributes:
        character: the character with its rest pose.
        humanoid: its humanoid bones, or None if it is not a rigged human.
    """

    character: Character
    humanoid: HumanoidMap | None = None

    @cached_property
    def middle(self) -> Float:
        """(3,) metres, the mean of the pivots at rest."""
        return np.asarray(self.character.pivots.mean(0, dtype=np.float64))

    @cached_property
    def pivots(self) -> Float32:
        """(J, 3) metres, the pivots at rest as an array that kernels accept."""
        return np.require(self.character.pivots, np.float32, ("C", "W"))

    @cached_property
    def layout(self) -> Layout:
        """The names and lines of the character.

        Messages about characters with equal layouts differ only in their numbers.
        """
        character = self.character
        bones = () if self.humanoid is None else self.humanoid.bones
        return character.id, character.names or (), bones, character.edges.tobytes(), len(character.pivots)


class CharacterInfos:
    """A cache of the constant parts of the characters on a stage. A character is analysed when it is new or
    has changed."""

    def __init__(self) -> None:
        self._infos: dict[str, CharacterInfo] = {}

    def update(
        self, characters: Mapping[str, Character], skeleton_of: Callable[[str], Skeleton | None]
    ) -> dict[str, CharacterInfo]:
        """Returns the constant parts of the characters that are on the stage now, by id.

        Args:
            characters: the characters by id. A changed character must be a new object.
            skeleton_of: a function that returns the skeleton of a character by its id, or None if it has no
                skeleton. It is called only for new or changed characters.
        """
        earlier, self._infos = self._infos, {}
        for name, character in characters.items():
            info = earlier.get(name)
            if info is None or info.character is not character:
                skeleton = skeleton_of(name)
                info = CharacterInfo(character, None if skeleton is None else humanoid_map(skeleton))
            self._infos[name] = info
        return self._infos


@dataclass(frozen=True)
class LiveEvent:
    """Something that happened between two frames.

    Attributes:
        kind: "possess", "release", "enter" or "leave".
        performer: number of the performer. 0 means all performers or an unknown performer.
        character: id of the character. Empty for "enter" and "leave".
    """

    kind: str
    performer: int
    character: str = ""


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """The data of one frame that outputs may send. It is immutable. All outputs use it from one thread.

    Attributes:
        time_ns: time of the frame in nanoseconds of the sensor's clock.
        performers: the bodies in view. The key is the performer's number, from 1, which does not change while
            the performer is in view.
        poses: the poses of the characters, in the order of the stage.
        characters: the constant parts of every posed character, by id.
        held: ids of the characters that a performer possesses.
        props: the loose objects, or None if there are none.
        events: the events since the previous frame of the edge.
        depth: the sensor's depth image, or None if the sensor sends tracked people instead.
        world_from_camera: (4, 4) pose of the sensor, or None if it is not known.
        mirrored: True if performers are mirrored. The depth image is never mirrored.
    """

    time_ns: int
    performers: Mapping[int, Body]
    poses: Sequence[Pose] = ()
    characters: Mapping[str, CharacterInfo] = field(default_factory=dict)
    held: frozenset[str] = frozenset()
    props: Props | None = None
    events: Sequence[LiveEvent] = ()
    depth: DepthFrame | None = None
    world_from_camera: Float | None = None
    mirrored: bool = False

    _humans: dict[str, HumanPose] = field(init=False, default_factory=dict, repr=False)
    """Cache of the human poses by name. Each pose is computed once for all outputs."""

    def find_human_performer(self, number: int) -> HumanPose | None:
        """Returns the human pose of a performer, or None if there is none with this number."""
        body, name = self.performers.get(number), f"{PERFORMER}{number}"
        if body is not None and name not in self._humans:
            self._humans[name] = human_of_body(body, name)
        return self._humans.get(name)

    def find_human_character(self, name: str) -> HumanPose | None:
        """Returns the human pose of a character, or None if it is not a rigged human on the stage."""
        if name not in self._humans:
            for info, pose in self.posed:
                if pose.character == name and info.humanoid is not None:
                    self._humans[name] = info.humanoid.convert_pose(pose)
                    break
        return self._humans.get(name)

    @cached_property
    def posed(self) -> list[tuple[CharacterInfo, Pose]]:
        """The posed characters with their constant parts.

        A pose is left out if it belongs to another version of its character, with a different number of
        transforms.
        """
        pairs = ((self.characters.get(pose.character), pose) for pose in self.poses)
        return [(i, p) for i, p in pairs if i is not None and len(p.positions) == len(i.character.pivots)]

    @property
    def humans(self) -> list[HumanPose]:
        """The human poses of all performers, and then of all characters that are rigged humans."""
        poses = [self.find_human_performer(number) for number in self.performers]
        poses += [self.find_human_character(pose.character) for pose in self.poses]
        return [human for human in poses if human is not None]

    def find_human(self, source: str) -> HumanPose | None:
        """Returns the human pose of a source, or None if there is none now.

        Args:
            source: id of a character or ``performer-N``. If empty, the first human character on the stage is
                used, or else the performer with the lowest number.
        """
        if source.startswith(PERFORMER):
            number = source.removeprefix(PERFORMER)
            return self.find_human_performer(int(number)) if number.isdecimal() else None
        if source:
            return self.find_human_character(source)
        for pose in self.poses:
            if (human := self.find_human_character(pose.character)) is not None:
                return human
        return self.find_human_performer(min(self.performers)) if self.performers else None

    @cached_property
    def rows(self) -> StageRows:
        """The position and rotation of everything on the stage."""
        return compute_stage_rows(self)


@dataclass(frozen=True, eq=False)
class StageRows:
    """The position and rotation of everything on the stage, as one array.

    Attributes:
        values: (R, 7) positions in metres and unit quaternions (w, x, y, z), world frame. The order is: each
            posed character as a whole, the bones of each rig, the performers' hips, the loose objects.
        key: hashable value that is equal for frames with the same names in the same order.
        infos: the constant parts of the posed characters.
    """

    values: Float
    key: tuple[tuple[Layout, ...], tuple[int, ...], tuple[int, ...]]
    infos: tuple[CharacterInfo, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The ids of the posed characters."""
        return tuple(layout[0] for layout in self.key[0])

    def labels(self) -> list[str]:
        """Returns the name of each row: ``anna``, ``anna/Head``, ``performer-1``, ``prop-3``."""
        layouts, performers, props = self.key
        bones = (f"{name}/{bone}" for name, bones, *_ in layouts for bone in bones)
        people = (f"{PERFORMER}{number}" for number in performers)
        return [*self.names, *bones, *people, *(f"prop-{number}" for number in props)]

    def bone_slices(self) -> list[slice]:
        """Returns the range of rows with the bones of each posed character. The range is empty for a
        character without bone names."""
        ends = np.cumsum([len(self.key[0]), *(len(layout[1]) for layout in self.key[0])]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]


def compute_stage_rows(frame: LiveFrame) -> StageRows:
    """Returns the position and rotation of everything on the stage of a frame."""
    placed = frame.posed
    infos = tuple(info for info, _ in placed)
    layouts = tuple(info.layout for info in infos)
    bones = sum(len(layout[1]) for layout in layouts)
    performers, props = tuple(frame.performers), frame.props
    ids = () if props is None else tuple(map(int, props.ids))
    values = np.empty((len(placed) + bones + len(performers) + len(ids), 7))
    row = len(placed)
    for number, (info, pose) in enumerate(placed):
        linear, positions = _transforms_of(pose)
        if info.character.kind == "graph":
            _fit_graph(info, pose, values[number])
        else:
            write_placement(linear, positions, info.pivots, info.middle, values[number])
        count = len(info.layout[1])
        if count:
            write_bone_rows(linear, positions, values[row : row + count])
        row += count
    for body in frame.performers.values():
        values[row, :3] = body.joints[Joint.HIP_CENTER]
        values[row, 3:] = IDENTITY if body.orientations is None else body.orientations[Joint.HIP_CENTER]
        row += 1
    if props is not None:
        values[row:, :3], values[row:, 3:] = props.positions, props.turns
    return StageRows(values, (layouts, performers, ids), infos)


def _transforms_of(pose: Pose) -> tuple[Float32, Float32]:
    """Returns the linear maps and positions of a pose as arrays that kernels accept."""
    rules = ("C", "W")
    return np.require(pose.linear, np.float32, rules), np.require(pose.positions, np.float32, rules)


def _fit_graph(info: CharacterInfo, pose: Pose, out: Float) -> None:
    """Writes the (7,) position and rotation of a deformation graph as one rigid object.

    A deformation graph has no root transform, unlike rigs and puppets. So the result is the best rigid fit of
    its nodes to their rest positions (Kabsch algorithm).
    """
    pivots = info.character.pivots
    out[:3] = middle = pose.positions.mean(0, dtype=np.float64)
    out[3:] = (
        from_matrix((pose.positions - middle).T @ (pivots - info.middle)) if len(pivots) > 1 else IDENTITY
    )


class PerformerSlots:
    """An allocator of performer numbers. Each performer gets the lowest free number from 1, and keeps it
    while in view.

    The tracker's ids increase with every person who enters, but receivers need constant addresses.
    """

    FORGET_AFTER_NS = 2_000_000_000
    """Time out of view, in nanoseconds, after which a number is free again. After a shorter loss of tracking,
    the performer keeps the number."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._seen_ns: dict[int, int] = {}

    def number(self, bodies: Sequence[Body], time_ns: int) -> tuple[dict[int, Body], list[LiveEvent]]:
        """Returns the bodies by number, and an event for each performer who entered or left."""
        events = []
        self._seen_ns.update((body.id, time_ns) for body in bodies)
        for body_id in list(self._numbers):
            if not 0 <= time_ns - self._seen_ns[body_id] <= self.FORGET_AFTER_NS:
                events.append(LiveEvent("leave", self._numbers.pop(body_id)))
        numbered = {}
        for body in bodies:
            if body.id not in self._numbers:
                taken_numbers = set(self._numbers.values())
                self._numbers[body.id] = next(
                    n for n in range(1, len(taken_numbers) + 2) if n not in taken_numbers
                )
                events.append(LiveEvent("enter", self._numbers[body.id]))
            numbered[self._numbers[body.id]] = body
        self._seen_ns = {body: self._seen_ns[body] for body in self._numbers}
        return dict(sorted(numbered.items())), events

    def find_number(self, body: int) -> int:
        """Returns the number of the performer with this tracker id, or 0 if the id is unknown."""
        return self._numbers.get(body, 0)
