"""The viewer's document: characters, the timeline of their motion, and the state of the edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import Character, Pose, Props
from enliven.health import HealthState
from enliven.logs import escape_text
from enliven.matching.match_list import MatchList
from enliven.person import Body
from enliven.wire import Topic
from enliven_viewer.playback.timeline import CueFrame, Timeline, TimelineMoment


@dataclass(frozen=True)
class EdgeState:
    """The state of an edge, as reported by the edge and as measured by the connection.

    Attributes:
        connected: whether messages arrive.
        address: address of the edge.
        phase: state of the edge as it reports it, such as "waiting", "possessed" or "ended".
        message: one sentence for the user, or empty.
        sensor_to_pose_ms: milliseconds from the sensor's frame to its published pose, or None.
        pose_to_screen_ms: milliseconds from publishing a pose to its arrival in the viewer, or None.
        health: problems reported by the edge, most severe first.
        signal: recent state of the stream. "live": as announced. "slow": fewer frames than announced.
            "damaged": some messages cannot be read. "silent": no messages.
    """

    connected: bool = False
    address: str = ""
    phase: str = ""
    message: str = ""
    sensor_to_pose_ms: float | None = None
    pose_to_screen_ms: float | None = None
    health: tuple[HealthState, ...] = ()
    signal: Literal["live", "slow", "damaged", "silent"] = "live"

    def __post_init__(self) -> None:
        for name in ("address", "phase", "message"):
            object.__setattr__(self, name, escape_text(getattr(self, name)))


@dataclass
class Document:
    """Characters by id, the timeline of their motion, and the edge's state."""

    timeline: Timeline = field(default_factory=Timeline)
    characters: dict[str, Character] = field(default_factory=dict)
    edge: EdgeState = field(default_factory=EdgeState)

    def add_character(self, character: Character) -> None:
        """Adds a character, or replaces the one with the same id."""
        self.characters[character.id] = character

    def remove_character(self, character_id: str) -> None:
        """Removes a character. The timeline keeps its poses."""
        self.characters.pop(character_id, None)

    def add_pose(self, pose: Pose, character: Character | None = None) -> None:
        """Adds a pose, for a revision of its character, to the timeline."""
        self.timeline.add_pose(pose, character)

    def characters_at(self, moment: TimelineMoment | None) -> dict[str, Character]:
        """Returns the characters by id, each in the revision of the moment's poses."""
        return {**self.characters, **(moment.characters if moment else {})}

    def add_bodies(self, time_ns: int, bodies: Sequence[Body]) -> None:
        """Adds the bodies of one time to the timeline."""
        self.timeline.add_bodies(time_ns, bodies)

    def add_props(self, props: Props) -> None:
        """Adds the props of one time to the timeline."""
        self.timeline.add_props(props)

    def add_board(self, board: MatchList) -> None:
        """Adds a character's match list to the timeline."""
        self.timeline.add_board(board)

    def add(self, topic: Topic, message: Any) -> None:
        """Adds a message of a topic without its own track to the timeline, by its key."""
        self.timeline.add(topic.name, topic.key(message), message)

    def set_cues(self, cues: CueFrame, time_ns: int | None = None) -> None:
        """Sets the cues of a character from a time on, or from the newest moment.

        Empty nodes mean that nothing is attached.
        """
        self.timeline.set_cues(cues, time_ns)

    def forget_cues(self, character_id: str) -> None:
        """Removes the cues of a character from the newest moment on."""
        self.timeline.forget_cues(character_id)


def find_bounds(points: Sequence[Float | Float32]) -> tuple[Float, Float] | None:
    """Returns the lowest and highest corner, (3,) each, of several (N, 3) arrays.

    Returns None without a finite point.
    """
    nonempty = [p for p in points if len(p)]
    if not nonempty:
        return None
    every = np.concatenate(nonempty).astype(np.float64)
    every = every[np.isfinite(every).all(axis=1)]
    return (every.min(axis=0), every.max(axis=0)) if len(every) else None
