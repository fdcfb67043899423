"""Writes a recording of a performance, as an edge writes it."""

from __future__ import annotations

import math

from enliven.recording import Recorder
from enliven.wire import PoseCodec, bodies_to_message, character_to_message, pack_recorded, pose_to_message


def write_recording(path, characters, people=()):
    """Writes a recording.

    Args:
        characters: characters, each with its poses in order of time.
        people: (time in ns, bodies) of people.
    """
    with Recorder(path, sync_seconds=math.inf) as recorder:
        for character, poses in characters:
            codec = PoseCodec(character)
            recorder.write(*pack_recorded(character_to_message(character, 1)), poses[0].time_ns)
            for sequence, pose in enumerate(poses):
                message = pose_to_message(pose, codec, revision=1, sequence=sequence)
                recorder.write(*pack_recorded(message), pose.time_ns)
        for time_ns, bodies in people:
            recorder.write(*pack_recorded(bodies_to_message(bodies, time_ns, time_ns)), time_ns)
