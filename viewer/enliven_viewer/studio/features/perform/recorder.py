"""Records a stage: bodies, poses, the performers who control characters, and when all hold still."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import Float
from enliven.frames import BodyFrame
from enliven.overdub.performance import PerformedMotion
from enliven.wire import BODIES, HOLDS, POSE, HoldMessage, Topic
from enliven_viewer.language import later, tr
from enliven_viewer.playback.timeline import NS_PER_S

_MAX_MOVEMENT_M = 0.06
"""Maximum movement of a joint in metres of a performer who holds still. It allows for breathing and sensor
noise.
"""
_MIN_CONFIDENCE = 0.3
"""Joints below this confidence are ignored. Positions of occluded joints are guesses that jump."""


class Stillness:
    """Measures the stillness of the performers in view. It starts only after at least one performer has
    moved.

    Attributes:
        since_ns: time on the sensor's clock since which all performers are still; None if one moves or none
            is in view.
    """

    def __init__(self) -> None:
        self.since_ns: int | None = None
        self._has_moved = False
        self._places: dict[int, Float] = {}

    def add_frame(self, frame: BodyFrame) -> None:
        """Processes the performers of a frame."""
        moved = len(frame.bodies) == 0
        for body in frame.bodies:
            place = self._places.get(body.id)
            offset = 0.0
            if place is not None:
                far = np.linalg.norm(body.joints - place, axis=1)
                offset = float(np.max(far, where=body.confidence > _MIN_CONFIDENCE, initial=0.0))
            if place is None or offset > _MAX_MOVEMENT_M:
                self._places[body.id], moved = body.joints, True
                self._has_moved |= place is not None
        if moved:
            self.since_ns = None
        elif self.since_ns is None:
            self.since_ns = frame.time_ns

    def seconds(self, now_ns: int) -> float:
        """Returns the seconds for which all performers have held still since the last movement, or 0 before
        the first movement.
        """
        if self.since_ns is None or not self._has_moved:
            return 0.0
        return max(now_ns - self.since_ns, 0) / NS_PER_S


_PART_LABELS = {
    "all": later("the whole body"),
    "arms": later("both arms"),
    "legs": later("both legs"),
    "hands": later("both hands"),
    "hip + right arm": later("hip and the right arm"),
}
"""Displayed words for body parts. Names that are not listed are displayed unchanged."""


@dataclass(frozen=True)
class Holder:
    """A performer who controls a character.

    Attributes:
        body: the performer's id.
        character: id of the controlled character.
        parts: names of the controlling body parts, in the order of attachment.
        number: the performer's number as shown to people; 0 if unknown.
    """

    body: int
    character: str
    parts: tuple[str, ...]
    number: int = 0

    @property
    def description(self) -> str:
        """Returns a text for an audience, such as "Performer 1 is in the horse: both arms"."""
        parts = [tr(_PART_LABELS.get(part, part)) for part in self.parts]
        return tr(
            "Performer {0} is in the {1}: {2}",
            self.number or self.body,
            self.character,
            tr(" and ").join(parts),
        )


class Holders:
    """Tracks the attachments of all characters. For each character, stores the messages since it was last
    free.
    """

    def __init__(self) -> None:
        self._parts: dict[str, dict[int, tuple[str, ...]]] = {}
        self.since_free: dict[str, list[HoldMessage]] = {}

    @property
    def current_holders(self) -> tuple[Holder, ...]:
        """Returns all performers who control a character, sorted by id."""
        holders = [
            Holder(body, name, own_parts)
            for name, held in self._parts.items()
            for body, own_parts in held.items()
        ]
        return tuple(sorted(holders, key=lambda holder: (holder.body, holder.character)))

    def record_change(self, message: HoldMessage) -> None:
        """Processes a change of attachments."""
        old_parts = self._parts.get(message.character, {})
        if not old_parts:
            self.since_free[message.character] = []
        self.since_free[message.character].append(message)
        parts_before = old_parts.get(message.former if message.mode == "take over" else message.body, ())
        held = {} if message.mode in ("alone", "remove") else dict(old_parts)
        if message.mode in ("alone", "join"):
            held[message.body] = (message.parts,)
        elif message.mode == "extend":
            held[message.body] = (*(part for part in parts_before if part != message.parts), message.parts)
        elif message.mode == "take over":
            held[message.body] = parts_before or (message.parts,)
        held = {who: held.get(who, (message.parts,)) for who in message.holders}
        self._parts[message.character] = held
        if not held:
            self.since_free[message.character] = []

    def forget(self) -> None:
        """Discards everything, for example after a restart of an edge."""
        self._parts, self.since_free = {}, {}


_MAX_EARLIER_FRAMES = 18_000
"""Maximum number of body frames from before a recording: ten minutes. A recording needs the body at the time
of each attachment.
"""


class LiveRecorder:
    """A recorder that receives all messages, and records those between :meth:`begin` and :meth:`end`.

    Attributes:
        holders: the performers and the characters that they control.
        stillness: measures how long all performers have held still in this recording.
        is_cut_short: True if the sensor's clock restarted during the recording. Later messages are not
            recorded.
    """

    def __init__(self) -> None:
        self.holders = Holders()
        self.newest_ns: int | None = None
        self.is_cut_short, self.stillness = False, Stillness()
        self._earlier_frames: deque[BodyFrame] = deque(maxlen=_MAX_EARLIER_FRAMES)
        self._recording: PerformedMotion | None = None
        self._delay_ns: int | None = None

    @property
    def recording(self) -> bool:
        """Returns True if a recording is running."""
        return self._recording is not None

    @property
    def since_ns(self) -> int:
        """Returns the start of the recording on the sensor's clock."""
        return 0 if self._recording is None else self._recording.since_ns

    @property
    def still_s(self) -> float:
        """Returns the seconds for which all performers have held still, since they last moved in this
        recording.
        """
        return self.stillness.seconds(self.newest_ns or 0)

    @property
    def seconds(self) -> float:
        """Returns the recorded length in seconds on the sensor's clock."""
        if self._recording is None or self.newest_ns is None or self._delay_ns is not None:
            return 0.0
        return max(self.newest_ns - self._recording.since_ns, 0) / NS_PER_S

    def begin(self, name: str, delay_ns: int = 0) -> None:
        """Starts recording now, or at the first message if the sensor's clock is still unknown.

        Args:
            delay_ns: latency from a performer's movement to its arrival here.
        """
        self._recording, self.is_cut_short, self._delay_ns = PerformedMotion(name), False, delay_ns
        self.stillness = Stillness()
        if self.newest_ns is not None:
            self._start_at(self._recording, self.newest_ns + delay_ns)

    def _start_at(self, performed: PerformedMotion, since: int) -> None:
        """Starts a recording at a time of the sensor's clock, including the attachments made before it."""
        performed.since_ns, self._delay_ns = since, None
        first = min(
            (events[0].time_ns for events in self.holders.since_free.values() if events), default=since
        )
        performed.frames = [frame for frame in self._earlier_frames if frame.time_ns >= first]
        performed.events = [event for events in self.holders.since_free.values() for event in events]

    def end(self) -> PerformedMotion:
        """Ends the recording and returns it."""
        assert self._recording is not None
        recording, self._recording, self._delay_ns = self._recording, None, None
        recording.events.sort(key=lambda event: event.time_ns)
        return recording

    def copy_unfinished(self) -> PerformedMotion | None:
        """Returns a copy of the unfinished recording, which continues, or None without a recording."""
        if self._recording is None:
            return None
        recording = self._recording
        return replace(
            recording,
            frames=list(recording.frames),
            events=sorted(recording.events, key=lambda event: event.time_ns),
            characters=dict(recording.characters),
            poses={key: list(poses) for key, poses in recording.poses.items()},
        )

    def record(self, topic: Topic, value: Any) -> None:
        """Processes a value of a topic from the link."""
        if topic is POSE:
            self._record_pose(value)
        elif topic is BODIES and not (
            self._earlier_frames and value.time_ns <= self._earlier_frames[-1].time_ns
        ):
            self._follow_clock(value.time_ns)
            frame = BodyFrame(list(value.bodies), value.time_ns, value.edge)
            self._earlier_frames.append(frame)
            self.stillness.add_frame(frame)
            if self._recording is not None and not self.is_cut_short:
                self._recording.frames.append(frame)
        elif topic is HOLDS:
            self.holders.record_change(value)
            if self._recording is not None and not self.is_cut_short:
                self._recording.events.append(value)

    def handle_restart(self) -> None:
        """Handles a restart of the edge: a new clock begins, and all attachments are gone."""
        self.newest_ns, self.is_cut_short = None, self.recording and self._delay_ns is None
        self._earlier_frames.clear()
        self.holders.forget()

    def _record_pose(self, received: Any) -> None:
        pose, recording = received.pose, self._recording
        self._follow_clock(pose.time_ns)
        if (
            recording is None
            or self.is_cut_short
            or received.character is None
            or pose.time_ns < recording.since_ns
        ):
            return
        key = pose.character, received.revision
        recording.characters.setdefault(key, received.character)
        recording.poses.setdefault(key, []).append(pose)

    def _follow_clock(self, time_ns: int) -> None:
        """Updates the known sensor time, and starts a recording that waits for it.

        After a slow frame, many messages arrive at once, topic by topic, so their times are not in order.
        """
        self.newest_ns = max(self.newest_ns or time_ns, time_ns)
        if self._recording is not None and self._delay_ns is not None:
            self._start_at(self._recording, time_ns + self._delay_ns)
