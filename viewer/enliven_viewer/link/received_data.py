"""Values received by the link: poses, bodies and cues with their times, notices, and an edge's health."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enliven.arrays import Float32, Int32
from enliven.document import Character, Pose
from enliven.logs import escape_text
from enliven.person import Body

State = Literal[
    "waiting", "connected", "on rate", "stale", "ended", "version mismatch", "name clash", "no access"
]


@dataclass(frozen=True)
class ReceivedPose:
    """A pose with the times at which it was captured, sent and received.

    Attributes:
        pose: pose of a character that the link has received.
        edge: name of the edge that sent it.
        sequence: number of the pose among the character's poses since the edge's start.
        captured_ns: time on the edge's wall clock when the frame was read.
        published_ns: time on the edge's wall clock when the pose was sent.
        received_ns: time on this machine's wall clock when the pose was read from the socket.
        clock_offset_ns: offset of the edge's clock from this machine's, as estimated at that time.
        character: the character, in the revision that the pose belongs to.
        revision: number of that revision.
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
        """Returns milliseconds from reading the frame to publishing the pose, on the edge."""
        return (self.published_ns - self.captured_ns) * 1e-6

    def age_ms(self, now_ns: int | None = None) -> float:
        """Returns milliseconds from reading the frame to ``now_ns``, across both machines' clocks.

        ``None`` means the current time.
        """
        now = time.time_ns() if now_ns is None else now_ns
        return max(0.0, (now + self.clock_offset_ns - self.captured_ns) * 1e-6)


@dataclass(frozen=True)
class ReceivedBodies:
    """The bodies in view at one time of the sensor's clock. ``captured_ns`` is defined in
    :class:`ReceivedPose`.
    """

    edge: str
    time_ns: int
    captured_ns: int
    bodies: tuple[Body, ...]


@dataclass(frozen=True)
class ReceivedCues:
    """The attached nodes of a character, or those that a possession would attach.

    Attributes:
        character: id of the character.
        state: "free", "preview" or "possessed".
        nodes: (K,) int32 indices of pivots.
        strengths: (K,) float32 in [0, 1].
        body: id of the performer, or of the first of several performers; -1 for none.
        time_ns: time on the sensor's clock.
        owners: (K,) ids of the performers who control the nodes; empty if the edge does not send them.
        held: number of attached nodes. They precede the previewed nodes. None means that all nodes are
            attached, or none in the state "preview".
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
    """A message for the user. Control characters in text from an edge are escaped."""

    level: Literal["info", "warning", "error"]
    text: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", escape_text(self.text))


@dataclass(frozen=True)
class Health:
    """The health of an edge as seen by the link.

    Attributes:
        state: "waiting": no message so far. "connected": heartbeats arrive. "on rate": poses also arrive at
            the announced rate. "stale": no messages recently. "ended": the edge has announced the end of its
            stream. "version mismatch": it uses another version. "name clash": another edge has the same name.
            "no access": the keys of the edge and of this viewer do not match, or they are not paired.
        text: one sentence for the user.
        pose_hz: recent poses per second, summed over the edge's characters.
        malformed: number of messages dropped because they could not be read.
        lost: number of poses that never arrived.
    """

    state: State
    text: str
    pose_hz: float
    malformed: int
    lost: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", escape_text(self.text))
