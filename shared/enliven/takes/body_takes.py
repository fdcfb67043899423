"""Takes of performers' joints for possession: every measured frame, without resampling.

body_take_from_file(path) -> BodyTake
body_take_from_frames(frames, id) -> BodyTake        # enliven.frames.BodyFrame
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from enliven.document import BodyTake, Character, HoldChange, Pose, Possession
from enliven.errors import EnlivenError, InputError
from enliven.files import DAMAGE
from enliven.frames import BodyFrame, Frame
from enliven.person import Joint
from enliven.recording import Recording
from enliven.takes.recorded import read_body_frames
from enliven.wire import HOLDS, HoldMessage


def body_take_from_file(path: Path | str) -> BodyTake:
    """Returns all motion of the performers in a recording: bodies from its sensor, or published ones.

    Raises:
        InputError: if the file is not a recording, or contains no bodies.
    """
    path = Path(path)
    return body_take_from_frames(read_body_frames(Recording(path)), path.stem)


@dataclass(frozen=True)
class RecordedHolds:
    """The performers of a recording, and their holds on characters.

    Attributes:
        take: the performers.
        begin_ns: the sensor's clock when the take begins.
        events: the changes of holds, by id and revision of the character, ordered by time.
    """

    take: BodyTake
    begin_ns: int
    events: dict[tuple[str, int], list[HoldMessage]] = field(default_factory=dict)

    def possession(self, key: tuple[str, int], character: Character, poses: list[Pose]) -> Possession | None:
        """Returns the possession of the character with these poses; None if it was not recorded.

        Args:
            key: the id and the revision of the character.
        """
        events = [event for event in self.events.get(key, []) if event.mode != "remove"]
        first = next((event for event in events if len(event.place) == 5 and event.place[0] > 0.0), None)
        if character.kind != "graph" or first is None or not first.size > 0.0:
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
            first.settings,
            float(np.ptp(character.vertices[:, 1])),
            first.size,
            tuple(first.place),
            self._take_second(poses[0].time_ns),
            self._take_second(poses[-1].time_ns),
            np.asarray(character.pivots, np.float64),
        )

    def _take_second(self, time_ns: int) -> float:
        """Returns the second of the take for a time of the sensor's clock, as in :attr:`BodyTake.seconds`."""
        return float((time_ns - self.begin_ns) * 1e-9)


def recorded_holds(recording: Recording, id: str) -> RecordedHolds | None:
    """Returns the performers of a recording and their holds; None if the recording does not contain them."""
    if HOLDS.name not in recording.info.topics:
        return None
    events = []
    for _, data in recording.messages(HOLDS.name):
        try:
            events.append(msgspec.msgpack.decode(data, type=HoldMessage))
        except (msgspec.MsgspecError, EnlivenError, *DAMAGE):
            continue
    return holds_from_frames(read_body_frames(recording), events, id)


def holds_from_frames(
    frames: Iterable[Frame], events: Iterable[HoldMessage], id: str
) -> RecordedHolds | None:
    """Returns the performers in the frames as a take, and their holds; None without performers."""
    observed = [frame for frame in frames if isinstance(frame, BodyFrame)]
    begin = next((frame.time_ns for frame in observed if frame.bodies), None)
    if begin is None:
        return None
    holds = RecordedHolds(body_take_from_frames(observed, id), begin)
    for event in events:
        holds.events.setdefault((event.character, event.revision), []).append(event)
    return holds


def body_take_from_frames(frames: Iterable[Frame], id: str) -> BodyTake:
    """Returns the bodies of frames as a take, beginning with the first frame that contains a performer.

    A frame that is not later than the previous one is dropped, and joints that are not finite count as
    unseen.

    Raises:
        InputError: if the frames contain no performer.
    """
    used_frames: list[BodyFrame] = []
    for frame in frames:
        begun = isinstance(frame, BodyFrame) and bool(frame.bodies or used_frames)
        if begun and (not used_frames or frame.time_ns > used_frames[-1].time_ns):
            used_frames.append(frame)
    people = sorted({body.id for frame in used_frames for body in frame.bodies})
    if not people:
        mend = "Track the depth first: enliven track TAKE.mcap -o bodies.mcap"
        raise InputError("no performer is in them", where=f"take {id!r}", mend=mend)
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
