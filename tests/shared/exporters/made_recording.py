"""A recording of a performance, as an edge writes it."""

from __future__ import annotations

import math

import msgspec

from enliven.recording import Recorder
from enliven.wire import PoseCodec, bodies_to_message, character_to_message, pose_to_message


def write_recording(path, characters, people=()):
    """Writes characters, each with its poses in the order of time, and (time in ns, bodies) of people."""
    with Recorder(path, sync_seconds=math.inf) as recorder:

        def write(topic, message, time_ns):
            kind = type(message)
            schema = msgspec.json.encode(msgspec.json.schema(kind)).decode()
            packed = msgspec.msgpack.encode(message)
            recorder.write(
                topic, f"enliven.{kind.__name__}", schema, "jsonschema", "msgpack", packed, time_ns
            )

        for character, poses in characters:
            codec = PoseCodec(character)
            write("character", character_to_message(character, 1), poses[0].time_ns)
            for sequence, pose in enumerate(poses):
                write("pose", pose_to_message(pose, codec, revision=1, sequence=sequence), pose.time_ns)
        for time_ns, bodies in people:
            write("bodies", bodies_to_message(bodies, time_ns, time_ns), time_ns)
