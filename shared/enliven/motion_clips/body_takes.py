"""Takes of performers' joints, which move possessed meshes. They contain every measured frame without
resampling.

body_take_from_file(path) -> BodyTake
body_take_from_frames(frames, id) -> BodyTake        # enliven.frames.BodyFrame
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from enliven.document import BodyTake, Character, HoldChange, Pose, Possession
from enliven.errors import InputError
from enliven.frames import BodyFrame, Frame
from enliven.motion_clips.edge_messages import read_messages
from enliven.motion_clips.tracked_people import read_body_frames
from enliven.person import Joint
from enliven.recording import Recording
from enliven.wire import HOLDS, HoldMessage


def body_take_from_file(path: Path | str) -> BodyTake:
    """Reads the motion of all performers in a recording. The bodies are from the sensor, or were published by
    an edge.

    Raises:
        InputError: if the file is not a recording, or contains no bodies.
    """
    path = Path(path)
    return body_take_from_frames(read_body_frames(Recording(path)), path.stem)


@dataclass(frozen=True)
class RecordedHolds:
    """The performers of a recording, and their attachments (holds) to characters.

    Attributes:
        take: the motion of the performers.
        begin_ns: time of the sensor's clock at the start of the take, nanoseconds.
        events: the attachments and releases, ordered by time. The key is the id and revision of the
            character.
    """

    take: BodyTake
    begin_ns: int
    events: dict[tuple[str, int], list[HoldMessage]] = field(default_factory=dict)

    def possession(self, key: tuple[str, int], character: Character, poses: list[Pose]) -> Possession | None:
        """Returns the record of possession of a character, or None if there is none.

        Args:
            key: the id and the revision of the character.
        """
        events = [event for event in self.events.get(key, []) if event.mode != "remove"]
        first_placed = next(
            (event for event in events if len(event.place) == 5 and event.place[0] > 0.0), None
        )
        if character.kind != "graph" or first_placed is None or not first_placed.size > 0.0:
            return None
        changes = []
        for event in events:
            performer_id, former = (
                None if performer < 0 else performer for performer in (event.body, event.former)
            )
            changes.append(
                HoldChange(self._take_second(event.time_ns), performer_id, event.parts, event.mode, former)
            )
        return Possession(
            self.take.id,
            tuple(changes),
            first_placed.settings,
            float(np.ptp(character.vertices[:, 1])),
            first_placed.size,
            tuple(first_placed.place),
            self._take_second(poses[0].time_ns),
            self._take_second(poses[-1].time_ns),
            np.asarray(character.pivots, np.float64),
        )

    def _take_second(self, time_ns: int) -> float:
        """Converts a time of the sensor's clock to seconds of the take, as in :attr:`BodyTake.seconds`."""
        return float((time_ns - self.begin_ns) * 1e-9)


def read_recorded_holds(recording: Recording, id: str) -> RecordedHolds | None:
    """Reads the performers of a recording and their attachments. Returns None if the recording does not
    contain them.
    """
    if HOLDS.name not in recording.info.topics:
        return None
    events = list(read_messages(recording, HOLDS.name, HoldMessage))
    return holds_from_frames(read_body_frames(recording), events, id)


def holds_from_frames(
    frames: Iterable[Frame], events: Iterable[HoldMessage], id: str
) -> RecordedHolds | None:
    """Converts the performers in frames to a take, with their attachments. Returns None if there are no
    performers.
    """
    observed = [frame for frame in frames if isinstance(frame, BodyFrame)]
    begin = next((frame.time_ns for frame in observed if frame.bodies), None)
    if begin is None:
        return None
    holds = RecordedHolds(body_take_from_frames(observed, id), begin)
    for event in events:
        holds.events.setdefault((event.character, event.revision), []).append(event)
    return holds


def body_take_from_frames(frames: Iterable[Frame], id: str) -> BodyTake:
    """Converts the bodies of frames to a take. It begins with the first frame that contains a performer.

    A frame that is not later than the previous frame is dropped. Joints that are not finite count as not
    seen.

    Raises:
        InputError: if the frames contain no performer.
    """
    used_frames: list[BodyFrame] = []
    for frame in frames:
        has_begun = isinstance(frame, BodyFrame) and bool(frame.bodies or used_frames)
        if has_begun and (not used_frames or frame.time_ns > used_frames[-1].time_ns):
            used_frames.append(frame)
    people = sorted({body.id for frame in used_frames for body in frame.bodies})
    if not people:
        advice = "Track the depth first: enliven track TAKE.mcap -o bodies.mcap"
        raise InputError("the take contains no performer", where=f"take {id!r}", remedy=advice)
    shape = (len(used_frames), len(people))
    joints, confidence = np.zeros((*shape, len(Joint), 3)), np.zeros((*shape, len(Joint)))
    present, stature = np.zeros(shape, np.bool_), np.zeros(shape)
    for i, frame in enumerate(used_frames):
        for body in frame.bodies:
            j = people.index(body.id)
            is_known = np.isfinite(body.joints.sum(1))
            joints[i, j] = np.where(is_known[:, None], body.joints, 0.0)
            confidence[i, j] = np.where(is_known, np.clip(body.confidence, 0.0, 1.0), 0.0)
            present[i, j], stature[i, j] = True, body.stature or 0.0
    seconds = np.array([frame.time_ns - used_frames[0].time_ns for frame in used_frames]) * 1e-9
    return BodyTake(id, seconds, np.array(people), joints, confidence, present, stature)
