"""Sensor streams and takes on disk: MCAP files that other tools can open.

:class:`Recorder` writes, :class:`Recording` reads. Topics, schemas and layouts are in
:mod:`enliven.recording.schemas`.
"""

from enliven.recording.reader import Recording, RecordingInfo, RecordingWarning, frame_of
from enliven.recording.recorder import Recorder
from enliven.recording.recovery import Recovery, recover
from enliven.recording.schemas import BODIES_TOPIC, DEPTH_TOPIC

__all__ = [
    "BODIES_TOPIC",
    "DEPTH_TOPIC",
    "Recorder",
    "Recording",
    "RecordingInfo",
    "RecordingWarning",
    "Recovery",
    "frame_of",
    "recover",
]
