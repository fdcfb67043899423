"""What the link delivers: poses, bodies and cues with their times, notices for the user, an edge's health."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enliven.arrays import Float32, Int32
from enliven.document import Character, Pose
from enliven.logs import escaped
from enliven.person import Body

State = Literal["waiting", "connected", "on rate", "stale", "ended", "version mismatch", "name clash"]


@dataclass(frozen=True)
class ReceivedPose:
    """A pose and its history.

    Attributes:
        pose: of a character that the link holds.
        edge: the name of the edge it came from.
        sequence: counts the character's poses since the edge's start.
        captured_ns: the edge's wall clock when the frame was read.
        published_ns: the edge's wall clock when the pose was sent.
        received_ns: this machine's wall clock when the pose was taken off the socket.
        clock_offset_ns: the edge's clock less this machine's, as known then.
        character: the revision of the character that the pose is of.
        revision: its number.
    """

    pose: Pose
    edge: str
    sequence: int
    captured_ns: int
    published_ns: int
    received_ns: int
    clock_offset_ns: int = 0
    character: Character | None = None
    revision: int = 0

    @property
    def sensor_to_pose_ms(self) -> float:
        """From frame read to pose published, on the edge."""
        return (self.published_ns - self.captured_ns) * 1e-6

    def age_ms(self, now_ns: int | None = None) -> float:
        """From frame read to ``now_ns`` (``time.time_ns()`` where None), across both machines' clocks."""
        now = time.time_ns() if now_ns is None else now_ns
        return max(0.0, (now + self.clock_offset_ns - self.captured_ns) * 1e-6)


@dataclass(frozen=True)
class ReceivedBodies:
    """The bodies in view at one moment of the sensor's clock; ``captured_ns`` as in :class:`ReceivedPose`."""

    edge: str
    time_ns: int
    captured_ns: int
    bodies: tuple[Body, ...]


@dataclass(frozen=True)
class ReceivedCues:
    """The nodes of a character that are held, or would be.

    Attributes:
        character: its id.
        state: "free", "preview" or "possessed".
        nodes: (K,) int32 indices of pivots.
        strengths: (K,) float32 in [0, 1].
        body: the performer's id, the first of several; -1 for none.
        time_ns: the sensor's clock.
        owners: (K,) ids of the performers that hold the nodes; empty if the edge does not tell.
        held: how many of the first nodes are held, the others would be; None: all or, in a preview, none.
    """

    character: str
    state: str
    nodes: Int32
    strengths: Float32
    body: int
    time_ns: int = 0
    owners: Int32 = field(default_factory=lambda: np.empty(0, np.int32))
    held: int | None = None


@dataclass(frozen=True)
class Notice:
    """A sentence for the user; what it repeats of an edge's words is escaped."""

    level: Literal["info", "warning", "error"]
    text: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", escaped(self.text))


@dataclass(frozen=True)
class Health:
    """The health of an edge, as the link hears it.

    Attributes:
        state: "waiting": never heard. "connected": its heart beats. "on rate": and poses come as fast as it
            says. "stale": it has fallen silent. "ended": it said that its stream is over. "version
            mismatch": it speaks another version. "name clash": another edge has its name.
        text: one sentence for the user.
        pose_hz: poses a second of late, of all its characters.
        malformed: messages dropped so far because they could not be read.
        lost: poses so far that never came.
    """

    state: State
    text: str
    pose_hz: float
    malformed: int
    lost: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", escaped(self.text))
