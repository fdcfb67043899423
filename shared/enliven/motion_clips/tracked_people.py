"""Reads takes from recordings: the motion of each person in a file with tracked bodies.

    read_recorded_clips(path, *, settings=TakeSettings()) -> list[Clip]
    clips_of_frames(frames, name, settings) -> list[Clip]          # enliven.frames.BodyFrame, in order

Bodies are from the tracking of a sensor, from ``enliven track``, or from the messages that an edge published.
A recording with only depth images must be tracked first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from enliven.document import Clip
from enliven.errors import InputError
from enliven.frames import BodyFrame, Frame
from enliven.motion_clips.edge_messages import read_messages
from enliven.motion_clips.joint_positions import clip_of_bodies
from enliven.motion_clips.merged_performers import merge_performers
from enliven.person import Body
from enliven.recording import DEPTH_TOPIC, Recording
from enliven.settings import parameter
from enliven.wire import BODIES, BodiesMessage, message_to_bodies

_STEP_S = 1.0 / 30.0
"""Time between two frames of a take, in seconds: the rate of depth cameras."""


@dataclass(frozen=True)
class TakeSettings:
    """Settings of the conversion from a recording to takes."""

    gap: float = parameter(
        0.5,
        "If a person is away for longer than this, a new take starts.",
        unit="s",
        low=0.0,
        high=60.0,
    )
    shortest: float = parameter(
        0.5, "Minimum length of a take. Shorter takes are discarded.", unit="s", low=0.0, high=600.0
    )


UNSPLIT_TAKE_SETTINGS = TakeSettings(gap=math.inf)
"""Settings that give each performer a single take, even if the tracker lost the performer for a
while."""


def read_recorded_clips(
    path: Path | str, *, settings: TakeSettings | None = None, whole: bool = False
) -> list[Clip]:
    """Returns one clip for each visit of a person. A person who leaves and comes back has several clips.

    The rest pose is the first observed pose. Use ``clip_of_bodies`` for another rest pose.

    Args:
        whole: True returns one clip for each person instead. While the person is lost, the clip repeats the
            last known pose.

    Raises:
        InputError: if the file is not a recording, or if all visits are too short.
    """
    path = Path(path)
    recording = Recording(path)
    chosen, frames = settings or TakeSettings(), read_body_frames(recording)
    if whole:
        observed = [frame for frame in frames if isinstance(frame, BodyFrame)]
        chosen, frames = replace(chosen, gap=math.inf), iter(merge_performers(observed).frames)
    clips = clips_of_frames(frames, path.stem, chosen)
    if not clips and DEPTH_TOPIC in recording.info.topics:
        advice = f"Track the people in the depth images first: enliven track {path.name} -o bodies.mcap"
        raise InputError(
            "the recording contains depth images, but no tracked bodies", where=str(path), remedy=advice
        )
    if not clips:
        advice = "Record a performance that lasts longer."
        raise InputError(
            "no performer is in the recording for long enough to make a take", where=str(path), remedy=advice
        )
    return clips


def read_body_frames(recording: Recording) -> Iterator[Frame]:
    """Yields frames with the bodies of a recording: from its sensors, or published by an edge.

    Unreadable messages are skipped.
    """
    if BODIES.name not in recording.info.topics:
        yield from recording.frames()
        return
    yield from read_messages(
        recording,
        BODIES.name,
        BodiesMessage,
        lambda message: BodyFrame(message_to_bodies(message), message.time_ns, ""),
    )


def clips_of_frames(frames: Iterable[Frame], name: str, settings: TakeSettings) -> list[Clip]:
    """Converts frames to clips in the order of time, named after ``name``; see :func:`read_recorded_clips`.

    If there is only a single time, for example a single depth image, each clip contains one pose for the
    duration of a step.
    """
    visits = _find_visits(frames, settings.gap)
    if len({ns for visit in visits for ns, _ in visit}) == 1:
        parts = [[(ns, body), (ns + round(_STEP_S * 1e9), body)] for ((ns, body),) in visits]
    else:
        parts = [visit for visit in visits if (visit[-1][0] - visit[0][0]) * 1e-9 >= settings.shortest]
    ids = [name] if len(parts) == 1 else [f"{name} {number}" for number in range(1, len(parts) + 1)]
    return [_visit_clip(id, part, _STEP_S) for id, part in zip(ids, parts, strict=True)]


_Visit = list[tuple[int, Body]]
"""A visit of a person: ascending times in nanoseconds, and the body at each time."""


def _find_visits(frames: Iterable[Frame], max_gap: float) -> list[_Visit]:
    """Returns the visits of all people in the order of arrival. A visit lasts from appearance to
    disappearance.
    """
    visits: list[_Visit] = []
    current: dict[tuple[str, int], _Visit] = {}
    for frame in frames:
        for body in frame.bodies if isinstance(frame, BodyFrame) else []:
            person = (frame.sensor, body.id)
            visit = current.get(person)
            if visit is not None and frame.time_ns <= visit[-1][0]:
                continue
            if visit is None or (frame.time_ns - visit[-1][0]) * 1e-9 > max_gap:
                visit = current[person] = []
                visits.append(visit)
            visit.append((frame.time_ns, body))
    return visits


def _visit_clip(id: str, visit: _Visit, step: float) -> Clip:
    times = np.array([ns - visit[0][0] for ns, _ in visit]) * 1e-9
    return clip_of_bodies([body for _, body in visit], times, id, step=step)
