"""Writes animated characters as a recording (.mcap), which the viewer plays and an edge replays.

Topics:

- ``character``, ``pose``, ``stage``: network messages, as in a take of an edge. ``enliven view`` plays them,
  and every command that reads takes accepts them.
- ``/bodies``: the humanoid characters as tracked people. With them, ``enliven replay`` can possess meshes.
- ``/tf``: the joints or parts as coordinate frames, for Foxglove.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from enliven.arrays import Int
from enliven.document import Character
from enliven.errors import InputError, ResourceError
from enliven.exporters.foxglove_frames import FRAMES, FRAMES_TOPIC, encode_frames, encode_world_frame
from enliven.exporters.performance import Performance
from enliven.exporters.performed_bodies import bodies_from_performance
from enliven.exporters.registry import Exporter
from enliven.exporters.wire_characters import wire_characters
from enliven.files import replace_file
from enliven.frames import BodyFrame
from enliven.person import Body
from enliven.recording import MessageKind, Recorder
from enliven.wire import (
    MAX_CHARACTERS,
    PoseCodec,
    PoseMessage,
    Revision,
    StageMessage,
    character_to_message,
    pack_recorded,
    pose_to_message,
)

_REVISION = 1
"""Revision number of all characters. It is constant, because the characters do not change."""
_REMEDY = "Choose another output file."
_Write = Callable[[], Any]
_Step = tuple[int, int, _Write]
"""A step of writing: time in nanoseconds, rank among steps of the same time, and a function that writes."""


def write_recording(
    path: Path | str,
    performances: Sequence[Performance],
    name: str = "enliven",
    progress: Callable[[float], object] | None = None,
) -> None:
    """Writes the performances as one recording, with times from 0.

    Args:
        name: the title, stored as metadata.
        progress: called with the finished fraction. An exception that it raises ends the export.

    Raises:
        InputError: if a character is too large for network messages, or there are too many characters.
        ResourceError: if the file cannot be written.
    """
    path = Path(path)
    if len(performances) > MAX_CHARACTERS:
        problem = (
            f"a recording can contain at most {MAX_CHARACTERS} characters, but {len(performances)} are "
            "selected"
        )
        raise InputError(problem, where=str(path), remedy="Choose fewer characters with --character.")
    characters = wire_characters(performances)
    seconds = max(float(performance.times[-1]) for performance in performances)
    with replace_file(path, _REMEDY) as part:
        try:
            # Sync only at the end, so that equal performances give equal files.
            with Recorder(part, sync_seconds=math.inf, overwrite=True) as recorder:
                _write_characters(recorder, characters, name)
                for time_ns, _, write in _merge_steps(recorder, characters, performances):
                    write()
                    if progress is not None:
                        progress(time_ns * 1e-9 / seconds if seconds else 1.0)
        except ResourceError as error:
            # The error names the temporary file, but the user needs the name of the output file.
            raise ResourceError(error.what, where=str(path), remedy=error.remedy) from None


MCAP = Exporter(write_recording, placements=("scale", "in_place"))


def _write_characters(recorder: Recorder, characters: Sequence[Character], name: str) -> None:
    """Writes the title, the characters and the list of them, at time 0."""
    recorder.add_metadata("export", {"title": name})
    for character in characters:
        recorder.write(*pack_recorded(character_to_message(character, _REVISION)), 0)
    revisions = [Revision(character.id, _REVISION) for character in characters]
    recorder.write(*pack_recorded(StageMessage(0, revisions)), 0)
    _write_kind(recorder, FRAMES_TOPIC, FRAMES, encode_world_frame(0), 0)


def _merge_steps(
    recorder: Recorder, characters: Sequence[Character], performances: Sequence[Performance]
) -> Iterator[_Step]:
    """Yields the steps of all characters and people in order of time."""
    tracks = [
        _pose_steps(recorder, character, performance, rank)
        for rank, (character, performance) in enumerate(zip(characters, performances, strict=True))
    ]
    tracks.append(_body_steps(recorder, performances, len(tracks)))
    return heapq.merge(*tracks, key=lambda step: step[:2])


def _pose_steps(
    recorder: Recorder, character: Character, performance: Performance, rank: int
) -> Iterator[_Step]:
    """Yields a step for each frame of a character, which writes its pose and its frames for Foxglove."""
    codec = PoseCodec(character)
    poses_and_frames = zip(performance.poses(), encode_frames(performance, character.id), strict=True)
    for sequence, (pose, frames) in enumerate(poses_and_frames):
        renamed_pose = replace(pose, character=character.id)
        message = pose_to_message(renamed_pose, codec, revision=_REVISION, sequence=sequence)
        yield pose.time_ns, rank, partial(_write_pose, recorder, message, frames)


def _write_pose(recorder: Recorder, message: PoseMessage, frames: bytes) -> None:
    recorder.write(*pack_recorded(message), message.time_ns)
    _write_kind(recorder, FRAMES_TOPIC, FRAMES, frames, message.time_ns)


def _body_steps(recorder: Recorder, performances: Sequence[Performance], rank: int) -> Iterator[_Step]:
    """Yields a step for each time of any person, which writes all people at that time.

    At times between two frames of a person, the last pose is repeated.
    """
    people = list[tuple[Int, list[Body]]]()
    for number, performance in enumerate(performances, 1):
        bodies = bodies_from_performance(performance, number)
        if bodies:
            people.append((np.round(performance.times * 1e9).astype(np.int64), bodies))
    for time_ns in np.unique(np.concatenate([times for times, _ in people])) if people else ():
        present_bodies = [
            bodies[int(np.searchsorted(times, time_ns, "right")) - 1]
            for times, bodies in people
            if times[0] <= time_ns <= times[-1]
        ]
        frame = BodyFrame(present_bodies, int(time_ns), "export")
        yield int(time_ns), rank, partial(recorder.write_frame, frame)


def _write_kind(recorder: Recorder, topic: str, kind: MessageKind, data: bytes, time_ns: int) -> None:
    """Writes a message of a type that is not part of the network protocol."""
    schema = kind.schema_name, kind.schema_text, kind.schema_encoding
    recorder.write(topic, *schema, kind.message_encoding, data, time_ns)
