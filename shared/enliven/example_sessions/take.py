"""Writes a puppet's motion as a take (.mcap) in the format that an edge records, so that the viewer can play
it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from enliven.document import ExampleCharacter, Project, character_from_puppet
from enliven.examples.puppet_motion import evaluate_state, pose_of_state
from enliven.recording import Recorder
from enliven.wire import PoseCodec, character_to_message, pack_recorded, pose_to_message

_CHARACTER_REVISION = 1
"""Revision of the take's only character. The character never changes, so its revision stays at 1."""


def write_puppet_take(
    path: Path | str, project: Project, puppet: ExampleCharacter, start: float, end: float, rate: float = 30.0
) -> None:
    """Writes the character and its poses from ``start`` to ``end`` seconds, ``rate`` poses per second.

    An existing file is replaced.

    Raises:
        InputError: if the puppet has no motion.
        ResourceError: if the file cannot be written.
    """
    character = character_from_puppet(puppet)
    codec = PoseCodec(character)
    times = np.arange(round((end - start) * rate) + 1) / rate
    poses = [
        pose_of_state(puppet, evaluate_state(project, puppet, start + time), round(time * 1e9))
        for time in times
    ]
    with Recorder(path, sync_seconds=math.inf, overwrite=True) as take:
        take.write(*pack_recorded(character_to_message(character, _CHARACTER_REVISION)), 0)
        for sequence, pose in enumerate(poses):
            message = pose_to_message(pose, codec, revision=_CHARACTER_REVISION, sequence=sequence)
            take.write(*pack_recorded(message), pose.time_ns)
