"""Records an edge's messages from a start time on, together with the required earlier messages."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

from enliven.frames import BodyFrame
from enliven.takes.performed import PerformedMotion
from enliven.wire import BODIES, HOLDS, POSE, Topic
from enliven_viewer.playback.timeline import NS_PER_S
from enliven_viewer.studio.perform.holders import Holders
from enliven_viewer.studio.perform.stillness import Stillness

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
        kept, self._recording, self._delay_ns = self._recording, None, None
        kept.events.sort(key=lambda event: event.time_ns)
        return kept

    def copy_unfinished(self) -> PerformedMotion | None:
        """Returns a copy of the unfinished recording, which continues, or None without a recording."""
        if self._recording is None:
            return None
        kept = self._recording
        return replace(
            kept,
            frames=list(kept.frames),
            events=sorted(kept.events, key=lambda event: event.time_ns),
            characters=dict(kept.characters),
            poses={key: list(poses) for key, poses in kept.poses.items()},
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
            self.holders.take(value)
            if self._recording is not None and not self.is_cut_short:
                self._recording.events.append(value)

    def handle_restart(self) -> None:
        """Handles a restart of the edge: a new clock begins, and all attachments are gone."""
        self.newest_ns, self.is_cut_short = None, self.recording and self._delay_ns is None
        self._earlier_frames.clear()
        self.holders.forget()

    def _record_pose(self, received: Any) -> None:
        pose, kept = received.pose, self._recording
        self._follow_clock(pose.time_ns)
        if kept is None or self.is_cut_short or received.character is None or pose.time_ns < kept.since_ns:
            return
        key = pose.character, received.revision
        kept.characters.setdefault(key, received.character)
        kept.poses.setdefault(key, []).append(pose)

    def _follow_clock(self, time_ns: int) -> None:
        """Updates the known sensor time, and starts a recording that waits for it.

        After a slow frame, many messages arrive at once, topic by topic, so their times are not in order.
        """
        self.newest_ns = max(self.newest_ns or time_ns, time_ns)
        if self._recording is not None and self._delay_ns is not None:
            self._start_at(self._recording, time_ns + self._delay_ns)
