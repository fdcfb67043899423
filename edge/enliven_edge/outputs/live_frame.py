"""A frame for live outputs: the parts of the edge's result that other programs get, as one constant value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from enliven.arrays import Float
from enliven.document import Character, Pose, Props
from enliven.person import Body, HumanPose, human_of_body
from enliven.rotation import IDENTITY, from_matrix, rotate
from enliven_edge.outputs.humanoid_map import HumanoidMap

PERFORMER = "performer-"
"""Prefix of the names of performers in addresses and messages: performer-1, performer-2, ..."""


@dataclass(frozen=True, eq=False)
class CharacterInfo:
    """The constant parts of a character on the stage.

    Attributes:
        character: with its rest pose.
        humanoid: its humanoid bones, or None if it is not a rigged human.
    """

    character: Character
    humanoid: HumanoidMap | None = None

    @cached_property
    def middle(self) -> Float:
        """(3,) metres, the mean of the pivots at rest."""
        return np.asarray(self.character.pivots.mean(0, dtype=np.float64))


@dataclass(frozen=True)
class LiveEvent:
    """Something that happened between two frames.

    Attributes:
        kind: "possess", "release", "enter" or "leave".
        performer: number of the performer. 0: all of them, or not known.
        character: id of the character. Empty for "enter" and "leave".
    """

    kind: str
    performer: int
    character: str = ""


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """Everything that outputs may send of one frame. It is shared by their threads and never changes.

    Attributes:
        time_ns: the sensor's clock.
        performers: the bodies in view by the performer's number, from 1. A number stays with its performer.
        poses: of the characters, in the order of the stage.
        characters: the constant parts of every posed character, by id.
        held: ids of the characters that a performer holds.
        props: loose objects, or None.
        events: since the previous frame of the edge.
    """

    time_ns: int
    performers: Mapping[int, Body]
    poses: Sequence[Pose] = ()
    characters: Mapping[str, CharacterInfo] = field(default_factory=dict)
    held: frozenset[str] = frozenset()
    props: Props | None = None
    events: Sequence[LiveEvent] = ()

    _humans: dict[str, HumanPose] = field(default_factory=dict, repr=False)
    """Human poses that were computed for some output, by name."""

    # Threads of several outputs may compute the same value twice at the same time. Both results are equal.
    def human_performer(self, number: int) -> HumanPose | None:
        """Returns the human pose of a performer, or None if there is none with this number."""
        body, name = self.performers.get(number), f"{PERFORMER}{number}"
        if body is not None and name not in self._humans:
            self._humans[name] = human_of_body(body, name)
        return self._humans.get(name)

    def human_character(self, name: str) -> HumanPose | None:
        """Returns the human pose of a character, or None if it is not a rigged human on the stage."""
        if name not in self._humans:
            info = self.characters.get(name)
            pose = next((pose for pose in self.poses if pose.character == name), None)
            if info is None or info.humanoid is None or pose is None:
                return None
            self._humans[name] = info.humanoid.pose(pose)
        return self._humans[name]

    @property
    def humans(self) -> list[HumanPose]:
        """The human poses of all performers, and then of all characters that are rigged humans."""
        poses = [self.human_performer(number) for number in self.performers]
        poses += [self.human_character(pose.character) for pose in self.poses]
        return [human for human in poses if human is not None]

    @cached_property
    def placements(self) -> dict[str, tuple[Float, Float]]:
        """The (3,) position in metres and (4,) rotation of each character as a whole, by id."""
        return {
            pose.character: placement_of(self.characters[pose.character], pose)
            for pose in self.poses
            if pose.character in self.characters
        }

    def human(self, source: str) -> HumanPose | None:
        """Returns the human pose of a source, or None if there is none now.

        Args:
            source: id of a character or ``performer-N``. Empty: the first human character on the stage, or
                else the performer with the lowest number.
        """
        if source.startswith(PERFORMER):
            number = source.removeprefix(PERFORMER)
            return self.human_performer(int(number)) if number.isdecimal() else None
        if source:
            return self.human_character(source)
        for pose in self.poses:
            if (human := self.human_character(pose.character)) is not None:
                return human
        return self.human_performer(min(self.performers)) if self.performers else None


def placement_of(info: CharacterInfo, pose: Pose) -> tuple[Float, Float]:
    """Returns the (3,) position and (4,) rotation of a character as one rigid object.

    A rig and a puppet have a root transform 0. A deformation graph has none, so its nodes are fitted to their
    rest positions (Kabsch). The position is that of the middle of the pivots at rest, moved by the rotation.
    """
    pivots = info.character.pivots
    if info.character.kind == "graph":
        rest = pivots - info.middle
        middle = pose.positions.mean(0, dtype=np.float64)
        turn = from_matrix((pose.positions - middle).T @ rest) if len(pivots) > 1 else IDENTITY
        return middle, turn
    turn = from_matrix(pose.linear[0])
    return pose.positions[0] + rotate(turn, info.middle - pivots[0]), turn


class PerformerSlots:
    """Gives each performer the lowest free number from 1, and keeps it while the performer is in view.

    The tracker's ids grow with every person that enters. Receivers need addresses that stay the same.
    """

    FORGET_AFTER_NS = 2_000_000_000
    """Nanoseconds out of view after which a number is free again. Shorter losses of tracking keep it."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._seen_ns: dict[int, int] = {}

    def number(self, bodies: Sequence[Body], time_ns: int) -> tuple[dict[int, Body], list[LiveEvent]]:
        """Returns the bodies by number, and the performers that entered or left."""
        events = []
        self._seen_ns.update((body.id, time_ns) for body in bodies)
        for body_id in list(self._numbers):
            if not 0 <= time_ns - self._seen_ns[body_id] <= self.FORGET_AFTER_NS:
                events.append(LiveEvent("leave", self._numbers.pop(body_id)))
        numbered = {}
        for body in bodies:
            if body.id not in self._numbers:
                taken = set(self._numbers.values())
                self._numbers[body.id] = next(n for n in range(1, len(taken) + 2) if n not in taken)
                events.append(LiveEvent("enter", self._numbers[body.id]))
            numbered[self._numbers[body.id]] = body
        self._seen_ns = {body: self._seen_ns[body] for body in self._numbers}
        return dict(sorted(numbered.items())), events

    def of(self, body: int) -> int:
        """Returns the number of a performer by the tracker's id, 0 if unknown."""
        return self._numbers.get(body, 0)
