"""Takes of recordings: the motion of each person in a file of tracked bodies.

    clips_of_recording(path, *, settings=TakeSettings()) -> list[Clip]
    clips_of_frames(frames, name, settings) -> list[Clip]          # enliven.frames.BodyFrame, in order

Bodies are those of a sensor that tracks, or those that an edge tracked in depth and recorded with a
performance. A recording of depth alone has to be tracked first.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from enliven.document import Clip
from enliven.errors import EnlivenError, InputError
from enliven.files import DAMAGE
from enliven.frames import BodyFrame, Frame
from enliven.person import Body
from enliven.recording import BODIES_TOPIC, Recording, frame_of
from enliven.settings import setting
from enliven.takes.capture_clip import clip_of_bodies
from enliven.wire import BY_TYPE, BodiesMessage, message_to_bodies

_TRACKED = BY_TYPE[BodiesMessage].name
"""The topic of the bodies that an edge tracks, in a recording as on the wire."""


@dataclass(frozen=True)
class TakeSettings:
    """Settings that turn a recording into takes."""

    gap: float = setting(
        0.5, "Somebody who is away for longer comes back in a take of its own.", unit="s", low=0.0, high=60.0
    )
    shortest: float = setting(0.5, "What is shorter is no take.", unit="s", low=0.0, high=600.0)
    step: float = setting(1.0 / 30.0, "Time between two frames of a take.", unit="s", low=1e-3, high=1.0)


def clips_of_recording(path: Path | str, *, settings: TakeSettings | None = None) -> list[Clip]:
    """Returns a clip for each visit of a person: a person who leaves and comes back has several.

    The rest pose is the first that was seen of them; ``clip_of_bodies`` takes
    any other.

    Raises:
        InputError: where the file is no recording, or no person is in it for long enough.
    """
    path = Path(path)
    made = clips_of_frames(body_frames(Recording(path)), path.stem, settings or TakeSettings())
    if not made:
        mend = "Depth must be tracked first: enliven edge --recording FILE --record performance.mcap"
        raise InputError("nobody is in it for long enough to be a take", where=str(path), mend=mend)
    return made


def body_frames(recording: Recording) -> Iterator[BodyFrame]:
    """Yields the bodies of a recording in the order of time: a sensor's, or else those that an edge tracked.

    A message that cannot be read is left out.
    """
    if BODIES_TOPIC in recording.info.topics:
        for topic, _, data in recording.in_order({BODIES_TOPIC}):
            with contextlib.suppress(EnlivenError, *DAMAGE):
                frame = frame_of(topic, data)
                if isinstance(frame, BodyFrame):
                    yield frame
        return
    for _, data in recording.messages(_TRACKED) if _TRACKED in recording.info.topics else ():
        with contextlib.suppress(msgspec.MsgspecError, EnlivenError, *DAMAGE):
            message = msgspec.msgpack.decode(data, type=BodiesMessage)
            yield BodyFrame(message_to_bodies(message), message.time_ns, "edge")


def clips_of_frames(frames: Iterable[Frame], name: str, settings: TakeSettings) -> list[Clip]:
    """Returns clips of frames in the order of time, named after ``name``; see :func:`clips_of_recording`."""
    parts = [part for part in _visits(frames, settings.gap) if _seconds(part) >= settings.shortest]
    ids = [name] if len(parts) == 1 else [f"{name} {number}" for number in range(1, len(parts) + 1)]
    return [_clip(id, part, settings.step) for id, part in zip(ids, parts, strict=True)]


_Visit = list[tuple[int, Body]]
"""Times in nanoseconds, ascending, and what was seen of one person then."""


def _visits(frames: Iterable[Frame], gap: float) -> list[_Visit]:
    """Returns the visits of the frames' people in the order of coming, each from appearance to
    disappearance."""
    made: list[_Visit] = []
    now: dict[tuple[str, int], _Visit] = {}
    for frame in frames:
        for body in frame.bodies if isinstance(frame, BodyFrame) else []:
            who = (frame.sensor, body.id)
            visit = now.get(who)
            if visit is not None and frame.time_ns <= visit[-1][0]:
                continue
            if visit is None or (frame.time_ns - visit[-1][0]) * 1e-9 > gap:
                visit = now[who] = []
                made.append(visit)
            visit.append((frame.time_ns, body))
    return made


def _seconds(visit: _Visit) -> float:
    return (visit[-1][0] - visit[0][0]) * 1e-9


def _clip(id: str, visit: _Visit, step: float) -> Clip:
    times = np.array([ns - visit[0][0] for ns, _ in visit]) * 1e-9
    return clip_of_bodies([body for _, body in visit], times, id, step=step)
