"""Gathers what an edge publishes from one moment on, with what has to be known of the time before."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

from enliven.frames import BodyFrame
from enliven.takes import Performed
from enliven.wire import BODIES, HOLDS, POSE, Topic
from enliven_viewer.playback import NS
from enliven_viewer.studio.perform.holders import Holders
from enliven_viewer.studio.perform.stillness import Stillness

_BEFORE = 18_000
"""Frames of performers that are kept from before a recording: ten minutes, since a hold may be as old."""


class LiveRecorder:
    """Hears everything that arrives; :meth:`begin` and :meth:`end` frame what is kept.

    Attributes:
        holders: who holds what.
        stillness: since when all performers hold still, in this recording.
        cut: whether the sensor's clock began again while it recorded: what came after is left out.
    """

    def __init__(self) -> None:
        self.holders = Holders()
        self.newest_ns: int | None = None
        self.cut, self.stillness = False, Stillness()
        self._frames: deque[BodyFrame] = deque(maxlen=_BEFORE)
        self._kept: Performed | None = None
        self._delay_ns: int | None = None

    @property
    def recording(self) -> bool:
        """Returns True if something is recorded."""
        return self._kept is not None

    @property
    def since_ns(self) -> int:
        """Returns the sensor's clock when the recording began."""
        return 0 if self._kept is None else self._kept.since_ns

    @property
    def still(self) -> float:
        """Returns seconds for which all performers have held still, after they moved in this recording."""
        return self.stillness.seconds(self.newest_ns or 0)

    @property
    def seconds(self) -> float:
        """Returns seconds of the sensor's clock that are recorded so far."""
        if self._kept is None or self.newest_ns is None or self._delay_ns is not None:
            return 0.0
        return max(self.newest_ns - self._kept.since_ns, 0) / NS

    def begin(self, name: str, delay_ns: int = 0) -> None:
        """Records from now on, or from the first time that is heard of a clock that is not known yet.

        Args:
            delay_ns: how much later than a performer moves it arrives here.
        """
        self._kept, self.cut, self._delay_ns = Performed(name), False, delay_ns
        self.stillness = Stillness()
        if self.newest_ns is not None:
            self._count_from(self._kept, self.newest_ns + delay_ns)

    def _count_from(self, kept: Performed, since: int) -> None:
        """Begins a recording at a time of the sensor's clock, with the holds that lead up to it."""
        kept.since_ns, self._delay_ns = since, None
        first = min((held[0].time_ns for held in self.holders.since_free.values() if held), default=since)
        kept.frames = [frame for frame in self._frames if frame.time_ns >= first]
        kept.events = [said for held in self.holders.since_free.values() for said in held]

    def end(self) -> Performed:
        """What was recorded; nothing more is."""
        assert self._kept is not None
        kept, self._kept, self._delay_ns = self._kept, None, None
        kept.events.sort(key=lambda said: said.time_ns)
        return kept

    def so_far(self) -> Performed | None:
        """Returns a copy of what was recorded until now, while the recording goes on; None without a
        recording.
        """
        if self._kept is None:
            return None
        kept = self._kept
        return replace(
            kept,
            frames=list(kept.frames),
            events=sorted(kept.events, key=lambda said: said.time_ns),
            characters=dict(kept.characters),
            poses={key: list(poses) for key, poses in kept.poses.items()},
        )

    def heard(self, topic: Topic, value: Any) -> None:
        """Takes a value of a topic, as the link brings it."""
        if topic is POSE:
            self._pose(value)
        elif topic is BODIES and not (self._frames and value.time_ns <= self._frames[-1].time_ns):
            self._note(value.time_ns)
            frame = BodyFrame(list(value.bodies), value.time_ns, value.edge)
            self._frames.append(frame)
            self.stillness.see(frame)
            if self._kept is not None and not self.cut:
                self._kept.frames.append(frame)
        elif topic is HOLDS:
            self.holders.take(value)
            if self._kept is not None and not self.cut:
                self._kept.events.append(value)

    def restarted(self) -> None:
        """Another clock begins, and all holds are over."""
        self.newest_ns, self.cut = None, self.recording and self._delay_ns is None
        self._frames.clear()
        self.holders.forget()

    def _pose(self, seen: Any) -> None:
        pose, kept = seen.pose, self._kept
        self._note(pose.time_ns)
        if kept is None or self.cut or seen.character is None or pose.time_ns < kept.since_ns:
            return
        key = pose.character, seen.revision
        kept.characters.setdefault(key, seen.character)
        kept.poses.setdefault(key, []).append(pose)

    def _note(self, time_ns: int) -> None:
        """Follows the sensor's clock; a recording that awaits it begins.

        After a slow picture many messages come at once, topic by topic: their times are no order of arrival.
        """
        self.newest_ns = max(self.newest_ns or time_ns, time_ns)
        if self._kept is not None and self._delay_ns is not None:
            self._count_from(self._kept, time_ns + self._delay_ns)
